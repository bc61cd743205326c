# SPDX-License-Identifier: Apache-2.0
"""Processes that end with their launcher, and those that do not."""

import os
import signal
import subprocess
import sys

import pytest

from ares_node.parent import LAUNCHER

#: Prints when it has checked its launcher, and how it ends.
CHILD = """
import os, signal, sys, time
from ares_node.parent import end_with_launcher
signal.signal(signal.SIGTERM, lambda *_: (print("asked to end", flush=True), os._exit(3)))
end_with_launcher()
print("up", flush=True)
while True:
    time.sleep(0.05)
"""
PATIENCE = 120.0


@pytest.fixture
def launcher():
    """Start a process that does nothing."""
    process = subprocess.Popen(["sleep", "600"])
    yield process
    process.kill()
    process.wait()


@pytest.fixture
def start():
    """Start a child that knows its launcher."""
    started = []

    def run(pid):
        started.append(
            subprocess.Popen(
                [sys.executable, "-c", CHILD],
                env={**os.environ, LAUNCHER: str(pid)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        )
        return started[-1]

    yield run
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_node_ends_with_its_launcher(launcher, start, number):
    child = start(launcher.pid)
    assert child.stdout.readline() == "up\n"
    launcher.send_signal(number)
    # the launcher is a zombie meanwhile: its status has not been collected
    assert child.wait(PATIENCE) == 3
    assert child.stdout.read() == "asked to end\n"


def test_a_node_whose_launcher_is_gone_ends(launcher, start):
    launcher.kill()
    launcher.wait()
    assert start(launcher.pid).wait(PATIENCE) == 3


def test_a_node_that_is_started_by_hand_has_none(launcher, start):
    child = start("")
    assert child.stdout.readline() == "up\n"
    launcher.kill()
    launcher.wait()
    assert child.poll() is None


#: Blocks in code that is not Python's, and lets no other thread run, when it is asked to end.
BLOCKED = """
import ctypes, signal, sys, time
from ares_node.parent import end_after
signal.signal(signal.SIGTERM, lambda *_: ctypes.PyDLL(None).sleep(600))
end_after(sys.stdin.read)
print("up", flush=True)
while True:
    time.sleep(0.05)
"""


def test_a_node_that_the_middleware_blocks_at_its_end_ends():
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", BLOCKED], text=True, **pipes) as child:
        try:
            assert child.stdout.readline() == "up\n"
            child.stdin.close()
            assert child.wait(PATIENCE) == -signal.SIGALRM
        finally:
            child.kill()
