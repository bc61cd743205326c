"""Fixtures for tests that talk over ROS: a private context on a domain of one's own.

Import the fixtures in a package's `test/conftest.py`. Two tests that run at the same time,
in whatever process, never share a domain: each domain is claimed with a file lock that ends
with the process.
"""

import fcntl
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor

# above 101 the ports of a domain meet the ephemeral ones
DOMAINS = range(1, 102)

# must be set before the first message is made, and before a node process starts
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")


@contextmanager
def claimed_domain(wait: float = 60.0) -> Iterator[int]:
    """A ROS domain id that nobody else on this machine has claimed.

    Args:
        wait: how long to wait for a free one, in s.

    Raises:
        TimeoutError: all of them stayed taken.
    """
    folder = Path(tempfile.gettempdir()) / f"ares-domains-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    # start elsewhere in each process, so that a domain rests between two owners
    start = os.getpid() % len(DOMAINS)
    deadline = time.monotonic() + wait
    while True:
        for domain in [*DOMAINS[start:], *DOMAINS[:start]]:
            lock = os.open(folder / str(domain), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(lock)
                continue
            try:
                yield domain
            finally:
                os.close(lock)
            return
        if time.monotonic() > deadline:
            raise TimeoutError(f"no free ROS domain within {wait} s")
        time.sleep(0.05)


@contextmanager
def ros_context_on(domain: int) -> Iterator[Context]:
    """An initialized context of one's own on a domain; shut down at the end."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    try:
        yield context
    finally:
        context.try_shutdown()


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """A domain id for this test alone."""
    with claimed_domain() as domain:
        yield domain


@pytest.fixture
def ros_context(ros_domain: int) -> Iterator[Context]:
    """A context for this test alone, on `ros_domain`."""
    with ros_context_on(ros_domain) as context:
        yield context


@pytest.fixture
def ros_environment(ros_domain: int) -> dict[str, str]:
    """Environment for the node processes of this test."""
    return {**os.environ, "ROS_DOMAIN_ID": str(ros_domain), "PYTHONUNBUFFERED": "1"}


def spin_until(executor: Executor, condition: Callable[[], bool], timeout: float = 10.0) -> bool:
    """Spin until the condition holds; whether it held within the timeout (s)."""
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        executor.spin_once(timeout_sec=0.02)
    return True
