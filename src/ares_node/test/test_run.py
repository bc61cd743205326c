# SPDX-License-Identifier: Apache-2.0
"""A node as a process: exit status, one-line reasons, signals."""

import ctypes
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node

from ares_node.diagnostics import Level
from ares_node.node import FlightNode, NodeError
from ares_node.qos import LOG, LOG_QOS
from ares_node.run import StopSignals
from ares_trials.testing.ros import own_words, spin_until
from ares_trials.testing.samples import one_in

DEMO = Path(__file__).with_name("demo_node.py")


def start(environment: dict[str, str], *arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, str(DEMO), *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(environment: dict[str, str], *arguments: str) -> tuple[int, str, str]:
    process = start(environment, *arguments)
    out, err = process.communicate(timeout=120)
    return process.returncode, out, own_words(err)


def test_a_node_that_ends_the_run_sets_the_status(ros_environment: dict[str, str]) -> None:
    status, out, err = run(ros_environment, "--ros-args", "-p", "mode:=finish")
    assert (status, err) == (3, "")
    assert out.split("\n")[:4] == ["running", "drained True", "deactivated", "cleaned up"]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--ros-args", "-p", "mode:=refuse"], "demo: the tank is empty"),
        (["--ros-args", "-p", "mode:=refuse_activation"], "demo: the valve is shut"),
        (["--ros-args", "-p", "mood:=run"],
         "demo: parameter mood is not known; expected one of autostart, mode"),
        (["--fast"], "demo: argument '--fast' is not known; expected --ros-args ..."),
    ],
)  # fmt: skip
def test_a_node_that_cannot_start(
    ros_environment: dict[str, str], arguments: list[str], line: str
) -> None:
    status, _, err = run(ros_environment, *arguments)
    assert (status, err) == (2, line + "\n")


@pytest.mark.parametrize("arguments", [["-p", "a:b"], ["--params-file", "none.yaml"], ["--what"]])
def test_malformed_ros_arguments(ros_environment: dict[str, str], arguments: list[str]) -> None:
    status, _, err = run(ros_environment, "--ros-args", *arguments)
    assert status == 2
    assert "Traceback" not in err
    assert sum(line.startswith("demo: ") for line in err.splitlines()) == 1


def test_a_defect_is_loud(ros_environment: dict[str, str]) -> None:
    status, _, err = run(ros_environment, "--ros-args", "-p", "mode:=defect")
    assert status == 2
    assert "Traceback" in err and err.endswith("demo: KeyError: 'lost'\n")
    status, out, err = run(ros_environment, "--ros-args", "-p", "mode:=defect_in_callback")
    assert status == 1
    assert "lost in a callback" in err
    assert "cleaned up" in out


@pytest.mark.parametrize("number", one_in(2, [signal.SIGINT, signal.SIGTERM]))
def test_a_signal_ends_the_run_cleanly(
    ros_environment: dict[str, str], number: signal.Signals
) -> None:
    process = start(ros_environment)
    assert process.stdout is not None
    assert process.stdout.readline() == "running\n"
    process.send_signal(number)
    out, err = process.communicate(timeout=120)
    assert (process.returncode, own_words(err)) == (0, "")
    assert out == "drained True\ndeactivated\ncleaned up\n"


@pytest.mark.parametrize("mode", ["slow_start", "wrapped_start"])
def test_a_signal_while_starting(ros_environment: dict[str, str], mode: str) -> None:
    process = start(ros_environment, "--ros-args", "-p", f"mode:={mode}")
    assert process.stdout is not None
    assert process.stdout.readline() == "starting\n"
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=120)
    assert (process.returncode, own_words(err)) == (0, "")
    assert out == "abandoned\n"


def test_a_second_signal_comes_upon_nothing_that_the_first_one_ends() -> None:
    stop = StopSignals()
    with stop.watch():
        with pytest.raises(BaseException, match=r"^$"):
            signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
    assert stop.requested


def test_a_signal_in_a_callback_of_compiled_code_is_silent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Callbacks of numba run while it loads kernels from its cache."""
    seen: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", seen.append)
    stop = StopSignals()
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))
    with stop.watch():
        callback()
    assert stop.requested
    assert seen == []


@pytest.mark.parametrize(
    ("mode", "line"),
    [
        ("stuck_start", "starting\n"),
        ("disposable", "running\n"),
        ("stuck_end", "running\n"),
        ("stuck_freeing", "running\n"),
    ],
)
def test_compiled_code_does_not_hold_the_process(
    ros_environment: dict[str, str], mode: str, line: str
) -> None:
    process = start(ros_environment, "--ros-args", "-p", f"mode:={mode}")
    assert process.stdout is not None
    assert process.stdout.readline() == line
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert (process.returncode, own_words(err)) == (0, "")


def test_the_system_ends_a_node_that_is_done_and_hangs_with_the_lock(
    ros_environment: dict[str, str],
) -> None:
    process = start(ros_environment, "--ros-args", "-p", "mode:=locked_freeing")
    assert process.stdout is not None
    assert process.stdout.readline() == "running\n"
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, own_words(err)) == (-signal.SIGALRM, "")
    assert "cleaned up" in out


@pytest.mark.parametrize("number", one_in(2, [signal.SIGTERM, signal.SIGINT]))
def test_a_signal_during_the_imports(
    tmp_path: Path, ros_environment: dict[str, str], number: signal.Signals
) -> None:
    (tmp_path / "slow.py").write_text(
        "import time\nprint('importing', flush=True)\ntime.sleep(60)\n", encoding="utf-8"
    )
    program = "from ares_node.entry import enter; enter('ares_node', 'slow:Node', 'slow')"
    process = subprocess.Popen(
        [sys.executable, "-c", program],
        env=ros_environment,
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "importing\n"
    process.send_signal(number)
    _, err = process.communicate(timeout=30)
    assert (process.returncode, own_words(err)) == (0, "")


def test_idle_process_wakes_on_a_signal(ros_environment: dict[str, str]) -> None:
    """Without autostart nothing ever calls back: only the signal can end the sleep."""
    process = start(ros_environment, "--ros-args", "-p", "autostart:=false")
    assert process.stdout is not None
    assert process.stdout.readline() == "idle\n"
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out, own_words(err)) == (0, "drained True\n", "")


def test_reports_carry_name_stamp_and_values(
    ros_context: Context, ros_environment: dict[str, str]
) -> None:
    node = Node("listener", context=ros_context)
    executor = EventsExecutor(context=ros_context)
    executor.add_node(node)
    heard: list[DiagnosticArray] = []
    node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    process = start(ros_environment)
    try:
        assert spin_until(executor, lambda: bool(heard))
    finally:
        process.terminate()
        process.communicate(timeout=120)
        executor.shutdown()
        node.destroy_node()
    status = heard[0].status[0]
    assert status.name == "ares/demo"
    assert (status.level, status.message) == (Level.OK.value, "alive")
    assert heard[0].header.stamp.sec == 0
    assert int(status.values[0].value) == heard[0].header.stamp.nanosec


def log_records(context: Context, environment: dict[str, str], mode: str, wanted: str) -> list[Log]:
    """Return the records of a demo on /rosout up to a wanted one."""
    node = Node("listener", context=context)
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    heard: list[Log] = []
    node.create_subscription(Log, LOG, heard.append, LOG_QOS)
    process = start(environment, "--ros-args", "-p", f"mode:={mode}")
    try:
        assert spin_until(executor, lambda: wanted in [record.msg for record in heard])
    finally:
        process.terminate()
        process.communicate(timeout=30)
        executor.shutdown()
        node.destroy_node()
    return [record for record in heard if record.msg == wanted]


def test_warnings_go_to_rosout(ros_context: Context, ros_environment: dict[str, str]) -> None:
    record = log_records(ros_context, ros_environment, "warn", "the tank leaks")[-1]
    assert record.level == Log.WARN
    assert record.name == "ares.demo"


def test_the_reason_of_a_refused_start_goes_to_rosout(ros_context: Context) -> None:
    class Refusing(FlightNode):
        def configure(self) -> None:
            raise NodeError("the tank is empty")

    listener = Node("listener", context=ros_context)
    node = Refusing("demo", context=ros_context)
    executor = EventsExecutor(context=ros_context)
    heard: list[Log] = []
    listener.create_subscription(Log, LOG, heard.append, LOG_QOS)
    executor.add_node(listener)
    executor.add_node(node)
    try:
        assert not node.start()
        assert spin_until(executor, lambda: bool(heard))
    finally:
        node.stop()
        executor.shutdown()
        node.destroy_node()
        listener.destroy_node()
    assert (heard[-1].level, heard[-1].msg) == (Log.ERROR, "the tank is empty")


def test_a_timer_that_is_destroyed_says_nothing_more(ros_context: Context) -> None:
    """A last call of a timer may be pending in the executor when it is destroyed."""
    executor = EventsExecutor(context=ros_context)
    node = FlightNode("demo", context=ros_context)
    heard: list[int] = []
    first = node.wall_timer(0.001, lambda: (heard.append(1), node.destroy_timer(second)))
    second = node.wall_timer(0.001, lambda: heard.append(2))
    third = node.wall_timer(0.001, lambda: heard.append(3))
    executor.add_node(node)
    try:
        time.sleep(0.02)
        node.destroy_timer(third)
        for _ in range(20):
            executor.spin_once(timeout_sec=0.01)
        assert heard.count(1) > 1
        assert 3 not in heard
        assert 2 not in heard[heard.index(1) :]
        node.destroy_timer(first)
    finally:
        executor.shutdown()
        node.destroy_node()


def test_a_reader_that_is_destroyed_says_nothing_more(ros_context: Context) -> None:
    """A message may be pending in the executor when its subscription is destroyed."""
    executor = EventsExecutor(context=ros_context)
    node = FlightNode("demo", context=ros_context)
    heard: list[int] = []
    sender = node.create_publisher(Log, "word", 10)
    readers = {
        number: node.create_subscription(Log, "word", lambda _, n=number: hear(n), 10)
        for number in (1, 2)
    }

    def hear(number: int) -> None:
        heard.append(number)
        for other in set(readers) - {number}:
            node.destroy_subscription(readers.pop(other))

    executor.add_node(node)
    try:
        for _ in range(50):
            sender.publish(Log())
            executor.spin_once(timeout_sec=0.02)
        assert len(heard) > 5
        assert len(set(heard)) == 1
    finally:
        executor.shutdown()
        node.destroy_node()


@pytest.mark.parametrize(("options", "said"), [([], False), (["-W", "default"], True)])
def test_arithmetic_beyond_numbers_is_no_line_of_ours(options, said):
    program = (
        "from ares_node.entry import set_up_libraries; set_up_libraries()\n"
        "import numpy as np; np.array([1e308]) * 1e308"
    )
    done = subprocess.run(
        [sys.executable, *options, "-c", program], capture_output=True, text=True, check=True
    )
    assert ("overflow encountered" in done.stderr) is said
