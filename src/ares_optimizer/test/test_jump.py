# SPDX-License-Identifier: Apache-2.0
"""Test the analytic jump condition: convergence, and agreement with the multipliers."""

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_optimizer.direct.kernels.jump import JUMP_INPUTS, JUMP_OUTPUTS, heating_slopes, jump
from ares_optimizer.solve import solve

LIMIT = 1135.0


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


@pytest.fixture(scope="module")
def solutions(ares_v):
    return {m: solve(ares_v, m) for m in ("direct11", "direct20", "jump", "indirect")}


def at_jettison(solution):
    """Return state, costates and thrust accelerations on both sides of the jettison."""
    flown, costates = solution.trajectory, solution.costates
    i = int(np.searchsorted(flown.time_s, solution.t_plf_s - 1e-6))
    k = int(np.searchsorted(costates.time_s, solution.t_plf_s - 1e-6))
    x = np.concatenate(
        (
            flown.position[i],
            flown.velocity[i],
            costates.lambda_v[k],
            -costates.lambda_r[k],
            1306665.0 / flown.mass[i : i + 2],
        )
    )
    return x, costates.lambda_v[k + 1], -costates.lambda_r[k + 1]


def test_jump_converges_to_the_optimum(solutions):
    solution = solutions["jump"]
    assert solution.converged, solution.reason
    assert len(solution.parameters) == 8
    assert solution.m_f_kg == pytest.approx(solutions["direct11"].m_f_kg, abs=1.0)
    assert solution.verification.fmhr_w_m2 == pytest.approx(LIMIT, abs=0.1)


def test_multipliers_of_the_direct_solution_are_the_jump(ares_v, solutions):
    arrays = ares_v.arrays()
    x, after, rate = at_jettison(solutions["direct20"])
    assert x.shape == (JUMP_INPUTS,)
    y = np.empty(JUMP_OUTPUTS)
    jump(x, arrays.environment[0], arrays.atmosphere, y)
    assert y[6] / LIMIT == pytest.approx(solutions["direct20"].costates.jump_pi[0], rel=1e-3)
    assert y[:3] == pytest.approx(after, abs=1e-6)
    assert y[3:6] == pytest.approx(rate, abs=1e-8)


def test_what_the_print_leaves_out(ares_v, solutions):
    # Eq. 3.50 has no N_v and no change of V by the thrust: 7 % here
    arrays = ares_v.arrays()
    x, _, _ = at_jettison(solutions["direct20"])
    n = np.array(heating_slopes(x, arrays.environment[0], arrays.atmosphere))
    printed = np.linalg.norm(x[6:9]) * (x[13] - x[12]) / (n[:3] @ x[3:6] * LIMIT)
    pi = solutions["direct20"].costates.jump_pi[0]
    assert 1.03 < pi / printed < 1.12


def test_recovered_costates_are_those_of_the_indirect_method(solutions):
    indirect = solutions["indirect"].costates
    for method, tolerance in (("direct20", 2e-4), ("direct11", 5e-4), ("jump", 2e-3)):
        costates = solutions[method].costates
        assert np.linalg.norm(costates.lambda_v[0]) == pytest.approx(1.0)
        assert costates.jump_pi[0] == pytest.approx(indirect.jump_pi[0], rel=10 * tolerance)
        for time in (155.9, 250.0, 400.0, 500.0, 700.0):
            ours = [
                [np.interp(time, c.time_s, x[:, k]) for k in range(3)]
                for c in (costates, indirect)
                for x in (c.lambda_v,)
            ]
            assert ours[0] == pytest.approx(ours[1], abs=tolerance)


def test_hamiltonian_is_constant_per_piece_and_through_the_jettison(solutions):
    for method, tolerance in (("direct20", 2e-5), ("direct11", 1e-4), ("jump", 5e-4)):
        costates = solutions[method].costates
        assert len(costates.hamiltonian_spread) == 3
        assert max(costates.hamiltonian_spread) < tolerance
        k = int(np.searchsorted(costates.time_s, solutions[method].t_plf_s - 1e-6))
        sides = costates.hamiltonian[k : k + 2]
        assert abs(np.diff(sides)[0]) < tolerance * abs(sides[0])


def test_steering_follows_the_recovered_primer(solutions):
    # lambda_v of the multipliers against B + A t of the parameters (Eqs. 3.37, 3.38)
    solution = solutions["direct20"]
    costates, flown = solution.costates, solution.trajectory
    for time in (156.0, 250.0, 330.0, 390.0, 450.0, 600.0, 760.0):
        primer = np.array([np.interp(time, costates.time_s, x) for x in costates.lambda_v.T])
        thrust = np.array([np.interp(time, flown.time_s, x) for x in flown.direction.T])
        cosine = primer @ thrust / np.linalg.norm(primer) / np.linalg.norm(thrust)
        assert np.degrees(np.arccos(min(1.0, cosine))) < 0.15


def test_without_a_jettison_the_jump_method_is_one_law(ares_v):
    state = ares_v.start().navigation()
    solution = solve(ares_v.arrays(), "jump", state=state, heating="ignored")
    assert solution.converged
    assert len(solution.parameters) == 7
