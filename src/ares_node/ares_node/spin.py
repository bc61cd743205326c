# SPDX-License-Identifier: Apache-2.0
"""Spinning in compiled code, with periodic returns to Python."""

from typing import Self

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.task import Future

#: Period of the returns, wall time, s.
LOOK_PERIOD = 0.1
#: Timeout of the executor if its timer does not fire, s.
TIMEOUT = 1.0


class Spinner:
    """Spin an executor until the next return is due.

    `spin_once` returns to Python after each message, which costs as much as the message.
    """

    def __init__(self, executor: Executor, node: Node) -> None:
        """Create the timer of the returns.

        Args:
            executor: to spin, with the node.
            node: owner of the timer.
        """
        self._executor = executor
        self._node = node
        self._turn = Future()
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(LOOK_PERIOD, self.come_back, clock=clock)

    def spin(self) -> None:
        """Process messages for LOOK_PERIOD, or until `come_back` is called."""
        self._turn = Future()
        # without a timeout it could block for ever; under load the timeout alone does not end it
        self._executor.spin_until_future_complete(self._turn, timeout_sec=TIMEOUT)

    def come_back(self) -> None:
        """Return to Python now; may be called from any thread."""
        self._turn.set_result(None)

    def __enter__(self) -> Self:
        """Return the spinner."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free the timer."""
        self._node.destroy_timer(self._timer)
