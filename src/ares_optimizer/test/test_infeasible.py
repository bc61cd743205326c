# SPDX-License-Identifier: Apache-2.0
"""Test missions that cannot be flown: a named cause, never a wrong success."""

import math

import pytest

from ares_models.mission import load_mission
from ares_optimizer.solve import solve


@pytest.fixture(scope="module")
def ares_v():
    mission = load_mission("ares_v")
    for heating in ("at_jettison", "from_jettison"):
        solve(mission, heating=heating)
    return mission


def refused(mission, change, method="direct11", **options):
    arrays = mission.arrays()
    change(arrays)
    solution = solve(arrays, method, state=mission.start().navigation(), **options)
    assert not solution.converged
    return solution


@pytest.mark.parametrize("propellant", [30_000.0, 100_000.0, 127_000.0])
def test_too_little_propellant(ares_v, propellant):
    def change(arrays):
        arrays.arcs["propellant"][1] = propellant

    solution = refused(ares_v, change)
    short = 127_817.0 - propellant
    assert solution.reason.startswith("propellant of the last stage: ")
    assert f"{short:,.0f} kg short" in solution.reason
    row = next(c for c in solution.constraints if c.name == "propellant of the last stage")
    assert not row.satisfied
    assert row.value == pytest.approx(127_817.0, abs=2.0)
    assert row.limit == propellant


@pytest.mark.parametrize("method", ["direct11", "direct20", "jump"])
def test_target_below_the_surface(ares_v, method):
    def change(arrays):
        arrays.target["radius"] = 6_300_000.0

    solution = refused(ares_v, change, method)
    assert solution.reason == (
        "target radius 6,300,000 m is 56,750 m below the surface (6,356,750 m)"
    )
    assert math.isnan(solution.m_f_kg)
    assert solution.verification is None


def test_orbit_below_the_surface():
    mission = load_mission("delta_iii")

    def change(arrays):
        arrays.target["semi_major_axis"] = 5.0e6
        arrays.target["eccentricity"] = 0.1

    assert "target apogee radius" in refused(mission, change).reason


def test_jettison_limit_never_met(ares_v):
    # the target orbit itself is 60 km up: the fairing would burn off
    def change(arrays):
        arrays.target["radius"] = 6_400_000.0
        arrays.target["flight_path_angle"] = 0.0
        arrays.arcs["propellant"][1] = 150_000.0
        arrays.jettisons["value"] = 1e-9

    solution = refused(ares_v, change)
    assert "heating limit of jettison 0: 1e-09 W/m2 is not met by any flight" in solution.reason
    assert "too much" in solution.reason


def test_limit_that_costs_more_propellant_than_there_is(ares_v):
    # 127,424 kg suffice without the limit, 127,817 kg are needed with it
    def change(arrays):
        arrays.arcs["propellant"][1] = 127_600.0

    solution = refused(ares_v, change)
    assert solution.reason.startswith("heating limit of jettison 0: 1,135 W/m2 is not met")


def test_thrust_that_cannot_carry(ares_v):
    def change(arrays):
        arrays.arcs["thrust"] *= 0.5
        arrays.arcs["mass_flow"] *= 0.5

    solution = refused(ares_v, change)
    assert solution.reason.startswith("no flight to the target found, the nearest: ")
    assert " off by " in solution.reason


def test_speed_beyond_the_vehicle(ares_v):
    def change(arrays):
        arrays.target["speed"] = 20_000.0

    assert "kg short" in refused(ares_v, change).reason


def test_flight_through_the_ground(ares_v):
    def change(arrays):
        arrays.arcs["thrust"][1] *= 0.2
        arrays.arcs["mass_flow"][1] *= 0.2

    assert "through the ground" in refused(ares_v, change).reason
