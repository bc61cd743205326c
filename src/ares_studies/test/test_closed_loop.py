# SPDX-License-Identifier: Apache-2.0
"""Whole flights without ROS: accuracy, robustness, and agreement of both ways to fly."""

import math

import numpy as np
import pytest

from ares_guidance.settings import LawSettings
from ares_models.mission import load_mission
from ares_models.orbits import Elements
from ares_studies.closed_loop import fly_compiled, fly_stepwise, ready_law
from ares_trials.testing.arrivals import assert_inserted, assert_within, errors
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.arrays import CUTOFF, JETTISON_DONE
from ares_vehicle_sim.dispersions import Dispersions, NavigationErrors
from ares_vehicle_sim.simulator import SimulatorOptions


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


def test_default_mission(ares_v):
    flight = fly_compiled(ares_v)
    assert_inserted(ares_v, flight, [1.0, 0.01, 1e-4, 1e-3])
    assert flight.plant["mass"] >= 174_060.0
    drop = flight.events[flight.events["type"] == JETTISON_DONE][0]
    assert drop["heating_rate"] <= 1135.0
    assert drop["heating_rate"] == pytest.approx(1135.0, rel=2e-4)


@pytest.mark.parametrize("hold_time_s", [2.0, 5.0, 20.0, 40.0])
def test_accuracy_does_not_depend_on_the_hold(ares_v, hold_time_s):
    flight = fly_compiled(
        ares_v, law=ready_law(ares_v, settings=LawSettings(hold_time_s=hold_time_s))
    )
    assert_within(errors(ares_v, flight), [1.0, 0.01, 1e-4, 1e-3])


@pytest.mark.parametrize("cycle_period_s", [0.1, 0.5, 2.0, 5.0])
def test_accuracy_does_not_depend_on_the_cycle(ares_v, cycle_period_s):
    flight = fly_compiled(
        ares_v, law=ready_law(ares_v, settings=LawSettings(cycle_period_s=cycle_period_s))
    )
    assert_within(errors(ares_v, flight), [1.0, 0.01, 1e-4, 1e-3])
    assert flight.plant["mass"] >= 174_060.0


def test_saturn_with_two_shifts_two_coasts_three_drops_and_a_tail_off():
    mission = load_mission("saturn_v_as506")
    flight = fly_compiled(mission)
    assert_inserted(mission, flight, [10.0, 0.05, 1e-3, 1e-3])
    cutoff = flight.events[flight.events["type"] == CUTOFF][0]
    # flown on 16 July 1969: 699.34 s
    assert cutoff["time"] == pytest.approx(699.34, abs=6.0)


def test_delta_iii_to_a_transfer_orbit_with_its_perigee_in_place():
    mission = load_mission("delta_iii")
    flight = fly_compiled(mission)
    target = mission.arrays().target[0]
    flown = Elements.from_state(
        flight.plant["position"], flight.plant["velocity"], mission.environment.mu_m3_s2
    )
    assert flown.semi_major_axis == pytest.approx(float(target["semi_major_axis"]), abs=100.0)
    assert flown.eccentricity == pytest.approx(float(target["eccentricity"]), abs=1e-5)
    for name in ("inclination", "ascending_node", "argument_of_perigee"):
        assert getattr(flown, name) == pytest.approx(float(target[name]), abs=math.radians(1e-3))
    # published optimum 7,529.712 kg
    assert 7_520.0 < flight.plant["mass"] < 7_529.8


def test_both_ways_to_fly_agree(ares_v):
    dispersions = Dispersions(
        initial_position_m=1000.0,
        initial_velocity_m_s=10.0,
        thrust=0.01,
        specific_impulse=0.005,
        log_density=0.3,
        start_delay_s={"low": 0.0, "high": 1.0},
        latency_s=0.1,
        j2=1.0826e-3,
        navigation=NavigationErrors(
            position_bias_m=10.0, position_noise_m=5.0, velocity_noise_m_s=0.05, heating_noise=0.01
        ),
    )
    for flight in (0, 7):
        compiled = fly_compiled(ares_v, dispersions=dispersions, seed=3, flight=flight).plant
        stepped = fly_stepwise(ares_v, dispersions=dispersions, seed=3, flight=flight).plant
        assert compiled["time"] == pytest.approx(stepped["time"], rel=1e-12)
        assert compiled["mass"] == pytest.approx(stepped["mass"], rel=1e-12)
        assert compiled["position"] == pytest.approx(stepped["position"], rel=1e-12)


@pytest.mark.parametrize("seeds", one_in(10, [range(k, k + 100) for k in range(0, 1000, 100)]))
def test_a_thousand_dispersed_starts_all_arrive(ares_v, seeds):
    dispersions = Dispersions(initial_position_m=1000.0, initial_velocity_m_s=10.0)
    options = SimulatorOptions(navigation_period_s=1.0, integration_step_s=1.0)
    missed = []
    for seed in seeds:
        flight = fly_compiled(ares_v, options=options, dispersions=dispersions, seed=seed)
        found = np.abs(errors(ares_v, flight))
        if not flight.plant["inserted"] or np.any(found > [1.0, 0.01, 1e-4, 1e-3]):
            missed.append((seed, found))
        elif flight.plant["jettisoned"] != 1:
            missed.append((seed, "fairing still on"))
    assert not missed


@pytest.mark.parametrize(("law", "count"), [("peg", 200), ("igm", 100)])
@pytest.mark.trial
def test_thrust_impulse_mass_and_density_dispersions_arrive_too(ares_v, law, count):
    dispersions = Dispersions(
        initial_position_m=1000.0,
        initial_velocity_m_s=10.0,
        thrust=0.01,
        specific_impulse=0.005,
        stage_mass=0.002,
        jettison_mass=0.02,
        log_density=0.3,
        j2=1.0826e-3,
    )
    for seed in range(count):
        flight = fly_compiled(ares_v, dispersions=dispersions, seed=seed, law=law)
        assert_inserted(ares_v, flight, [100.0, 1.0, 0.01, 0.01])
        for drop in flight.events[flight.events["type"] == JETTISON_DONE]:
            assert drop["heating_rate"] <= 1135.0


def test_noisy_navigation_still_arrives(ares_v):
    noisy = Dispersions(
        navigation=NavigationErrors(
            position_noise_m=5.0,
            velocity_noise_m_s=0.05,
            sensed_delta_v_scale=1e-4,
            heating_noise=0.01,
        )
    )
    flight = fly_stepwise(ares_v, dispersions=noisy, seed=3)
    assert_inserted(ares_v, flight, [200.0, 1.0, 0.01, 0.01])
