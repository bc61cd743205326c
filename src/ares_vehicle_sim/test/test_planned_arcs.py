# SPDX-License-Identifier: Apache-2.0
"""Free arcs: the plant ends them as planned, to the nanosecond, within their bounds."""

import math

import pytest

from ares_trials.testing.craft import Craft
from ares_vehicle_sim import arrays as names
from ares_vehicle_sim.kernels.entry import advance, command, next_tick

COAST_ARC, BURN_ARC = 1, 2


def craft(**bounds):
    """Return a vehicle with a free coast from 150 s, a free burn and a last burn."""
    vehicle = Craft(mu=0.0)
    arcs = vehicle.arcs
    arcs["duration"][1:3] = math.inf
    arcs["shortest"][1:3] = 0.0
    arcs["longest"][1:3] = math.inf
    for name, value in bounds.items():
        arcs[name][COAST_ARC] = value
    return vehicle


def ends(vehicle):
    return list(vehicle.events(names.ARC_ENDED)["time"])


@pytest.mark.parametrize("period", [0.1, 1.0])
def test_free_arcs_end_as_planned(period):
    vehicle = craft()
    vehicle.steering["arc_end_times"][0, COAST_ARC] = 171.2345678
    vehicle.steering["arc_end_times"][0, BURN_ARC] = 190.8765432
    vehicle.steering["cutoff_time"] = 195.5
    plant = vehicle.fly(200.0, period)
    assert ends(vehicle) == pytest.approx([150.0, 171.2345678, 190.8765432], abs=1e-9)
    assert list(vehicle.events(names.IGNITION)["time"]) == pytest.approx(
        [50.0, 171.2345678, 190.8765432], abs=1e-9
    )
    assert list(vehicle.events(names.CUTOFF)["time"]) == pytest.approx([195.5], abs=1e-9)
    flow = vehicle.arcs["mass_flow"]
    burnt = (190.8765432 - 171.2345678) * flow[2] + (195.5 - 190.8765432) * flow[3]
    assert plant["mass"] == pytest.approx(110e3 - burnt, abs=1e-6)


@pytest.mark.parametrize(
    ("planned", "bounds", "end"),
    [
        (160.0, {"shortest": 20.0}, 170.0),
        (math.nan, {"shortest": 20.0, "longest": 40.0}, 190.0),
        (500.0, {"longest": 40.0}, 190.0),
        (120.0, {}, 150.0),
    ],
)
def test_bounds_of_a_coast(planned, bounds, end):
    vehicle = craft(**bounds)
    vehicle.steering["arc_end_times"][0, COAST_ARC] = planned
    vehicle.fly(195.0)
    assert ends(vehicle)[1] == pytest.approx(end, abs=1e-9)


def test_a_burn_without_a_plan_goes_on_to_its_propellant():
    vehicle = craft(longest=10.0)
    vehicle.arcs["propellant"][1:] = 20e3
    vehicle.fly(400.0)
    spent = 160.0 + 20e3 / vehicle.arcs["mass_flow"][BURN_ARC]
    assert list(vehicle.events(names.DEPLETION)["time"]) == pytest.approx([spent], abs=1e-6)


def test_what_is_not_known_any_more_stays():
    vehicle = craft()
    vehicle.steering["arc_end_times"][0, COAST_ARC] = 171.5
    vehicle.begin()
    vehicle.steering["arc_end_times"] = math.nan
    assert command(vehicle.mission, vehicle.carried, vehicle.steering)
    advance(vehicle.mission, vehicle.carried, 180.0)
    assert ends(vehicle) == pytest.approx([150.0, 171.5], abs=1e-9)


def test_the_plan_of_a_command_under_way_counts_when_it_arrives():
    vehicle = craft()
    vehicle.plant["latency"] = 150.0
    vehicle.steering["arc_end_times"][0, COAST_ARC] = 171.5
    vehicle.fly(210.0)
    assert ends(vehicle)[1] == pytest.approx(200.0, abs=1e-9)


def test_a_plan_that_is_past_ends_the_arc_at_once():
    vehicle = craft()
    vehicle.begin()
    advance(vehicle.mission, vehicle.carried, 165.0)
    vehicle.steering["arc_end_times"][0, COAST_ARC] = 160.0
    assert command(vehicle.mission, vehicle.carried, vehicle.steering)
    advance(vehicle.mission, vehicle.carried, 166.0)
    assert ends(vehicle) == pytest.approx([150.0, 165.0], abs=1e-9)


@pytest.mark.parametrize(
    ("end", "ticks"),
    [(math.nan, 1), (249.0, 1), (251.5, 10), (10_149.0, 10), (10_151.5, 100)],
    ids=["not planned", "short", "long", "nearly very long", "very long"],
)
def test_navigation_states_are_further_apart_in_long_coasts(end, ticks):
    vehicle = craft()
    vehicle.steering["arc_end_times"][0, COAST_ARC] = end
    vehicle.begin()
    vehicle.carried.options["navigation_period"] = 0.1
    advance(vehicle.mission, vehicle.carried, 149.0)
    assert next_tick(vehicle.mission, vehicle.carried, 7) == 8
    advance(vehicle.mission, vehicle.carried, 151.0)
    assert next_tick(vehicle.mission, vehicle.carried, 7) == 7 + ticks


def test_the_cut_off_is_that_of_the_last_arc():
    vehicle = craft()
    vehicle.steering["arc_end_times"][0, COAST_ARC] = 171.5
    vehicle.steering["cutoff_time"] = 172.0
    plant = vehicle.fly(180.0)
    assert plant["arc"] == BURN_ARC
    assert plant["inserted"] == 0


def test_where_only_the_last_arc_is_free_an_earlier_burn_is_cut_off():
    vehicle = Craft(mu=0.0)
    vehicle.steering["cutoff_time"] = 120.5
    plant = vehicle.fly(130.0)
    assert plant["inserted"] == 1
    assert list(vehicle.events(names.CUTOFF)["time"]) == pytest.approx([120.5], abs=1e-9)


def test_a_last_burn_of_fixed_length_ends_by_the_clock():
    vehicle = craft(longest=10.0)
    for name in ("duration", "shortest", "longest"):
        vehicle.arcs[name][3] = 12.3456
    vehicle.steering["arc_end_times"][0, BURN_ARC] = 180.5
    vehicle.steering["cutoff_time"] = 185.0
    plant = vehicle.fly(200.0)
    assert plant["inserted"] == 1
    assert plant["complete"] == 1
    assert list(vehicle.events(names.CUTOFF)["time"]) == pytest.approx([192.8456], abs=1e-9)


def test_bounds_of_the_last_arc():
    vehicle = Craft(mu=0.0)
    vehicle.arcs["longest"][3] = 30.0
    vehicle.fly(260.0)
    assert list(vehicle.events(names.CUTOFF)["time"]) == pytest.approx([250.0], abs=1e-9)


@pytest.mark.parametrize("end", [math.inf, -math.inf])
def test_an_end_that_is_no_time_is_refused(end):
    vehicle = craft()
    vehicle.begin()
    vehicle.steering["arc_end_times"][0, COAST_ARC] = end
    assert not command(vehicle.mission, vehicle.carried, vehicle.steering)
