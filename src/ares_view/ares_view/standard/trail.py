# SPDX-License-Identifier: Apache-2.0
"""The way of a flight in a bounded number of points. No ROS."""

from collections.abc import Callable
from typing import Any

from ares_node.time import NANOSECONDS


class Trail:
    """Points evenly spread in flight time, of the whole flight, never more than so many.

    When they get too many every second one goes, and from then on they are twice as far apart.

    Attributes:
        points: the points so far.
    """

    def __init__(self, most: int) -> None:
        """No points yet; 2 at least are kept."""
        self.points: list[Any] = []
        self._most = most
        self._step_ns = NANOSECONDS
        self._due_ns: int | None = None

    def offer(self, stamp_ns: int, make: Callable[[], Any]) -> bool:
        """Take a point if one is due.

        Args:
            stamp_ns: flight time, ns.
            make: makes the point.

        Returns:
            Whether it was taken.
        """
        if self._due_ns is not None and stamp_ns < self._due_ns:
            return False
        self.points.append(make())
        if len(self.points) > self._most:
            self.points = self.points[::2]
            self._step_ns *= 2
        self._due_ns = stamp_ns + self._step_ns
        return True
