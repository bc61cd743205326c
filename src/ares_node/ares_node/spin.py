# SPDX-License-Identifier: Apache-2.0
"""Spinning in compiled code, with a look around now and then."""

from types import TracebackType
from typing import Self

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.task import Future

#: Wall time in s between looks.
LOOK_PERIOD = 0.1
#: Longest time in s in an executor whose timer does not fire.
TIMEOUT = 1.0


class Spinner:
    """Takes an executor's messages until the next look is due.

    `spin_once` comes back to Python after each message, which costs as much as the message.
    """

    def __init__(self, executor: Executor, node: Node) -> None:
        """Spin nothing yet.

        Args:
            executor: what is spun; the node is on it.
            node: gets a timer for the looks until `close`.
        """
        self._executor = executor
        self._node = node
        self._turn = Future()
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(LOOK_PERIOD, self.come_back, clock=clock)

    def spin(self) -> None:
        """Take what comes for LOOK_PERIOD, or until someone wants to `come_back`."""
        self._turn = Future()
        # without a timeout it waits for ever; under load the timeout alone does not end it
        self._executor.spin_until_future_complete(self._turn, timeout_sec=TIMEOUT)

    def come_back(self) -> None:
        """Look around now; from any thread."""
        self._turn.set_result(None)

    def __enter__(self) -> Self:
        """It has its timer already."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Free the timer."""
        self._node.destroy_timer(self._timer)
