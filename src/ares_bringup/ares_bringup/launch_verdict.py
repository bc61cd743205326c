# SPDX-License-Identifier: Apache-2.0
"""Derive the verdict and exit status of a flight under `ros2 launch`. No ROS, no launch.

The judge's node gives the verdict on the flight. Launch also knows how each process ended; this
module tells it the consequences, which are those of a child of `ares fly`.
"""

import asyncio
import signal
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from ares_bringup.crew import describe_end, settled
from ares_bringup.keeper import GUIDANCE, JUDGE, RECORDER, SIMULATOR, SPARED, Keeper
from ares_bringup.outcomes import (
    EXIT_CANNOT_START,
    EXIT_INTERRUPTED,
    EXIT_NOT_AS_IT_SHOULD,
    EXIT_TARGET,
)

PACKAGE = "ares_bringup"
#: Signals to the judge, see `ares_bringup.judge`.
SIGNALS = {
    SIMULATOR: signal.SIGUSR2,
    GUIDANCE: signal.Signals(signal.SIGRTMIN),
    RECORDER: signal.SIGUSR1,
}
#: Exit statuses of a judge that has given its verdict.
VERDICTS = (EXIT_TARGET, EXIT_NOT_AS_IT_SHOULD, EXIT_CANNOT_START, EXIT_INTERRUPTED)


@dataclass(frozen=True)
class Consequence:
    """Hold the actions of launch after the end of a process.

    Attributes:
        line: message for the user; "": none.
        tell_judge: signal for the judge; None: none.
        shut_down: end all processes of the flight.
        restart: restart the process.
    """

    line: str = ""
    tell_judge: signal.Signals | None = None
    shut_down: bool = False
    restart: bool = False


class LaunchVerdict:
    """Collect the ends of a flight's processes.

    Attributes:
        keeper: decides on restarts.
        running: processes that have not ended for good.
        up: processes that run.
    """

    def __init__(self, shut_down_with_judge: bool = True) -> None:
        """Start with no processes.

        Args:
            shut_down_with_judge: end the flight's processes when the judge has given its verdict.
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
        """Add processes whose ends are awaited."""
        self.running = set(names)

    def started(self, name: str) -> None:
        """Note that a process runs."""
        self.up.add(name)

    def cannot_start(self, reason: str) -> None:
        """Record that nothing is started, and why."""
        self._cannot_start = True
        print(f"ares: {reason}", file=sys.stderr, flush=True)

    def interrupt(self) -> None:
        """Record that launch shuts down."""
        self._interrupted |= self._judged is None

    def ended(self, name: str, status: int) -> Consequence:
        """Return the consequence of the end of a process.

        Args:
            name: of the node.
            status: exit status, negative for a signal.
        """
        status = settled(status) or 0
        follows = self._judge_ended(status) if name == JUDGE else self._node_ended(name, status)
        self.up.discard(name)
        if not follows.restart:
            self.running.discard(name)
        if follows.shut_down:
            # drop processes that await a restart
            self.running &= self.up
        return follows

    def _judge_ended(self, status: int) -> Consequence:
        if -status in SIGNALS.values():
            # the judge was signalled before its handler was installed: no flight had begun
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
            # without a judge no flight has begun
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
        """Return the exit status of the flight, equal to that of `ares fly`."""
        if self._cannot_start or self._judged == EXIT_CANNOT_START:
            return EXIT_CANNOT_START
        if self._interrupted or self._judged is None:
            return EXIT_INTERRUPTED
        return self._judged or (EXIT_NOT_AS_IT_SHOULD if self._problems else EXIT_TARGET)


def is_launched_itself(file: Path, words: Sequence[str]) -> bool:
    """Tell whether `ros2 launch` was given this file, not one that includes it.

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
    """Make `ros2 launch` exit with the verdict's status; launch itself uses 0 and 1 only.

    Args:
        verdict: read when launch has finished.
        loop: the event loop of launch.
    """

    def leave(task: "asyncio.Task[int]") -> None:
        # the loop stops here, so the exit passes through the end of the command
        sys.exit(verdict.status or task.result())

    # launch handles SIGTERM only if Python has a handler; else it dies without a status
    signal.signal(signal.SIGTERM, lambda _number, _frame: None)
    for task in asyncio.all_tasks(loop):
        if getattr(task.get_coro(), "__name__", "") == "run_async":
            task.add_done_callback(leave)
