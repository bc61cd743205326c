# SPDX-License-Identifier: Apache-2.0
"""Whole flights to targets by elements: fixed elements are met, free ones are left to the law."""

import math
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from ares_guidance.arrays import ERROR_PROPELLANT_SHORT
from ares_guidance.laws import check_law, find_law, make_law
from ares_guidance.plan import ArcPlan
from ares_guidance.settings import LawSettings
from ares_models.judge import End
from ares_models.mission import Mission, load_mission
from ares_models.orbits import Elements
from ares_optimizer.indirect.solve import solve_indirect
from ares_optimizer.solution import Status
from ares_optimizer.solve import solve
from ares_studies.closed_loop import arc_plan, fly_compiled, ready_law
from ares_trials.testing.arrivals import judged
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.dispersions import Dispersions

LAUNCHERS = Path(__file__).parents[3] / "benchmarks" / "launchers"
EQUATOR = 6378140.0
TRANSFER = {"perigee_altitude_m": 185e3, "apogee_altitude_m": 35786e3}
TARGETS = {
    "transfer": {**TRANSFER, "inclination_deg": 28.5},
    "transfer with its perigee": {
        **TRANSFER,
        "inclination_deg": 28.5,
        "argument_of_perigee_deg": 140.0,
    },
    "transfer in full": {
        **TRANSFER,
        "inclination_deg": 28.5,
        "ascending_node_deg": 114.0,
        "argument_of_perigee_deg": 130.0,
    },
    "transfer in any plane": TRANSFER,
    "transfer through a node": {**TRANSFER, "ascending_node_deg": 114.0},
    "at perigee": {**TRANSFER, "inclination_deg": 28.5, "at": "perigee"},
    "escape": {"perigee_altitude_m": 185e3, "c3_m2_s2": 1e6, "inclination_deg": 28.5},
    "parabola at a place": {
        "perigee_altitude_m": 185e3,
        "c3_m2_s2": 0.0,
        "true_anomaly_deg": 10.0,
    },
    "circle in any plane": {"perigee_altitude_m": 185e3},
    "nearly a circle": {
        "perigee_altitude_m": 185e3,
        "apogee_altitude_m": 200e3,
        "inclination_deg": 28.5,
    },
}
LAWS = ("peg", "igm", "optimal")


def aimed(name="ares_v", **target):
    return Mission.model_validate(load_mission(name).model_dump() | {"target": target})


# each target, by one or two of the laws
@pytest.mark.parametrize(("name", "law"), one_in(2, product(TARGETS, LAWS)))
def test_what_is_named_is_met(name, law):
    mission = aimed(**TARGETS[name])
    plan = arc_plan(mission, find_law(law))
    check_law(law, mission.arrays(foreseen=True), mission.start().navigation(), plan)
    plant = fly_compiled(mission, law=law).plant
    result = judged(mission, plant)
    assert result.end is End.TARGET, result
    best = solve_indirect(mission.arrays(), mission.start().navigation(), verify=False)
    # optimal flies by peg until it has found its optimum
    lost = 1e-4 if law == "optimal" else 3e-3
    assert -1e-6 < 1.0 - plant["mass"] / best.m_f_kg < lost


@pytest.mark.parametrize("law", ["peg", "igm"])
def test_a_burn_through_more_than_half_a_radian_loses_little(law):
    """Fly burns of 15 min together; by a pass for small angles they cost peg 0.33 % of the mass."""
    mission = load_mission(LAUNCHERS / "gslv2_gto.yaml")
    assert not mission.needs_plan
    best = solve_indirect(mission.arrays(), mission.start().navigation(), verify=False)
    plant = fly_compiled(mission, law=law).plant
    assert judged(mission, plant).end is End.TARGET
    assert plant["mass"] > 0.9995 * best.m_f_kg


@pytest.mark.parametrize(("law", "loss"), [("peg", 4e-3), ("optimal", 1e-6)])
@pytest.mark.parametrize("inclination", [65.0, 100.0])
def test_a_slow_start_turns_into_another_plane(law, loss, inclination):
    """Turn by 35 and by 70 deg, cheap at the speed of a first stage; igm loses 4 %."""
    data = load_mission(LAUNCHERS / "f9_iss.yaml").model_dump(exclude_unset=True)
    data["initial_state"] |= {"azimuth_deg": 90.0, "latitude_deg": 30.0}
    data["target"]["inclination_deg"] = inclination
    data["stages"][0]["ignition_mass_kg"] = 113e3
    mission = Mission.model_validate(data)
    solution = solve(mission, "indirect")
    assert solution.status is Status.CONVERGED
    plant = fly_compiled(mission, law=law).plant
    result = judged(mission, plant)
    assert result.end is End.TARGET, result
    assert -1e-6 < 1.0 - plant["mass"] / solution.m_f_kg < loss


@pytest.mark.parametrize("name", TARGETS)
def test_large_turns_are_flown_to_the_same_targets(name):
    mission = aimed(**TARGETS[name])
    settings = LawSettings(small_turn_limit_deg=0.0)
    plant = fly_compiled(mission, law=ready_law(mission, settings=settings)).plant
    result = judged(mission, plant)
    assert result.end is End.TARGET, result


def planned_end(mission):
    """Return the orbit at the end of the optimum."""
    track = solve(mission, "indirect").trajectory
    mu = mission.environment.mu_m3_s2
    return Elements.from_state(track.position[-1], track.velocity[-1], mu)


@pytest.mark.parametrize("law", ["peg", "igm"])
@pytest.mark.parametrize("thrust", [0.0, -0.02])
def test_a_place_that_is_free_is_that_of_the_plan(law, thrust):
    mission = aimed(**TARGETS["transfer"])
    dispersed = Dispersions(thrust={"mean": thrust})
    plant = fly_compiled(mission, dispersions=dispersed, law=law).plant
    orbit = Elements.from_state(plant["position"], plant["velocity"], mission.environment.mu_m3_s2)
    planned = planned_end(mission)
    assert math.degrees(planned.true_anomaly) > 5.0
    assert orbit.true_anomaly == pytest.approx(planned.true_anomaly, abs=1e-4)
    assert orbit.perigee_radius == pytest.approx(EQUATOR + 185e3, abs=10.0)
    assert orbit.apogee_radius == pytest.approx(EQUATOR + 35786e3, abs=1e3)


def test_an_apogee_alone_is_flown_to_from_the_height_of_the_start():
    mission = aimed(apogee_altitude_m=35786e3, inclination_deg=28.5)
    plant = fly_compiled(mission).plant
    assert judged(mission, plant).end is End.TARGET
    orbit = Elements.from_state(plant["position"], plant["velocity"], mission.environment.mu_m3_s2)
    start = float(np.linalg.norm(mission.start().position))
    assert orbit.perigee_radius == pytest.approx(start, abs=100.0)


@pytest.mark.parametrize("law", LAWS)
def test_a_free_place_needs_a_plan(law):
    free = aimed(**TARGETS["transfer"])
    arrays = free.arrays(foreseen=True)
    with pytest.raises(ValueError, match=f"{law}.*needs a plan of .* the target's orbit"):
        check_law(law, arrays, free.start().navigation())
    for name in ("transfer with its perigee", "at perigee"):
        assert not make_law(law, aimed(**TARGETS[name]).arrays()).lacks_plan
    assert not make_law(law, load_mission("ares_v").arrays()).lacks_plan


def test_a_plan_needs_the_end_of_a_free_place():
    law = make_law("peg", aimed(**TARGETS["transfer"]).arrays())
    with pytest.raises(ValueError, match="end of burn 1 is missing; expected the state there"):
        law.follow_arcs(ArcPlan({1: 300.0}, {}))


@pytest.mark.parametrize("law", LAWS)
def test_a_weak_upper_stage_ends_in_a_climb(law):
    """Cut off 33 deg behind perigee, where gravity takes most of what the thrust gives.

    The optimum, 21,170.8 kg, is that of a collocation which shares nothing with this project;
    level at perigee an end costs 18 % of it.
    """
    mission = load_mission(Path(__file__).with_name("missions") / "ariane5_eca.yaml")
    plant = fly_compiled(mission, law=law).plant
    result = judged(mission, plant)
    assert result.end is End.TARGET, result
    assert plant["mass"] > (21_170.7 if law == "optimal" else 0.997 * 21_170.8)


@pytest.mark.parametrize("law", LAWS)
def test_short_of_propellant_the_perigee_is_kept(law):
    whole = aimed(**TARGETS["transfer"])
    stage = whole.stages[-1].model_copy(update={"propellant_kg": 190_000.0})
    mission = whole.model_copy(update={"stages": (whole.stages[0], stage)})
    guidance = make_law(law, mission.arrays(foreseen=True))
    guidance.follow_arcs(arc_plan(whole, guidance.kind))
    flight = fly_compiled(mission, law=guidance)
    assert int(flight.guidance["error"]) == ERROR_PROPELLANT_SHORT
    orbit = Elements.from_state(
        flight.plant["position"], flight.plant["velocity"], mission.environment.mu_m3_s2
    )
    assert orbit.perigee_radius == pytest.approx(EQUATOR + 185e3, abs=2e3)
    assert EQUATOR + 185e3 < orbit.apogee_radius < 0.9 * (EQUATOR + 35786e3)


@pytest.mark.parametrize("law", LAWS)
def test_a_place_beside_a_perigee_is_for_the_optimal_law(law):
    mission = aimed(**TARGETS["transfer with its perigee"], true_anomaly_deg=7.5)
    arrays, start = mission.arrays(foreseen=True), mission.start().navigation()
    if law == "optimal":
        check_law(law, arrays, start)
        result = judged(mission, fly_compiled(mission, law=make_law(law, arrays)).plant)
        assert result.end is End.TARGET, result
        return
    with pytest.raises(ValueError, match=f"law is '{law}', which flies to no place"):
        check_law(law, arrays, start)


def test_a_plane_that_the_flight_hardly_comes_to():
    # its northmost point is where the flight ends: no plane of the inclination passes beyond
    mission = aimed(
        perigee_altitude_m=282137.0,
        eccentricity=0.00424849,
        inclination_deg=29.3768,
        true_anomaly_deg=24.0567,
    )
    result = judged(mission, fly_compiled(mission).plant)
    assert result.end is End.TARGET, result


@pytest.mark.parametrize("inclination_deg", [0.0, 1.0])
def test_from_the_equator(inclination_deg):
    content = load_mission("ares_v").model_dump()
    content["initial_state"] = {
        "time_s": 155.9,
        "latitude_deg": 0.0,
        "right_ascension_deg": 20.0,
        "radius_m": 6415384.0,
        "speed_m_s": 1896.0,
        "flight_path_angle_deg": 20.0,
        "azimuth_deg": 90.0,
    }
    content["target"] = {**TRANSFER, "inclination_deg": inclination_deg}
    mission = Mission.model_validate(content)
    for limit_deg in (0.0, 40.0):
        settings = LawSettings(small_turn_limit_deg=limit_deg)
        law = ready_law(mission, settings=settings)
        result = judged(mission, fly_compiled(mission, law=law).plant)
        assert result.end is End.TARGET, result
    solution = solve_indirect(mission.arrays(), mission.start().navigation())
    assert solution.converged, solution.reason
