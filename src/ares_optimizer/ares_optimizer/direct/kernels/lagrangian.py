# SPDX-License-Identifier: Apache-2.0
"""Violations of the constraints at a point, multipliers, and the gradient of the Lagrangian.

Multipliers are least-squares estimates at the point.
"""

import math
from typing import NamedTuple

import numpy as np

from ares_models.jit import allocating, kernel
from ares_optimizer.direct.kernels.evaluate import Point
from ares_optimizer.direct.kernels.scratch import Scratch
from ares_optimizer.kernels.algebra import Array, row_multipliers

_NEAR = 0.05


@kernel
def violation(point: Point) -> float:
    """Return the largest constraint violation; inf where a constraint is not finite."""
    worst = 0.0
    for c in point.equations:
        worst = max(worst, abs(c))
        if not math.isfinite(c):
            return math.inf
    for c in point.inequalities:
        worst = max(worst, c)
        if not math.isfinite(c):
            return math.inf
    return worst


@kernel
def sum_violation(point: Point) -> float:
    """Return the sum of the constraint violations (l1 norm); inf when not finite."""
    s = 0.0
    for c in point.equations:
        s += abs(c)
    for c in point.inequalities:
        s += max(c, 0.0)
    return s if math.isfinite(s) else math.inf


@kernel
def sum_of_squares(point: Point) -> float:
    """Return the sum of the squared constraint violations; inf when not finite."""
    s = 0.0
    for c in point.equations:
        s += c * c
    for c in point.inequalities:
        s += max(c, 0.0) ** 2
    return s if math.isfinite(s) else math.inf


@allocating
def active_rows(point: Point, mu: Array, level: float) -> tuple[Array, Array, np.ndarray]:
    """Return gradients and values of the equations and of the active inequalities.

    Args:
        point: the point.
        mu: shape (i,): an inequality with a positive multiplier is active.
        level: an inequality above this value is active too.

    Returns:
        rows (k, n), values (k,), and the inequality of each row (-1: an equation).
    """
    e, n = point.equation_rows.shape
    used = e
    for a in range(mu.size):
        if mu[a] > 0.0 or point.inequalities[a] > level:
            used += 1
    rows = np.empty((used, n))
    values = np.empty(used)
    index = np.full(used, -1, np.int64)
    rows[:e] = point.equation_rows
    values[:e] = point.equations
    k = e
    for a in range(mu.size):
        if mu[a] > 0.0 or point.inequalities[a] > level:
            rows[k] = point.inequality_rows[a]
            values[k] = point.inequalities[a]
            index[k] = a
            k += 1
    return rows, values, index


class Workspace(NamedTuple):
    """Hold the workspace of a search.

    Attributes:
        scratch: from ``make_scratch``.
        point: from ``make_point``: the values at the variables.
        other: the values at a trial point.
    """

    scratch: Scratch
    point: Point
    other: Point


class Multipliers(NamedTuple):
    """Hold Lagrange multipliers.

    Attributes:
        nu: shape (e,), of the equations.
        mu: shape (i,), of the inequalities, not negative.
    """

    nu: Array
    mu: Array


@allocating
def estimate_multipliers(point: Point, multipliers: Multipliers) -> None:
    """Estimate the multipliers by least squares at a point.

    Args:
        point: the point.
        multipliers: updated. The active set begins with the inequalities that have a positive
            multiplier or are near their limit; negative multipliers leave it one by one.
    """
    nu, mu = multipliers
    e = nu.size
    for a in range(mu.size):
        mu[a] = 1.0 if mu[a] > 0.0 or point.inequalities[a] > -_NEAR else 0.0
    for _ in range(mu.size + 1):
        rows, values, index = active_rows(point, mu, math.inf)
        x = np.empty(values.size)
        right = np.empty(values.size)
        for a in range(values.size):
            s = 0.0
            for j in range(point.gradient.size):
                s -= rows[a, j] * point.gradient[j]
            right[a] = s
        row_multipliers(rows, right, 1e-13, x)
        nu[:] = x[:e]
        least = 0.0
        out = -1
        for a in range(e, values.size):
            mu[index[a]] = max(1e-300, x[a])
            if x[a] < least:
                least = x[a]
                out = index[a]
        if out < 0:
            break
        mu[out] = 0.0
    for a in range(mu.size):
        mu[a] = mu[a] if mu[a] > 1e-200 else 0.0


@allocating
def lagrangian_gradient(point: Point, multipliers: Multipliers, out: Array) -> None:
    """Compute the gradient of objective + nu . equations + mu . inequalities."""
    nu, mu = multipliers
    out[:] = point.gradient
    for a in range(nu.size):
        for j in range(out.size):
            out[j] += nu[a] * point.equation_rows[a, j]
    for a in range(mu.size):
        if mu[a] != 0.0:
            for j in range(out.size):
                out[j] += mu[a] * point.inequality_rows[a, j]
