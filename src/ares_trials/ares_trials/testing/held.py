# SPDX-License-Identifier: Apache-2.0
"""Measure the resources of this process, for tests and benchmarks only."""

import os
import resource
from dataclasses import dataclass
from pathlib import Path

from ares_bringup.held import PORT, SHARED, all_pids, children, of_middleware


@dataclass(frozen=True)
class Held:
    """Hold the resources of this process at one moment.

    Attributes:
        memory_mib: resident memory.
        descriptors: open files and sockets.
        threads: its threads.
        mapped: files in shared memory that it has mapped.
        children: its child processes.
    """

    memory_mib: float
    descriptors: int
    threads: int
    mapped: int
    children: int


def held() -> Held:
    """Measure the resources of this process."""
    own = Path("/proc") / str(os.getpid())
    pages = int((own / "statm").read_text().split()[1])
    return Held(
        memory_mib=pages * resource.getpagesize() / 2**20,
        # without the descriptor that lists them
        descriptors=len(list((own / "fd").iterdir())) - 1,
        threads=len(list((own / "task").iterdir())),
        mapped=len(of_middleware([os.getpid()])),
        children=len(children(own)),
    )


def orphans(names: set[str]) -> set[str]:
    """Return the files that no process uses among `names`, with their locks.

    Ports are no orphans: the middleware reuses them in the next flight of that domain, and there
    are only as many as participants.
    """
    used = of_middleware(all_pids())
    there = {path.name for path in SHARED.iterdir()}
    left = {name for name in names - used if not name.startswith(PORT)}
    return {name for name in there if any(one in name for one in left)}
