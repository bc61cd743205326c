# SPDX-License-Identifier: Apache-2.0
"""Detect the end of a flight, and stalls. No ROS."""

import math
import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from ares_bringup.options import CannotStart
from ares_node.security import RANGE

if TYPE_CHECKING:
    from ares_bringup.monitor import FlightMonitor

#: Wall time in s after which a slow start is explained.
PATIENCE = 15.0
#: The same if discovery is switched off.
OFF_PATIENCE = 3.0
#: Wall time in s for all nodes to start, compilation of the first flight included, and in addition
#: for them to say themselves why they do not.
START_TIMEOUT = 300.0
START_MARGIN = 60.0
#: Wall time in s without a sign that the flight goes on, after which it is aborted. The simulator
#: gives one each second; the longest time for which it may stand still, waiting for guidance that
#: plans in flight, is 50 s by default.
STALL_TIMEOUT = 60.0
#: Wall time in s between two looks above which this process itself was stopped, and heard nothing.
STOPPED_AFTER = 5.0


class Watch:
    """Check in every turn of a loop for the end, a stall or a slow start."""

    def __init__(
        self,
        monitor: "FlightMonitor",
        say: Callable[[str], None],
        interrupted: Callable[[], bool],
        begun: Callable[[], None] = lambda: None,
        patience: float = PATIENCE,
    ) -> None:
        """Start watching.

        Args:
            monitor: of the flight.
            say: gets a line for the user.
            interrupted: whether a signal requests the end.
            begun: called once when the flight has begun.
            patience: wall time in s after which a slow start is explained.
        """
        self._monitor = monitor
        self._interrupted = interrupted
        self._say = say
        self._made = self._looked = self._awake_since = time.monotonic()
        self._patience = patience
        self._off = os.environ.get(RANGE) == "OFF"
        self._begun: Callable[[], None] | None = begun

    def over(self) -> bool:
        """Tell whether the flight is over or aborted; the summary then has the reason.

        Raises:
            CannotStart: it has not begun within START_TIMEOUT.
        """
        summary = self._monitor.summary
        if summary.started and self._begun:
            self._begun()
            self._begun = None
        if self._monitor.ended:
            return True
        if self._interrupted():
            summary.interrupted = True
            return True
        now = time.monotonic()
        if now - self._looked > STOPPED_AFTER:
            self._awake_since = now
        self._looked = now
        if summary.started:
            if now - max(self._monitor.last_heard, self._awake_since) > STALL_TIMEOUT:
                summary.problems.append(f"nothing heard for {STALL_TIMEOUT:.0f} s: given up")
                return True
        elif now - self._made > START_TIMEOUT + START_MARGIN:
            raise CannotStart(f"the flight has not begun within {now - self._made:.0f} s")
        elif self._off and now - self._made > OFF_PATIENCE:
            self._off = False
            self._say(f"waiting for the nodes: {RANGE} is OFF, by which none finds another")
        elif now - self._made > self._patience:
            self._patience = math.inf
            self._say("waiting for the nodes; the very first flight compiles them")
        return False
