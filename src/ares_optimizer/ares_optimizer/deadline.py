"""A wall-clock limit that searches ask between their steps."""

import math
import time

#: What a search says that the limit has ended.
TIME_LIMIT_PASSED = "the time limit passed before the search ended"


class Deadline:
    """A moment after which no further start is tried.

    Attributes:
        end: s, on the clock of ``time.perf_counter``.
    """

    def __init__(self, seconds: float | None = None) -> None:
        """Set the limit.

        Args:
            seconds: from now; None: no limit.
        """
        self.end = math.inf if seconds is None else time.perf_counter() + seconds

    def within(self, seconds: float) -> "Deadline":
        """A deadline that is no later than this one and no further off than given."""
        sooner = Deadline(seconds)
        sooner.end = min(sooner.end, self.end)
        return sooner

    @property
    def passed(self) -> bool:
        """Whether the time is over."""
        return time.perf_counter() >= self.end
