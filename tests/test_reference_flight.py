# SPDX-License-Identifier: Apache-2.0
"""The flight kept in bags/: still as flown now. Guidance's answers: test_check.py."""

from pathlib import Path

import pytest

from ares_bags.reader import open_bag
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
