"""The flight that is kept in bags/: still what we fly, still what guidance answers."""

from pathlib import Path

import numpy as np
import pytest

from ares_bags.reader import open_bag
from ares_guidance.law import Law
from ares_models.arrays import NAVIGATION
from ares_models.mission import load_mission
from ares_studies.closed_loop import fly_stepwise
from ares_vehicle_sim.simulator import SimulatorOptions

REFERENCE = Path(__file__).parent.parent / "bags" / "reference"


@pytest.fixture(scope="module")
def bag():
    return open_bag(REFERENCE)


def test_the_same_flight_again(bag):
    flight = fly_stepwise(
        load_mission(bag.custom_data["mission"]), options=SimulatorOptions(navigation_period_s=1.0)
    )
    recorded = bag.columns("flight_event")
    assert list(flight.events["type"]) == list(recorded["type"])
    assert flight.events["time"] == pytest.approx(recorded["time"], abs=1e-4)
    assert flight.events["mass"] == pytest.approx(recorded["mass"], abs=0.05)
    assert flight.events["position"] == pytest.approx(recorded["position"], abs=0.5)


def test_guidance_answers_the_recorded_states_as_it_did(bag):
    states, commands = bag.columns("nav_state"), bag.columns("thrust_command")
    assert np.array_equal(states["stamp"], commands["nav_stamp"])
    law = Law(load_mission(bag.custom_data["mission"]).arrays())
    nav = np.zeros(1, NAVIGATION)
    for k, stamp in enumerate(states["stamp"]):
        nav["time"] = stamp / 1e9
        for name in NAVIGATION.names:
            if name != "time":
                nav[name] = states[name][k]
        law.step(nav[0])
        steering = law.steering[0]
        t = stamp / 1e9
        directions = [
            direction + (t - reference) * rate
            for direction, rate, reference in (
                (steering["direction"], steering["direction_rate"], steering["reference_time"]),
                (
                    commands["direction"][k],
                    commands["direction_rate"][k],
                    commands["reference_time"][k],
                ),
            )
        ]
        assert directions[0] == pytest.approx(directions[1], abs=1e-6)
        assert steering["cutoff_time"] == pytest.approx(commands["cutoff_time"][k], abs=1e-4)
