# SPDX-License-Identifier: Apache-2.0
"""The iterative guidance mode alone: self-start, K1 to K4 against quadrature, plane, gates."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ares_guidance.arrays import (
    ERROR_NAVIGATION_INVALID,
    ERROR_NONE,
    ERROR_PROPELLANT_SHORT,
    ERROR_TARGET_UNREACHABLE,
    LAW_IGM,
    PHASE_CONVERGING,
    PHASE_TRACKING,
)
from ares_guidance.kernels.prediction.segments import thrust_integrals
from ares_guidance.laws import find_law, make_law
from ares_guidance.settings import LawSettings
from ares_models.kernels.targets import desired_state, plane_normal
from ares_models.kernels.vectors import cross, load
from ares_models.mission import load_mission
from ares_trials.testing.laws import SELF_STARTING, first_navigation, step_anew


def igm(mission, **settings):
    return make_law("igm", mission.arrays(), LawSettings(**settings))


def upper_stage(mission, arc, mass, speed_short, below, aside=0.0, turned=0.0):
    """Return a navigation state of the last burn, short of the target.

    Args:
        speed_short: m/s under the target's speed.
        below: m under the target's radius.
        aside: m out of the target's plane.
        turned: rad by which the velocity points out of the plane.
    """
    arrays = mission.arrays()
    target = arrays.target[0]
    start = mission.start()
    normal, _ = plane_normal(
        target, load(start.position), cross(load(start.position), load(start.velocity))
    )
    radial = np.cross(normal, np.cross(start.position, normal))
    radial /= np.linalg.norm(radial)
    position, velocity, _ = desired_state(target, arrays.environment[0]["mu"], load(radial), normal)
    position, velocity, normal = map(np.array, (position, velocity, normal))
    course = velocity / np.linalg.norm(velocity)
    course = course * math.cos(turned) + normal * math.sin(turned)
    nav = first_navigation(
        mission,
        position=position - below * radial + aside * normal,
        velocity=(np.linalg.norm(velocity) - speed_short) * course,
        mass=mass,
        arc=arc,
        jettisoned=(1 << len(arrays.jettisons)) - 1,
    )
    nav["time"] = nav["arc_start_time"] + 30.0
    return nav


STATES = {
    # node held: pitch and yaw both have a position to reach
    "saturn_v_as506": {"arc": 6, "mass": 160e3, "speed_short": 700.0, "below": -500.0}
    | {"aside": 800.0, "turned": 2e-3},
    # node free
    "ares_v": {"arc": 1, "mass": 220e3, "speed_short": 900.0, "below": 10500.0, "turned": 3e-3},
}


def flown_plan(nav, mission, law, turns):
    """Integrate the law's steering under IGM's own model, by quadrature.

    Constant mean gravity, pitch and yaw linear in time; ``turns`` 0 leaves chi-tilde alone.

    Returns:
        position m and velocity m/s at the end of the thrust, and the terminal frame.
    """
    solution = law.state["solution"]
    arrays = mission.arrays()
    mu = arrays.environment[0]["mu"]
    eta = np.array(solution["plane_normal"])
    xi = np.array(solution["desired_position"]) / np.linalg.norm(solution["desired_position"])
    wanted, velocity, zeta = map(np.array, desired_state(arrays.target[0], mu, load(xi), load(eta)))
    r, v = np.array(nav["position"]), np.array(nav["velocity"])
    mean_gravity = -0.5 * mu * (r / np.linalg.norm(r) ** 3 + wanted / np.linalg.norm(wanted) ** 3)
    go = np.array(solution["velocity_to_go"])
    tilde = np.array(
        [math.atan2(go @ xi, go @ zeta), math.atan2(go @ eta, math.hypot(go @ xi, go @ zeta))]
    )
    now = np.array(solution["direction"])
    pitch, yaw = math.atan2(now @ xi, now @ zeta), math.asin(now @ eta)
    rate = np.array(solution["direction_rate"])
    above = math.cos(pitch) * xi - math.sin(pitch) * zeta
    aside = math.cos(yaw) * eta - math.sin(yaw) * (math.sin(pitch) * xi + math.cos(pitch) * zeta)
    slope = np.array([rate @ above / math.cos(yaw), rate @ aside])
    start = tilde + turns * (np.array([pitch, yaw]) - tilde)
    segment = law.state["segments"][0]

    def motion(t, y):
        p, q = start + turns * slope * t
        thrust = segment["exhaust_velocity"] / (segment["tau"] - t)
        along = math.cos(q) * (math.sin(p) * xi + math.cos(p) * zeta) + math.sin(q) * eta
        return np.concatenate([y[3:], thrust * along + mean_gravity])

    burn, drift = float(solution["time_to_go"]), float(solution["tail_drift"])
    end = solve_ivp(motion, (0.0, burn), np.concatenate([r, v]), rtol=1e-10, atol=1e-6).y[:, -1]
    r_end = end[:3] + drift * end[3:] + 0.5 * drift**2 * mean_gravity
    return r_end, end[3:] + drift * mean_gravity, (xi, eta, zeta), (wanted, velocity)


def test_it_has_the_code_of_the_status_message():
    assert find_law("igm").code == LAW_IGM == 3


@pytest.mark.parametrize("name", SELF_STARTING)
def test_starts_by_itself_within_thirty_iterations(name):
    mission = load_mission(name)
    law = igm(mission)
    assert law.step(first_navigation(mission))
    assert law.state["phase"] == PHASE_TRACKING
    assert law.state["error"] == ERROR_NONE
    assert 0 < law.state["iterations"] <= 30


def test_predicts_the_flight_that_follows():
    mission = load_mission("ares_v")
    law = igm(mission)
    law.step(first_navigation(mission))
    # flown closed loop: jettison 438.4 s, cut-off 767.2 s. Mean gravity over 630 s is coarse
    assert law.steering[0]["jettison_time"] == pytest.approx(438.4, abs=5.0)
    assert law.steering[0]["cutoff_time"] == pytest.approx(767.2, abs=25.0)


@pytest.mark.parametrize("name", STATES)
def test_the_direction_is_a_unit_vector_normal_to_its_rate(name):
    mission = load_mission(name)
    law = igm(mission)
    nav = upper_stage(mission, **STATES[name])
    law.step(nav)
    steering = law.steering[0]
    assert steering["reference_time"] == nav["time"]
    assert np.linalg.norm(steering["direction"]) == pytest.approx(1.0, abs=1e-12)
    assert steering["direction"] @ steering["direction_rate"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", STATES)
def test_the_position_terms_reach_the_position_and_cost_no_velocity(name):
    mission = load_mission(name)
    nav = upper_stage(mission, **STATES[name])
    law = igm(mission, velocity_to_go_tolerance_m_s=1e-6)
    law.step(nav)
    assert law.state["phase"] == PHASE_TRACKING
    r, v, (xi, eta, zeta), (wanted, velocity) = flown_plan(nav, mission, law, 1.0)
    r_tilde, v_tilde, _, _ = flown_plan(nav, mission, law, 0.0)
    # chi-tilde meets the velocity exactly, and misses the position
    assert v_tilde == pytest.approx(velocity, abs=1e-3)
    missed = np.abs([(r_tilde - wanted) @ xi, (r_tilde - wanted) @ eta])
    left = np.abs([(r - wanted) @ xi, (r - wanted) @ eta])
    assert missed[0] > 1000.0
    # the terms are of first order in the turn, so the residual is of second order
    go = law.state["solution"]["velocity_to_go"]
    square = math.acos(law.state["solution"]["direction"] @ go / np.linalg.norm(go)) ** 2
    assert 0.01 < square < 0.05
    assert np.all(left <= 2.0 * square * missed)
    assert np.linalg.norm(v - velocity) < square * np.linalg.norm(go)
    assert abs((r - wanted) @ zeta) < square * np.linalg.norm(r_tilde - np.array(nav["position"]))


def test_half_way_by_impulse_the_thrust_points_along_chi_tilde():
    mission = load_mission("saturn_v_as506")
    nav = upper_stage(mission, **STATES["saturn_v_as506"])
    law = igm(mission)
    law.step(nav)
    solution = law.state["solution"]
    burn = float(solution["time_to_go"])
    integrals = thrust_integrals(law.state, burn, burn)
    then = solution["direction"] + integrals[1] / integrals[0] * solution["direction_rate"]
    chi_tilde = solution["velocity_to_go"] / np.linalg.norm(solution["velocity_to_go"])
    turned = math.acos(np.clip(solution["direction"] @ chi_tilde, -1.0, 1.0))
    assert turned > math.radians(0.5)
    assert then / np.linalg.norm(then) == pytest.approx(chi_tilde, abs=0.05 * turned)


def test_a_free_node_is_put_where_the_inclination_is_exact():
    mission = load_mission("ares_v")
    law = igm(mission)
    law.step(first_navigation(mission))
    tilt = math.acos(law.state["solution"]["plane_normal"][2])
    assert tilt == pytest.approx(float(mission.arrays().target[0]["inclination"]), abs=1e-12)


def test_an_inclination_below_the_latitude_is_said_and_still_steered_at():
    mission = load_mission("ares_v")
    arrays = mission.arrays()
    arrays.target["inclination"] = math.radians(15.0)
    law = make_law("igm", arrays)
    # large angles lead to a solution
    law.onboard.settings["small_turn_limit"] = math.inf
    law.step(first_navigation(mission))
    assert law.state["error"] == ERROR_TARGET_UNREACHABLE
    assert law.steered
    assert np.all(np.isfinite(law.steering[0]["direction"]))


def test_a_target_beyond_the_propellant_is_said_and_still_steered_at():
    mission = load_mission("ares_v")
    arrays = mission.arrays()
    arrays.arcs["propellant"][1] = 120e3
    law = make_law("igm", arrays)
    law.step(first_navigation(mission))
    assert law.state["error"] == ERROR_PROPELLANT_SHORT
    assert law.steered


def test_the_gates_of_the_cycle_hold_here_too():
    mission = load_mission("ares_v")
    law = igm(mission, steering_jump_limit_deg=0.5, max_stale_cycles=2)
    law.step(first_navigation(mission))
    good = law.steering.copy()
    law.step(first_navigation(mission, velocity=[math.nan] * 3))
    assert law.state["error"] == ERROR_NAVIGATION_INVALID
    assert law.steering.tobytes() == good.tobytes()
    start = mission.start()
    kicked = start.velocity + np.array([300.0, -200.0, 250.0])
    step_anew(law, first_navigation(mission, time=start.time_s + 1.0, velocity=kicked))
    assert law.state["stale_cycles"] == 1
    assert law.steering[0]["direction"] == pytest.approx(good[0]["direction"], abs=0.0)


def test_a_start_that_does_not_settle_points_along_the_velocity():
    mission = load_mission("ares_v")
    law = igm(mission, max_iterations=1)
    nav = first_navigation(mission)
    law.step(nav)
    assert law.state["phase"] == PHASE_CONVERGING
    course = nav["velocity"] / np.linalg.norm(nav["velocity"])
    assert law.steering[0]["direction"] == pytest.approx(course)


def test_thicker_air_moves_the_jettison():
    mission = load_mission("ares_v")
    nominal = first_navigation(mission)["heating_rate"]
    times = []
    for factor in (0.7, 1.0, 1.2):
        law = igm(mission)
        law.step(first_navigation(mission, heating_rate=factor * nominal))
        times.append(float(law.steering[0]["jettison_time"]))
    assert times[0] < times[1] < times[2]
