# SPDX-License-Identifier: Apache-2.0
"""The plant against closed forms and an independent integrator."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ares_models.arrays import LONGEST_FLIGHT, MISSION_TIME, TIME_AFTER_IGNITION
from ares_models.kernels.thrust_curve import curve_area
from ares_trials.testing.craft import MU, Craft
from ares_vehicle_sim import arrays as names
from ares_vehicle_sim.kernels.entry import advance, command


def test_rocket_equation_without_gravity():
    vehicle = Craft(mu=0.0)
    plant = vehicle.fly(140.0)
    gained = plant["velocity"][1] - 2000.0
    mass = 300e3 - 90.0 * 1250.0
    assert plant["mass"] == pytest.approx(mass, rel=1e-14)
    assert gained == pytest.approx(4000.0 * math.log(300e3 / mass), abs=1e-6)
    assert plant["sensed_delta_v"] == pytest.approx([0.0, gained, 0.0], abs=1e-6)


@pytest.mark.parametrize("period", [0.1, 0.25, 1.0])
def test_events_stand_at_their_exact_times(period):
    vehicle = Craft(criterion=TIME_AFTER_IGNITION, value=7.0123)
    vehicle.steering["cutoff_time"] = 251.23456
    plant = vehicle.fly(260.0, period)
    assert vehicle.events(names.STAGING)["time"] == pytest.approx([150.0], abs=1e-9)
    assert vehicle.events(names.IGNITION)["time"] == pytest.approx([50.0, 160.0, 220.0], abs=1e-9)
    assert vehicle.events(names.JETTISON_DONE)["time"] == pytest.approx([167.0123], abs=1e-9)
    assert vehicle.events(names.CUTOFF)["time"] == pytest.approx([251.23456], abs=1e-9)
    assert plant["complete"] == 1
    assert plant["inserted"] == 1
    burnt = 60.0 * vehicle.arcs["mass_flow"][2] + 31.23456 * vehicle.arcs["mass_flow"][3]
    assert plant["mass"] == pytest.approx(110e3 - 2000.0 - burnt, abs=1e-6)


def test_agrees_with_an_independent_integrator():
    vehicle = Craft()
    vehicle.steering["direction"] = [0.6, 0.8, 0.0]
    vehicle.steering["direction_rate"] = [-4e-3, 3e-3, 1e-3]
    plant = vehicle.fly(150.0)

    def rates(t, x):
        r, v, m = x[:3], x[3:6], x[6]
        w = vehicle.steering["direction"][0] + (t - 50.0) * vehicle.steering["direction_rate"][0]
        thrust = 5.0e6 / m * w / np.linalg.norm(w)
        return [*v, *(thrust - MU * r / np.linalg.norm(r) ** 3), -1250.0]

    reference = solve_ivp(
        rates,
        (50.0, 150.0),
        [6.5e6, 0.0, 0.0, 500.0, 2000.0, 300.0, 300e3],
        method="DOP853",
        rtol=1e-13,
        atol=1e-9,
    ).y[:, -1]
    assert plant["position"] == pytest.approx(reference[:3], abs=1e-4)
    assert plant["velocity"] == pytest.approx(reference[3:6], abs=1e-6)


def test_thrust_curves_have_their_exact_area():
    vehicle = Craft(mu=0.0)
    arc = vehicle.arcs
    arc["start_knots"][2] = 3
    arc["start_time"][2, :3] = [0.0, 1.03, 3.17]
    arc["start_fraction"][2, :3] = arc["start_flow"][2, :3] = [0.0, 0.1, 1.0]
    arc["tail_knots"][3] = 3
    arc["tail_time"][3, :3] = [0.0, 0.256, 1.5]
    arc["tail_fraction"][3, :3] = [1.0, 0.17, 0.0]
    vehicle.steering["cutoff_time"] = 249.87
    plant = vehicle.fly(260.0)
    lost = 3.17 - (0.5 * 0.1 * 1.03 + 0.5 * 1.1 * 2.14)
    gained = 0.5 * 1.17 * 0.256 + 0.5 * 0.17 * 1.244
    burnt = (60.0 - lost) * arc["mass_flow"][2] + (29.87 + gained) * arc["mass_flow"][3]
    assert plant["mass"] == pytest.approx(110e3 - burnt, abs=1e-7)
    assert vehicle.events(names.FLIGHT_COMPLETE)["time"] == pytest.approx([251.37], abs=1e-9)
    assert curve_area(arc["start_time"][2], arc["start_fraction"][2], 3, 3.17) == pytest.approx(
        3.17 - lost
    )
    velocity = 4300.0 * math.log(110e3 / (110e3 - burnt))
    first = 4000.0 * math.log(300e3 / (300e3 - 125e3))
    assert plant["velocity"][1] == pytest.approx(2000.0 + first + velocity, abs=1e-3)


@pytest.mark.parametrize("own_flow", [False, True])
def test_a_solid_motor_burns_by_its_table(own_flow):
    vehicle = Craft(mu=0.0)
    arc = vehicle.arcs[2:3]
    times = [0.0, 0.2, 9.0, 31.5, 31.5, 48.0, 60.0]
    thrust = [0.0, 0.9, 1.0, 0.7, 0.65, 0.2, 0.0]
    flow = [0.0, 0.95, 0.97, 0.75, 0.7, 0.25, 0.0] if own_flow else thrust
    arc["tabled"] = 1
    arc["start_knots"] = 7
    arc["start_time"][0, :7] = times
    arc["start_fraction"][0, :7] = thrust
    arc["start_flow"][0, :7] = flow
    # propellant of the table, rounded as in a file
    arc["propellant"] = round(float(arc["mass_flow"][0]) * float(np.trapezoid(flow, times)), 6)
    plant = vehicle.fly(220.0)
    first = 4000.0 * math.log(300e3 / (300e3 - 125e3))
    speed, mass = 2000.0 + first, 110e3
    for k in range(6):
        if times[k + 1] == times[k]:
            continue

        def rates(t, x, k=k):
            w = (t - times[k]) / (times[k + 1] - times[k])
            force = 9.0e5 * (thrust[k] + w * (thrust[k + 1] - thrust[k]))
            taken = 9.0e5 / 4300.0 * (flow[k] + w * (flow[k + 1] - flow[k]))
            return [force / x[1], -taken]

        span = (times[k], times[k + 1])
        found = solve_ivp(rates, span, [speed, mass], method="DOP853", rtol=1e-13, atol=1e-9)
        speed, mass = found.y[:, -1]
    assert plant["velocity"][1] == pytest.approx(speed, rel=1e-9)
    assert plant["mass"] == pytest.approx(mass, rel=1e-9)
    assert vehicle.events(names.ARC_ENDED)["time"] == pytest.approx([150.0, 160.0, 220.0])
    assert len(vehicle.events(names.DEPLETION)) == 0


def test_commanded_jettison_between_navigation_states():
    vehicle = Craft()
    vehicle.steering["jettison"] = 0
    vehicle.steering["jettison_time"] = 187.654321
    plant = vehicle.fly(200.0)
    assert vehicle.events(names.JETTISON_DONE)["time"] == pytest.approx([187.654321], abs=1e-9)
    assert plant["jettisoned"] == 1


def test_jettison_waits_for_its_stage():
    vehicle = Craft(criterion=MISSION_TIME, value=120.0)
    vehicle.fly(200.0)
    assert vehicle.events(names.JETTISON_DONE)["time"] == pytest.approx([160.0], abs=1e-9)


def test_a_part_that_stays_on_is_carried_over_staging():
    vehicle = Craft(jettison_stage=0)
    assert vehicle.fly(155.0)["mass"] == pytest.approx(112e3)


def test_depletion_ends_a_flight_without_cutoff():
    vehicle = Craft()
    vehicle.arcs["propellant"][1:] = 20e3
    plant = vehicle.fly(300.0)
    left = 20e3 - 60.0 * vehicle.arcs["mass_flow"][2]
    spent = 220.0 + left / vehicle.arcs["mass_flow"][3]
    assert vehicle.events(names.DEPLETION)["time"] == pytest.approx([spent], abs=1e-6)
    assert plant["complete"] == 1
    assert plant["inserted"] == 0
    assert len(vehicle.events(names.CUTOFF)) == 0


def test_early_depletion_goes_on_to_the_next_stage():
    vehicle = Craft()
    vehicle.arcs["propellant"][0] = 110e3
    vehicle.fly(200.0)
    assert vehicle.events(names.DEPLETION)["time"] == pytest.approx([138.0], abs=1e-6)
    assert vehicle.events(names.STAGING)["time"] == pytest.approx([138.0], abs=1e-6)


def test_attitude_rate_limit():
    vehicle = Craft()
    vehicle.options["attitude_rate_limit"] = math.radians(3.0)
    vehicle.plant["velocity"] = [2000.0, 0.0, 0.0]
    plant = vehicle.fly(60.0)
    turned = math.degrees(math.atan2(plant["direction"][1], plant["direction"][0]))
    assert turned == pytest.approx(30.0, abs=0.1)
    assert np.linalg.norm(plant["direction"]) == pytest.approx(1.0, abs=1e-12)
    plant = vehicle.fly(100.0)
    assert plant["direction"] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)


def test_the_ground_ends_a_flight():
    vehicle = Craft()
    vehicle.plant["velocity"] = [-3000.0, 100.0, 0.0]
    vehicle.steering["direction"] = [-1.0, 0.0, 0.0]
    plant = vehicle.fly(200.0)
    assert len(vehicle.events(names.IMPACT)) == 1
    assert plant["complete"] == 1
    assert plant["inserted"] == 0


@pytest.mark.parametrize("latency", [0.0, 0.3])
def test_a_cut_off_that_was_predicted_is_flown_whatever_is_not_known_later(latency):
    """A law that was restarted has no solution yet: the engine does not burn on for that."""
    vehicle = Craft(mu=0.0)
    vehicle.plant["latency"] = latency
    vehicle.steering["cutoff_time"] = 249.25
    vehicle.fly(245.0)
    vehicle.steering["cutoff_time"] = math.nan
    for time in (245.5, 246.0, 260.0):
        assert command(vehicle.mission, vehicle.carried, vehicle.steering)
        advance(vehicle.mission, vehicle.carried, time)
    assert list(vehicle.events(names.CUTOFF)["time"]) == pytest.approx([249.25], abs=1e-9)


@pytest.mark.parametrize("latency", [0.0, 0.3])
def test_a_cut_off_that_nobody_has_predicted_does_not_come(latency):
    vehicle = Craft(mu=0.0)
    vehicle.plant["latency"] = latency
    vehicle.steering["cutoff_time"] = math.nan
    vehicle.fly(245.0)
    assert not len(vehicle.events(names.CUTOFF))


def test_a_command_is_in_force_after_its_latency():
    vehicle = Craft(mu=0.0)
    vehicle.plant["latency"] = 0.25
    vehicle.plant["velocity"] = [1000.0, 0.0, 0.0]
    plant = vehicle.fly(50.4)
    # along the velocity at first, then along y
    flow = vehicle.arcs["mass_flow"][0]
    expected = 4000.0 * np.log([300e3 / (300e3 - 0.25 * flow), 1.0])
    expected[1] = 4000.0 * math.log((300e3 - 0.25 * flow) / (300e3 - 0.4 * flow))
    assert plant["velocity"][:2] == pytest.approx([1000.0 + expected[0], expected[1]], abs=1e-9)


def test_no_command_is_taken_while_one_is_under_way():
    vehicle = Craft()
    plant = vehicle.plant[0]
    plant["latency"] = 0.25
    vehicle.begin()
    vehicle.steering["direction"] = [0.0, 0.0, 1.0]
    assert command(vehicle.mission, vehicle.carried, vehicle.steering)
    assert plant["pending"]["direction"] == pytest.approx([0.0, 1.0, 0.0])
    assert plant["pending_time"] == pytest.approx(50.25)


def test_a_flight_that_does_not_end_is_ended():
    vehicle = Craft(mu=0.0)
    vehicle.arcs["duration"][1] = 1e300
    vehicle.options["max_step"] = 100.0
    plant = vehicle.fly(2.0 * LONGEST_FLIGHT, period=1000.0)
    assert plant["complete"] == 1
    assert plant["inserted"] == 0
    (event,) = vehicle.events(names.TIME_LIMIT)
    assert event["time"] == pytest.approx(50.0 + LONGEST_FLIGHT, abs=1000.0)
    assert event["index"] == 1


@pytest.mark.parametrize("begin", [-1e308, -1e17, 1e17, math.nan])
def test_a_clock_that_cannot_advance_ends_the_flight(begin):
    vehicle = Craft()
    vehicle.plant["time"] = begin
    assert vehicle.fly(51.0)["complete"] == 1
    assert len(vehicle.events(names.TIME_LIMIT)) == 1


@pytest.mark.parametrize("step", [1e-9, 0.0, math.nan])
def test_steps_without_number_end_the_flight(step):
    vehicle = Craft()
    vehicle.options["max_step"] = step
    assert vehicle.fly(51.0)["complete"] == 1
    assert len(vehicle.events(names.TIME_LIMIT)) == 1


def test_a_last_arc_of_fixed_length_is_not_followed_by_another():
    vehicle = Craft(mu=0.0)
    vehicle.arcs["duration"][3] = 20.0
    plant = vehicle.fly(400.0)
    assert plant["arc"] == 3


def test_there_is_room_for_every_event_of_the_longest_mission():
    """Eight stages of three arcs, engines lost in each, and eight jettisons."""
    vehicle = Craft(mu=0.0)
    arcs = np.repeat(vehicle.arcs[:1], 48)
    arcs["stage"] = np.arange(48) // 6
    arcs["begins_stage"] = np.arange(48) % 6 == 0
    arcs["duration"] = 1.0
    arcs["duration"][-1] = math.inf
    arcs["propellant"] = 6.5 * arcs["mass_flow"]
    vehicle.arcs = arcs
    vehicle.jettisons = np.repeat(vehicle.jettisons, 8)
    vehicle.jettisons["criterion"] = MISSION_TIME
    vehicle.jettisons["value"] = 60.0
    vehicle.jettisons["stage"] = 0
    plant = vehicle.fly(110.0)
    assert plant["complete"] == 1
    assert len(vehicle.events(names.IGNITION)) == 48
    assert plant["events"][plant["event_count"] - 1]["type"] == names.FLIGHT_COMPLETE
    assert plant["event_count"] < names.MAX_EVENTS
