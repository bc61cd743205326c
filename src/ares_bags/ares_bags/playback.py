# SPDX-License-Identifier: Apache-2.0
"""Control a replay: pause, rate, seek; from the keyboard or another thread."""

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

#: Longest sleep in s between two checks for a command.
NAP = 0.05
#: Factor of a key on the rate; jump of an arrow key, s of flight time.
FASTER = 2.0
JUMP_S = 10.0

#: A key as the terminal sends it: an arrow, or a character.
_KEY = re.compile(r"\x1b\[[A-D]|[^\x1b]")

KEYS_HELP = (
    "keys: space pauses and goes on, + and - change the pace, left and right go 10 s, q ends"
)


class Playback:
    """Hold the rate and the position of a replay; safe to use from any thread.

    Attributes:
        rate: flight seconds per wall second; 0: as fast as the readers acknowledge.
        paused: whether the replay is paused.
        time_s: flight time of the last messages sent, s; NaN before the first.
    """

    def __init__(self, rate: float = 1.0) -> None:
        """Start playing at a rate.

        Raises:
            ValueError: the rate is negative or not finite.
        """
        self._lock = threading.Lock()
        self.rate = 0.0
        self.paused = False
        self.time_s = math.nan
        self._target: float | None = None
        # reference of the rate: flight time _from, s, at wall time _since, s; None while paused
        self._since: float | None = None
        self._from = math.nan
        self._due = math.nan
        self.set_rate(rate)

    # ---- called by the controlling thread

    def set_rate(self, rate: float) -> None:
        """Change the rate.

        Raises:
            ValueError: it is negative or not finite.
        """
        if not 0.0 <= rate < math.inf:
            raise ValueError(f"rate is {rate}; expected zero or a positive number")
        with self._lock:
            self._rebase()
            self.rate = rate

    def pause(self) -> None:
        """Pause."""
        with self._lock:
            self._rebase()
            self.paused = True

    def resume(self) -> None:
        """Resume after a pause."""
        with self._lock:
            self.paused = False

    def seek(self, time_s: float) -> None:
        """Continue from another flight time, s; the clock jumps there."""
        with self._lock:
            self._target = time_s

    def _rebase(self) -> None:
        """Move the reference of the rate to the present position."""
        if self._since is not None:
            flown = (time.monotonic() - self._since) * self.rate if self.rate else math.inf
            self._from = min(self._from + flown, self._due)
        self._since = None

    # ---- called by the replay

    def sent(self, time_s: float) -> None:
        """Note that the messages of a flight time, s, have been sent."""
        self.time_s = time_s

    def jump(self) -> float | None:
        """Reset the reference of the rate before the clock jumps.

        Returns:
            Flight time in s of the last `seek`; None if there was none.
        """
        with self._lock:
            target, self._target = self._target, None
            self._since = None
            self._from = math.nan
        return target

    def wait_until(self, time_s: float, stopped: Callable[[], bool]) -> bool:
        """Wait until a flight time is due.

        Args:
            time_s: flight time, s.
            stopped: polled while waiting; True ends the wait.

        Returns:
            Whether messages of that time are due: neither stopped nor sought elsewhere.
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
        """Return the wall time in s until a flight time; while paused, the polling interval."""
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
    """Read keys from the terminal, if there is one; restore its mode at the end.

    Args:
        playback: controlled by the keys.
        say: gets a line for each key.

    Yields:
        Poll: handles the keys pressed since its last call; returns True once the end is requested.
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
    """Return the descriptor of this process's controlling terminal, None without one."""
    try:
        descriptor = sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):
        return None
    return descriptor if os.isatty(descriptor) and _in_front(descriptor) else None


def _in_front(terminal: int) -> bool:
    """Tell whether this process has the terminal; a background process is stopped by a read."""
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
