# SPDX-License-Identifier: Apache-2.0
"""Coasts that touch their lower altitude bound after burns of fixed length: flown as planned."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ares_guidance.floor import held_burns
from ares_guidance.plan import plan_of
from ares_models.arrays import TARGET_KEPLERIAN, TARGET_RADIUS_SPEED_ANGLE_PLANE
from ares_models.judge import End, judge
from ares_models.kernels.environment import altitude
from ares_models.mission import Mission, load_mission
from ares_models.orbits import Elements
from ares_models.tolerances import FLOOR_M
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, offline_trajectory, ready_law
from ares_trials.testing.arrivals import judged
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions

MISSIONS = Path(__file__).parents[2] / "ares_optimizer" / "test" / "missions"
EQUATOR = 6_378_137.0
LAWS = ("peg", "igm", "optimal")
#: Of the plan's mass.
MOST_LOST = 3e-4
#: What a coast is asked for, and the lowest altitude or perigee that it may have, m.
FLOORS = {
    "the ground": ({}, 0.0),
    "an altitude": ({"min_altitude_m": 45e3}, 45e3),
    "a perigee": ({"min_perigee_altitude_m": 35e3}, 35e3),
}


@cache
def dipping(floor):
    """Make a vehicle without air whose lower stages nearly suffice: its best coast dips."""
    return Mission.model_validate(
        {
            "name": "dipping",
            "title": "Lower stages that are all but enough",
            "source": "made up",
            "environment": {
                "mu_m3_s2": 3.986004418e14,
                "earth": {
                    "equatorial_radius_m": EQUATOR,
                    "polar_radius_m": 6_356_752.3,
                    "rotation_rate_rad_s": 7.292115e-5,
                },
                "atmosphere": {"model": "us76", "density_factor": 1e-12},
            },
            "initial_state": {
                "time_s": 120.0,
                "latitude_deg": 12.0,
                "right_ascension_deg": -30.0,
                "radius_m": EQUATOR + 75e3,
                "speed_m_s": 3000.0,
                "flight_path_angle_deg": 19.0,
                "azimuth_deg": 95.0,
            },
            "stages": [
                {
                    "name": "first",
                    "ignition_mass_kg": 90e3,
                    "propellant_kg": 50e3,
                    "arcs": [{"thrust_n": 1.1e6, "isp_s": 310.0, "burn_time_s": 138.0}],
                },
                {
                    "name": "second",
                    "ignition_mass_kg": 36e3,
                    "propellant_kg": 23e3,
                    "arcs": [{"thrust_n": 260e3, "isp_s": 420.0, "burn_time_s": 364.0}],
                },
                {
                    "name": "third",
                    "ignition_mass_kg": 9e3,
                    "propellant_kg": 4.5e3,
                    "arcs": [
                        {"coast_s": "free", "max_s": 3000.0} | FLOORS[floor][0],
                        {"thrust_n": 60e3, "isp_s": 440.0, "burn_time_s": "free"},
                    ],
                },
            ],
            "target": {
                "perigee_radius_m": EQUATOR + 200e3,
                "apogee_radius_m": 42_164_137.0,
                "inclination_deg": 13.0,
            },
        }
    )


@cache
def plan(floor):
    return solve(dipping(floor), "auto", verify=False)


@pytest.mark.trial
@pytest.mark.parametrize("floor", one_in(3, FLOORS))
def test_the_plan_touches_its_floor(floor):
    arrays = dipping(floor).arrays()
    found = plan(floor)
    assert found.converged, found.reason
    trajectory = offline_trajectory(found)
    assert list(held_burns(trajectory, arrays)) == [1]
    kept = plan_of(trajectory, arrays)
    assert kept.held == {1}
    record = kept.record(arrays)[0]
    # a burn that lacks energy lowers the apogee, not the perigee
    assert record["target"]["kind"][1] == TARGET_KEPLERIAN
    plain = replace(kept, floored=frozenset()).record(arrays)[0]
    assert plain["target"]["kind"][1] == TARGET_RADIUS_SPEED_ANGLE_PLANE
    assert list(np.flatnonzero(record["ends_leg"])) == [1]
    assert record["length"][1] == pytest.approx(364.0)


@pytest.mark.trial
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["coast_10", "coast_18", "coast_22"])
def test_three_stages_graze_the_ground_and_arrive(name, law):
    mission = load_mission(MISSIONS / f"{name}.yaml")
    optimum = solve(mission, "auto", verify=False)
    plant = fly_compiled(mission, law=ready_law(mission, law, guess=optimum)).plant
    assert judged(mission, plant).end is End.TARGET
    assert float(plant["mass"]) > (1.0 - MOST_LOST) * optimum.m_f_kg


@pytest.mark.parametrize("law_name", LAWS)
@pytest.mark.parametrize("floor", one_in(3, FLOORS))
@pytest.mark.trial
def test_a_law_keeps_the_floor_and_what_the_plan_has(floor, law_name):
    mission, level = dipping(floor), FLOORS[floor][1]
    arrays = mission.arrays()
    environment = arrays.environment[0]
    mu = float(environment["mu"])
    simulator = Simulator(mission, SimulatorOptions(navigation_period_s=0.5))
    law = ready_law(mission, law_name, guess=plan(floor))
    lowest = perigee = math.inf
    while not simulator.complete:
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
        now = simulator.navigation
        if now["arc"] == 2:
            lowest = min(lowest, altitude(tuple(now["position"]), environment))
            orbit = Elements.from_state(now["position"], now["velocity"], mu)
            perigee = min(perigee, orbit.perigee_radius - EQUATOR)
    plant = simulator.plant
    reached = judge(plant["position"], plant["velocity"], arrays.target[0], mu, EQUATOR)
    assert reached.end is End.TARGET, reached
    assert float(plant["mass"]) > (1.0 - MOST_LOST) * plan(floor).m_f_kg
    low = perigee if floor == "a perigee" else lowest
    assert level - FLOOR_M < low < level + 2.0 * FLOOR_M
