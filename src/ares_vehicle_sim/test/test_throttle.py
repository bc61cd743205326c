# SPDX-License-Identifier: Apache-2.0
"""Throttled burns against their closed form, and burns in held attitude."""

import math

import numpy as np
import pytest

from ares_trials.testing.craft import Craft
from ares_vehicle_sim import arrays as names
from ares_vehicle_sim.kernels.entry import advance, command, describe

MASS, FLOW, VE = 300e3, 1250.0, 4000.0


def craft(limit, least=0.0):
    """Its first burn is throttled; no gravity."""
    vehicle = Craft(mu=0.0)
    vehicle.arcs["max_acceleration"][0] = limit
    vehicle.arcs["min_throttle"][0] = least
    return vehicle


def flown(limit, least, span):
    """Return the velocity gained and the mass, regime by regime."""
    upper = min(MASS, VE * FLOW / limit)
    lower = least * VE * FLOW / limit
    full = min(span, (MASS - upper) / FLOW)
    mass = MASS - FLOW * full
    gained = VE * math.log(MASS / mass)
    limited = min(span - full, VE / limit * math.log(mass / lower) if lower > 0.0 else math.inf)
    mass *= math.exp(-limit * limited / VE)
    gained += limit * limited
    rest = span - full - limited
    end = mass - least * FLOW * rest
    return gained + VE * math.log(mass / end), end


@pytest.mark.parametrize("period", [0.1, 1.0])
@pytest.mark.parametrize(
    ("limit", "least"), [(20.0, 0.0), (20.0, 0.9), (12.0, 0.5), (20.0, 1.0), (18.0, 0.97)]
)
def test_velocity_gained_by_a_throttled_burn(limit, least, period):
    vehicle = craft(limit, least)
    vehicle.options["max_step"] = period
    plant = vehicle.fly(149.0, period)
    gained, mass = flown(limit, least, 99.0)
    assert plant["mass"] == pytest.approx(mass, rel=1e-12)
    assert plant["propellant_used"] == pytest.approx(MASS - mass, rel=1e-10)
    assert plant["velocity"][1] - 2000.0 == pytest.approx(gained, abs=1e-4 * period**4 + 1e-7)
    assert plant["sensed_delta_v"][1] == pytest.approx(gained, abs=1e-4 * period**4 + 1e-7)


def test_the_limit_is_what_is_told():
    vehicle = craft(20.0, 0.9)
    plant = vehicle.fly(105.0)
    describe(vehicle.mission, vehicle.carried)
    truth = vehicle.carried.truth[0]
    assert truth["thrust"] == pytest.approx(20.0 * plant["mass"])
    assert truth["mass_flow"] == pytest.approx(20.0 * plant["mass"] / VE)


def test_a_throttled_burn_ends_with_its_propellant():
    vehicle = craft(20.0, 0.9)
    vehicle.arcs["propellant"][0] = 100e3
    vehicle.fly(155.0)
    (spent,) = vehicle.events(names.DEPLETION)["time"]
    assert flown(20.0, 0.9, spent - 50.0)[1] == pytest.approx(200e3, abs=1e-3)


def test_a_part_that_drops_in_a_throttled_burn():
    vehicle = Craft(mu=0.0, criterion=1, value=100.0, jettison_stage=0)
    vehicle.arcs["max_acceleration"][0] = 12.0
    plant = vehicle.fly(140.0)
    assert plant["mass"] == pytest.approx(
        (MASS * math.exp(-12.0 * 50.0 / VE) - 2000.0) * math.exp(-12.0 * 40.0 / VE), rel=1e-12
    )
    assert plant["velocity"][1] == pytest.approx(2000.0 + 12.0 * 90.0, abs=1e-6)


def test_a_throttled_engine_that_starts_late():
    vehicle = craft(12.0)
    arcs = vehicle.arcs
    arcs["start_knots"][0] = 2
    arcs["start_time"][0, :2] = 1.5
    arcs["start_fraction"][0, :2] = arcs["start_flow"][0, :2] = [0.0, 1.0]
    plant = vehicle.fly(60.0)
    assert plant["velocity"][1] == pytest.approx(2000.0 + 12.0 * 8.5, abs=1e-7)


def test_a_held_burn_keeps_the_direction_commanded_at_ignition():
    vehicle = Craft(mu=0.0)
    vehicle.arcs["held"][0] = 1
    vehicle.plant["velocity"] = [2000.0, 0.0, 0.0]
    vehicle.steering["direction_rate"] = [0.0, 0.0, 1e-3]
    vehicle.begin()
    advance(vehicle.mission, vehicle.carried, 60.0)
    vehicle.steering["direction"] = [0.0, 0.0, 1.0]
    vehicle.steering["direction_rate"] = 0.0
    assert command(vehicle.mission, vehicle.carried, vehicle.steering)
    advance(vehicle.mission, vehicle.carried, 149.0)
    plant = vehicle.plant[0]
    gained = VE * math.log(MASS / (MASS - 99.0 * FLOW))
    assert plant["velocity"] == pytest.approx([2000.0, gained, 0.0], abs=1e-6)
    assert plant["direction"] == pytest.approx([0.0, 1.0, 0.0])
    advance(vehicle.mission, vehicle.carried, 161.0)
    assert plant["direction"] == pytest.approx([0.0, 0.0, 1.0])


def test_a_held_burn_after_a_coast_begins_where_the_command_points_then():
    vehicle = Craft(mu=0.0)
    vehicle.arcs["held"][2] = 1
    vehicle.steering["direction_rate"] = [0.0, 0.0, 0.02]
    plant = vehicle.fly(170.0)
    expected = np.array([0.0, 1.0, 0.02 * 110.0])
    assert plant["direction"] == pytest.approx(expected / np.linalg.norm(expected))
