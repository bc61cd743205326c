# SPDX-License-Identifier: Apache-2.0
"""Options, discovery settings and parameter files."""

import fcntl
import math
import os
import re
import signal
import subprocess
import sys
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from ares_bringup import fly
from ares_bringup.discovery import PROFILE, PROFILE_3, PROFILE_VARIABLES, discovery_settings
from ares_bringup.judge import law_that_flew
from ares_bringup.node_values import node_parameters
from ares_bringup.options import CannotStart, FlyOptions, domain_id
from ares_bringup.params_file import node_values
from ares_bringup.summary import FlightSummary
from ares_bringup.watch import Watch
from ares_trials.testing.flights import made_up_status


@pytest.mark.parametrize("text", ["233", "-1", "one", "1.5", "\u0663"])
def test_a_domain_that_does_not_exist(monkeypatch, text):
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(
        CannotStart, match=r"ROS_DOMAIN_ID is .*; expected an integer from 0 to 232"
    ):
        domain_id(FlyOptions())


def test_the_domain_of_the_options_wins(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert domain_id(FlyOptions()) == 7
    assert domain_id(FlyOptions(domain_id=8)) == 8
    monkeypatch.setenv("ROS_DOMAIN_ID", "")
    assert domain_id(FlyOptions()) is None


@pytest.mark.parametrize(("found", "words"), [("/opt/ros2", " ros2 topic list"), (None, "")])
def test_a_flight_names_only_a_command_that_is_there(monkeypatch, facts, found, words):
    monkeypatch.setattr(fly, "which", lambda _: found)
    summary = FlightSummary(facts, "peg", None)
    summary.domain_id = 7
    assert f": ROS_DOMAIN_ID=7{words} (namespace /" in fly._greeting(summary)


def test_discovery_settings_are_added_but_replace_nothing():
    settings = discovery_settings({})
    assert settings["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert settings["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(PROFILE)
    assert PROFILE.is_file()
    own = {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "FASTDDS_DEFAULT_PROFILES_FILE": "/mine.xml",
    }
    assert discovery_settings(own) == {}


def test_fast_dds_3_gets_the_same_settings_in_its_own_words(tmp_path):
    (tmp_path / "share" / "fastdds").mkdir(parents=True)
    settings = discovery_settings({"AMENT_PREFIX_PATH": f"/none:{tmp_path}"})
    assert settings["FASTDDS_DEFAULT_PROFILES_FILE"] == str(PROFILE_3)
    # the middleware of Kilted warns of the other variable
    assert "FASTRTPS_DEFAULT_PROFILES_FILE" not in settings
    words = PROFILE.read_text().replace("heartbeatPeriod", "heartbeat_period")
    assert PROFILE_3.read_text() == words


def test_discovery_that_is_off_is_said(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    said, now = [], [1000.0]
    monkeypatch.setattr("ares_bringup.watch.time.monotonic", lambda: now[0])
    summary = SimpleNamespace(started=False)
    monitor = SimpleNamespace(summary=summary, ended=False, last_heard=0.0)
    watch = Watch(monitor, said.append, lambda: False, patience=math.inf)
    for seconds, lines in ((2.9, 0), (0.2, 1), (100.0, 1)):
        now[0] += seconds
        assert not watch.over()
        assert len(said) == lines
    assert "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF" in said[0]


def test_a_watch_that_was_stopped_itself_gives_nothing_up(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("ares_bringup.watch.time.monotonic", lambda: now[0])
    summary = SimpleNamespace(started=True, problems=[])
    monitor = SimpleNamespace(summary=summary, ended=False, last_heard=1000.0)
    watch = Watch(monitor, print, lambda: False)
    for seconds, over in ((0.1, False), (500.0, False), *[(1.0, False)] * 60, (1.0, True)):
        now[0] += seconds
        assert watch.over() is over
    assert summary.problems == ["nothing heard for 60 s: given up"]


@pytest.mark.parametrize(
    ("cycles", "law"),
    [
        ({}, "peg"),
        ({3: 5}, "igm"),
        ({4: 90, 1: 10}, "optimal"),
        ({1: 2}, "peg"),
        ({200: 1}, "law 200"),
    ],
)
def test_the_law_is_the_one_that_flew(facts, cycles, law):
    summary = FlightSummary(facts, "peg", None)
    for code, count in cycles.items():
        for cycle in range(count):
            summary.add_status(replace(made_up_status(cycle + 1), law=code))
    assert law_that_flew(summary) == law


JUDGE = "import sys; from ares_bringup.__main__ import judge; sys.exit(judge())"


def test_a_judge_that_is_stopped_has_no_good_word(ros_domain):
    process = subprocess.Popen(
        [sys.executable, "-c", JUDGE], env={**os.environ, "ROS_DOMAIN_ID": str(ros_domain)}
    )

    def takes_it():
        status = Path(f"/proc/{process.pid}/status").read_text()
        caught = int(re.search(r"SigCgt:\s*(\w+)", status)[1], 16)
        return caught & 1 << signal.SIGTERM - 1

    # before the node is up, somewhere in its imports
    while not takes_it():
        assert process.poll() is None
    process.terminate()
    assert process.wait(120.0) == 130


TALKER = """
import rclpy
rclpy.init()
rclpy.create_node("talker")
print("the result")
rclpy.shutdown()
"""


def test_what_the_middleware_complains_of_is_no_result(ros_domain):
    """Hold the ports in shared memory: the middleware prints a line on standard error."""
    first = 7400 + 250 * ros_domain
    with ExitStack() as held:
        for port in range(first, first + 40):
            path = Path(f"/dev/shm/fastrtps_port{port}_el")
            # a port that another process holds serves as well
            with suppress(BlockingIOError):
                file = held.enter_context(path.open("w"))
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                held.callback(path.unlink, missing_ok=True)
        environment = {**os.environ, "ROS_DOMAIN_ID": str(ros_domain)}
        for name in PROFILE_VARIABLES:
            environment.pop(name, None)
        environment |= discovery_settings(environment)
        done = subprocess.run(
            [sys.executable, "-c", TALKER],
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
            check=True,
        )
    assert done.stdout == "the result\n"
    assert "Failed init_port" in done.stderr


def test_values_of_a_node_in_a_parameter_file(tmp_path):
    path = tmp_path / "some.yaml"
    path.write_text(
        "/**:\n  ros__parameters: {seed: 1, mission: all}\n"
        "/moon/guidance:\n  ros__parameters: {mission: own}\n"
        "recorder:\n  ros__parameters: {seed: 3}\n"
    )
    assert node_values(path, "guidance") == {"seed": 1, "mission": "own"}
    assert node_values(path, "recorder") == {"seed": 3, "mission": "all"}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("- a\n", "not a parameter file"),
        ("guidance: {mission: x}\n", "guidance: expected ros__parameters"),
        ("guidance: [\n", "not valid YAML"),
    ],
)
def test_what_is_not_a_parameter_file(tmp_path, text, complaint):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=complaint) as caught:
        node_values(path, "guidance")
    assert "\n" not in str(caught.value)


def test_a_flight_that_the_optimizer_plans_needs_what_solves(monkeypatch):
    monkeypatch.setattr("ares_bringup.node_values.unmet", lambda *asked: f"{asked}")
    assert set(node_parameters(FlyOptions("ares_v"), None, 1)) == {"vehicle_sim", "guidance"}
    with pytest.raises(CannotStart, match=r"\('ares_optimizer', 'solve'\)"):
        node_parameters(FlyOptions("ares_v", settings={"initial_guess": "analytic"}), None, 1)
