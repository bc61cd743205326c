# SPDX-License-Identifier: Apache-2.0
"""List and remove the middleware's files in shared memory, which killed processes leave."""

import fcntl
import os
import re
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

SHARED = Path("/dev/shm")
#: Prefixes of the middleware's files, and of those of its ports.
_PREFIX = "fastrtps_"
PORT = f"{_PREFIX}port"
#: Wall time in s between two lists of the nodes' files in shared memory; one takes 1 to 2 ms.
_LOOK_PERIOD_S = 0.5


def shared_memory(pids: Iterable[int]) -> set[str]:
    """Return the files in shared memory that processes have mapped; skip ended processes."""
    found: set[str] = set()
    for pid in pids:
        with suppress(OSError):
            found.update(re.findall(rf"{SHARED}/\S+", Path(f"/proc/{pid}/maps").read_text()))
    return found


def all_pids() -> list[int]:
    """Return the ids of all processes of this machine."""
    return [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]


def clear(paths: Iterable[str]) -> None:
    """Remove the middleware's files from shared memory, each with its lock.

    Other files are left to their owner: a process pool keeps its semaphores under other names and
    removes them itself.
    """
    for path in paths:
        if _PREFIX not in path:
            continue
        Path(path).unlink(missing_ok=True)
        Path(f"{path}_el").unlink(missing_ok=True)


def of_middleware(pids: Iterable[int]) -> set[str]:
    """Return the names of the middleware's files that processes have mapped."""
    names = (Path(path).name for path in shared_memory(pids))
    return {name for name in names if name.startswith(_PREFIX)}


def children(process: Path) -> list[str]:
    """Return the ids of the children of a process, given its folder in /proc."""
    try:
        return (process / "task" / process.name / "children").read_text().split()
    except OSError:
        return []


def used_by_family() -> set[str]:
    """Return the files in shared memory that this process and its children have mapped."""
    own = os.getpid()
    return of_middleware([own, *map(int, children(Path("/proc") / str(own)))])


def _is_abandoned(segment: str) -> bool:
    """Tell whether the process that made a segment has ended: its lock is free."""
    try:
        lock = os.open(SHARED / f"{segment}_el", os.O_RDWR)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(lock)
    return True


@contextmanager
def shared_memory_cleared() -> Iterator[Callable[[], None]]:
    """Yield a function that lists the files mapped by this process and its children.

    At the end remove the segments of killed processes, which cannot do it themselves. Call the
    function repeatedly: the files of a killed process are soon no longer mapped. Ports stay for
    reuse.
    """
    names: set[str] = set()
    due = time.monotonic()

    def look() -> None:
        nonlocal due
        now = time.monotonic()
        if now >= due:
            names.update(used_by_family())
            due = now + _LOOK_PERIOD_S

    try:
        yield look
    finally:
        segments = [name for name in names if not name.startswith(PORT)]
        clear(str(SHARED / name) for name in segments if _is_abandoned(name))
