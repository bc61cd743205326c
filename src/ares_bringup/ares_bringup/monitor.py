"""The node that watches a flight for `ares fly`: events, guidance status, diagnostics."""

import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node

from ares_bringup.summary import ENDS, Diagnostic, Event, FlightSummary, Status
from ares_msgs.msg import FlightEvent, GuidanceStatus
from ares_node.qos import (
    DIAGNOSTIC,
    DIAGNOSTICS,
    EVENTS,
    FLIGHT,
    FLIGHT_EVENT,
    GUIDANCE_STATUS,
    NAMESPACE,
)
from ares_node.time import seconds_from_stamp
from ares_vehicle_sim.arrays import FLIGHT_STARTED

_LEVELS = {
    DiagnosticStatus.WARN: "WARN",
    DiagnosticStatus.ERROR: "ERROR",
    DiagnosticStatus.STALE: "STALE",
}
_OURS = NAMESPACE + "/"

#: Wall time in s after which the end of a flight counts although guidance was never heard.
DOUBT_TIMEOUT = 10.0
#: Warnings and errors that are passed on while the flight goes on.
MAX_SAID = 20


class FlightMonitor(Node):
    """Collects what the summary of a flight needs, and nothing that comes at the full rate.

    Events stay on the graph for those who join late, so those of an earlier flight whose
    simulator still runs come first. A simulator flies only if there is no other, so that the
    last flight that begins is the one to watch.

    Attributes:
        summary: filled while the flight goes on.
        last_heard: wall time of the last message, s of time.monotonic().
    """

    def __init__(
        self,
        summary: FlightSummary,
        say: Callable[[str], None],
        **kwargs: Any,
    ) -> None:
        """Create the subscriptions.

        Args:
            summary: what to fill.
            say: gets one line for each warning or error of a node.
            **kwargs: passed on to rclpy (`context`, ...).
        """
        super().__init__(
            "flight_monitor",
            namespace=NAMESPACE,
            enable_rosout=False,
            start_parameter_services=False,
            **kwargs,
        )
        self.summary = summary
        self.last_heard = time.monotonic()
        self._end_seen_at: float | None = None
        self._say = say
        self._said = 0
        self._first_status: tuple[float, float] | None = None
        lost = SubscriptionEventCallbacks(message_lost=self._on_lost)
        self._inputs = [
            self.create_subscription(kind, topic, callback, qos, event_callbacks=lost)
            for kind, topic, callback, qos in (
                (FlightEvent, FLIGHT_EVENT, self._on_event, EVENTS),
                (GuidanceStatus, GUIDANCE_STATUS, self._on_status, FLIGHT),
                (DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, DIAGNOSTIC),
            )
        ]

    @property
    def ended(self) -> bool:
        """The flight has begun and come to its end."""
        if self._end_seen_at is None or not self.summary.started:
            return False
        # without a word from guidance these may be the events of an earlier flight
        return (
            self.summary.guidance_cycles > 0 or time.monotonic() - self._end_seen_at > DOUBT_TIMEOUT
        )

    def _on_event(self, message: FlightEvent) -> None:
        now = self.last_heard = time.monotonic()
        if message.type == FLIGHT_STARTED and self.summary.started:
            self.summary.forget_flight()
            self._end_seen_at = self._first_status = None
        self.summary.add_event(
            Event(
                type=message.type,
                index=message.index,
                time=message.time,
                position=_vector(message.position),
                velocity=_vector(message.velocity),
                mass=message.mass,
            )
        )
        if message.type in ENDS:
            self._end_seen_at = now
            if self._first_status is not None:
                flight_time, wall_time = self._first_status
                self.summary.set_rate(message.time - flight_time, now - wall_time)

    def _on_status(self, message: GuidanceStatus) -> None:
        now = self.last_heard = time.monotonic()
        if self._first_status is None:
            # not an event: the first ones may have waited for this reader
            self._first_status = seconds_from_stamp(message.stamp), now
        self.summary.add_status(
            Status(
                time=seconds_from_stamp(message.stamp),
                cycle=message.cycle,
                converged=message.converged,
                total_iterations=message.total_iterations,
                stale_cycles=message.stale_cycles,
                cutoff_time=message.cutoff_time,
                predicted_position=_vector(message.predicted_position),
                predicted_velocity=_vector(message.predicted_velocity),
            )
        )

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.last_heard = time.monotonic()
        for status in message.status:
            level = _LEVELS.get(status.level)
            if level is not None and status.name.startswith(_OURS):
                line = Diagnostic(
                    time=seconds_from_stamp(message.header.stamp),
                    node=status.name.rsplit("/", maxsplit=1)[-1],
                    level=level,
                    message=status.message,
                )
                self.summary.add_diagnostic(line)
                if not self._said_by_node(line):
                    self._pass_on(str(line))

    def _pass_on(self, line: str) -> None:
        self._said += 1
        if self._said <= MAX_SAID:
            self._say(line)
        elif self._said == MAX_SAID + 1:
            self._say("further warnings are counted only")

    def _said_by_node(self, line: Diagnostic) -> bool:
        """What ends a node's work it prints itself."""
        return line.level == "ERROR" and (line.node == "recorder" or not self.summary.started)

    def _on_lost(self, info: Any) -> None:
        self.summary.lost_messages += info.total_count_change


def _vector(values: Any) -> tuple[float, float, float]:
    x, y, z = values
    return float(x), float(y), float(z)
