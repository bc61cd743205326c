# SPDX-License-Identifier: Apache-2.0
"""Fixtures for tests that talk over ROS: a private context on a domain of one's own.

Import the fixtures in a package's `test/conftest.py`. Two tests that run at the same time,
in whatever process, never share a domain, nor one with a flight of `ares fly`.
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


def own_words(text: str) -> str:
    """What a process has said, without the middleware's word on a port of shared memory.

    Of processes that start at once one may find such a port taken: it says so and takes the next.
    """
    lines = text.splitlines(keepends=True)
    return "".join(line for line in lines if "RTPS_TRANSPORT_SHM" not in line)


def spin_until(executor: Executor, condition: Callable[[], bool], timeout: float = 120.0) -> bool:
    """Spin until the condition holds; whether it held within the timeout (s)."""
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        executor.spin_once(timeout_sec=0.02)
    return True
