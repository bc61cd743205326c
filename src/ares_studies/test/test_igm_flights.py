# SPDX-License-Identifier: Apache-2.0
"""Whole flights under the iterative guidance mode: accuracy, robustness, cost."""

import math
from importlib import resources

import pytest
import yaml

from ares_guidance.laws import make_law
from ares_guidance.settings import LawSettings
from ares_models.mission import load_mission
from ares_models.orbits import Elements, Insertion
from ares_studies.closed_loop import Flight, fly_compiled, fly_stepwise, ready_law
from ares_trials.testing.arrivals import assert_inserted, assert_within, errors
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.arrays import CUTOFF, JETTISON_DONE
from ares_vehicle_sim.dispersions import Dispersions, NavigationErrors
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions

ASKED = [10.0, 0.05, 1e-3, 1e-3]


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


@pytest.fixture(scope="module")
def as506():
    return load_mission("saturn_v_as506")


@pytest.fixture
def changed(tmp_path):
    """Return a function that loads a shipped mission with a changed file."""

    def load(name, change):
        shipped = resources.files("ares_models").joinpath("missions", f"{name}.yaml")
        content = yaml.safe_load(shipped.read_text())
        change(content)
        path = tmp_path / f"{name}.yaml"
        path.write_text(yaml.safe_dump(content))
        return load_mission(path)

    return load


def first(flight, kind):
    return flight.events[flight.events["type"] == kind][0]


@pytest.mark.parametrize("name", ["ares_v", "saturn_v_as506"])
@pytest.mark.parametrize("navigation_period_s", [0.1, 1.0])
@pytest.mark.parametrize("cycle_period_s", [1.0, 2.0])
def test_asked_accuracy(name, navigation_period_s, cycle_period_s):
    mission = load_mission(name)
    flight = fly_compiled(
        mission,
        SimulatorOptions(navigation_period_s=navigation_period_s),
        law=ready_law(mission, "igm", LawSettings(cycle_period_s=cycle_period_s)),
    )
    assert_inserted(mission, flight, [0.1, 1e-4, 1e-4, 1e-6])


@pytest.mark.parametrize("name", ["ares_v", "saturn_v_as506"])
@pytest.mark.parametrize("hold_time_s", [2.0, 5.0, 20.0, 40.0])
def test_accuracy_bears_any_hold(name, hold_time_s):
    mission = load_mission(name)
    flight = fly_compiled(
        mission, law=ready_law(mission, "igm", LawSettings(hold_time_s=hold_time_s))
    )
    assert_within(errors(mission, flight), ASKED)


def test_one_pass_a_cycle_as_the_flight_computer_had_is_enough(ares_v):
    once = LawSettings(velocity_to_go_tolerance_m_s=100.0, jettison_time_tolerance_s=100.0)
    flight = fly_compiled(ares_v, law=ready_law(ares_v, "igm", once))
    assert flight.guidance["total_iterations"] < 1.01 * flight.guidance["cycle"]
    assert_within(errors(ares_v, flight), ASKED)


def test_a_transfer_orbit_with_its_perigee_in_place():
    mission = load_mission("delta_iii")
    flight = fly_compiled(mission, law="igm")
    target = mission.arrays().target[0]
    flown = Elements.from_state(
        flight.plant["position"], flight.plant["velocity"], mission.environment.mu_m3_s2
    )
    assert flown.semi_major_axis == pytest.approx(float(target["semi_major_axis"]), abs=10.0)
    assert flown.eccentricity == pytest.approx(float(target["eccentricity"]), abs=1e-6)
    for name in ("inclination", "ascending_node", "argument_of_perigee"):
        assert getattr(flown, name) == pytest.approx(float(target[name]), abs=math.radians(1e-3))
    # published optimum 7,529.712 kg
    assert 7_529.3 < flight.plant["mass"] < 7_529.72


def test_the_fairing_goes_when_the_heating_allows_and_the_mass_is_a_little_less(ares_v, changed):
    flight = fly_compiled(ares_v, law="igm")
    drop = first(flight, JETTISON_DONE)
    assert drop["heating_rate"] <= 1135.0
    assert drop["heating_rate"] == pytest.approx(1135.0, rel=2e-4)
    peg = fly_compiled(ares_v)
    cost = peg.plant["mass"] - flight.plant["mass"]
    assert 30.0 < cost < 40.0

    def drop_by_time(content):
        del content["jettisons"][0]["heating_limit_w_m2"]
        content["jettisons"][0]["time_s"] = 438.36

    # two thirds of that is the later drop; the rest is what mean gravity costs in steering
    same_drop = changed("ares_v", drop_by_time)
    masses = [fly_compiled(same_drop, law=law).plant["mass"] for law in ("peg", "igm")]
    assert 10.0 < masses[0] - masses[1] < 14.0


@pytest.mark.parametrize("name", one_in(3, ["ares_v", "saturn_v_as506", "delta_iii"]))
def test_a_hundred_dispersed_starts_all_arrive(name):
    mission = load_mission(name)
    dispersions = Dispersions(initial_position_m=1000.0, initial_velocity_m_s=10.0)
    for seed in range(100):
        flight = fly_compiled(mission, dispersions=dispersions, seed=seed, law="igm")
        assert flight.plant["inserted"] == 1, seed
        assert flight.guidance["error"] == 0, seed
        if name == "delta_iii":
            flown = Elements.from_state(
                flight.plant["position"], flight.plant["velocity"], mission.environment.mu_m3_s2
            )
            assert flown.semi_major_axis == pytest.approx(24_361_140.0, abs=10.0)
        else:
            assert_within(errors(mission, flight), ASKED)


@pytest.mark.parametrize("name", ["ares_v", "saturn_v_as506"])
@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_thrust_a_tenth_off_the_mission_file_costs_no_accuracy(name, factor):
    mission = load_mission(name)
    believed = mission.arrays()
    believed.arcs["thrust"] *= factor
    believed.arcs["mass_flow"] *= factor
    simulator = Simulator(mission)
    guide = make_law("igm", believed)
    while not simulator.complete:
        guide.step(simulator.navigation)
        simulator.command(guide.steering)
        simulator.advance()
    assert_inserted(mission, Flight(simulator.plant, guide.state), ASKED)


def test_noise_arrives_too(ares_v):
    noisy = Dispersions(
        navigation=NavigationErrors(
            position_noise_m=5.0,
            velocity_noise_m_s=0.05,
            sensed_delta_v_scale=1e-4,
            heating_noise=0.01,
        )
    )
    flight = fly_stepwise(ares_v, dispersions=noisy, seed=3, law="igm")
    assert_within(errors(ares_v, flight), [200.0, 1.0, 0.01, 0.01])


@pytest.mark.parametrize("name", ["ares_v", "saturn_v_as506"])
def test_both_ways_to_fly_agree(name):
    mission = load_mission(name)
    dispersions = Dispersions(initial_position_m=1000.0, initial_velocity_m_s=10.0, thrust=0.01)
    compiled = fly_compiled(mission, dispersions=dispersions, seed=7, law="igm").plant
    stepped = fly_stepwise(mission, dispersions=dispersions, seed=7, law="igm").plant
    for value in ("time", "mass", "position", "velocity"):
        assert compiled[value] == pytest.approx(stepped[value], rel=1e-12)


def test_the_saturn_flies_as_it_flew_but_for_four_seconds(as506):
    simulator = Simulator(as506, SimulatorOptions(navigation_period_s=0.02))
    guide = make_law("igm", as506.arrays())
    passed = {}
    while not simulator.complete:
        nav = simulator.navigation
        for time in (460.62, 548.22):
            if abs(nav["time"] - time) < 1e-6:
                passed[time] = Insertion.from_state(nav["position"], nav["velocity"])
        guide.step(nav)
        simulator.command(guide.steering)
        simulator.advance()
    flight = Flight(simulator.plant, guide.state)
    assert_within(errors(as506, flight), ASKED)
    assert first(flight, CUTOFF)["time"] == pytest.approx(695.25, abs=0.05)
    # flown on 16 July 1969: cut-off 699.34 s; centre engine off at 5707.5 m/s and 0.90 deg,
    # S-II off at 6916.2 m/s and 0.61 deg
    for time, speed, angle, ahead in ((460.62, 5707.5, 0.90, 24.1), (548.22, 6916.2, 0.61, 36.5)):
        assert passed[time].speed - speed == pytest.approx(ahead, abs=0.5)
        assert math.degrees(passed[time].flight_path_angle) == pytest.approx(angle, abs=0.03)


def test_a_quarter_of_a_percent_of_s2_thrust_explains_the_four_seconds(changed):
    def weaken(content):
        for arc in content["stages"][0]["arcs"]:
            if "thrust_n" in arc:
                arc["thrust_n"] *= 1.0 - 0.00272

    weaker = changed("saturn_v_as506", weaken)
    flight = fly_compiled(weaker, law="igm")
    assert_within(errors(weaker, flight), ASKED)
    assert first(flight, CUTOFF)["time"] == pytest.approx(699.34, abs=0.1)
