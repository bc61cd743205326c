# SPDX-License-Identifier: Apache-2.0
"""How a replay goes on: paused, faster, slower, elsewhere. Told by keys, or by another thread."""

import math
import os
import re
import select
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: Longest nap in s between two looks at what is asked.
NAP = 0.05
#: What a key does to the pace, and how far another goes, s of flight time.
FASTER = 2.0
JUMP_S = 10.0

#: A key as the terminal sends it: an arrow, or a character.
_KEY = re.compile(r"\x1b\[[A-D]|[^\x1b]")

KEYS_HELP = (
    "keys: space pauses and goes on, + and - change the pace, left and right go 10 s, q ends"
)


class Playback:
    """The pace of a replay, and where it is; safe to use from any thread.

    Attributes:
        rate: flight seconds per wall second; 0: as fast as the readers acknowledge.
        paused: whether it waits.
        time_s: flight time of the last messages that went out; nan before.
    """

    def __init__(self, rate: float = 1.0) -> None:
        """Play from the start on.

        Raises:
            ValueError: the rate is negative or not finite.
        """
        self._lock = threading.Lock()
        self.rate = 0.0
        self.paused = False
        self.time_s = math.nan
        self._target: float | None = None
        # at the wall time _since it was at the flight time _from, and ran
        self._since: float | None = None
        self._from = math.nan
        self._due = math.nan
        self.set_rate(rate)

    # ---- asked from outside

    def set_rate(self, rate: float) -> None:
        """Go on at another pace.

        Raises:
            ValueError: it is negative or not finite.
        """
        if not 0.0 <= rate < math.inf:
            raise ValueError(f"rate is {rate}; expected zero or a positive number")
        with self._lock:
            self._stand()
            self.rate = rate

    def pause(self) -> None:
        """Wait from now on."""
        with self._lock:
            self._stand()
            self.paused = True

    def resume(self) -> None:
        """Go on after a pause."""
        with self._lock:
            self.paused = False

    def seek(self, time_s: float) -> None:
        """Go on from another flight time, s; the clock jumps there."""
        with self._lock:
            self._target = time_s

    def _stand(self) -> None:
        """Note where it is: from here on another pace counts."""
        if self._since is not None:
            flown = (time.monotonic() - self._since) * self.rate if self.rate else math.inf
            self._from = min(self._from + flown, self._due)
        self._since = None

    # ---- asked by the replay

    def sent(self, time_s: float) -> None:
        """The messages of a flight time, s, have gone out."""
        self.time_s = time_s

    def jump(self) -> float | None:
        """The clock is about to jump: the pace counts from there.

        Returns:
            Where somebody wants to go on, flight time in s; None: nobody has asked.
        """
        with self._lock:
            target, self._target = self._target, None
            self._since = None
            self._from = math.nan
        return target

    def wait_until(self, time_s: float, stopped: Callable[[], bool]) -> bool:
        """Wait for the moment of a flight time.

        Args:
            time_s: flight time, s.
            stopped: looked at while waiting; True ends the wait.

        Returns:
            Whether messages of that time are due: nobody has stopped, or gone elsewhere.
        """
        while not stopped():
            if self._target is not None:
                return False
            left = self._left(time_s)
            if left <= 0.0:
                return True
            time.sleep(min(left, NAP))
        return False

    def _left(self, time_s: float) -> float:
        """Wall time in s until a flight time; a nap while paused."""
        with self._lock:
            self._due = time_s
            if self.paused:
                return NAP
            if self._since is None:
                self._since = time.monotonic()
                if math.isnan(self._from):
                    self._from = time_s
            if not self.rate:
                return 0.0
            return self._since + (time_s - self._from) / self.rate - time.monotonic()


@contextmanager
def keys(playback: Playback, say: Callable[[str], None]) -> Iterator[Callable[[], bool]]:
    """Take keys from the terminal, where there is one; the terminal is put back at the end.

    Args:
        playback: what they change.
        say: gets a line for each.

    Yields:
        To be called again and again: takes what was pressed; True once the end is asked for.
    """
    terminal = _own_terminal()
    if terminal is None:
        yield lambda: False
        return
    before = termios.tcgetattr(terminal)
    asked_to_end = False

    def look() -> bool:
        nonlocal asked_to_end
        while _in_front(terminal) and select.select([terminal], [], [], 0.0)[0]:
            pressed = os.read(terminal, 32).decode(errors="replace")
            if not pressed:
                break
            for key in _KEY.findall(pressed):
                asked_to_end |= key == "q"
                _press(playback, key, say)
        return asked_to_end

    try:
        # signals by key, such as Ctrl-C, still come
        tty.setcbreak(terminal, termios.TCSANOW)
        say(KEYS_HELP)
        yield look
    finally:
        termios.tcsetattr(terminal, termios.TCSANOW, before)


def _own_terminal() -> int | None:
    """Descriptor of the terminal that this process has in front of it."""
    try:
        descriptor = sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):
        return None
    return descriptor if os.isatty(descriptor) and _in_front(descriptor) else None


def _in_front(terminal: int) -> bool:
    """Whether keys are for this process: one in the background is stopped if it reads."""
    try:
        return os.tcgetpgrp(terminal) == os.getpgrp()
    except OSError:
        return False


def _press(playback: Playback, key: str, say: Callable[[str], None]) -> None:
    if key == " ":
        if playback.paused:
            playback.resume()
        else:
            playback.pause()
        where = "" if math.isnan(playback.time_s) else f" at {playback.time_s:.3f} s"
        say(f"{'paused' if playback.paused else 'going on'}{where}")
    elif key in ("+", "-", "\x1b[A", "\x1b[B") and playback.rate:
        factor = FASTER if key in ("+", "\x1b[A") else 1.0 / FASTER
        playback.set_rate(playback.rate * factor)
        say(f"pace {playback.rate:g}")
    elif key in ("\x1b[C", "\x1b[D") and not math.isnan(playback.time_s):
        target = playback.time_s + (JUMP_S if key == "\x1b[C" else -JUMP_S)
        playback.seek(target)
        say(f"from {target:.3f} s on")
