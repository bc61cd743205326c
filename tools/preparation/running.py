# SPDX-License-Identifier: Apache-2.0
"""Run the commands of a preparation: one call at a time, logged, a failure told in one line."""

import contextlib
import fcntl
import os
import re
import shlex
import shutil
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from preparation.layout import Workspace
from preparation.progress import BAR, Steps, say

#: Step of waiting for another call's preparation.
OTHERS = "another call"


class WorkspaceError(Exception):
    """Report in one line that the workspace cannot be prepared."""


@contextlib.contextmanager
def preparation_lock(root: Path) -> Iterator[int]:
    """Hold the lock of the preparation; yield its descriptor.

    Children inherit the descriptor: if this process is killed, the lock is free only when
    its pip or colcon has ended too.
    """
    (root / "build").mkdir(exist_ok=True)
    descriptor = os.open(root / "build" / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("another call is preparing the workspace; waiting for it")
            steps = Steps({OTHERS: time_left(descriptor)})
            with BAR.over(steps), steps.step(OTHERS):
                fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield descriptor
    finally:
        os.close(descriptor)


def announce(lock: int, lengths: Mapping[str, float]) -> None:
    """Write the expected end of the preparation to the lock's file, for calls that wait."""
    os.ftruncate(lock, 0)
    os.pwrite(lock, f"{time.time() + sum(lengths.values()):.0f}".encode(), 0)


def time_left(lock: int) -> float:
    """Return the expected time left of the call with the lock, s; 1 s if unknown."""
    try:
        return max(float(os.pread(lock, 32, 0)) - time.time(), 1.0)
    except ValueError:
        return 1.0


NO_NETWORK = re.compile(
    r"name resolution|not known|NewConnectionError|ConnectTimeout|Connection refused"
    r"|Network is unreachable|Max retries|[Rr]ead timed out|ProxyError|from versions: none"
)


def cause_of_failure(output: str) -> str:
    """Return the line of a log that best explains a failure."""
    missing = re.search(r"(?:satisfies the requirement|found for) (\S+)", output)
    if NO_NETWORK.search(output):
        what = f" (pip could not get {missing[1]})" if missing else ""
        return f"no network or package index{what}: connect, or tell pip where its index is"
    if missing:
        return f"the package index has no {missing[1]} for this Python and machine"
    if "No space left on device" in output:
        return "the disk is full"
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    blamed = [line for line in lines if re.search(r"\b[Ee]rror\b|ERROR", line)]
    return (blamed or lines or ["no output"])[-1][:200]


def run_logged(
    command: Sequence[str],
    workspace: Workspace,
    environ: Mapping[str, str],
    lock: int,
    task: str,
) -> None:
    """Run a command with its output in the log.

    Raises:
        WorkspaceError: it failed.
    """
    log = workspace.log
    log.parent.mkdir(exist_ok=True)
    with log.open("a", encoding="utf-8") as stream:
        stream.write(f"$ {shlex.join(command)}\n")
        stream.flush()
        begin = stream.tell()
        status = subprocess.run(
            list(command),
            cwd=workspace.root,
            env=dict(environ),
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=stream,
            pass_fds=(lock,),
            check=False,
        ).returncode
    if status != 0:
        with log.open("rb") as raw:
            raw.seek(begin)
            output = raw.read().decode(errors="replace")
        raise WorkspaceError(f"{task} failed: {cause_of_failure(output)} (log: {log})")


def remove(path: Path) -> None:
    """Remove a file, a link or a folder, if it exists."""
    if path.is_symlink() or path.is_file():
        path.unlink()
    elif path.exists():
        shutil.rmtree(path)
