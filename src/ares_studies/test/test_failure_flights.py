# SPDX-License-Identifier: Apache-2.0
"""Failures in flight: detected on board, and flown to the best end within reach."""

import math

import numpy as np
import pytest

from ares_guidance.arrays import (
    FOUND_EARLY_END,
    FOUND_ENGINE_LOST,
    FOUND_NO_IGNITION,
    FOUND_NOTHING,
    FOUND_STUCK_JETTISON,
    FOUND_STUCK_THROTTLE,
    FOUND_THRUST_LOW,
)
from ares_models.failures import Failure, FailureKind
from ares_models.mission import load_mission
from ares_models.mission_parts import AbortPart
from ares_models.orbits import Insertion
from ares_studies.closed_loop import fly_compiled
from ares_trials.testing.arrivals import assert_inserted
from ares_vehicle_sim.simulator import CAMPAIGN


@pytest.mark.parametrize("name", ["ares_v", "saturn_v_as506", "space_shuttle_sts121"])
def test_nothing_is_found_where_nothing_fails(name):
    flight = fly_compiled(load_mission(name), CAMPAIGN)
    assert flight.guidance["found"]["kind"] == FOUND_NOTHING
    assert flight.guidance["left"]["count"] == 0


# masses of the optimum that knew of the loss from the start, kg
@pytest.mark.parametrize(
    ("name", "at", "best_kg"),
    [
        ("ares_v", 200.0, 168_882.0),
        ("ares_v", 250.0, 171_502.0),
        ("ares_v", 300.0, 173_333.0),
        ("saturn_v_as506", 168.0, 126_548.0),
        ("saturn_v_as506", 300.0, 132_669.0),
        ("saturn_v_as506", 470.0, 136_007.0),
        ("saturn_v_as506", 600.0, 136_372.0),
    ],
)
def test_with_an_engine_lost_little_is_lost_against_knowing_it_all_along(name, at, best_kg):
    mission = load_mission(name)
    lost = Failure(FailureKind.ENGINE_OUT, at, thrust_ratio=0.8)
    flight = fly_compiled(mission, CAMPAIGN, failure=lost)
    assert_inserted(mission, flight)
    assert best_kg * 0.995 < flight.plant["mass"] < best_kg
    found = flight.guidance["found"]
    # the last stage of the second mission has one engine, which cannot lose one
    assert found["kind"] == (FOUND_ENGINE_LOST if at < 550.0 else FOUND_THRUST_LOW)
    assert at < found["first_time"] <= at + 2.0


@pytest.mark.parametrize(
    ("name", "failure", "kind", "within"),
    [
        (
            "ares_v",
            Failure(FailureKind.THRUST_LOW, 400.3, thrust_ratio=0.9, flow_ratio=1.0),
            FOUND_THRUST_LOW,
            (400.3, 402.3),
        ),
        ("ares_v", Failure(FailureKind.EARLY_SHUTDOWN, 330.3), FOUND_EARLY_END, (330.3, 332.3)),
        (
            "saturn_v_as506",
            Failure(FailureKind.FAILED_IGNITION, arc=3),
            FOUND_NO_IGNITION,
            (498.0, 500.0),
        ),
        (
            "saturn_v_as506",
            Failure(FailureKind.STUCK_JETTISON, jettison=1),
            FOUND_STUCK_JETTISON,
            (192.3, 194.3),
        ),
        ("ares_v", Failure(FailureKind.STUCK_JETTISON, jettison=0), FOUND_STUCK_JETTISON, None),
        (
            "space_shuttle_sts121",
            Failure(FailureKind.STUCK_THROTTLE, 480.3),
            FOUND_STUCK_THROTTLE,
            (480.3, 482.3),
        ),
    ],
)
def test_it_is_found_within_two_seconds_and_flown_to_the_target(name, failure, kind, within):
    mission = load_mission(name)
    flight = fly_compiled(mission, CAMPAIGN, failure=failure)
    found = flight.guidance["found"]
    assert found["kind"] == kind
    if within:
        assert within[0] < found["time"] <= within[1]
    assert_inserted(mission, flight)


# masses of the optimum that is told of it then, kg
@pytest.mark.parametrize(
    ("name", "at", "ratio", "best_kg"),
    [
        ("ares_v", 160.0, 0.9, 139_372.0),
        ("ares_v", 240.0, 0.7, 114_419.0),
        ("ares_v", 240.4, 0.7, 114_700.0),
        ("saturn_v_as506", 240.0, 0.7, 73_550.0),
    ],
)
def test_no_whole_number_of_engines_is_lost_so_the_clock_ends_the_burn(name, at, ratio, best_kg):
    mission = load_mission(name)
    weak = Failure(FailureKind.THRUST_LOW, at, thrust_ratio=ratio, flow_ratio=ratio)
    flight = fly_compiled(mission, CAMPAIGN, failure=weak)
    assert_inserted(mission, flight)
    assert flight.plant["mass"] > 0.995 * best_kg
    assert flight.guidance["found"]["kind"] == FOUND_THRUST_LOW


def test_a_burn_that_the_clock_does_not_end_goes_on_as_one_that_has_lost_engines():
    mission = load_mission("ares_v")
    lost = Failure(FailureKind.ENGINE_OUT, 300.0, thrust_ratio=0.7)
    flight = fly_compiled(mission, CAMPAIGN, failure=lost)
    assert_inserted(mission, flight)
    assert flight.guidance["found"]["kind"] == FOUND_ENGINE_LOST


def test_a_weak_engine_behind_a_throttle_takes_more_propellant():
    mission = load_mission("space_shuttle_sts121")
    weak = Failure(FailureKind.THRUST_LOW, 480.0, thrust_ratio=0.95, flow_ratio=1.0)
    flight = fly_compiled(mission, CAMPAIGN, failure=weak)
    # a tank that has nothing to spare
    assert flight.guidance["lowered"] > 0.0
    found = flight.guidance["found"]
    assert found["kind"] == FOUND_THRUST_LOW
    assert 480.0 < found["time"] <= 482.0
    assert found["ratio"] == pytest.approx(0.95, abs=2e-3)


@pytest.mark.parametrize(("at", "best_kg"), [(736.0, 174_147.0), (752.0, 174_177.0)])
def test_at_the_very_end_the_radius_is_let_go_rather_than_the_mass(at, best_kg):
    mission = load_mission("ares_v")
    weak = Failure(FailureKind.THRUST_LOW, at, thrust_ratio=0.7, flow_ratio=0.7)
    plant = fly_compiled(mission, CAMPAIGN, failure=weak).plant
    assert plant["mass"] > 0.995 * best_kg
    flown = Insertion.from_state(plant["position"], plant["velocity"])
    target = mission.arrays().target[0]
    assert 100.0 < flown.radius - target["radius"] < 3_000.0
    assert flown.flight_path_angle == pytest.approx(
        target["flight_path_angle"], abs=math.radians(1e-3)
    )
    mu = mission.environment.mu_m3_s2
    energies = [
        0.5 * s**2 - mu / r
        for s, r in ((flown.speed, flown.radius), (target["speed"], target["radius"]))
    ]
    assert (energies[0] - energies[1]) / target["speed"] == pytest.approx(0.0, abs=0.1)


def test_a_fairing_that_does_not_go_is_planned_with_its_mass():
    mission = load_mission("ares_v")
    stuck = fly_compiled(
        mission, CAMPAIGN, failure=Failure(FailureKind.STUCK_JETTISON, jettison=0)
    ).plant["mass"]
    whole = fly_compiled(mission, CAMPAIGN).plant["mass"]
    assert 0.0 < stuck - whole < mission.jettisons[0].mass_kg


SAFE_M = 140_000.0


def with_safe_orbit(mission):
    """Add a section `abort` to a mission."""
    return mission.model_copy(update={"abort": AbortPart(safe_perigee_altitude_m=SAFE_M)})


@pytest.mark.parametrize(
    ("at", "radius_m", "slower_m_s"),
    [(350.0, 6_563_366.0, 377.0), (364.0, 6_378_165.0 + SAFE_M, -27.0), (380.0, 6_563_366.0, 0.0)],
)
def test_the_ends_in_their_order(at, radius_m, slower_m_s):
    mission = with_safe_orbit(load_mission("saturn_v_as506"))
    shut_down = Failure(FailureKind.EARLY_SHUTDOWN, at)
    plant = fly_compiled(mission, CAMPAIGN, failure=shut_down).plant
    assert plant["inserted"] == 1
    flown = Insertion.from_state(plant["position"], plant["velocity"])
    target = mission.arrays().target[0]
    assert flown.radius == pytest.approx(radius_m, abs=100.0)
    assert target["speed"] - flown.speed == pytest.approx(slower_m_s, abs=1.0)
    assert flown.flight_path_angle == pytest.approx(0.0, abs=math.radians(0.01))


@pytest.mark.parametrize("law", ["igm", "optimal"])
def test_other_laws_plan_with_the_vehicle_that_is_left(law):
    mission = load_mission("ares_v")
    lost = Failure(FailureKind.ENGINE_OUT, 250.0, thrust_ratio=0.8)
    flight = fly_compiled(mission, CAMPAIGN, law=law, failure=lost)
    assert_inserted(mission, flight)
    assert 0.995 * 171_502.0 < flight.plant["mass"] < 171_502.0


def test_a_failure_does_not_outlive_its_flight():
    mission = load_mission("ares_v")
    whole = fly_compiled(mission).plant["mass"]
    fly_compiled(mission, failure=Failure(FailureKind.EARLY_SHUTDOWN, 330.0))
    assert np.array_equal(fly_compiled(mission).plant["mass"], whole)
