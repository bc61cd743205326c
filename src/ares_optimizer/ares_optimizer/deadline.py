# SPDX-License-Identifier: Apache-2.0
"""Limit the wall time of searches, compiled ones included."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Flag = NDArray[np.int64]


@dataclass(frozen=True)
class Progress:
    """Hold the progress of a search.

    Attributes:
        method: method that is searching: ``collocation``, ``direct`` or ``indirect``.
        iterations: of the running search.
        violation: largest violation of a constraint, in the scale of the method.
        m_f_kg: final mass of the current iterate; NaN: not known.
    """

    method: str
    iterations: int
    violation: float
    m_f_kg: float = math.nan


class Deadline:
    """Limit the time of searches: no further start is tried, a running search ends.

    A kernel cannot read the clock. It reads a flag instead, which a thread sets at the limit; the
    thread lives within the ``with`` statement of the deadline.

    Attributes:
        report: called with the progress of the search.
        end: limit, s, on the clock of ``time.perf_counter``.
        flag: shape (1,), for kernels: 1 after the limit.
    """

    def __init__(
        self,
        seconds: float | None = None,
        report: Callable[[Progress], None] = lambda _progress: None,
    ) -> None:
        """Set the limit.

        Args:
            seconds: from now; None: no limit.
            report: called after each iteration, or each search if it is compiled, in the thread of
                the search.
        """
        self.report = report
        self.begin(seconds)
        self.flag: Flag = np.zeros(1, np.int64)
        self._flags = [self.flag]
        self._timer: threading.Timer | None = None

    def begin(self, seconds: float | None) -> None:
        """Count the limit from now: a request may have waited for others.

        Args:
            seconds: from now; None: no limit.
        """
        self._began = time.perf_counter()
        self.end = math.inf if seconds is None else self._began + seconds

    def __enter__(self) -> "Deadline":
        """Start the thread that watches the clock for the kernels."""
        left = self.end - time.perf_counter()
        if left <= threading.TIMEOUT_MAX:
            self._timer = threading.Timer(max(0.0, left), self.end_now)
            self._timer.daemon = True
            self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop that thread."""
        if self._timer is not None:
            self._timer.cancel()

    def end_now(self) -> None:
        """Reach the limit at once, from any thread."""
        for flag in self._flags:
            flag[0] = 1

    def watch(self, flag: Flag) -> None:
        """Set another flag, shape (1,), at the limit too."""
        self._flags.append(flag)
        if self.passed:
            self.end_now()

    def within(self, seconds: float) -> "Deadline":
        """Return an earlier deadline, at most ``seconds`` from now, for use between searches.

        Kernels see the flag of the later deadline alone: a search that runs when the earlier one
        passes still ends by itself, so its result does not depend on the speed of the machine.
        """
        sooner = Deadline(seconds, self.report)
        sooner.end = min(sooner.end, self.end)
        sooner.flag = self.flag
        return sooner

    @property
    def passed(self) -> bool:
        """Return true after the limit."""
        return bool(self.flag[0]) or time.perf_counter() >= self.end

    @property
    def share_passed(self) -> float:
        """Return the share of the time that has passed; 0 without a limit."""
        return (time.perf_counter() - self._began) / max(self.end - self._began, 1e-9)
