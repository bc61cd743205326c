# SPDX-License-Identifier: Apache-2.0
"""Print lines on standard error while the workspace is prepared, with a bar below on a terminal."""

import contextlib
import math
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping

#: Wall time in s between two updates of the bar.
PERIOD = 0.2
#: Rate at which the share of a running step approaches 1 without reaching it: 0.78 at the expected
#: end.
APPROACH = 1.5
#: Width of the bar, characters.
WIDTH = 24
CLEAR_LINE = "\r\x1b[K"


class Steps:
    """Estimate the completed share of some steps and the time left."""

    def __init__(
        self, lengths: Mapping[str, float], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Start with no step done.

        Args:
            lengths: duration of each step on an idle machine of two cores, s, by name.
            clock: s, of any origin.
        """
        self._lengths = lengths
        self._clock = clock
        self._begun = clock()
        self._running: dict[str, float] = {}
        self._done: dict[str, float] = {}

    @contextlib.contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Mark a step as running inside the block, if it is one of these; steps may overlap."""
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
        """Return the names of the running steps."""
        return list(self._running)

    @property
    def elapsed(self) -> float:
        """Return the time since the start, s."""
        return self._clock() - self._begun

    def share(self) -> float:
        """Return the completed share, 0 to 1."""
        # ratio of this machine's durations to the expected ones
        known = sum(self._lengths[name] for name in self._done)
        slower = sum(self._done.values()) / known if known else 1.0
        done, now = known, self._clock()
        for name, begun in list(self._running.items()):
            length = self._lengths[name]
            done -= length * math.expm1(-APPROACH * (now - begun) / max(slower * length, 1e-3))
        return done / sum(self._lengths.values())

    def left(self) -> float:
        """Estimate the time left, s, at the speed so far once that is known."""
        share = self.share()
        if share < 0.1:
            return (1.0 - share) * sum(self._lengths.values())
        return self.elapsed * (1.0 - share) / share


class Bar:
    """Draw steps on a terminal's last line; draw nothing elsewhere."""

    def __init__(self) -> None:
        """Start without a bar."""
        self._steps: Steps | None = None
        self._over = threading.Event()
        self._pen = threading.Lock()

    def say(self, text: str) -> None:
        """Print one line on standard error, apart from a verb's standard output."""
        with self._pen:
            clear = CLEAR_LINE if self._steps else ""
            print(f"{clear}ares: {text}", file=sys.stderr, flush=True)

    @contextlib.contextmanager
    def over(self, steps: Steps) -> Iterator[None]:
        """Draw the bar while the block runs."""
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
    """Format the bar."""
    share = steps.share()
    full = round(WIDTH * share)
    about = " and ".join(steps.running)
    return (
        f"ares: [{'#' * full}{'.' * (WIDTH - full)}] {share:4.0%}  {steps.elapsed:.0f} s, "
        f"about {steps.left():.0f} s left  {about}"
    )


BAR = Bar()
say = BAR.say
