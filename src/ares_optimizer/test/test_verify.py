# SPDX-License-Identifier: Apache-2.0
"""Test the independent integration: sequence, physics, and the errors that it detects."""

import math

import numpy as np
import pytest

from ares_models.arrays import COAST, TIME_AFTER_IGNITION, MissionArrays
from ares_models.kernels.environment import gravity as kernel_gravity
from ares_models.kernels.environment import heating_rate
from ares_models.kernels.kepler import kepler
from ares_models.mission import load_mission
from ares_optimizer.obstacles import check_obstacle
from ares_optimizer.proof.checks import constraint_table, heating_from_jettison
from ares_optimizer.proof.flight import fly, steering_of
from ares_optimizer.proof.physics import elements, gravity, heating
from ares_optimizer.proof.sequence import plan_flight, running, thrust_and_flow
from ares_optimizer.request import Heating
from ares_optimizer.solution import Check, ConstraintCheck
from ares_optimizer.solve import solve


def along_velocity(_begin, _end):
    return lambda _: np.array([0.0, -1.0, 0.0])


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


def test_a_coast_is_a_conic(ares_v):
    arrays = ares_v.arrays()
    arrays.arcs["thrust"] = 0.0
    arrays.arcs["mass_flow"] = 0.0
    arrays.arcs["kind"][0] = COAST
    start = ares_v.start().navigation()[0]
    flight = fly(arrays, start, along_velocity, [math.nan], 800.0)
    r, v = kepler(tuple(start["position"]), tuple(start["velocity"]), 800.0 - 155.9, 3.986e14)
    assert flight.final[:3] == pytest.approx(np.array(r), abs=1e-3)
    assert flight.final[3:6] == pytest.approx(np.array(v), abs=1e-6)


def test_a_flight_to_the_centre_ends_there(ares_v):
    arrays = ares_v.arrays()
    arrays.arcs["thrust"] = 0.0
    arrays.arcs["mass_flow"] = 0.0
    start = ares_v.start().navigation()
    start["velocity"][0] *= 1e-9
    flight = fly(arrays, start[0], along_velocity, [math.nan], 5_000.0)
    assert not flight.whole
    # free fall takes pi / sqrt(8) sqrt(r^3 / mu)
    radius = float(np.linalg.norm(start["position"][0]))
    falls = math.pi / math.sqrt(8.0) * math.sqrt(radius**3 / 3.986e14)
    assert flight.trajectory.time_s[-1] == pytest.approx(155.9 + falls, abs=1.0)
    assert flight.pieces[-1].end == flight.trajectory.time_s[-1]
    checks = constraint_table(arrays, start[0], flight, Heating.AT_JETTISON)
    assert not all(check.satisfied for check in checks)


def test_masses_follow_the_sequence(ares_v):
    # Table 2.2: 450,600 kg at burnout, then the second stage's own stack
    arrays = ares_v.arrays()
    flight = fly(arrays, ares_v.start().navigation()[0], along_velocity, [441.02], 769.45)
    times, mass = flight.trajectory.time_s, flight.trajectory.mass
    i = int(np.searchsorted(times, 337.15))
    assert mass[i] == pytest.approx(450_600.0, abs=1.0)
    assert mass[i + 1] == 307_837.0
    i = int(np.searchsorted(times, 441.02 - 1e-9))
    assert mass[i] - mass[i + 1] == pytest.approx(5837.0)
    # the mass that the thesis prints for its times
    assert flight.final[6] == pytest.approx(173_427.0, abs=1.0)


def test_thrust_curves_give_their_area():
    mission = load_mission("saturn_v_as506")
    arrays = mission.arrays()
    start = mission.start().navigation()[0]
    plan = plan_flight(arrays, start, 700.0)
    grid = np.linspace(162.3, plan.end, 200_001)
    middle = 0.5 * (grid[1:] + grid[:-1])
    # no burn is throttled here: the mass does not matter
    flow = [
        thrust_and_flow(arrays.arcs, running(plan.engines, t, t), t, math.nan)[1]
        for t in middle[::20]
    ]
    flown = float(np.sum(flow) * 20 * (grid[1] - grid[0]))
    # S-II as the file has it, S-IVB from 549 s on
    last = float(arrays.arcs[-1]["mass_flow"])
    first = sum(
        float(arc["mass_flow"]) * (arc["duration"] - arc["start_loss"] + arc["tail_gain"])
        for arc in arrays.arcs[:-1]
    )
    begin = 162.3 + float(arrays.arcs["duration"][:-1].sum())
    rest = last * (700.0 - begin - arrays.arcs[-1]["start_loss"] + arrays.arcs[-1]["tail_gain"])
    assert flown == pytest.approx(first + rest, rel=2e-4)
    assert plan.used_kg == pytest.approx(rest, rel=1e-9)
    assert plan.end == pytest.approx(700.0 + arrays.arcs[-1]["tail_time"].max())


def test_a_burn_ends_when_its_propellant_is_gone(ares_v):
    arrays = ares_v.arrays()
    arrays.arcs["propellant"][0] *= 0.5
    plan = plan_flight(arrays, ares_v.start().navigation()[0], 700.0)
    assert plan.stagings == [(pytest.approx(155.9 + 0.5 * 181.25, abs=1e-6), 1)]


def test_physics_is_that_of_the_models(ares_v):
    rng = np.random.default_rng(5)
    for spherical in (0, 1):
        arrays = ares_v.arrays()
        arrays.environment["altitude_model"] = 1 - spherical
        arrays.environment["j2"] = 1.0826e-3
        arrays.environment["density_factor"] = 1.3
        for _ in range(50):
            r = rng.standard_normal(3)
            r *= rng.uniform(6.36e6, 6.7e6) / np.linalg.norm(r)
            v = rng.standard_normal(3) * 4e3
            record = arrays.environment[0]
            assert gravity(r, record) == pytest.approx(
                np.array(kernel_gravity(tuple(r), record)), rel=1e-13
            )
            assert heating(r, v, arrays) == pytest.approx(
                heating_rate(tuple(r), tuple(v), record, arrays.atmosphere), rel=1e-9
            )


def test_elements_of_a_known_orbit():
    # perigee 7000 km over the node, in a plane of 30 deg with its node at 40 deg
    mu, a, e = 3.986e14, 1e7, 0.3
    node = np.array([math.cos(math.radians(40)), math.sin(math.radians(40)), 0.0])
    normal = np.array(
        [
            math.sin(math.radians(30)) * math.sin(math.radians(40)),
            -math.sin(math.radians(30)) * math.cos(math.radians(40)),
            math.cos(math.radians(30)),
        ]
    )
    r = a * (1 - e) * node
    v = math.sqrt(mu * (1 + e) / (a * (1 - e))) * np.cross(normal, node)
    figures = elements(r, v, mu)
    assert figures["semi_major_axis"] == pytest.approx(a)
    assert figures["eccentricity"] == pytest.approx(e)
    assert figures["inclination"] == pytest.approx(30.0)
    assert figures["ascending_node"] == pytest.approx(40.0)
    assert figures["argument_of_perigee"] % 360.0 == pytest.approx(0.0, abs=1e-6)
    assert figures["flight_path_angle"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"t_meco_s": 0.03}, "speed at cut-off"),
        ({"jettison_times_s": -0.5}, "heating at jettison 0"),
    ],
)
def test_a_wrong_solution_is_caught(ares_v, change, name):
    solution = solve(ares_v)
    arrays, start = ares_v.arrays(), ares_v.start().navigation()[0]
    cutoff = solution.t_meco_s + change.get("t_meco_s", 0.0)
    drops = [solution.t_plf_s + change.get("jettison_times_s", 0.0)]
    flight = fly(
        arrays,
        start,
        steering_of(solution.arcs),
        drops,
        cutoff,
        [arc.start_s for arc in solution.arcs],
    )
    table = constraint_table(arrays, start, flight, Heating.AT_JETTISON)
    broken = [check.name for check in table if not check.satisfied]
    assert name in broken


def test_a_jettison_left_out_is_caught(ares_v):
    solution = solve(ares_v)
    arrays, start = ares_v.arrays(), ares_v.start().navigation()[0]
    flight = fly(arrays, start, steering_of(solution.arcs), [math.nan], solution.t_meco_s)
    table = constraint_table(arrays, start, flight, Heating.AT_JETTISON)
    assert "jettison 0 before cut-off" in [c.name for c in table if not c.satisfied]
    assert flight.at_jettison == (None,)
    assert math.isnan(flight.peak_w_m2)


def test_trajectory_has_events_twice(ares_v):
    flown = solve(ares_v).trajectory
    assert np.all(np.diff(flown.time_s) >= 0.0)
    twice = flown.time_s[:-1][np.diff(flown.time_s) == 0.0]
    assert len(twice) == 2
    assert np.linalg.norm(flown.direction, axis=1) == pytest.approx(1.0)
    assert flown.position.shape == flown.velocity.shape == (len(flown.time_s), 3)


def test_drop_at_a_time_after_ignition(ares_v):
    arrays = ares_v.arrays()
    arrays.jettisons["criterion"] = TIME_AFTER_IGNITION
    arrays.jettisons["value"] = 100.0
    assert isinstance(arrays, MissionArrays)
    solution = solve(arrays._replace(), state=ares_v.start().navigation())
    assert solution.converged, solution.reason
    assert solution.t_plf_s == pytest.approx(437.15)


def test_a_floor_that_is_missed_is_named_with_the_distance():
    key, name = Check.LOWEST_ALTITUDE, "perigee radius in arc 5"
    perigee = ConstraintCheck(key, name, 6_499_155.0, 6_528_137.0, True, "m", False)
    said = "perigee radius in arc 5 is 6,499,155 m, 28,982 m below its floor of 6,528,137 m"
    assert check_obstacle((perigee,)) == said
    ground = ConstraintCheck(key, "lowest altitude", -70_000.0, 0.0, True, "m", False)
    assert check_obstacle((perigee, ground)) == "the flight goes through the ground, 70,000 m deep"


@pytest.mark.parametrize(("name", "allowed"), [("ares_v", 0.2), ("falcon9_leo_pad", 11.35)])
def test_in_the_air_a_heating_limit_is_kept_within_a_hundredth(name, allowed):
    arrays = load_mission(name).arrays()
    assert heating_from_jettison(arrays, 1135.0 + 0.99 * allowed, 1135.0).satisfied
    assert not heating_from_jettison(arrays, 1135.0 + 1.01 * allowed, 1135.0).satisfied
