# SPDX-License-Identifier: Apache-2.0
"""Loss of one of five core engines at any time: guidance replans with the longer burn."""

import pytest

from ares_models.mission import load_mission
from ares_models.mission_arcs import EngineOut
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled
from ares_trials.testing.arrivals import assert_inserted
from ares_vehicle_sim.arrays import JETTISON_DONE


def losing_an_engine(at):
    mission = load_mission("ares_v")
    core, upper = mission.stages
    failure = EngineOut(time_after_ignition_s=at, engines=5, lost=1)
    return mission.model_copy(
        update={"stages": (core.model_copy(update={"engine_out": failure}), upper)}
    )


@pytest.mark.parametrize("law", ["peg", "igm", "optimal"])
@pytest.mark.parametrize("at", [0.5, 10.0, 45.0, 90.0, 135.0, 170.0, 181.0])
def test_the_target_is_reached(law, at):
    mission = losing_an_engine(at)
    flight = fly_compiled(mission, law=law)
    assert_inserted(mission, flight)
    drop = flight.events[flight.events["type"] == JETTISON_DONE][0]
    assert drop["heating_rate"] <= 1135.0


@pytest.mark.parametrize("at", [45.0, 135.0])
def test_optimal_guidance_loses_little_against_knowing_it_all_along(at):
    mission = losing_an_engine(at)
    best = solve(mission, "indirect", verify=False)
    optimal = fly_compiled(mission, law="optimal").plant["mass"]
    assert fly_compiled(mission).plant["mass"] + 50.0 < optimal < best.m_f_kg
