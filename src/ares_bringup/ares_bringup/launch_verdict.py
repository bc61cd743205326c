"""One verdict and one exit status for a flight under `ros2 launch`. Needs neither ROS nor launch.

The judge's node says what the flight came to. Launch knows besides how each process ended, and
is told here what follows from that: the same as for a child of `ares fly`.
"""

import atexit
import contextlib
import logging
import os
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from ares_bringup.keeper import GUIDANCE, JUDGE, RECORDER, SIMULATOR, SPARED, Keeper
from ares_bringup.summary import EXIT_CANNOT_START, EXIT_INTERRUPTED, EXIT_NOT_AS_IT_SHOULD

#: Sent to the judge: see `ares_bringup.judge`.
SIGNALS = {SIMULATOR: "SIGUSR2", GUIDANCE: "SIGRTMIN", RECORDER: "SIGUSR1"}
#: Wall time in s for nodes that launch has left behind to end.
LEFT_BEHIND_TIMEOUT = 2.0
LOOK_PERIOD = 0.02


@dataclass(frozen=True)
class Consequence:
    """What launch has to do because a process has ended.

    Attributes:
        line: for the person at the terminal; empty: nothing to say.
        tell_judge: name of the signal for the judge; empty: none.
        shut_down: end everything.
        restart: start the process again.
    """

    line: str = ""
    tell_judge: str = ""
    shut_down: bool = False
    restart: bool = False


class LaunchVerdict:
    """Collects how the processes of one flight end.

    Attributes:
        pids: processes that run, by name.
        keeper: says whether one that has ended is started again.
    """

    def __init__(self, shut_down_with_judge: bool = True) -> None:
        """Nothing has ended yet.

        Args:
            shut_down_with_judge: end everything when the judge has spoken.
        """
        self.keeper = Keeper()
        self.pids: dict[str, int] = {}
        self._shut_down_with_judge = shut_down_with_judge
        self._cannot_start = False
        self._interrupted = False
        self._judged: int | None = None
        self._problems = False

    def cannot_start(self, reason: str) -> None:
        """Nothing is started, for this reason."""
        self._cannot_start = True
        print(f"ares: {reason}", file=sys.stderr, flush=True)

    def interrupt(self) -> None:
        """A signal asks launch to end."""
        self._interrupted |= self._judged is None

    def ended(self, name: str, status: int) -> Consequence:
        """A process has ended.

        Args:
            name: of the node.
            status: exit status, negative for a signal.
        """
        self.pids.pop(name, None)
        if name == JUDGE:
            # told of a lost node before it could listen: there was no flight yet
            deaf = -status in [signal.Signals[word] for word in SIGNALS.values()]
            self._judged = EXIT_CANNOT_START if deaf else status
            return Consequence(shut_down=self._shut_down_with_judge)
        if self._judged is not None or self._interrupted or self._cannot_start:
            self._problems |= status != 0 and name not in SPARED and self._judged is not None
            return Consequence()
        line, again = self.keeper.ended(name, status)
        if status == EXIT_CANNOT_START and not self.keeper.restarted(name):
            self._cannot_start = True
            return Consequence(shut_down=True)
        self._problems |= name not in SPARED
        return Consequence(line, SIGNALS.get(name, ""), restart=again)

    @property
    def status(self) -> int:
        """Exit status of the whole, as `ares fly` would have it."""
        if self._cannot_start or self._judged == EXIT_CANNOT_START:
            return EXIT_CANNOT_START
        if self._interrupted or self._judged is None:
            return EXIT_INTERRUPTED
        return self._judged or (EXIT_NOT_AS_IT_SHOULD if self._problems else 0)

    def end_left_behind(self) -> None:
        """End what launch has left running, as it does after a SIGTERM."""
        for number in (signal.SIGTERM, signal.SIGKILL):
            deadline = time.monotonic() + LEFT_BEHIND_TIMEOUT
            alive = [pid for pid in self.pids.values() if _signalled(pid, number)]
            while alive and time.monotonic() < deadline:
                time.sleep(LOOK_PERIOD)
                alive = [pid for pid in alive if _signalled(pid, 0)]


def _signalled(pid: int, number: int) -> bool:
    """Send a signal to a child; False if it is no more."""
    with contextlib.suppress(ChildProcessError):
        os.waitpid(pid, os.WNOHANG)
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return False
    return True


def end_process_with(verdict: LaunchVerdict) -> bool:
    """Let the `ros2` command end with the verdict; launch itself knows 0 and 1 only.

    Returns:
        False in another program, whose exit status is its own.
    """
    if Path(sys.argv[0]).name != "ros2":
        return False

    def leave() -> None:
        verdict.end_left_behind()
        logging.shutdown()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(verdict.status)

    atexit.register(leave)
    return True
