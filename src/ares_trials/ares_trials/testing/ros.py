# SPDX-License-Identifier: Apache-2.0
"""Fixtures for tests over ROS: a private context on a private domain.

Import the fixtures in a package's `test/conftest.py`. Concurrent tests, in any process, never share
a domain with each other or with a flight of `ares fly`.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor

from ares_node.domains import claimed_domain

# must be set before the first message is made, and before a node process starts
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")


@contextmanager
def ros_context_on(domain: int) -> Iterator[Context]:
    """Initialize a private context on a domain for a block."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    try:
        yield context
    finally:
        context.try_shutdown()


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """Claim a domain for this test alone."""
    with claimed_domain() as domain:
        yield domain


@pytest.fixture
def ros_context(ros_domain: int) -> Iterator[Context]:
    """Initialize a context for this test alone, on `ros_domain`."""
    with ros_context_on(ros_domain) as context:
        yield context


@pytest.fixture
def ros_environment(ros_domain: int) -> dict[str, str]:
    """Return the environment for the node processes of this test."""
    return {**os.environ, "ROS_DOMAIN_ID": str(ros_domain), "PYTHONUNBUFFERED": "1"}


def own_words(text: str) -> str:
    """Remove the middleware's lines on shared-memory ports from a process's output.

    Of processes that start together one may find a port taken: it logs that and uses the next.
    """
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if "RTPS_TRANSPORT_SHM" not in line)


def spin_until(executor: Executor, condition: Callable[[], bool], timeout: float = 120.0) -> bool:
    """Spin until a condition holds; return False after the timeout, s."""
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        executor.spin_once(timeout_sec=0.02)
    return True
