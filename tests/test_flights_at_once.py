"""Flights that start in the same second: each flies as if it were alone.

$ARES_FLIGHTS flights (default 4) in $ARES_ROUNDS rounds (default 1); one in four by `ros2 launch`,
or what stands in for it.
"""

import itertools
import json
import os
import subprocess
import sys

import pytest

from ares_bags.compare import differences
from ares_bags.reader import open_bag

MISSIONS = ("ares_v", "saturn_v_as506", "delta_iii")
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
    """Nothing set that would choose a graph."""
    clean = {key: value for key, value in os.environ.items() if key != "ROS_DOMAIN_ID"}
    return {**clean, "ROS_LOG_DIR": str(folder / "log")}


def by_fly(mission, bag):
    words = ["fly", "--mission", mission, "--bag", str(bag), "--json"]
    return [sys.executable, "-m", "ares_bringup.cli", *words]


def by_launch(ros2, mission, bag):
    return [*ros2, "launch", "ares_bringup", "flight.launch.py"] + [
        f"mission:={mission}",
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
def alone(tmp_path_factory):
    """Bag of each mission, flown alone."""
    bags = {}
    for mission in MISSIONS:
        folder = tmp_path_factory.mktemp(mission)
        bags[mission] = folder / "bag"
        flight = begin(by_fly(mission, bags[mission]), folder)
        out, err = flight.communicate()
        assert flight.returncode == 0, err
        assert json.loads(out)["foreign_messages"] == 0
    return bags


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("_number", range(ROUNDS))
def test_flights_that_start_together_fly_as_if_alone(alone, ros2, tmp_path, _number):
    started = []
    for k, mission in zip(range(FLIGHTS), itertools.cycle(MISSIONS)):
        bag = tmp_path / f"bag{k}"
        command = by_launch(ros2, mission, bag) if k % 4 == 3 else by_fly(mission, bag)
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
        assert bag.custom_data["mission"] == mission
    assert len(ids) == FLIGHTS
