# SPDX-License-Identifier: Apache-2.0
"""One verdict and one exit status for a flight under `ros2 launch`. Needs neither ROS nor launch.

The judge's node says what the flight came to. Launch knows besides how each process ended, and
is told here what follows from that: the same as for a child of `ares fly`.
"""

import asyncio
import signal
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from ares_bringup.crew import describe_end
from ares_bringup.keeper import GUIDANCE, JUDGE, RECORDER, SIMULATOR, SPARED, Keeper
from ares_bringup.summary import (
    EXIT_CANNOT_START,
    EXIT_INTERRUPTED,
    EXIT_NOT_AS_IT_SHOULD,
    EXIT_TARGET,
)

PACKAGE = "ares_bringup"
#: Sent to the judge: see `ares_bringup.judge`.
SIGNALS = {
    SIMULATOR: signal.SIGUSR2,
    GUIDANCE: signal.Signals(signal.SIGRTMIN),
    RECORDER: signal.SIGUSR1,
}
#: With which a judge ends that has spoken.
VERDICTS = (EXIT_TARGET, EXIT_NOT_AS_IT_SHOULD, EXIT_CANNOT_START, EXIT_INTERRUPTED)


@dataclass(frozen=True)
class Consequence:
    """What launch has to do because a process has ended.

    Attributes:
        line: for the person at the terminal; empty: nothing to say.
        tell_judge: signal for the judge; None: none.
        shut_down: end all processes of the flight.
        restart: start the process again.
    """

    line: str = ""
    tell_judge: signal.Signals | None = None
    shut_down: bool = False
    restart: bool = False


class LaunchVerdict:
    """Collects how the processes of one flight end.

    Attributes:
        keeper: says whether one that has ended is started again.
        running: processes that have not ended for good.
        up: those of them that have been started, and not ended since.
    """

    def __init__(self, shut_down_with_judge: bool = True) -> None:
        """Nothing has been started yet.

        Args:
            shut_down_with_judge: end the flight's processes when the judge has spoken.
        """
        self.keeper = Keeper()
        self.running: set[str] = set()
        self.up: set[str] = set()
        self._shut_down_with_judge = shut_down_with_judge
        self._cannot_start = False
        self._interrupted = False
        self._judged: int | None = None
        self._problems = False

    def start(self, names: Iterable[str]) -> None:
        """Expect these processes to end some time."""
        self.running = set(names)

    def started(self, name: str) -> None:
        """Note that a process runs."""
        self.up.add(name)

    def cannot_start(self, reason: str) -> None:
        """Nothing is started, for this reason."""
        self._cannot_start = True
        print(f"ares: {reason}", file=sys.stderr, flush=True)

    def interrupt(self) -> None:
        """Launch shuts down."""
        self._interrupted |= self._judged is None

    def ended(self, name: str, status: int) -> Consequence:
        """Say what follows from the end of a process.

        Args:
            name: of the node.
            status: exit status, negative for a signal.
        """
        follows = self._judge_ended(status) if name == JUDGE else self._node_ended(name, status)
        self.up.discard(name)
        if not follows.restart:
            self.running.discard(name)
        if follows.shut_down:
            # who waits to be started again is not
            self.running &= self.up
        return follows

    def _judge_ended(self, status: int) -> Consequence:
        if -status in SIGNALS.values():
            # told of a lost node before it could listen: there was no flight yet
            self._judged = EXIT_CANNOT_START
        elif status in VERDICTS:
            self._judged = status
        else:
            self._judged = EXIT_NOT_AS_IT_SHOULD
            line = f"{JUDGE} {describe_end(status)}: the flight ends without its verdict"
            return Consequence(line, shut_down=True)
        return Consequence(shut_down=self._shut_down_with_judge)

    def _node_ended(self, name: str, status: int) -> Consequence:
        if self._judged is not None or self._interrupted or self._cannot_start:
            if status == 0 or name in SPARED or self._judged is None:
                return Consequence()
            self._problems = True
            return Consequence(f"{name} {describe_end(status)} after the flight")
        tell = SIGNALS.get(name)
        if tell is not None and JUDGE not in self.up:
            # there was no flight yet
            self._cannot_start = True
            return Consequence(f"{name} {describe_end(status)}", shut_down=True)
        line, again = self.keeper.ended(name, status)
        if status == EXIT_CANNOT_START and not self.keeper.restarted(name):
            self._cannot_start = True
            return Consequence(shut_down=True)
        self._problems |= name not in SPARED
        return Consequence(line, tell, restart=again)

    @property
    def status(self) -> int:
        """Exit status of the flight, as `ares fly` would have it."""
        if self._cannot_start or self._judged == EXIT_CANNOT_START:
            return EXIT_CANNOT_START
        if self._interrupted or self._judged is None:
            return EXIT_INTERRUPTED
        return self._judged or (EXIT_NOT_AS_IT_SHOULD if self._problems else EXIT_TARGET)


def is_launched_itself(file: Path, words: Sequence[str]) -> bool:
    """Tell whether `ros2 launch` was asked for this file, and not for one that includes it.

    Args:
        file: the launch file.
        words: the command line, sys.argv.
    """
    if not words or Path(words[0]).name != "ros2":
        return False
    by_package = (PACKAGE, file.name) in pairwise(words)
    return by_package or any(
        ":=" not in word and Path(word).is_file() and file.samefile(word) for word in words[1:]
    )


def end_launch_with(verdict: LaunchVerdict, loop: asyncio.AbstractEventLoop) -> None:
    """Let `ros2 launch` end with the verdict; launch itself knows 0 and 1 only.

    Args:
        verdict: asked when launch has nothing more to do.
        loop: the one that launch runs in.
    """

    def leave(task: "asyncio.Task[int]") -> None:
        # out of the loop, which stops now, and through the command's own end
        sys.exit(verdict.status or task.result())

    # launch handles SIGTERM only where Python does; else it dies of it, without a status
    signal.signal(signal.SIGTERM, lambda _number, _frame: None)
    for task in asyncio.all_tasks(loop):
        if getattr(task.get_coro(), "__name__", "") == "run_async":
            task.add_done_callback(leave)
