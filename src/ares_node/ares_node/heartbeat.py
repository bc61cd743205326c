# SPDX-License-Identifier: Apache-2.0
"""A word of each node once a second: that it lives, how busy it is, how long it takes.

By the conventions of diagnostic_updater: one status per task, named `node: task`, at the level of
the task, with the wall clock in the stamp. It differs from machine to machine: no bag holds it, and
no verdict is made from it.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from ares_node.diagnostics import hardware_id
from ares_node.qos import DIAGNOSTIC, DIAGNOSTICS

#: Wall time in s between words.
PERIOD = 1.0
#: What the name of the status ends with.
_TASK = ": heartbeat"
#: Hardware id of a node that takes part in no flight.
NO_HARDWARE = "none"


def is_heartbeat(status: DiagnosticStatus) -> bool:
    """Tell a heartbeat from a report on a flight."""
    return status.name.endswith(_TASK)


class Heartbeat:
    """Publishes a node's heartbeat as long as the node is there."""

    def __init__(
        self,
        node: Node,
        state: Callable[[], str] = lambda: "active",
        flight_id: Callable[[], int] = lambda: 0,
    ) -> None:
        """Begin with the first whole second.

        Args:
            node: whose.
            state: gives its lifecycle state.
            flight_id: gives the flight that it takes part in; 0 for none.
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
        """Count a message that is taken, and how long that takes."""
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
            values=[KeyValue(key=key, value=value) for key, value in said.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._wall.now().to_msg()
        self._out.publish(array)
        self._taken, self._longest_s, self._since = 0, 0.0, now
