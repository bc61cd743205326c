# SPDX-License-Identifier: Apache-2.0
"""The rate of a replay, and the keys that change it."""

import math
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest
from rclpy.context import Context

from ares_bags.playback import Playback
from ares_bags.reader import open_bag
from ares_bags.replay import Extract, replay
from ares_trials.testing.bags import NAV, START_NS, write_bag
from ares_trials.testing.samples import one_in


class Clock:
    """Advance time by sleeps only; run each scheduled action at its time."""

    def __init__(self) -> None:
        self.now = 0.0
        self.due: dict[float, object] = {}

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        for moment in sorted(self.due):
            if moment <= self.now:
                self.due.pop(moment)()  # type: ignore[operator]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr("ares_bags.playback.time", made)
    return made


def moment_of(playback: Playback, clock: Clock, time_s: float) -> float:
    assert playback.wait_until(time_s, lambda: False)
    playback.sent(time_s)
    return clock.now


def test_pace_pause_and_pace_again(clock: Clock) -> None:
    playback = Playback(2.0)
    assert moment_of(playback, clock, 100.0) == 0.0
    assert moment_of(playback, clock, 101.0) == pytest.approx(0.5)
    # half of the way to 103 s at the old pace, half of it four times as slow
    clock.due[1.0] = lambda: playback.set_rate(0.5)
    assert moment_of(playback, clock, 103.0) == pytest.approx(1.0 + 1.0 / 0.5, abs=0.06)
    begun = clock.now
    clock.due[begun + 1.0] = playback.pause
    clock.due[begun + 8.0] = playback.resume
    assert moment_of(playback, clock, 104.0) == pytest.approx(begun + 2.0 + 7.0, abs=0.11)
    playback.set_rate(0.0)
    begun = clock.now
    assert moment_of(playback, clock, 900.0) == begun
    playback.set_rate(1.0)
    assert moment_of(playback, clock, 901.0) == pytest.approx(begun + 1.0)


def test_elsewhere(clock: Clock) -> None:
    playback = Playback()
    assert moment_of(playback, clock, 100.0) == 0.0
    clock.due[1.0] = lambda: playback.seek(300.0)
    assert not playback.wait_until(200.0, lambda: False)
    assert playback.jump() == 300.0
    assert playback.jump() is None
    begun = clock.now
    assert moment_of(playback, clock, 300.0) == begun
    assert moment_of(playback, clock, 301.0) == pytest.approx(begun + 1.0)
    for rate in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="expected zero or a positive number"):
            playback.set_rate(rate)


def test_a_piece_in_a_loop(ros_context: Context, tmp_path: Path) -> None:
    bag = open_bag(write_bag(tmp_path / "flight", 40))
    begin = START_NS / 1e9
    lines: list[str] = []
    extract = Extract([NAV], begin + 0.5, begin + 1.5, loop=True, again=lines.append)
    result = replay(
        bag,
        ros_context,
        playback=Playback(0.0),
        extract=extract,
        wait_for_readers_s=0.0,
        stopped=lambda: len(lines) == 3,
    )
    assert result.counts == {NAV: 33}
    assert result.loops == 3
    assert lines[0] == "loop 1: the clock goes back"
    with pytest.raises(Exception, match=r"nothing|no message .* it holds 155.900 to 159.800 s"):
        Extract(start_s=1000.0).check(bag)


def test_it_goes_on_elsewhere(ros_context: Context, tmp_path: Path) -> None:
    bag = open_bag(write_bag(tmp_path / "flight", 40))
    playback = Playback(0.0)
    last = START_NS / 1e9 + 3.9
    looks = iter(range(100))

    def stopped() -> bool:
        # the fifth look is the one before the fourth state
        if next(looks, 100) == 5:
            playback.seek(last)
        return False

    result = replay(
        bag,
        ros_context,
        playback=playback,
        extract=Extract([NAV]),
        wait_for_readers_s=0.0,
        stopped=stopped,
    )
    assert result.complete
    assert 2 <= result.counts[NAV] < 10
    assert playback.time_s == pytest.approx(last)


#: The terminal in front of the process, and a replay.
RUN = """
import fcntl, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
from ares_bags.replay import run_replay
sys.exit(run_replay(sys.argv[1], rate=0.25))
"""


class Terminal:
    """Run a replay with a terminal of its own."""

    def __init__(self, environment: dict[str, str], path: Path) -> None:
        self.master, self.slave = pty.openpty()
        self.before = termios.tcgetattr(self.slave)
        self.text = ""
        self.process = subprocess.Popen(
            [sys.executable, "-c", RUN, str(path)],
            env=environment,
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            start_new_session=True,
        )

    def wait_for(self, text: str) -> None:
        deadline = time.monotonic() + 60.0
        while text not in self.text:
            assert time.monotonic() < deadline, self.text
            if select.select([self.master], [], [], 1.0)[0]:
                self.text += os.read(self.master, 4096).decode()

    def press(self, keys: str) -> None:
        os.write(self.master, keys.encode())

    def press_until(self, keys: str, text: str) -> None:
        """Press keys until a text appears; before the first message there is no position."""
        while text not in self.text:
            self.press(keys)
            if select.select([self.master], [], [], 0.2)[0]:
                self.text += os.read(self.master, 4096).decode()

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.master)
        os.close(self.slave)


@pytest.mark.parametrize("end", one_in(3, ["q", "SIGINT", "SIGTERM", "Ctrl-C"]))
def test_keys_and_a_terminal_that_is_put_back(
    ros_environment: dict[str, str], tmp_path: Path, end: str
) -> None:
    path = write_bag(tmp_path / "long", 600)
    terminal = Terminal(ros_environment, path)
    try:
        terminal.wait_for("keys: space pauses and goes on")
        terminal.press(" ")
        terminal.wait_for("paused")
        assert not termios.tcgetattr(terminal.slave)[3] & termios.ICANON
        # as they come when somebody types faster than they are taken
        terminal.press("+ ")
        terminal.wait_for("pace 0.5")
        terminal.wait_for("going on")
        terminal.press_until("\x1b[C", " s on")
        if end == "q":
            terminal.press("q")
        elif end == "Ctrl-C":
            terminal.press("\x03")
        else:
            terminal.process.send_signal(getattr(signal, end))
        terminal.wait_for("stopped before the end")
        assert terminal.process.wait(timeout=60) == 0
        assert termios.tcgetattr(terminal.slave) == terminal.before
    finally:
        terminal.close()
