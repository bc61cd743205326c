# SPDX-License-Identifier: Apache-2.0
"""The delta-V budget compared with another integrator and the rocket equation."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from ares_models.mission import load_mission
from ares_optimizer.proof.physics import gravity
from ares_optimizer.solve import solve
from ares_studies.flight_page.data import make_flight
from ares_studies.flight_page.optimum import record_optimum

DONE = {}


def solved(name):
    if name not in DONE:
        mission = load_mission(name)
        solution = solve(mission, "indirect")
        assert solution.converged
        DONE[name] = (mission, solution, make_flight(record_optimum("optimum", mission, solution)))
    return DONE[name]


def integrated(mission, solution):
    """Integrate ideal, gravity and steering losses, m/s, by DOP853, with the proof's gravity."""
    arrays = mission.arrays()
    environment = arrays.environment[0]
    edges = sorted(
        {t for arc in solution.flown for t in (arc.start_s, arc.end_s)}
        | {t for t in solution.jettison_times_s if math.isfinite(t)}
    )
    track = solution.trajectory
    state = np.concatenate((track.position[0], track.velocity[0], [track.mass[0], 0.0, 0.0, 0.0]))
    for begin, end in pairwise(edges):
        if end - begin < 1e-9:
            continue
        middle = 0.5 * (begin + end)
        # the directions flown, and what dropped at the begin; all else is integrated
        row = int(np.searchsorted(track.time_s, middle)) - 1
        first = int(np.searchsorted(track.time_s, begin + 1e-9)) - 1
        last = int(np.searchsorted(track.time_s, end - 1e-9))
        state[6] = track.mass[first]
        direction = CubicSpline(track.time_s[first : last + 1], track.direction[first : last + 1])
        thrust = float(track.thrust[row])
        arc = next(a.arc for a in solution.flown if a.start_s <= middle <= a.end_s)
        flow = thrust / float(arrays.arcs[arc]["exhaust_velocity"]) if thrust else 0.0

        def rate(t, y, thrust=thrust, flow=flow, direction=direction):
            r, v, m = y[:3], y[3:6], y[6]
            g, u = gravity(r, environment), direction(t)
            along = v / np.linalg.norm(v)
            push = thrust / m
            return np.concatenate(
                (v, g + push * u, [-flow, push, -g @ along, push * (1.0 - u @ along)])
            )

        state = solve_ivp(rate, (begin, end), state, method="DOP853", rtol=1e-11, atol=1e-7).y[
            :, -1
        ]
    return state[7:]


@pytest.mark.parametrize("name", ["ares_v", "geostationary_transfer"])
def test_the_budget_is_that_of_another_integrator(name):
    mission, solution, flight = solved(name)
    ideal, pull, steering = integrated(mission, solution)
    budget = flight.budget
    assert budget.ideal_m_s == pytest.approx(ideal, abs=0.01)
    assert budget.gravity_m_s == pytest.approx(pull, abs=0.01)
    assert budget.steering_m_s == pytest.approx(steering, abs=0.01)
    assert budget.ideal_m_s == pytest.approx(solution.delta_v_m_s, abs=0.01)


@pytest.mark.parametrize("name", ["ares_v", "geostationary_transfer"])
def test_the_budget_closes(name):
    mission, solution, flight = solved(name)
    budget, track = flight.budget, solution.trajectory
    gained = np.linalg.norm(track.velocity[-1]) - np.linalg.norm(track.velocity[0])
    assert budget.gained_m_s == pytest.approx(gained, abs=1e-9)
    spent = budget.gravity_m_s + budget.steering_m_s + budget.drag_m_s + budget.pressure_m_s
    assert budget.ideal_m_s - spent == pytest.approx(gained, abs=0.01)
    assert budget.open_m_s == pytest.approx(0.0, abs=0.01)
    # what is left, by the rocket equation with the numbers of the mission file
    used = next(c.value for c in solution.constraints if c.key == "propellant")
    left = next(c.limit for c in solution.constraints if c.key == "propellant") - used
    assert budget.left_kg == pytest.approx(left, abs=0.01)
    exhaust = float(mission.arrays().arcs[-1]["exhaust_velocity"])
    expected = exhaust * math.log(solution.m_f_kg / (solution.m_f_kg - left))
    assert budget.left_m_s == pytest.approx(expected, rel=1e-3)


def test_propellant_falls_along_a_burn_and_stays_along_a_coast():
    _, solution, flight = solved("geostationary_transfer")
    left, time = flight.propellant_kg, flight.states.time_s
    _, coast, _ = solution.flown
    quiet = (time >= coast.start_s) & (time <= coast.end_s)
    assert np.ptp(left[quiet]) < 1e-6
    assert np.all(np.diff(left[time < coast.start_s]) < 0.0)
    _, _, ares = solved("ares_v")
    # the stage above begins with all of its own
    upper = ares.phases[1].first
    assert ares.propellant_kg[upper] == pytest.approx(286_900.0, abs=0.01)


# ---- what proves the optimum


def test_free_burns_and_coasts_switch_where_the_switching_function_is_zero():
    _, solution, flight = solved("geostationary_transfer")
    proof = flight.optimality
    first, coast, last = solution.flown
    scale = np.nanmax(np.abs(proof.switching))
    for at in (first.end_s, coast.end_s, last.end_s):
        assert np.interp(at, proof.time_s, proof.switching) == pytest.approx(0.0, abs=1e-3 * scale)
    inside = (proof.time_s > first.start_s) & (proof.time_s < first.end_s - 1.0)
    assert np.all(proof.switching[inside] > 0.0)
    inside = (proof.time_s > coast.start_s + 1.0) & (proof.time_s < coast.end_s - 1.0)
    assert np.all(proof.switching[inside] < 0.0)


def test_the_hamiltonian_is_zero_where_the_length_is_free_and_constant_elsewhere():
    _, solution, flight = solved("ares_v")
    proof = flight.optimality
    core, upper = solution.flown
    size = float(np.abs(solution.costates.hamiltonian).max())
    inside = (proof.time_s > core.start_s) & (proof.time_s < core.end_s)
    assert np.ptp(proof.hamiltonian_m_s2[inside]) < 1e-6 * size
    inside = (proof.time_s > upper.start_s) & (proof.time_s < upper.end_s)
    assert np.abs(proof.hamiltonian_m_s2[inside]).max() < 1e-6 * size
    # the core burns for a given time
    assert np.all(np.isnan(proof.switching[proof.time_s < core.end_s]))


def test_the_primer_is_the_direction_of_the_thrust():
    _, solution, flight = solved("ares_v")
    proof = flight.optimality
    parts = np.array([proof.primer_up, proof.primer_ahead, proof.primer_right])
    np.testing.assert_allclose(np.linalg.norm(parts, axis=0), proof.primer, rtol=1e-9)
    pitch = np.degrees(np.arcsin(proof.primer_up / proof.primer))
    states = flight.states
    shown = np.interp(proof.time_s, states.time_s, states.pitch_deg)
    # a jettison stands twice
    near = np.abs(proof.time_s - solution.t_plf_s) < 1.0
    inside = (proof.time_s > states.time_s[2]) & (proof.time_s < states.time_s[-2]) & ~near
    assert np.abs(pitch - shown)[inside].max() < 0.005


def test_a_solution_without_costates_has_no_such_chapter():
    mission, solution, _ = solved("ares_v")
    without = dataclasses.replace(solution, costates=None)
    assert make_flight(record_optimum("optimum", mission, without)).optimality is None
