# SPDX-License-Identifier: Apache-2.0
"""Compare the dense algebra with NumPy, and the dual program with brute force."""

from itertools import combinations

import numpy as np
import pytest

from ares_optimizer.kernels.algebra import (
    dual_multipliers,
    full_qr,
    least_step,
    solve_lower_transposed,
    solve_symmetric,
    solve_upper,
)


@pytest.mark.parametrize("seed", range(5))
def test_factors_of_the_jacobian(seed):
    rng = np.random.default_rng(seed)
    m, n = 5, 11
    a = rng.standard_normal((m, n))
    q, r = np.empty((n, n)), np.empty((m, m))
    ratio = full_qr(a, q, r)
    assert q.T @ q == pytest.approx(np.eye(n), abs=1e-13)
    assert pytest.approx(q[:, :m] @ r, abs=1e-13) == a.T
    assert a @ q[:, m:] == pytest.approx(np.zeros((m, n - m)), abs=1e-13)
    assert 0.0 < ratio <= 1.0
    b, x = rng.standard_normal(m), np.empty(m)
    solve_lower_transposed(r, b, x)
    assert r.T @ x == pytest.approx(b, abs=1e-11)
    solve_upper(r, b, x)
    assert r @ x == pytest.approx(b, abs=1e-11)
    step = np.empty(n)
    least_step(a, b, 0.0, step)
    assert step == pytest.approx(np.linalg.lstsq(a, -b, rcond=None)[0], abs=1e-10)


def test_no_rows_leave_the_whole_space():
    q, r = np.empty((3, 3)), np.empty((0, 0))
    assert full_qr(np.empty((0, 3)), q, r) == 1.0
    assert q == pytest.approx(np.eye(3))


def test_dependent_rows_do_not_break_the_solution():
    rows = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]])
    step = np.empty(3)
    least_step(rows, np.array([1.0, 2.0]), 1e-13, step)
    assert rows @ step == pytest.approx([-1.0, -2.0], abs=1e-5)


def test_symmetric_solution():
    rng = np.random.default_rng(1)
    a = rng.standard_normal((4, 4))
    a = a @ a.T
    b, x = rng.standard_normal(4), np.empty(4)
    solve_symmetric(a.copy(), b, x, 4)
    assert a @ x == pytest.approx(b, rel=1e-9)


@pytest.mark.parametrize("seed", range(30))
def test_dual_programme(seed):
    rng = np.random.default_rng(seed)
    k, z = int(rng.integers(1, 7)), 5
    rows = rng.standard_normal((k, z))
    if seed % 3 == 0 and k > 1:
        rows[1] = 0.0  # a constraint that the equations already determine
    m = rows @ rows.T
    q = rng.standard_normal(k)
    q[np.diag(m) == 0.0] = 1.0
    x = np.empty(k)
    assert dual_multipliers(m, q, x) == 0
    slack = m @ x + q
    assert x.min() >= 0.0
    assert slack.min() > -1e-9
    assert abs(x @ slack) < 1e-9

    # no other active set gives a smaller primal objective 1/2 |d|^2
    value = 0.5 * x @ m @ x + q @ x
    for size in range(k + 1):
        for active in combinations(range(k), size):
            part = list(active)
            trial = np.zeros(k)
            if part:
                trial[part] = np.linalg.lstsq(m[np.ix_(part, part)], -q[part], rcond=None)[0]
            if trial.min() >= -1e-12:
                assert value <= 0.5 * trial @ m @ trial + q @ trial + 1e-9
