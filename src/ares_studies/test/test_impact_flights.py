# SPDX-License-Identifier: Apache-2.0
"""Suborbital ends: the impact point is kept out of named areas, or the failure is reported."""

import math
from functools import cache

import numpy as np
import pytest

from ares_guidance.arrays import (
    AVOID_CLEAR,
    AVOID_CUT,
    AVOID_LOST,
    AVOID_NOTHING,
    AVOID_STEER,
    MONITOR_DIRECTION,
    MONITOR_JETTISON,
    MONITOR_TIME_TO_GO,
    MONITOR_WORK,
)
from ares_guidance.findings import describe_avoiding
from ares_models.failures import Failure, FailureKind
from ares_models.impacts import find_impact
from ares_models.mission import Mission, load_mission
from ares_studies.closed_loop import fly_compiled, ready_law
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.dispersions import Dispersions, load_dispersions
from ares_vehicle_sim.simulator import CAMPAIGN, Simulator


@cache
def with_areas(name, *areas):
    """Load a shipped mission with other areas: (latitude deg, longitude deg, radius m) each."""
    data = load_mission(name).model_dump(exclude_unset=True)
    data["abort"]["avoid"] = [
        {
            "name": f"area {k}",
            "latitude_deg": latitude,
            "longitude_deg": longitude,
            "radius_m": radius,
        }
        for k, (latitude, longitude, radius) in enumerate(areas)
    ]
    return Mission.model_validate(data)


def fly(mission, failure, seed=None, law="peg"):
    """Fly; return the flight and its impact point."""
    dispersions = Dispersions() if seed is None else load_dispersions("standard")
    flight = fly_compiled(mission, CAMPAIGN, dispersions, seed or 0, law=law, failure=failure)
    return flight, fallen(mission, flight.plant)


def fallen(mission, plant):
    return find_impact(
        plant["position"],
        plant["velocity"],
        float(plant["time"]),
        mission.environment_array()[0],
        mission.area_names,
    )


def shut_down(time):
    return Failure(FailureKind.EARLY_SHUTDOWN, time)


def low(time, ratio):
    return Failure(FailureKind.THRUST_LOW, time, thrust_ratio=ratio, flow_ratio=ratio)


#: Failures that leave some thrust and no orbit, and areas about where the vehicle would fall. The
#: upper stage of ares_v moves its impact point little before it is on the ground.
FAILURES = [
    ("saturn_v_as506", shut_down(165.0), 80e3),
    ("saturn_v_as506", shut_down(165.0), 600e3),
    ("saturn_v_as506", shut_down(240.0), 80e3),
    ("saturn_v_as506", shut_down(240.0), 250e3),
    ("saturn_v_as506", shut_down(280.0), 800e3),
    ("saturn_v_as506", low(250.0, 0.3), 250e3),
    ("saturn_v_as506", low(400.0, 0.1), 80e3),
    ("ares_v", shut_down(240.0), 80e3),
    ("ares_v", low(160.0, 0.6), 80e3),
    ("ares_v", low(400.0, 0.3), 250e3),
    ("ares_v", low(600.0, 0.1), 80e3),
]


@pytest.mark.parametrize(
    "seed", [None, *(pytest.param(k, marks=pytest.mark.trial) for k in (1, 2))]
)
@pytest.mark.parametrize(("name", "failure", "radius_m"), one_in(3, FAILURES))
def test_what_would_fall_into_an_area_falls_outside(name, failure, seed, radius_m):
    _, unsteered = fly(with_areas(name), failure, seed)
    area = (unsteered.latitude_deg, unsteered.longitude_deg, radius_m)
    steered, impact = fly(with_areas(name, area), failure, seed)
    assert impact is None or (impact.area is None and impact.outside_m > 0.0)
    assert steered.guidance["avoid"]["mode"] != AVOID_NOTHING
    # what a law without a solution asks for in vain is not counted here
    own = MONITOR_DIRECTION | MONITOR_TIME_TO_GO | MONITOR_JETTISON | MONITOR_WORK
    assert steered.guidance["monitors"]["violated"] & own == 0


def test_an_area_beside_another_is_not_fallen_into_instead():
    name, failure = "saturn_v_as506", shut_down(240.0)
    _, unsteered = fly(with_areas(name), failure)
    latitude, longitude = unsteered.latitude_deg, unsteered.longitude_deg
    areas = [(latitude, longitude + east, 150e3) for east in (-7.0, -3.4, 0.0, 3.4)]
    _, impact = fly(with_areas(name, *areas), failure)
    assert impact.area is None
    assert impact.outside_m > 10e3


@pytest.mark.parametrize("seed", [None, 3])
def test_what_thrust_cannot_pass_is_not_entered(seed):
    """Put a wall across the track: the engines are cut off before it, or the thrust is reversed."""
    name, failure = "saturn_v_as506", shut_down(240.0)
    _, unsteered = fly(with_areas(name), failure, seed)
    # a circle that ends 800 km short of where it would fall, too wide to go round
    east = unsteered.longitude_deg + 12.0
    wall = with_areas(name, (unsteered.latitude_deg, east, 1900e3))
    steered, impact = fly(wall, failure, seed)
    assert impact.area is None
    assert impact.longitude_deg < unsteered.longitude_deg - 5.0
    assert steered.plant["inserted"] == 1 or steered.guidance["avoid"]["mode"] != AVOID_LOST


def test_at_no_time_with_thrust_is_the_impact_point_inside():
    name, failure = "saturn_v_as506", shut_down(200.0)
    _, unsteered = fly(with_areas(name), failure)
    area = (unsteered.latitude_deg, unsteered.longitude_deg, 250e3)
    mission = with_areas(name, area)
    simulator = Simulator(mission, CAMPAIGN, failure=failure)
    law = ready_law(mission)
    nearest = math.inf
    while not simulator.complete:
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
        impact = fallen(mission, simulator.plant)
        nearest = min(nearest, impact.outside_m)
    assert nearest > 0.0
    assert law.state["avoid"]["mode"] in (AVOID_CLEAR, AVOID_STEER, AVOID_CUT)


def test_what_cannot_be_avoided_is_said():
    """Fail inside an area that the remaining thrust cannot leave."""
    name, failure = "ares_v", low(600.0, 0.1)
    _, unsteered = fly(with_areas(name), failure)
    mission = with_areas(name, (unsteered.latitude_deg, unsteered.longitude_deg, 3000e3))
    flight, impact = fly(mission, failure)
    assert impact.area == "area 0"
    avoid = flight.guidance["avoid"]
    assert avoid["mode"] == AVOID_LOST
    assert describe_avoiding(avoid, mission.area_names) == (
        "no safe orbit is in reach: the impact point cannot be kept clear of area 0"
    )


def test_thrust_that_is_gone_at_once_leaves_nothing_to_decide():
    name, failure = "ares_v", shut_down(740.0)
    flight, impact = fly(load_mission(name), failure)
    assert impact.area == "Africa"
    assert flight.plant["time"] == pytest.approx(740.0, abs=1.1)
    assert flight.guidance["avoid"]["mode"] == AVOID_NOTHING


@pytest.mark.parametrize("name", ["ares_v", "saturn_v_as506"])
@pytest.mark.parametrize(
    "failure", [None, Failure(FailureKind.ENGINE_OUT, 250.0, thrust_ratio=0.8)]
)
def test_where_an_orbit_is_in_reach_areas_change_nothing(name, failure):
    plain, _ = fly(with_areas(name), failure)
    # the whole ground track
    areas = tuple((20.0, longitude, 3000e3) for longitude in (-70.0, -40.0, -10.0, 20.0))
    guarded, _ = fly(with_areas(name, *areas), failure)
    for key in ("position", "velocity", "mass", "time"):
        assert np.array_equal(plain.plant[key], guarded.plant[key])
    assert guarded.guidance["avoid"]["mode"] == AVOID_NOTHING


@pytest.mark.parametrize("law", ["igm", "optimal"])
def test_other_laws_do_so_too(law):
    name, failure = "saturn_v_as506", shut_down(240.0)
    _, unsteered = fly(with_areas(name), failure, law=law)
    area = (unsteered.latitude_deg, unsteered.longitude_deg, 150e3)
    _, impact = fly(with_areas(name, area), failure, law=law)
    assert impact.area is None
