# SPDX-License-Identifier: Apache-2.0
"""Burns in the middle of which the thrust turns half round: laws ask for a plan of these."""

from pathlib import Path

import pytest

from ares_guidance.laws import FindsNoWay, make_law
from ares_models.judge import End
from ares_models.mission import load_mission
from ares_studies.closed_loop import fly_compiled, fly_stepwise, ready_law
from ares_trials.testing.arrivals import judged
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.dispersions import Dispersions

MISSIONS = Path(__file__).parents[2] / "ares_optimizer" / "test" / "missions"
#: Final mass, kg, of a Radau collocation that shares nothing with this project.
TRUE_KG = {"long_weak_burn": 14_749.58, "nearly_there": 56_554.34}
LOST = 5e-4


@pytest.fixture(scope="module", params=one_in(2, ("nearly_there", "long_weak_burn")))
def name(request):
    return request.param


@pytest.fixture(scope="module")
def mission(name):
    return load_mission(MISSIONS / f"{name}.yaml")


@pytest.mark.parametrize("fly", [fly_compiled, fly_stepwise])
def test_the_optimal_law_flies_them_by_a_plan(name, mission, fly):
    law = ready_law(mission, "optimal")
    assert law.asks
    plant = fly(mission, law=law).plant
    assert judged(mission, plant).end is End.TARGET
    assert plant["mass"] > (1.0 - LOST) * TRUE_KG[name]


@pytest.mark.parametrize("law", ["peg", "igm"])
def test_other_laws_name_the_one_that_flies_them(mission, law):
    with pytest.raises(
        FindsNoWay, match=f"law is '{law}', which finds no steering .*; try law optimal"
    ):
        ready_law(mission, law)


def test_without_a_plan_nothing_is_commanded(mission):
    law = make_law("optimal", mission.arrays(foreseen=True), start=mission.start().navigation())
    with pytest.raises(ValueError, match=r"which needs a plan; use --initial-guess optimizer"):
        law.step(mission.start().navigation()[0])


@pytest.mark.parametrize("thrust", [0.99, 1.01])
def test_another_thrust_is_flown_round_the_flip(mission, thrust):
    other = Dispersions(thrust={"mean": thrust - 1.0})
    plant = fly_compiled(mission, dispersions=other, law="optimal").plant
    assert judged(mission, plant).end is End.TARGET


def test_a_mission_that_a_law_flies_by_itself_asks_for_no_plan():
    for law in ("peg", "igm", "optimal"):
        assert not ready_law(load_mission("ares_v"), law).asks
