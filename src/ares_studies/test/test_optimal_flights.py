# SPDX-License-Identifier: Apache-2.0
"""Optimal guidance, closed loop: it flies the optimum, or PEG without one."""

import numpy as np
import pytest

from ares_guidance.arrays import LAW_OPTIMAL, LAW_PEG
from ares_guidance.settings import LawSettings
from ares_models.mission import load_mission
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, fly_stepwise, ready_law
from ares_trials.testing.arrivals import assert_inserted
from ares_vehicle_sim.arrays import JETTISON_DONE
from ares_vehicle_sim.simulator import SimulatorOptions


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


def jettison(flight):
    """Return the last jettison of a flight."""
    return flight.events[flight.events["type"] == JETTISON_DONE][-1]


@pytest.mark.parametrize("hold_time_s", [2.0, 5.0, 10.0])
@pytest.mark.parametrize("cycle_period_s", [1.0, 2.0])
def test_the_optimum_is_flown(ares_v, hold_time_s, cycle_period_s):
    best = solve(ares_v, "indirect", verify=False)
    flight = fly_compiled(
        ares_v,
        law=ready_law(
            ares_v,
            "optimal",
            LawSettings(hold_time_s=hold_time_s, cycle_period_s=cycle_period_s),
        ),
    )
    assert_inserted(ares_v, flight)
    assert flight.guidance["law"] == LAW_OPTIMAL
    # the margin that the jettison keeps costs grams
    assert flight.plant["mass"] == pytest.approx(best.m_f_kg, abs=0.05)
    assert jettison(flight)["time"] == pytest.approx(best.t_plf_s, abs=0.01)
    assert jettison(flight)["heating_rate"] <= 1135.0


@pytest.mark.parametrize("name", ["delta_iii", "saturn_v_as506"])
def test_other_missions(name):
    mission = load_mission(name)
    best = solve(mission, "indirect", verify=False)
    flight = fly_compiled(mission, law="optimal")
    assert flight.plant["inserted"] == 1
    assert flight.guidance["law"] == LAW_OPTIMAL
    assert flight.plant["mass"] == pytest.approx(best.m_f_kg, abs=0.05)
    assert flight.plant["mass"] > fly_compiled(mission).plant["mass"]


def test_compiled_and_stepwise_flights_are_the_same(ares_v):
    options = SimulatorOptions(navigation_period_s=1.0)
    one = fly_compiled(ares_v, options=options, law="optimal")
    other = fly_stepwise(ares_v, options=options, law="optimal")
    assert one.plant["mass"] == other.plant["mass"]
    assert np.array_equal(one.plant["position"], other.plant["position"])


def test_a_solve_that_may_not_take_its_time_falls_back_to_peg(ares_v):
    law = ready_law(ares_v, "optimal", LawSettings(max_solve_iterations=0))
    flight = fly_compiled(ares_v, law=law)
    assert_inserted(ares_v, flight)
    assert flight.guidance["law"] == LAW_PEG
    assert flight.plant["mass"] == fly_compiled(ares_v).plant["mass"]
