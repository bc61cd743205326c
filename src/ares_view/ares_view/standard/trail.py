# SPDX-License-Identifier: Apache-2.0
"""Hold the path of a flight in a bounded number of points. No ROS."""

from collections.abc import Callable
from typing import Any

from ares_node.time import NANOSECONDS


class Trail:
    """Hold points evenly spread in flight time over the whole flight, in bounded number.

    When there are too many, every second one is dropped and their spacing doubles.

    Attributes:
        points: the points so far.
    """

    def __init__(self, most: int) -> None:
        """Start empty; keep `most` points at most, 2 at least."""
        self.points: list[Any] = []
        self._most = most
        self._step_ns = NANOSECONDS
        self._due_ns: int | None = None

    def offer(self, stamp_ns: int, make: Callable[[], Any]) -> bool:
        """Append a point if one is due.

        Args:
            stamp_ns: flight time, ns.
            make: makes the point.

        Returns:
            Whether it was appended.
        """
        if self._due_ns is not None and stamp_ns < self._due_ns:
            return False
        self.points.append(make())
        if len(self.points) > self._most:
            self.points = self.points[::2]
            self._step_ns *= 2
        self._due_ns = stamp_ns + self._step_ns
        return True
