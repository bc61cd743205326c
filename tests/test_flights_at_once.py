# SPDX-License-Identifier: Apache-2.0
"""Flights that start in the same second: each is flown as if alone.

$ARES_FLIGHTS flights (default 4) in $ARES_ROUNDS rounds (default 1); one in four by `ros2 launch`,
or what stands in for it.
"""

import itertools
import json
import os
import subprocess
import sys

import pytest
import yaml

from ares_bags.compare import differences
from ares_bags.reader import open_bag
from ares_trials.testing.flights import short_burn

#: Speed in m/s that the one burn of each mission adds: 60 to 160 s of flight.
MISSIONS = {"short": 180.0, "longer": 330.0, "longest": 480.0}
#: Real-time factor: they are in the air for seconds, and together.
PACE = "20"
TOPICS = [
    f"/ares/{name}"
    for name in (
        "nav_state",
        "vehicle_state",
        "thrust_command",
        "guidance_status",
        "flight_event",
    )
]
FLIGHTS = int(os.environ.get("ARES_FLIGHTS", "4"))
ROUNDS = int(os.environ.get("ARES_ROUNDS", "1"))


def environment(folder):
    """Return an environment without a choice of graph."""
    clean = {key: value for key, value in os.environ.items() if key != "ROS_DOMAIN_ID"}
    return {**clean, "ROS_LOG_DIR": str(folder / "log")}


def by_fly(mission, bag):
    words = ["fly", "--mission", str(mission), "--pace", PACE, "--bag", str(bag), "--json"]
    return [sys.executable, "-m", "ares_bringup", *words]


def by_launch(ros2, mission, bag):
    return [*ros2, "launch", "ares_bringup", "flight.launch.py"] + [
        f"mission:={mission}",
        f"pace:={PACE}",
        f"bag:={bag}",
    ]


def begin(command, folder):
    return subprocess.Popen(
        command,
        env=environment(folder),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture(scope="module")
def missions(tmp_path_factory):
    folder = tmp_path_factory.mktemp("missions")
    files = {name: folder / f"{name}.yaml" for name in MISSIONS}
    for name, file in files.items():
        file.write_text(yaml.safe_dump(short_burn(MISSIONS[name], name=name)))
    return files


@pytest.fixture
def alone(missions, ares, tmp_path):
    """Fly each mission alone; return the bags."""
    bags = {}
    for name, file in missions.items():
        bags[name] = tmp_path / name
        words = ("--mission", str(file), "--bag", str(bags[name]))
        done = ares("fly", "--in-process", "--json", *words)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["foreign_messages"] == 0
    return bags


@pytest.mark.long
@pytest.mark.trial
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("_number", range(ROUNDS))
def test_flights_that_start_together_fly_as_if_alone(alone, missions, ros2, tmp_path, _number):
    started = []
    for k, mission in zip(range(FLIGHTS), itertools.cycle(missions)):
        bag = tmp_path / f"bag{k}"
        file = missions[mission]
        command = by_launch(ros2, file, bag) if k % 4 == 3 else by_fly(file, bag)
        started.append((mission, bag, begin(command, tmp_path)))
    ids = set()
    for mission, path, flight in started:
        _, err = flight.communicate()
        assert flight.returncode == 0, err
        bag = open_bag(path)
        assert differences(open_bag(alone[mission]), bag, TOPICS) == []
        flown = {int(x) for topic in TOPICS for x in bag.columns(topic)["flight_id"]}
        assert len(flown) == 1
        ids |= flown
        assert bag.custom_data["mission"] == str(missions[mission])
    assert len(ids) == FLIGHTS
