# SPDX-License-Identifier: Apache-2.0
"""Build the quadratic model of a step and minimise it in the trust region.

The normal step meets the linearised equations. The tangential step, in the null space of their
Jacobian, minimises the model. Its Hessian is that of the Lagrangian, by differences of exact
gradients along a basis of the null space. Inequalities enter through the dual of the reduced
quadratic program.
"""

import math
from typing import NamedTuple

import numpy as np

from ares_models.jit import allocating, kernel
from ares_optimizer.direct.kernels.evaluate import Point, evaluate_with_gradients
from ares_optimizer.direct.kernels.lagrangian import Multipliers, Workspace, lagrangian_gradient
from ares_optimizer.direct.kernels.problem import Problem
from ares_optimizer.kernels.algebra import Array, dual_multipliers, full_qr, solve_lower_transposed

_DIFFERENCE = 1e-6
_SHIFTS = 24


class Frame(NamedTuple):
    """Hold the decomposition of a step from a point.

    Attributes:
        basis: shape (n, z), orthonormal columns: the null space of the equations.
        normal: shape (n,), the normal step, which meets the linearised equations.
        base: shape (n,), gradient of the Lagrangian.
    """

    basis: Array
    normal: Array
    base: Array


@allocating
def reduced_hessian(
    p: Array, problem: Problem, workspace: Workspace, multipliers: Multipliers, frame: Frame
) -> tuple[Array, Array]:
    """Compute the Hessian of the Lagrangian in the null space by differences.

    Args:
        p: shape (n,).
        problem: the flight.
        workspace: its ``other`` is written.
        multipliers: those of the Lagrangian.
        frame: at ``p``.

    Returns:
        Z^T H Z, shape (z, z), and Z^T H normal, shape (z,).
    """
    basis, normal, base = frame
    hessian = np.empty((basis.shape[1], basis.shape[1]))
    cross = np.empty(basis.shape[1])
    n, z = basis.shape
    trial = np.empty(n)
    moved = np.empty(n)
    for a in range(z + 1):
        if problem.stop[0] != 0:
            hessian[:] = 0.0
            break
        h = _DIFFERENCE
        if a == z:
            size = 0.0
            for j in range(n):
                size = max(size, abs(normal[j]))
            cross[:] = 0.0
            if size < 1e-9:
                break
            h = _DIFFERENCE / size
        for j in range(n):
            trial[j] = p[j] + h * (basis[j, a] if a < z else normal[j])
        evaluate_with_gradients(trial, problem, workspace.scratch, workspace.other)
        lagrangian_gradient(workspace.other, multipliers, moved)
        for b in range(z):
            s = 0.0
            for j in range(n):
                s += basis[j, b] * (moved[j] - base[j])
            if a < z:
                hessian[b, a] = s / h
            else:
                cross[b] = s / h
    for a in range(z):
        for b in range(a):
            s = 0.5 * (hessian[a, b] + hessian[b, a])
            hessian[a, b] = s
            hessian[b, a] = s
    return hessian, cross


class Model(NamedTuple):
    """Hold the quadratic model at a point.

    Attributes:
        frame: null space and normal step.
        hessian: shape (z, z), of the Lagrangian: Z^T H Z.
        cross: shape (z,), Z^T H normal.
        values, vectors: eigenvalues (in modulus) and eigenvectors of the Hessian.
        curvature: least eigenvalue of the Hessian; nan where it is not finite.
    """

    frame: Frame
    hessian: Array
    cross: Array
    values: Array
    vectors: Array
    curvature: float


class ReducedModel(NamedTuple):
    """Hold the quadratic model in the null space of the equations, beside a normal step.

    Attributes:
        slope: shape (z,), gradient at the normal step.
        values, vectors: eigenvalues (in modulus) and eigenvectors of its Hessian.
        rows: shape (i, z), gradients of the inequalities.
        slack: shape (i,), slack of the inequalities after the normal step.
    """

    slope: Array
    values: Array
    vectors: Array
    rows: Array
    slack: Array


@allocating
def reduce_model(point: Point, model: Model, normal: Array, slope: Array) -> ReducedModel:
    """Reduce the quadratic model to the null space, beside a normal step."""
    n, z = model.frame.basis.shape
    i = point.inequalities.size
    rows = np.empty((i, z))
    slack = np.empty(i)
    for a in range(i):
        for b in range(z):
            s = 0.0
            for j in range(n):
                s += point.inequality_rows[a, j] * model.frame.basis[j, b]
            rows[a, b] = s
        s = -point.inequalities[a]
        for j in range(n):
            s -= point.inequality_rows[a, j] * normal[j]
        slack[a] = s
    return ReducedModel(slope, model.values, model.vectors, rows, slack)


@allocating
def shifted_step(
    reduced: ReducedModel, floor: float, shift: float, mu: Array, free: Array
) -> float:
    """Minimise the reduced model with ``shift`` added to its eigenvalues.

    Args:
        reduced: the reduced model; its inequalities are met.
        floor: smaller eigenvalues are raised to this.
        shift: added to each.
        mu: shape (i,), written: multipliers of the inequalities.
        free: shape (z,), written: the step.

    Returns:
        length of the step.
    """
    slope, values, vectors, rows, initial = reduced
    i, z = rows.shape
    inverse = np.empty((z, z))
    along = np.empty((i, z))
    slack = np.empty(i)
    dual = np.empty((i, i))
    for a in range(z):
        for b in range(z):
            s = 0.0
            for c in range(z):
                s += vectors[a, c] * vectors[b, c] / (max(values[c], floor) + shift)
            inverse[a, b] = s
    for a in range(z):
        s = 0.0
        for b in range(z):
            s -= inverse[a, b] * slope[b]
        free[a] = s
    for a in range(i):
        slack[a] = initial[a]
        for b in range(z):
            slack[a] -= rows[a, b] * free[b]
            s = 0.0
            for c in range(z):
                s += inverse[b, c] * rows[a, c]
            along[a, b] = s
    for a in range(i):
        for b in range(i):
            s = 0.0
            for c in range(z):
                s += rows[a, c] * along[b, c]
            dual[a, b] = s
    dual_multipliers(dual, slack, mu)
    size = 0.0
    for b in range(z):
        for a in range(i):
            if mu[a] != 0.0:
                free[b] -= along[a, b] * mu[a]
        size += free[b] * free[b]
    return math.sqrt(size)


@kernel
def tangent_step(reduced: ReducedModel, radius: float, mu: Array, free: Array) -> None:
    """Minimise the reduced model subject to the inequalities and the trust region.

    Args:
        reduced: the reduced model.
        radius: of the trust region.
        mu: shape (i,), written: multipliers of the inequalities.
        free: shape (z,), written: the step in the null space.
    """
    top = 0.0
    for value in reduced.values:
        top = max(top, value)
    floor = max(1e-12, 1e-9 * top)
    size = 0.0
    # shift of the eigenvalues that keeps the step, inequalities met, in the trust region
    shift = 0.0
    low = 0.0
    high = math.inf
    for _ in range(_SHIFTS):
        size = shifted_step(reduced, floor, shift, mu, free)
        if size > 1.2 * radius:
            low = shift
        elif shift == 0.0 or size > 0.6 * radius:
            return
        else:
            high = shift
        if high < math.inf:
            shift = math.sqrt(low * high) if low > 0.0 else 0.1 * high
        else:
            shift = max(10.0 * shift, 10.0 * floor, 1e-6 * top)
    if size <= 1.2 * radius:
        return
    for b in range(free.size):
        free[b] *= 1.2 * radius / size


@allocating
def build_model(
    p: Array, problem: Problem, workspace: Workspace, multipliers: Multipliers
) -> Model:
    """Build the quadratic model at ``workspace.point``, which holds the values at ``p``."""
    point = workspace.point
    e, n = point.equation_rows.shape
    q = np.empty((n, n))
    r = np.empty((e, e))
    y = np.empty(e)
    right = np.empty(e)
    full_qr(point.equation_rows, q, r)
    for a in range(e):
        right[a] = -point.equations[a]
    solve_lower_transposed(r, right, y)
    normal = np.empty(n)
    for j in range(n):
        s = 0.0
        for a in range(e):
            s += q[j, a] * y[a]
        normal[j] = s
    base = np.empty(n)
    lagrangian_gradient(point, multipliers, base)
    basis = np.ascontiguousarray(q[:, e:])
    frame = Frame(basis, normal, base)
    hessian, cross = reduced_hessian(p, problem, workspace, multipliers, frame)
    values = np.empty(n - e)
    if not math.isfinite(np.sum(hessian)):
        return Model(frame, hessian, cross, values, hessian.copy(), math.nan)
    eigenvalues, eigenvectors = np.linalg.eigh(hessian)
    for a in range(n - e):
        values[a] = abs(eigenvalues[a])
    vectors = np.ascontiguousarray(eigenvectors)
    return Model(frame, hessian, cross, values, vectors, eigenvalues[0])


@kernel
def length_of(x: Array) -> float:
    """Return the Euclidean norm of a vector."""
    s = 0.0
    for value in x:
        s += value * value
    return math.sqrt(s)


class Step(NamedTuple):
    """Hold a step and the change of the objective that the model predicts for it.

    Attributes:
        step: shape (n,).
        first_order: linear part of the change.
        second_order: quadratic part, from the Hessian of the Lagrangian.
    """

    step: Array
    first_order: float
    second_order: float


@allocating
def model_step(point: Point, model: Model, radius: float, mu: Array) -> Step:
    """Return the step that minimises the model in the trust region; set its multipliers ``mu``."""
    n, z = model.frame.basis.shape
    size = length_of(model.frame.normal)
    shrink = min(1.0, 0.8 * radius / size) if size > 0.0 else 1.0
    normal = np.empty(n)
    slope = np.empty(z)
    free = np.empty(z)
    step = np.empty(n)
    for j in range(n):
        normal[j] = shrink * model.frame.normal[j]
    for a in range(z):
        s = shrink * model.cross[a]
        for j in range(n):
            s += model.frame.basis[j, a] * point.gradient[j]
        slope[a] = s
    tangent_step(reduce_model(point, model, normal, slope), radius, mu, free)
    first_order = 0.0
    for j in range(n):
        s = normal[j]
        for a in range(z):
            s += model.frame.basis[j, a] * free[a]
        step[j] = s
        first_order += point.gradient[j] * s
    second_order = 0.0
    for a in range(z):
        second_order += shrink * model.cross[a] * free[a]
        for b in range(z):
            second_order += 0.5 * free[a] * model.hessian[a, b] * free[b]
    return Step(step, first_order, second_order)
