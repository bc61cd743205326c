# SPDX-License-Identifier: Apache-2.0
"""Start, watch and end the child processes of a flight; leave none behind. No ROS."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Self

from ares_node.names import remappings

STANDARD_ERROR = 2

#: Wall time in s between polls of a child that is ending.
LOOK_PERIOD = 0.005
#: Wall time in s for a child to end after SIGTERM when the flight is aborted.
CLOSE_TIMEOUT = 10.0


def ros_arguments(parameters: Mapping[str, object], namespace: str) -> list[str]:
    """Return command-line arguments with namespace and parameters of a node, quoted for YAML."""
    arguments = ["--ros-args", "-r", f"__ns:={namespace}", *remappings(namespace)]
    for name, value in parameters.items():
        arguments += ["-p", f"{name}:={json.dumps(value, ensure_ascii=False)}"]
    return arguments


def describe_end(status: int) -> str:
    """Describe an exit status of `subprocess`."""
    if status >= 0:
        return f"ended with exit status {status}"
    try:
        return f"was killed by {signal.Signals(-status).name}"
    except ValueError:
        return f"was killed by signal {-status}"


def settled(status: int | None) -> int | None:
    """Return 0 for a node that was done, when its middleware hung; other exit statuses as they are.

    `ares_node.run` has the system end such a node by SIGALRM.
    """
    return 0 if status == -signal.SIGALRM else status


class Crew:
    """Hold child processes by name; end those that still run at the end of the `with` block.

    Each child is a process group of its own, so that Ctrl-C in the terminal reaches the
    parent only, which then ends the children in order. Their standard output goes to
    standard error.
    """

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        """Start with no children.

        Args:
            environment: of the children; None: that of this process.
        """
        self._environment = environment
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        self._asked: set[str] = set()
        self._seen: set[str] = set()

    def __enter__(self) -> Self:
        """Return the crew."""
        return self

    def __exit__(self, *_: object) -> None:
        """End all children that still run."""
        self.stop(self.running(), CLOSE_TIMEOUT)

    def start(self, name: str, module: str, arguments: Iterable[str]) -> None:
        """Start `module` as a child called `name`, again if it has ended."""
        if former := self._children.get(name):
            former.communicate()
            self._seen.discard(name)
        self._children[name] = subprocess.Popen(
            [sys.executable, "-P", "-m", "ares_bringup.child", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=STANDARD_ERROR,
            process_group=0,
            env=self._environment,
        )

    def running(self) -> list[str]:
        """Return the names of the children that have not ended."""
        return [name for name, child in self._children.items() if child.poll() is None]

    def pid(self, name: str) -> int:
        """Return the process id of a child."""
        return self._children[name].pid

    def status(self, name: str) -> int | None:
        """Return the exit status of a child, negative for a signal; None while it runs."""
        return settled(self._children[name].poll())

    def newly_ended(self) -> list[tuple[str, int]]:
        """Return the children, with exit status, that ended on their own since the last call."""
        ended = []
        for name in self._children:
            if name in self._seen or name in self._asked:
                continue
            status = self.status(name)
            if status is not None:
                self._seen.add(name)
                ended.append((name, status))
        return ended

    def ask_to_stop(self, names: Iterable[str]) -> None:
        """Send SIGTERM to children that still run; from then on their end is expected."""
        for name in names:
            if self._children[name].poll() is None:
                self._asked.add(name)
                self._children[name].terminate()

    def stop(
        self, names: Iterable[str], timeout: float, meanwhile: Callable[[], None] | None = None
    ) -> list[str]:
        """End children: SIGTERM unless already sent, SIGKILL to those that do not end.

        Args:
            names: of the children.
            timeout: wall time in s until SIGKILL.
            meanwhile: called repeatedly while waiting; must return within some ms.

        Returns:
            Names of the children that had to be killed.
        """
        waiting = [name for name in names if self._children[name].poll() is None]
        self.ask_to_stop(name for name in waiting if name not in self._asked)
        deadline = time.monotonic() + timeout
        try:
            while waiting and time.monotonic() < deadline:
                if meanwhile is None:
                    time.sleep(LOOK_PERIOD)
                else:
                    meanwhile()
                waiting = [name for name in waiting if self._children[name].poll() is None]
        finally:
            for name in waiting:
                self._children[name].kill()
                self._children[name].wait()
        return waiting
