# SPDX-License-Identifier: Apache-2.0
"""Heartbeat of each node once a second: lifecycle state, message rate, longest callback.

It follows the conventions of diagnostic_updater: one status per task, named `node: task`, at the
level of the task, stamped by the wall clock. It differs between machines: no bag holds it, and no
verdict uses it.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from ares_node.diagnostics import facts, hardware_id
from ares_node.qos import DIAGNOSTIC, DIAGNOSTICS

#: Period of the heartbeat, wall time, s.
PERIOD = 1.0
#: Suffix of the status name.
_TASK = ": heartbeat"
#: Hardware id of a node without a flight.
NO_HARDWARE = "none"


def is_heartbeat(status: DiagnosticStatus) -> bool:
    """Return whether a status is a heartbeat, not a report on a flight."""
    return status.name.endswith(_TASK)


class Heartbeat:
    """Publish a node's heartbeat for the life of the node."""

    def __init__(
        self,
        node: Node,
        state: Callable[[], str] = lambda: "active",
        flight_id: Callable[[], int] = lambda: 0,
    ) -> None:
        """Begin with the first whole second.

        Args:
            node: that lives.
            state: returns its lifecycle state.
            flight_id: returns its flight; 0 for none.
        """
        self._name = node.get_fully_qualified_name().lstrip("/") + _TASK
        self._state = state
        self._flight_id = flight_id
        self._taken = 0
        self._longest_s = 0.0
        self._since = time.monotonic()
        self._out = node.create_publisher(DiagnosticArray, DIAGNOSTICS, DIAGNOSTIC)
        self._wall = Clock(clock_type=ClockType.SYSTEM_TIME)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._beat, clock=steady)

    @contextmanager
    def counted(self) -> Iterator[None]:
        """Count a received message and measure the time of its callback."""
        begun = time.perf_counter()
        try:
            yield
        finally:
            self._taken += 1
            self._longest_s = max(self._longest_s, time.perf_counter() - begun)

    def _beat(self) -> None:
        now = time.monotonic()
        said = {
            "state": self._state(),
            "rate_hz": f"{self._taken / (now - self._since):.1f}",
            "latency_ms": f"{1e3 * self._longest_s:.3f}",
        }
        status = DiagnosticStatus(
            level=DiagnosticStatus.OK,
            name=self._name,
            message=said["state"],
            hardware_id=hardware_id(self._flight_id()) or NO_HARDWARE,
            values=facts(said),
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._wall.now().to_msg()
        self._out.publish(array)
        self._taken, self._longest_s, self._since = 0, 0.0, now
