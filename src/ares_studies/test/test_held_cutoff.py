# SPDX-License-Identifier: Apache-2.0
"""The last seconds: the predicted cut-off is the one flown."""

import math
from pathlib import Path

import numpy as np
import pytest

from ares_guidance.arrays import PHASE_CUTOFF, PHASE_HOLD
from ares_guidance.laws import make_law
from ares_models.mission import load_mission
from ares_studies.closed_loop import ready_law
from ares_trials.testing.laws import step_anew
from ares_vehicle_sim.simulator import CAMPAIGN, Simulator


@pytest.fixture(scope="module")
def ariane():
    return load_mission(Path(__file__).with_name("missions") / "ariane5_eca.yaml")


def test_a_cut_off_in_a_climb_is_flown_as_predicted(ariane):
    simulator = Simulator(ariane, CAMPAIGN)
    law = ready_law(ariane, "optimal")
    held = []
    while not simulator.complete:
        law.step(simulator.navigation)
        if law.state["phase"] >= PHASE_HOLD:
            held.append(float(law.steering["cutoff_time"][0]))
        # a command that is refused raises
        simulator.command(law.steering)
        simulator.advance()
    assert len(held) >= 8
    assert np.ptp(held) < 0.2
    end = simulator.plant
    assert end["inserted"] == 1
    assert end["time"] == pytest.approx(held[-1], abs=1e-6)
    # an independent collocation has 21,170.8 kg
    assert end["mass"] == pytest.approx(21170.8, abs=0.2)
    target = ariane.arrays().target[0]
    energy = 0.5 * np.sum(end["velocity"] ** 2) - 3.986004418e14 / np.linalg.norm(end["position"])
    assert 2.0 * energy == pytest.approx(float(target["c3"]), abs=0.02 * 1e4)


def flown_to_hold(mission):
    """Fly to the last seconds; return law and simulator."""
    simulator = Simulator(mission, CAMPAIGN)
    law = make_law("peg", mission.arrays(foreseen=True))
    while law.state["phase"] < PHASE_HOLD:
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
    return law, simulator


def test_a_cut_off_that_is_past_is_commanded_as_one_that_the_vehicle_takes():
    """Report a speed far above the target's: the engine is cut off at once."""
    law, simulator = flown_to_hold(load_mission("ares_v"))
    # the state between does not reach it
    before = float(simulator.navigation["time"])
    simulator.advance()
    fast = simulator.navigation.copy()
    fast["velocity"] *= 1.02
    step_anew(law, fast)
    assert law.state["phase"] == PHASE_CUTOFF
    assert before <= law.steering["cutoff_time"][0] <= fast["time"]
    simulator.command(law.steering)
    simulator.advance()
    assert simulator.plant["inserted"] == 1
    assert simulator.plant["events"]["time"][simulator.plant["event_count"] - 1] == fast["time"]


def test_a_refinement_that_finds_no_cut_off_leaves_the_one_that_was_predicted():
    """Report a speed out of reach of the thrust: the cut-off held before is flown."""
    law, simulator = flown_to_hold(load_mission("ares_v"))
    predicted = float(law.steering["cutoff_time"][0])
    state = simulator.navigation.copy()
    state["velocity"] *= -1.0
    step_anew(law, state)
    assert law.steering["cutoff_time"][0] == pytest.approx(predicted, abs=1e-6)
    assert not math.isnan(predicted)
