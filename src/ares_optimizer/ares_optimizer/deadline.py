# SPDX-License-Identifier: Apache-2.0
"""A wall-clock limit that searches ask between their steps, compiled ones too."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

Flag = NDArray[np.int64]


@dataclass(frozen=True)
class Progress:
    """One word on how a search goes on.

    Attributes:
        method: which searches, whatever was asked: ``collocation``, ``direct`` or ``indirect``.
        iterations: of the search that runs.
        violation: greatest violation of a constraint, as the method scales them.
        m_f_kg: mass after the cut-off of the present iterate; NaN: not known to the method.
    """

    method: str
    iterations: int
    violation: float
    m_f_kg: float = math.nan


class Deadline:
    """A moment after which no further start is tried, and a running search ends.

    A kernel cannot ask the clock. It looks at a flag instead, which a thread writes when the
    time is over; the thread lives within the ``with`` statement of the deadline.

    Attributes:
        tell: gets a word on the search now and then.
        end: s, on the clock of ``time.perf_counter``.
        flag: shape (1,), for kernels: 1 once the time is over.
    """

    def __init__(
        self,
        seconds: float | None = None,
        tell: Callable[[Progress], None] = lambda _progress: None,
    ) -> None:
        """Set the limit.

        Args:
            seconds: from now; None: no limit.
            tell: gets a word on each iteration, or search where those are compiled, in the thread
                that searches.
        """
        self.tell = tell
        self.end = math.inf if seconds is None else time.perf_counter() + seconds
        self.flag: Flag = np.zeros(1, np.int64)
        self._flags = [self.flag]
        self._timer: threading.Timer | None = None

    def __enter__(self) -> "Deadline":
        """Begin to watch the clock for the kernels."""
        left = self.end - time.perf_counter()
        if left <= threading.TIMEOUT_MAX:
            self._timer = threading.Timer(max(0.0, left), self.end_now)
            self._timer.daemon = True
            self._timer.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Watch no longer."""
        if self._timer is not None:
            self._timer.cancel()

    def end_now(self) -> None:
        """Let the time be over, from any thread."""
        for flag in self._flags:
            flag[0] = 1

    def watch(self, flag: Flag) -> None:
        """Have a kernel's own flag, shape (1,), set when the time is over."""
        self._flags.append(flag)
        if self.passed:
            self.end_now()

    def within(self, seconds: float) -> "Deadline":
        """A deadline no later than this one and no further off than given, between searches.

        Within a search only this one counts: what a short search finds is not left to chance.
        """
        sooner = Deadline(seconds, self.tell)
        sooner.end = min(sooner.end, self.end)
        sooner.flag = self.flag
        return sooner

    @property
    def passed(self) -> bool:
        """Whether the time is over."""
        return bool(self.flag[0]) or time.perf_counter() >= self.end
