# SPDX-License-Identifier: Apache-2.0
"""A ROS domain of one's own: claimed with a file lock that ends with the process. No ROS."""

import fcntl
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

#: Domains that are claimed. Above 101 their ports meet the ephemeral ones; 0 is everybody's.
DOMAINS = range(1, 102)
#: Wall time in s between looks for a free one.
LOOK_PERIOD = 0.05


def _claim(folder: Path, domain: int, namespace: str = "") -> int | None:
    """The descriptor that holds a domain, or a namespace in it; None if somebody else does."""
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
    # start elsewhere in each process, so that a domain rests between two owners
    start = os.getpid() % len(DOMAINS)
    return [*DOMAINS[start:], *DOMAINS[:start]]


def claim_domain(
    preferred: Sequence[int] = (), wait: float = 60.0, namespace: str = ""
) -> tuple[int, int]:
    """A ROS domain id that nobody else on this machine has claimed, until this process ends.

    Args:
        preferred: tried before DOMAINS.
        wait: how long to wait for a free one, in s.
        namespace: the preferred ones are claimed for it alone; others share them.

    Returns:
        The domain, and the descriptor that holds it: closing it gives the domain back.

    Raises:
        TimeoutError: all of them stayed taken.
    """
    folder = _folder()
    deadline = time.monotonic() + wait
    while True:
        for domain in (*preferred, *_candidates()):
            lock = _claim(folder, domain, namespace if domain in preferred else "")
            if lock is not None:
                return domain, lock
        if time.monotonic() > deadline:
            raise TimeoutError(f"no free ROS domain within {wait:g} s")
        time.sleep(LOOK_PERIOD)


@contextmanager
def claimed_domain(wait: float = 60.0) -> Iterator[int]:
    """`claim_domain` for the length of a block."""
    domain, lock = claim_domain(wait=wait)
    try:
        yield domain
    finally:
        os.close(lock)
