# SPDX-License-Identifier: Apache-2.0
"""Claims of ROS domains by file locks that end with the process. No ROS."""

import fcntl
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

#: Domains to claim. Above 101 their ports overlap the ephemeral ones; 0 is the common default.
DOMAINS = range(1, 102)
#: Polling period for a free domain, wall time, s.
LOOK_PERIOD = 0.05
#: Wait for a free domain, wall time, s.
LONGEST_WAIT = 60.0


def _claim(folder: Path, domain: int, namespace: str = "") -> int | None:
    """Lock a domain, or a namespace in it; return the descriptor, or None if it is taken."""
    name = f"{domain}{namespace.replace('/', '.')}"
    lock = os.open(folder / name, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        return None
    return lock


def _folder() -> Path:
    folder = Path(tempfile.gettempdir()) / f"ares-domains-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    return folder


def _candidates() -> list[int]:
    # each process starts elsewhere, so that a domain is not reused immediately
    start = os.getpid() % len(DOMAINS)
    return [*DOMAINS[start:], *DOMAINS[:start]]


def claim_domain(preferred: Sequence[int] = (), namespace: str = "") -> tuple[int, int]:
    """Claim a free ROS domain on this machine until this process ends.

    Args:
        preferred: tried before DOMAINS.
        namespace: of the claim on a preferred domain; other namespaces may share it.

    Returns:
        The domain, and the descriptor of its lock; closing it releases the domain.

    Raises:
        TimeoutError: all domains stayed taken.
    """
    folder = _folder()
    deadline = time.monotonic() + LONGEST_WAIT
    while True:
        for domain in (*preferred, *_candidates()):
            lock = _claim(folder, domain, namespace if domain in preferred else "")
            if lock is not None:
                return domain, lock
        if time.monotonic() > deadline:
            raise TimeoutError(f"no free ROS domain within {LONGEST_WAIT:g} s")
        time.sleep(LOOK_PERIOD)


@contextmanager
def claimed_domain() -> Iterator[int]:
    """Claim a ROS domain for the duration of a block."""
    domain, lock = claim_domain()
    try:
        yield domain
    finally:
        os.close(lock)
