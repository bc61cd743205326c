# SPDX-License-Identifier: Apache-2.0
"""Flights with stand-ins for the nodes: consequences for the flight when one of them fails."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ares_bringup import fly as module
from ares_bringup import processes, watch
from ares_bringup.crew import Crew
from ares_bringup.fly import fly
from ares_bringup.options import CannotStart, FlyOptions
from ares_bringup.outcomes import Outcome
from ares_trials.testing.ros import own_words
from ares_trials.testing.samples import one_in


@pytest.fixture
def flight(facts, fake_nodes, ros_domain, tmp_path, monkeypatch):
    """Fly the stand-ins in the way that they are told."""
    monkeypatch.setattr(module, "mission_facts", lambda _: facts)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.setenv("FAKE_MARKS", str(tmp_path))
    pids = []
    start = Crew.start

    def noting_start(self, name, *rest):
        start(self, name, *rest)
        pids.append(self.pid(name))

    monkeypatch.setattr(Crew, "start", noting_start)

    def run(begun=lambda: None, restarts=3, until=lambda _said: False, **behaviour):
        for name, how in behaviour.items():
            monkeypatch.setenv(f"FAKE_{name.upper()}", how)
        said = []

        def say(line):
            said.append(line)
            if until(said):
                os.kill(os.getpid(), signal.SIGTERM)

        try:
            greetings = []

            def greet(line):
                greetings.append(line)
                begun()

            options = FlyOptions("ares_v", bag=tmp_path / "bag", restarts=restarts)
            summary = fly(options, say, fake_nodes, greet=greet)
            assert [line[:25] for line in greetings] == [f"flight {summary.flight_id:016x}: "]
            return summary, said
        finally:
            assert not [pid for pid in pids if Path(f"/proc/{pid}").exists()]

    return run


def given_up(said):
    return "not restarted" in said[-1]


def test_a_good_flight(flight, tmp_path):
    summary, said = flight()
    assert summary.exit_code == 0
    assert summary.bag == str(tmp_path / "bag")
    assert summary.t_plf_s == 30.0
    # how far the stand-in gets beside the other one is a matter of the machine
    assert summary.guidance_cycles > 0
    # unknown if a slow machine hears begin and end in one go
    assert summary.realtime_factor is None or summary.realtime_factor > 1.0
    assert 0.0 < summary.wall_s < 60.0
    assert said == []


@pytest.mark.parametrize("name", one_in(3, ["vehicle_sim", "guidance", "recorder"]))
def test_a_node_that_cannot_start_has_the_word(flight, name, capfd):
    with pytest.raises(CannotStart) as caught:
        flight(**{name: "refuse"})
    assert str(caught.value) == ""
    assert own_words(capfd.readouterr().err) == f"{name}: refused, as it was told\n"


def test_guidance_killed_in_flight(flight):
    summary, said = flight(restarts=0, guidance="kill")
    assert summary.outcome is Outcome.TARGET
    line = (
        "guidance was killed by SIGKILL in flight: flying on with its last good command; "
        "not restarted: 0 restarts were allowed"
    )
    assert summary.shortcomings() == said == [line]
    assert summary.exit_code == 1


def test_guidance_that_dies_again_and_again_is_given_up(flight, monkeypatch):
    """Let the stand-in kill itself after each start."""
    # the other nodes end in time on a busy machine too
    monkeypatch.setattr(processes, "INTERRUPTED_STOP_TIMEOUT", 30.0)
    summary, said = flight(restarts=2, guidance="kill", vehicle_sim="slow", until=given_up)
    assert summary.problems == said
    assert [line.rpartition("; ")[2] for line in said] == [
        "restarted (1 of 2)",
        "restarted (2 of 2)",
        "not restarted: 2 restarts were allowed",
    ]


def test_recorder_killed_in_flight(flight):
    summary, said = flight(recorder="kill")
    assert summary.outcome is Outcome.TARGET
    assert summary.exit_code == 1
    line = "recorder was killed by SIGKILL in flight: the bag is incomplete; "
    assert said == [line + "`ares bag repair` saves what was written"]


@pytest.mark.trial
def test_recorder_that_ends_with_a_complaint(flight):
    summary, _ = flight(recorder="exit1")
    assert summary.exit_code == 1
    assert "recorder ended with exit status 1" in summary.shortcomings()[0]


def test_simulator_killed_in_flight(flight):
    summary, said = flight(vehicle_sim="kill")
    assert summary.outcome is Outcome.INCOMPLETE
    assert summary.exit_code == 1
    assert said == ["vehicle_sim was killed by SIGKILL in flight"]


def test_a_node_that_hears_no_signal_is_killed(flight, monkeypatch):
    monkeypatch.setattr(processes, "NODE_STOP_TIMEOUT", 3.0)
    summary, _ = flight(guidance="hang")
    assert summary.outcome is Outcome.TARGET
    assert summary.shortcomings() == ["guidance did not end within 3 s: killed"]


@pytest.mark.trial
def test_an_interrupted_flight_does_not_wait_for_a_node_that_hears_no_signal(
    flight, tmp_path, monkeypatch
):
    monkeypatch.setattr(processes, "INTERRUPTED_STOP_TIMEOUT", 1.0)

    def interrupt():
        while not (tmp_path / "guidance").exists():
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGTERM)

    summary, _ = flight(interrupt, vehicle_sim="slow", guidance="hang")
    assert summary.exit_code == 130
    assert "guidance did not end within 1 s: killed" in summary.shortcomings()


def test_a_missed_target(flight):
    summary, _ = flight(vehicle_sim="miss")
    assert summary.outcome is Outcome.TARGET_MISSED
    assert summary.exit_code == 1


def test_a_flight_without_news_is_given_up(flight, monkeypatch):
    monkeypatch.setattr(watch, "STALL_TIMEOUT", 1.0)
    summary, _ = flight(restarts=0, vehicle_sim="slow", guidance="kill")
    assert summary.outcome is Outcome.INCOMPLETE
    assert "nothing heard for 1 s: given up" in summary.shortcomings()


@pytest.mark.trial
def test_a_coast_longer_than_the_silence_allowed_is_flown(flight, monkeypatch):
    monkeypatch.setattr(watch, "STALL_TIMEOUT", 2.0)
    summary, said = flight(vehicle_sim="coast", guidance="quiet")
    assert summary.shortcomings() == said == []
    assert summary.wall_s > 5.0


@pytest.mark.trial
def test_a_simulator_whose_time_stands_is_given_up(flight, monkeypatch):
    monkeypatch.setattr(watch, "STALL_TIMEOUT", 1.0)
    summary, _ = flight(vehicle_sim="stand", guidance="quiet")
    assert summary.outcome is Outcome.INCOMPLETE
    assert "nothing heard for 1 s: given up" in summary.shortcomings()


@pytest.mark.parametrize("number", one_in(2, [signal.SIGINT, signal.SIGTERM]))
def test_an_interrupted_flight(flight, number):
    summary, _ = flight(lambda: os.kill(os.getpid(), number), vehicle_sim="slow")
    assert summary.outcome is Outcome.INTERRUPTED
    assert summary.exit_code == 130


def test_a_killed_parent_leaves_nothing(fake_nodes, ros_domain, tmp_path):
    program = f"""
from ares_trials.testing.flights import made_up_mission
from ares_bringup import fly as module
from ares_bringup.crew import Crew
from ares_bringup.options import FlyOptions
module.mission_facts = lambda name: made_up_mission()
start = Crew.start
def noting_start(self, name, *rest):
    start(self, name, *rest)
    print(self.pid(name), flush=True)
Crew.start = noting_start
bag = __import__("pathlib").Path({str(tmp_path / "bag")!r})
module.fly(FlyOptions("ares_v", bag=bag), modules={fake_nodes!r})
"""
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(ros_domain),
        "FAKE_VEHICLE_SIM": "slow",
        "FAKE_MARKS": str(tmp_path),
    }
    parent = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, env=environment
    )
    pids = [int(parent.stdout.readline()) for _ in range(3)]
    deadline = time.monotonic() + 30.0
    while not (tmp_path / "bag").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    parent.kill()
    parent.wait()
    parent.stdout.close()
    while [pid for pid in pids if Path(f"/proc/{pid}").exists()]:
        assert time.monotonic() < deadline, "a child outlived its parent"
        time.sleep(0.05)
