# SPDX-License-Identifier: Apache-2.0
"""Lines on standard error while the workspace is made, and on a terminal a bar below them.

Needs nothing but the standard library: nothing else is installed by then.
"""

import contextlib
import math
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping

#: Wall time in s between drawings of the bar.
PERIOD = 0.2
#: How fast a running step's share comes near to 1, which it does not reach by itself: 0.78 are
#: done when it should have ended.
APPROACH = 1.5
#: Characters of the bar itself.
WIDTH = 24
CLEAR_LINE = "\r\x1b[K"


class Steps:
    """How much of some steps is done, and how long the rest may take."""

    def __init__(
        self, lengths: Mapping[str, float], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Nothing is done yet.

        Args:
            lengths: by name, how long each step takes on an idle machine of two cores, s.
            clock: s, of any origin.
        """
        self._lengths = lengths
        self._clock = clock
        self._begun = clock()
        self._running: dict[str, float] = {}
        self._done: dict[str, float] = {}

    @contextlib.contextmanager
    def step(self, name: str) -> Iterator[None]:
        """While a step runs, if it is one of these; others may run beside it."""
        if name not in self._lengths:
            yield
            return
        self._running[name] = self._clock()
        try:
            yield
        finally:
            self._done[name] = self._clock() - self._running.pop(name)

    @property
    def running(self) -> list[str]:
        """Names of the steps that run."""
        return list(self._running)

    @property
    def elapsed(self) -> float:
        """Time since the beginning, s."""
        return self._clock() - self._begun

    def share(self) -> float:
        """How much is done, 0 to 1."""
        # how much slower this machine is than the one that the lengths are of
        known = sum(self._lengths[name] for name in self._done)
        slower = sum(self._done.values()) / known if known else 1.0
        done, now = known, self._clock()
        for name, begun in list(self._running.items()):
            length = self._lengths[name]
            done -= length * math.expm1(-APPROACH * (now - begun) / max(slower * length, 1e-3))
        return done / sum(self._lengths.values())

    def left(self) -> float:
        """How long the rest may take, s: as fast as it went so far, once that can be told."""
        share = self.share()
        if share < 0.1:
            return (1.0 - share) * sum(self._lengths.values())
        return self.elapsed * (1.0 - share) / share


class Bar:
    """Draws steps on a terminal's last line; anywhere else it draws nothing."""

    def __init__(self) -> None:
        """No bar is drawn yet."""
        self._steps: Steps | None = None
        self._over = threading.Event()
        self._pen = threading.Lock()

    def say(self, text: str) -> None:
        """Print one line for the user, apart from what a verb prints on stdout."""
        with self._pen:
            clear = CLEAR_LINE if self._steps else ""
            print(f"{clear}ares: {text}", file=sys.stderr, flush=True)

    @contextlib.contextmanager
    def over(self, steps: Steps) -> Iterator[None]:
        """While the steps run."""
        if not sys.stderr.isatty():
            yield
            return
        self._steps = steps
        self._over.clear()
        drawing = threading.Thread(target=self._draw, args=(steps,), daemon=True)
        drawing.start()
        try:
            yield
        finally:
            self._over.set()
            drawing.join()
            self._steps = None
            print(CLEAR_LINE, end="", file=sys.stderr, flush=True)

    def _draw(self, steps: Steps) -> None:
        while not self._over.wait(PERIOD):
            columns = shutil.get_terminal_size().columns
            with self._pen:
                print(CLEAR_LINE + line(steps)[: columns - 1], end="", file=sys.stderr, flush=True)


def line(steps: Steps) -> str:
    """The bar as text."""
    share = steps.share()
    full = round(WIDTH * share)
    about = " and ".join(steps.running)
    return (
        f"ares: [{'#' * full}{'.' * (WIDTH - full)}] {share:4.0%}  {steps.elapsed:.0f} s, "
        f"about {steps.left():.0f} s left  {about}"
    )


BAR = Bar()
say = BAR.say
