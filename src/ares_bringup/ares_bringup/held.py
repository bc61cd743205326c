# SPDX-License-Identifier: Apache-2.0
"""What a process holds, and what is left in shared memory; for tests, benchmarks and faults."""

import fcntl
import os
import re
import resource
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

SHARED = Path("/dev/shm")
#: How the files of the middleware begin, and those by which participants find each other.
_PREFIX = "fastrtps_"
_PORT = f"{_PREFIX}port"
#: How often a flight looks what its nodes have in shared memory; once takes 1 to 2 ms.
_LOOK_PERIOD_S = 0.5


@dataclass(frozen=True)
class Held:
    """Of this process at one moment.

    Attributes:
        memory_mib: resident.
        descriptors: open files and sockets.
        threads: of it.
        mapped: files in shared memory that it has mapped.
        children: its child processes.
    """

    memory_mib: float
    descriptors: int
    threads: int
    mapped: int
    children: int


def held() -> Held:
    """What this process holds now."""
    own = Path("/proc") / str(os.getpid())
    pages = int((own / "statm").read_text().split()[1])
    return Held(
        memory_mib=pages * resource.getpagesize() / 2**20,
        # one of them is that of the list
        descriptors=len(list((own / "fd").iterdir())) - 1,
        threads=len(list((own / "task").iterdir())),
        mapped=len(_of_middleware([os.getpid()])),
        children=len(_children(own)),
    )


def shared_memory(pids: Iterable[int]) -> set[str]:
    """Files in shared memory that processes have mapped; none of those that have gone."""
    found: set[str] = set()
    for pid in pids:
        with suppress(OSError):
            found.update(re.findall(rf"{SHARED}/\S+", Path(f"/proc/{pid}/maps").read_text()))
    return found


def all_pids() -> list[int]:
    """Processes of this machine."""
    return [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]


def clear(paths: Iterable[str]) -> None:
    """Remove the middleware's files in shared memory that nobody uses any more, each with its lock.

    Others are left to who made them: semaphores of a pool of processes are in use under another
    name by the process that made them, which removes them itself.
    """
    for path in paths:
        if _PREFIX not in path:
            continue
        Path(path).unlink(missing_ok=True)
        Path(f"{path}_el").unlink(missing_ok=True)


def _of_middleware(pids: Iterable[int]) -> set[str]:
    """Names of the middleware's among the files that processes have mapped."""
    names = (Path(path).name for path in shared_memory(pids))
    return {name for name in names if name.startswith(_PREFIX)}


def _children(process: Path) -> list[str]:
    try:
        return (process / "task" / process.name / "children").read_text().split()
    except OSError:
        return []


def used_by_family() -> set[str]:
    """Files in shared memory that this process and its children have mapped now."""
    own = os.getpid()
    return _of_middleware([own, *map(int, _children(Path("/proc") / str(own)))])


def orphans(names: set[str]) -> set[str]:
    """Those of some files, and what goes with them, that are left and that no process uses.

    The middleware leaves a port now and then, and takes it again with the next flight of that
    domain: ports are as many as there are participants, and no orphans.
    """
    used = _of_middleware(all_pids())
    there = {path.name for path in SHARED.iterdir()}
    left = {name for name in names - used if not name.startswith(_PORT)}
    return {name for name in there if any(one in name for one in left)}


def _is_abandoned(segment: str) -> bool:
    """Whether the process is gone that has made a segment: it held a lock for as long as it was."""
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
    """A look at what the family has mapped; at the end that of killed processes is removed.

    They cannot do it themselves, and nobody else does. To be called again and again: what a killed
    one had is no longer mapped soon after. Ports stay: the next participant takes them.
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
        segments = [name for name in names if not name.startswith(_PORT)]
        clear(str(SHARED / name) for name in segments if _is_abandoned(name))
