# SPDX-License-Identifier: Apache-2.0
"""Watch a flight for its verdict: events, guidance status, diagnostics."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node

from ares_bags.errors import printable
from ares_bringup.observed import Diagnostic, Event, GuidanceSample
from ares_bringup.outcomes import EXIT_MEANINGS
from ares_bringup.summary import FlightSummary
from ares_models.passage import Passage
from ares_msgs.msg import FlightEvent, FlightMember, GuidanceStatus
from ares_node import diagnostics, qos
from ares_node.diagnostics import Timing, folded, hardware_id, number_of, of_another_flight, timing
from ares_node.heartbeat import is_heartbeat
from ares_node.key import FORGED
from ares_node.membership import Membership, Role, State
from ares_node.time import seconds_from_stamp
from ares_studies.event_words import ENDS

_LEVELS = {
    DiagnosticStatus.WARN: "WARN",
    DiagnosticStatus.ERROR: "ERROR",
    DiagnosticStatus.STALE: "STALE",
}
#: Wall time in s for the verdict to arrive.
VERDICT_TIMEOUT = 0.5
#: Most warnings and errors printed during the flight.
MAX_SAID = 20
#: Most events kept, not counting that of the end.
MAX_EVENTS = 1000


def verdict_facts(summary: FlightSummary) -> dict[str, object]:
    """Return the facts on a flight's end for the live page."""
    shortcomings = summary.shortcomings()
    return {
        diagnostics.VERDICT: summary.verdict,
        diagnostics.GOOD: not shortcomings,
        diagnostics.SHORTCOMINGS: "\n".join(map(folded, shortcomings)),
        diagnostics.EXIT_STATUS: f"{summary.exit_code}, {EXIT_MEANINGS[summary.exit_code]}",
    }


class FlightMonitor:
    """Collect the inputs of the flight's summary; subscribe to nothing at the full rate.

    It is a member of the flight, as its judge: the simulator can wait for it.

    Attributes:
        node: owner of its endpoints.
        summary: filled during the flight.
        last_heard: wall time of the last sign that the flight goes on, s of time.monotonic().
        when_ended: called when the flight has ended.
        held: withhold the judge's agreement, so that the flight does not start; see `let_go`.
        pages: browsers in which the live page is open; -1: it is not served yet.
    """

    def __init__(self, node: Node, summary: FlightSummary, say: Callable[[str], None]) -> None:
        """Create the endpoints.

        Args:
            node: owner of the endpoints.
            summary: to be filled; its flight_id selects the flight.
            say: gets one line for each warning or error of a node.
        """
        self.node = node
        self.summary = summary
        self.last_heard = time.monotonic()
        self._membership = Membership(
            node, Role.JUDGE, flight_id=summary.flight_id, complain=self._on_forged
        )
        #: events of the end received while the simulator still announces that it flies
        self._ends: list[FlightEvent] = []
        self.when_ended: Callable[[], None] = lambda: None
        self.held = False
        self.pages = -1
        self._ended = False
        self._say = say
        self._said = 0
        self._first_status: tuple[float, float] | None = None
        self._flown: float | None = None
        lost = SubscriptionEventCallbacks(message_lost=self._on_lost)
        self._inputs = [
            node.create_subscription(kind, topic, callback, profile, event_callbacks=lost)
            for kind, topic, callback, profile in (
                (
                    FlightEvent,
                    qos.FLIGHT_EVENT,
                    self._membership.seals.reader(qos.FLIGHT_EVENT, self._on_event),
                    qos.EVENTS,
                ),
                (GuidanceStatus, qos.GUIDANCE_STATUS, self._on_status, qos.FLIGHT),
                (DiagnosticArray, qos.DIAGNOSTICS, self._on_diagnostics, qos.DIAGNOSTIC),
                (Timing, qos.TIMING, self._on_timing, qos.DIAGNOSTIC),
            )
        ]
        self._timing_out = node.create_publisher(Timing, qos.TIMING, qos.DIAGNOSTIC)
        self._membership.listen(self._on_member)

    def let_go(self) -> None:
        """Agree to the flight, which may then start."""
        if self.held:
            self.held = False
            self._membership.agree_as_observer()

    def say_verdict(self) -> None:
        """Send the verdict to the live page."""
        words = verdict_facts(self.summary)
        self._timing_out.publish(timing(self.node, self.summary.flight_id, words))
        self._timing_out.wait_for_all_acked(Duration(seconds=VERDICT_TIMEOUT))

    def guidance_ended(self) -> None:
        """Announce that the process of the flying guidance has ended."""
        simulator = self._membership.simulator
        if simulator is not None:
            self._membership.announce_departure(int(simulator.guidance_id))

    @property
    def ended(self) -> bool:
        """Return whether the flight has begun and ended."""
        return self._ended and self.summary.started

    def recorders(self, *states: State) -> list[FlightMember]:
        """Return the recorders of this flight that are in one of some states."""
        return self._membership.others(Role.RECORDER, *states)

    def leave(self) -> None:
        """Leave the flight and free the endpoints."""
        self._membership.close()
        self.node.destroy_publisher(self._timing_out)
        for endpoint in self._inputs:
            self.node.destroy_subscription(endpoint)

    def _on_member(self, _member: FlightMember) -> None:
        if self.held:
            self._membership.join()
        else:
            self._membership.agree_as_observer()
        self.summary.flight_id = self._membership.flight_id
        if self._ends and not self._flies():
            # of several, the last is the simulator's own
            end, self._ends = self._ends[-1], []
            self._take_event(end)

    def _flies(self) -> bool:
        simulator = self._membership.simulator
        return simulator is not None and simulator.state == State.FLYING

    def _on_forged(self, text: str) -> None:
        self.summary.add_forged(text)
        self._pass_on(text)

    def _is_ours(self, flight_id: int) -> bool:
        ours = self._membership.belongs(flight_id)
        self.summary.foreign_messages = self._membership.foreign
        return ours

    def _on_event(self, message: FlightEvent) -> None:
        if not self._is_ours(message.flight_id):
            return
        self.last_heard = time.monotonic()
        if message.type in ENDS and self._flies():
            self._ends.append(message)
        else:
            self._take_event(message)

    def _take_event(self, message: FlightEvent) -> None:
        now = time.monotonic()
        if len(self.summary.events) >= MAX_EVENTS and (self._ended or message.type not in ENDS):
            self.summary.lost_messages += 1
            return
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
            self._ended = True
            if self._first_status is not None:
                flight_time, wall_time = self._first_status
                self.summary.set_rate(message.time - flight_time, now - wall_time)
        if self.ended:
            self.when_ended()

    def _on_status(self, message: GuidanceStatus) -> None:
        if not self._is_ours(message.flight_id):
            return
        now = self.last_heard = time.monotonic()
        if self._first_status is None:
            # from a status, since the first events may have waited for this reader
            self._first_status = seconds_from_stamp(message.stamp), now
        self.summary.add_status(
            GuidanceSample(
                time=seconds_from_stamp(message.stamp),
                cycle=message.cycle,
                converged=message.converged,
                total_iterations=message.total_iterations,
                stale_cycles=message.stale_cycles,
                law=message.law,
                cutoff_time=message.cutoff_time,
                predicted_position=_vector(message.predicted_position),
                predicted_velocity=_vector(message.predicted_velocity),
                boosts=message.phase == GuidanceStatus.PHASE_BOOST,
            )
        )

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if is_heartbeat(status):
                continue
            if of_another_flight(status, self.summary.flight_id):
                self._is_ours(0)
                continue
            if status.hardware_id != hardware_id(self.summary.flight_id):
                continue
            said = {item.key: item.value for item in status.values}
            planned = number_of(said, diagnostics.FINAL_MASS_KG)
            if planned is not None:
                self.summary.planned_m_f_kg = planned
                self._say(_plan(said, planned))
            if passage := Passage.from_text(said.get(diagnostics.PASSAGE, "")):
                self.summary.set_air(passage)
            level = _LEVELS.get(status.level)
            if level is not None:
                self.last_heard = time.monotonic()
                line = Diagnostic(
                    time=seconds_from_stamp(message.header.stamp),
                    node=status.name.rsplit("/", maxsplit=1)[-1],
                    level=level,
                    message=status.message,
                )
                self.summary.add_diagnostic(line)
                if line.message.startswith(FORGED):
                    self.summary.add_forged(f"{line.node}: {line.message}")
                if not self._said_by_node(line):
                    self._pass_on(str(line))

    def _on_timing(self, status: Timing) -> None:
        if status.hardware_id != hardware_id(self.summary.flight_id):
            return
        said = {item.key: item.value for item in status.values}
        longest, pages = (
            number_of(said, diagnostics.LONGEST_CYCLE_MS),
            number_of(said, diagnostics.PAGES),
        )
        flown = number_of(said, diagnostics.FLIGHT_TIME_S)
        if longest is not None:
            self.summary.longest_cycle_ms = longest
        if pages is not None:
            self.pages = int(pages)
        waits = (
            said.get(diagnostics.PAUSED) == str(True)
            or (number_of(said, diagnostics.PACE) or 0.0) > 0.0
        )
        if waits or flown not in (None, self._flown):
            # the simulator waits for the wall clock, or flies on: it is not stuck
            self.last_heard = time.monotonic()
            self._flown = flown

    def _pass_on(self, line: str) -> None:
        self._said += 1
        if self._said <= MAX_SAID:
            self._say(line)
        elif self._said == MAX_SAID + 1:
            self._say("further warnings are counted but not shown")

    def _said_by_node(self, line: Diagnostic) -> bool:
        """Tell whether the node prints an error itself, since it ends its work."""
        return line.level == "ERROR" and (line.node == "recorder" or not self.summary.started)

    def _on_lost(self, info: Any) -> None:
        self.summary.lost_messages += info.total_count_change


def _plan(said: Mapping[str, str], mass: float) -> str:
    """Describe the plan accepted by guidance."""
    lowest = number_of(said, diagnostics.LOWEST_COAST_M)
    coasts = f", no coast below {lowest / 1e3:,.1f} km" if lowest is not None else ""
    method = printable(said.get("method", ""))
    return f"plan taken, by method {method}: {mass:,.1f} kg after the last cut-off{coasts}"


def _vector(values: Any) -> tuple[float, float, float]:
    x, y, z = values
    return float(x), float(y), float(z)
