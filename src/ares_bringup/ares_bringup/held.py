"""What a process holds, and what is left behind in shared memory; for tests and benchmarks."""

import os
import re
import resource
from dataclasses import dataclass
from pathlib import Path

SHARED = Path("/dev/shm")
#: How the files begin by which participants find each other.
_PORT = "fastrtps_port"


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
        mapped=len(_mapped(own)),
        children=len(_children(own)),
    )


def _mapped(process: Path) -> set[str]:
    """Files in shared memory that a process has mapped; none of one that has gone."""
    try:
        maps = (process / "maps").read_text().splitlines()
    except OSError:
        return set()
    return set(re.findall(rf"{SHARED}/(fastrtps_\w+)", "\n".join(maps)))


def _children(process: Path) -> list[str]:
    try:
        return (process / "task" / process.name / "children").read_text().split()
    except OSError:
        return []


def used_by_family() -> set[str]:
    """Files in shared memory that this process and its children have mapped now."""
    own = Path("/proc") / str(os.getpid())
    family = [own, *(Path("/proc") / child for child in _children(own))]
    return set().union(*map(_mapped, family))


def orphans(names: set[str]) -> set[str]:
    """Those of some files, and what goes with them, that are left and that no process uses.

    The middleware leaves a port now and then, and takes it again with the next flight of that
    domain: ports are as many as there are participants, and no orphans.
    """
    used = set().union(*map(_mapped, Path("/proc").glob("[0-9]*")))
    there = {path.name for path in SHARED.iterdir()}
    left = {name for name in names - used if not name.startswith(_PORT)}
    return {name for name in there if any(one in name for one in left)}
