# SPDX-License-Identifier: Apache-2.0
"""Children: started with their parameters, ended in every case."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ares_bringup.crew import Crew, describe_end, ros_arguments, settled

SLEEPER = "import time, sys; print('up', file=sys.stderr, flush=True)\nwhile True: time.sleep(1)\n"
DEAF = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN)\n" + SLEEPER
PARENT = """
import os, signal, sys, time
from ares_bringup.crew import Crew
# under nohup it is ignored, and would be here too
signal.signal(signal.SIGHUP, signal.SIG_DFL)
with Crew() as crew:
    crew.start("one", "sleeper", [])
    print(crew.pid("one"), flush=True)
    time.sleep(60)
"""


@pytest.fixture
def modules(tmp_path, monkeypatch):
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    (tmp_path / "deaf.py").write_text(DEAF)
    (tmp_path / "quitter.py").write_text("import sys; sys.exit(3)\n")
    (tmp_path / "teller.py").write_text(
        "import sys; print(sys.argv); open(sys.argv[1], 'w').write(' '.join(sys.argv[2:]))\n"
    )
    path = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{path}")
    return tmp_path


def alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", maxsplit=1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def wait_until(condition, timeout=120.0):
    deadline = time.monotonic() + timeout
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert condition()


def test_arguments_and_standard_output(modules, capfd):
    with Crew() as crew:
        crew.start("teller", "teller", [str(modules / "told"), "a b", "c"])
        wait_until(lambda: crew.status("teller") is not None)
    assert (modules / "told").read_text() == "a b c"
    out, err = capfd.readouterr()
    assert out == ""
    assert "a b" in err


@pytest.mark.usefixtures("modules")
def test_an_end_is_reported_once():
    with Crew() as crew:
        crew.start("quitter", "quitter", [])
        crew.start("sleeper", "sleeper", [])
        wait_until(lambda: crew.running() == ["sleeper"])
        assert crew.newly_ended() == [("quitter", 3)]
        assert crew.newly_ended() == []
        assert crew.stop(["quitter", "sleeper"], 10.0) == []
        assert crew.newly_ended() == []
        assert crew.status("sleeper") == -signal.SIGTERM


@pytest.mark.usefixtures("modules")
def test_a_deaf_child_is_killed(capfd):
    with Crew() as crew:
        crew.start("deaf", "deaf", [])
        err = ""
        while "up" not in err:
            err += capfd.readouterr().err
            time.sleep(0.02)
        assert crew.stop(["deaf"], 0.2) == ["deaf"]
        assert crew.status("deaf") == -signal.SIGKILL


@pytest.mark.usefixtures("modules")
def test_an_exception_leaves_no_child():
    with pytest.raises(RuntimeError), Crew() as crew:  # noqa: PT012
        crew.start("sleeper", "sleeper", [])
        raise RuntimeError
    assert crew.running() == []


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.usefixtures("modules")
def test_a_parent_that_is_gone_leaves_no_child(number):
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True, stderr=subprocess.PIPE
    )
    pid = int(parent.stdout.readline())
    while "up" not in parent.stderr.readline():
        pass
    assert alive(pid)
    parent.send_signal(number)
    parent.wait()
    wait_until(lambda: not alive(pid))
    parent.communicate()


@pytest.mark.usefixtures("modules")
def test_ctrl_c_in_the_terminal_reaches_the_parent_only():
    with Crew() as crew:
        crew.start("sleeper", "sleeper", [])
        assert os.getpgid(crew.pid("sleeper")) != os.getpgid(0)


def test_a_node_that_was_done_when_its_middleware_hung_ended_well():
    assert [settled(status) for status in (-signal.SIGALRM, 0, 2, -9, None)] == [0, 0, 2, -9, None]


def test_ends_in_words():
    assert describe_end(2) == "ended with exit status 2"
    assert describe_end(-9) == "was killed by SIGKILL"


def test_parameters_keep_their_type(ros_domain):
    import rclpy
    from rclpy.context import Context
    from rclpy.node import Node

    values = {
        "plain": "ares_v",
        "number_as_text": "1.5",
        "truth_as_text": "true",
        "empty": "",
        "awkward": "a b: [c] {d} #e 'f' \"g\" \\h i:=j",
        "other_letters": "\u00fc\u0444",
        "small": 1e-5,
        "whole": 2.0,
        "integer": 3,
        "truth": True,
    }
    context = Context()
    rclpy.init(args=ros_arguments(values, "/there"), context=context, domain_id=ros_domain)
    try:
        node = Node("any", context=context, automatically_declare_parameters_from_overrides=True)
        got = {name: node.get_parameter(name).value for name in values}
        assert node.get_namespace() == "/there"
        node.destroy_node()
    finally:
        context.try_shutdown()
    assert got == values
    assert {name: type(value) for name, value in got.items()} == {
        name: type(value) for name, value in values.items()
    }
