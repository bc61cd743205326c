# SPDX-License-Identifier: Apache-2.0
"""Test the direct methods against two independent programs, and their robustness."""

import math
from statistics import median

import numpy as np
import pytest

from ares_models.arrays import ALTITUDE_SPHERICAL
from ares_models.mission import load_mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.direct.search import Guess, find_direct
from ares_optimizer.proof.physics import elements
from ares_optimizer.solution import OUT_OF_TIME
from ares_optimizer.solve import solve

METHODS = ("direct11", "direct14", "direct20")


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


def proven(solution):
    """Check that a solution converged and that the independent integration agrees."""
    assert solution.converged, solution.reason
    assert all(check.satisfied for check in solution.constraints)
    assert solution.verification.position_defect_m < 0.1
    assert solution.verification.velocity_defect_m_s < 1e-3
    assert solution.verification.mass_defect_kg < 1e-3
    assert solution.verification.m_f_kg == pytest.approx(solution.m_f_kg, abs=1e-3)
    return solution


@pytest.mark.parametrize("method", METHODS)
def test_default_mission(ares_v, method):
    solution = proven(solve(ares_v, method))
    assert solution.m_f_kg == pytest.approx(174_183.1, abs=0.5)
    assert solution.t_plf_s == pytest.approx(416.64, abs=0.1)
    assert solution.t_meco_s == pytest.approx(766.907, abs=0.005)
    assert solution.verification.fmhr_w_m2 == pytest.approx(1135.0, abs=0.1)
    assert solution.notes["least_curvature"] > 0.0


@pytest.mark.parametrize("method", METHODS)
def test_spherical_altitude(ares_v, method):
    arrays = ares_v.arrays()
    arrays.environment["altitude_model"] = ALTITUDE_SPHERICAL
    solution = proven(solve(arrays, method, state=ares_v.start().navigation()))
    assert solution.m_f_kg == pytest.approx(174_087.3, abs=0.5)
    assert solution.t_plf_s == pytest.approx(433.40, abs=0.1)
    assert solution.t_meco_s == pytest.approx(767.229, abs=0.005)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("density_factor", [1.0, 1.7])
def test_jettison_held(ares_v, method, density_factor):
    arrays = ares_v.arrays()
    arrays.environment["density_factor"] = density_factor
    solution = proven(
        solve(arrays, method, state=ares_v.start().navigation(), jettison_times={0: 441.02})
    )
    assert solution.m_f_kg == pytest.approx(174_088.9, abs=0.5)
    assert solution.t_plf_s == 441.02


def test_without_the_heating_limit_everything_is_lighter(ares_v):
    free = proven(solve(ares_v, heating="ignored"))
    assert free.t_plf_s == 337.15
    assert free.m_f_kg > solve(ares_v).m_f_kg + 300.0
    assert free.m_f_kg > 174_500.0


def test_a_limit_that_does_not_bind_is_reported_inactive(ares_v):
    arrays = ares_v.arrays()
    arrays.jettisons["value"] = 1e9
    solution = proven(solve(arrays, state=ares_v.start().navigation()))
    heating = next(c for c in solution.constraints if c.name == "heating at jettison 0")
    assert not heating.active
    assert heating.multiplier == 0.0
    assert solution.t_plf_s == pytest.approx(337.15, abs=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_delta_iii(method):
    solution = proven(solve(load_mission("delta_iii"), method))
    assert solution.m_f_kg == pytest.approx(7_529.712, abs=0.01)
    assert solution.t_meco_s == pytest.approx(924.139, abs=0.001)
    assert math.isnan(solution.t_plf_s)


@pytest.mark.parametrize("method", METHODS)
def test_saturn_v(method):
    # two stages, coasts, thrust curves, three drops at fixed times, plane and tail-off
    mission = load_mission("saturn_v_as506")
    solution = proven(solve(mission, method))
    assert solution.jettison_times_s[1:] == pytest.approx((192.3, 197.9))
    assert solution.m_f_kg == pytest.approx(136_417.9, abs=0.1)
    # the thrust ends after the command: the target is met at the end of thrust
    last = solution.arcs[-1]
    assert last.end_s > solution.t_meco_s
    assert last.end_mass_kg == pytest.approx(solution.m_f_kg, abs=1e-6)


def test_more_parameters_never_cost_mass(ares_v):
    found = [solve(ares_v, method, verify=False).m_f_kg for method in METHODS]
    assert found[0] <= found[1] + 1e-3
    assert found[1] <= found[2] + 1e-3
    assert found[2] - found[0] < 0.1


def random_guess(start, rng):
    axis = start["velocity"] / np.linalg.norm(start["velocity"])
    while True:
        direction = rng.standard_normal(3)
        direction /= np.linalg.norm(direction)
        if direction @ axis >= 0.5:
            break
    return Guess(
        direction,
        rng.uniform(-2e-3, 2e-3, 3),
        420.0 * rng.uniform(0.7, 1.3),
        330.0 * rng.uniform(0.7, 1.3),
        rng.uniform(-2e-3, 2e-3, 3),
    )


@pytest.mark.parametrize("method", ["direct11", "direct20", "jump"])
@pytest.mark.trial
def test_random_guesses(ares_v, method):
    rng = np.random.default_rng(20080801)
    start = ares_v.start().navigation()
    arrays = ares_v.arrays()
    best = solve(arrays, method, state=start, verify=False).m_f_kg
    reached, times = 0, []
    for _ in range(200):
        guess = random_guess(start[0], rng)
        solution = solve(arrays, method, state=start, guess=guess, verify=False)
        times.append(solution.solve_ms)
        if solution.converged:
            assert solution.m_f_kg == pytest.approx(best, abs=1.0), guess
            reached += 1
    assert reached >= 198
    assert median(times) <= 100.0


def test_a_solution_is_a_guess(ares_v):
    first = solve(ares_v, "direct20")
    again = solve(ares_v, "direct11", guess=first, verify=False)
    assert again.iterations <= 4
    assert again.m_f_kg == pytest.approx(first.m_f_kg, abs=0.1)


def test_the_rest_of_the_flight_is_the_same_flight(ares_v):
    # from a state on the optimum the optimum must come back
    whole = solve(ares_v, "direct20")
    flown = whole.trajectory
    for time, arc, arc_start in ((250.0, 0, 155.9), (380.0, 1, 337.15), (600.0, 1, 337.15)):
        i = int(np.searchsorted(flown.time_s, time))
        state = ares_v.start().navigation()
        state["time"] = flown.time_s[i]
        state["position"] = flown.position[i]
        state["velocity"] = flown.velocity[i]
        state["mass"] = flown.mass[i]
        state["arc"] = arc
        state["arc_start_time"] = arc_start
        state["jettisoned"] = int(flown.time_s[i] > whole.t_plf_s)
        rest = proven(solve(ares_v, "direct11", state=state))
        assert rest.m_f_kg == pytest.approx(whole.m_f_kg, abs=0.1)
        assert rest.t_meco_s == pytest.approx(whole.t_meco_s, abs=1e-3)


def test_steering_arcs_tell_the_whole_flight(ares_v):
    solution = solve(ares_v)
    arcs = solution.arcs
    assert [arc.start_s for arc in arcs[1:]] == [arc.end_s for arc in arcs[:-1]]
    assert arcs[0].start_s == 155.9
    assert arcs[-1].end_s == pytest.approx(solution.t_meco_s)
    # rocket equation, and the drops in between
    speeds = (414.7 * 9.80665, 448.0 * 9.80665, 448.0 * 9.80665)
    for arc, speed in zip(arcs, speeds, strict=True):
        assert arc.delta_v_m_s == pytest.approx(
            speed * math.log(arc.start_mass_kg / arc.end_mass_kg), rel=1e-10
        )
        assert np.linalg.norm(arc.direction) == pytest.approx(1.0)
    assert arcs[1].end_mass_kg - arcs[2].start_mass_kg == pytest.approx(5837.0)
    assert arcs[1].start_mass_kg == 307_837.0
    # Eq. 3.40: the thrust direction is continuous at the jettison
    before = np.array(arcs[1].direction) + np.array(arcs[1].direction_rate) * (
        arcs[1].end_s - arcs[1].reference_time_s
    )
    assert before / np.linalg.norm(before) == pytest.approx(np.array(arcs[2].direction))


def test_polar_and_far_targets(ares_v):
    for inclination, speed in ((50.0, 7840.675), (95.0, 7840.675), (28.5, 10_900.0)):
        arrays = ares_v.arrays()
        arrays.target["inclination"] = math.radians(inclination)
        arrays.target["speed"] = speed
        solution = proven(solve(arrays, state=ares_v.start().navigation()))
        last = solution.trajectory
        figures = elements(last.position[-1], last.velocity[-1], 3.986e14)
        assert figures["inclination"] == pytest.approx(inclination, abs=1e-4)
        assert figures["speed"] == pytest.approx(speed, abs=1e-2)


def test_jettison_before_staging(ares_v):
    # the limit is met in stage 1 already, and the drop belongs to stage 1
    arrays = ares_v.arrays()
    arrays.jettisons["stage"] = 0
    arrays.jettisons["value"] = 3e5
    arrays.arcs["stack_mass"][1] -= 5837.0
    solution = proven(solve(arrays, state=ares_v.start().navigation()))
    assert 200.0 < solution.t_plf_s < 337.15
    staged = next(arc for arc in solution.arcs if arc.start_s == 337.15)
    assert staged.start_mass_kg == pytest.approx(302_000.0)


def test_two_heating_jettisons(ares_v):
    arrays = ares_v.arrays()
    two = np.concatenate((arrays.jettisons, arrays.jettisons))
    two["mass"] = (2000.0, 3837.0)
    two["value"] = (1135.0, 8000.0)
    arrays = type(arrays)(arrays.environment, arrays.atmosphere, arrays.arcs, two, arrays.target)
    solution = proven(solve(arrays, state=ares_v.start().navigation()))
    late, early = solution.jettison_times_s
    assert 340.0 < early < late < 425.0
    assert solution.m_f_kg > 174_183.1


def test_deadline_ends_a_search(ares_v, monkeypatch):
    arrays = ares_v.arrays()
    arrays.jettisons["value"] = 1e-9
    start = ares_v.start().navigation()
    # the fourth look at the clock is after the limit
    asked = iter([False] * 3)
    monkeypatch.setattr(Deadline, "passed", property(lambda _: next(asked, True)))
    solution = solve(arrays, state=start, time_limit_s=60.0)
    assert not solution.converged
    assert solution.reason == OUT_OF_TIME.reason
    assert solution.iterations < 300


def test_solver_object_tells_how_it_ended(ares_v):
    found = find_direct(ares_v.arrays(), ares_v.start().navigation()[0], "direct11")
    assert found.converged
    assert found.base_converged
    assert found.miss < 1e-7
    assert found.inequalities.min() >= 0.0
