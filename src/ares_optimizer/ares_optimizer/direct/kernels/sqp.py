# SPDX-License-Identifier: Apache-2.0
"""Minimise by sequential quadratic programming on exact gradients, compiled throughout.

Each step has two parts. The normal step meets the linearised equations. The tangential step, in
the null space of their Jacobian, minimises a quadratic model. The Hessian of the model is that
of the Lagrangian, by differences of exact gradients along a basis of the null space.
Multipliers are least-squares estimates at the point; inequalities enter through the dual of the
reduced quadratic program. A trust region with the l1 merit function and second-order
corrections globalises the search. Source: Nocedal and Wright, *Numerical Optimization*,
chapters 15 to 18.
"""

import math
from typing import NamedTuple

import numpy as np

from ares_models.jit import allocating, kernel
from ares_optimizer.direct.kernels.evaluate import (
    Point,
    evaluate,
    evaluate_with_gradients,
    make_point,
    make_scratch,
)
from ares_optimizer.direct.kernels.flight import Scratch, drop_column
from ares_optimizer.direct.kernels.problem import D_EARLIEST, TIME_SCALE, Problem
from ares_optimizer.kernels.algebra import (
    Array,
    dual_multipliers,
    full_qr,
    least_step,
    row_multipliers,
    solve_lower_transposed,
)

# exit status of a search
CONVERGED = 0
TOO_MANY_ITERATIONS = 1
NO_PROGRESS = 2
NOT_FEASIBLE = 3
NOT_FINITE = 4
STOPPED = 5

_DIFFERENCE = 1e-6
_FEASIBLE = 1e-8
_DECREASE = 1e-9  # predicted decrease of the objective: 3e-5 kg on the default mission
_PATIENCE = 12
_FLAT_DECREASE = 1e-7  # this and the next replace the two above after _PATIENCE iterations
_FLAT_FEASIBLE = 1e-7
_NEAR = 0.05
_FIRST_RADIUS = 1.0
_LARGEST_RADIUS = 10.0
_SMALLEST_RADIUS = 1e-7
_RESTORE_STEP = 0.6
_CORRECTIONS = 3
_SHIFTS = 24


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


@kernel
def into_bounds(p: Array, problem: Problem) -> None:
    """Clip the times of a guess to the range in which a flight can have them."""
    n = problem.variables
    earliest = (problem.earliest_cutoff - problem.start_time) / TIME_SCALE
    latest = (problem.latest_cutoff - problem.start_time) / TIME_SCALE
    p[n - 1] = min(max(p[n - 1], earliest), latest)
    floor = -math.inf
    for d in range(problem.drops.shape[0]):
        column = drop_column(problem, d)
        floor = max(floor, (problem.drops[d, D_EARLIEST] - problem.start_time) / TIME_SCALE)
        p[column] = max(min(p[column], p[n - 1] - 0.01), floor)
        floor = p[column]


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
def restore(p: Array, problem: Problem, workspace: Workspace, goal: float, iterations: int) -> int:
    """Reduce the constraint violation of a guess by damped Gauss-Newton steps.

    Args:
        p: shape (n,), changed.
        problem: the flight.
        workspace: on return its ``point`` holds the values at ``p``.
        goal: violation at which to stop.
        iterations: most iterations.

    Returns:
        iterations used.
    """
    scratch, point, other = workspace
    n = problem.variables
    step = np.empty(n)
    trial = np.empty(n)
    none = np.zeros(point.inequalities.size)
    damping = 0.0
    evaluate_with_gradients(p, problem, scratch, point)
    square = sum_of_squares(point)
    for k in range(iterations):
        if violation(point) <= goal or not math.isfinite(square) or problem.stop[0] != 0:
            return k
        # inequalities at their limit are active too, or the step would violate them
        rows, values, _ = active_rows(point, none, -1e-9)
        least_step(rows, values, damping + 1e-13, step)
        size = 0.0
        for s in step:
            size = max(size, abs(s))
        if not math.isfinite(size):
            return k
        factor = min(1.0, _RESTORE_STEP / size) if size > 0.0 else 1.0
        better = False
        for _ in range(8):
            for j in range(n):
                trial[j] = p[j] + factor * step[j]
            into_bounds(trial, problem)
            evaluate(trial, problem, scratch, other)
            if sum_of_squares(other) < square * (1.0 - 1e-3 * factor):
                better = True
                break
            factor *= 0.4
        if better:
            p[:] = trial
            damping = 0.1 * damping if damping > 1e-6 else 0.0
            evaluate_with_gradients(p, problem, scratch, point)
            square = sum_of_squares(point)
        elif damping >= 1.0:
            return k
        else:
            damping = max(1e-3, 10.0 * damping)
    return iterations


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


@kernel
def linear_value(point: Point, a: int, step: Array) -> float:
    """Return the linearised value of inequality ``a`` after a step."""
    c: float = point.inequalities[a]
    for j in range(step.size):
        c += point.inequality_rows[a, j] * step[j]
    return c


@kernel
def linear_violation(point: Point, step: Array) -> float:
    """Return the sum of the violations of the linearised constraints after a step."""
    s = 0.0
    for a in range(point.equations.size):
        c = point.equations[a]
        for j in range(step.size):
            c += point.equation_rows[a, j] * step[j]
        s += abs(c)
    for a in range(point.inequalities.size):
        s += max(linear_value(point, a, step), 0.0)
    return s


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


class Merit(NamedTuple):
    """Hold the l1 merit function, objective + penalty * sum of violations, at a point.

    Attributes:
        penalty: weight of the violations.
        level: value before the step.
        promised: decrease that the model predicts.
    """

    penalty: float
    level: float
    promised: float


@kernel
def merit_of(f: float, penalty: float, step: Step, point: Point, multipliers: Multipliers) -> Merit:
    """Choose the penalty and predict the decrease of the merit function for a step.

    Args:
        f: objective at the point.
        penalty: of the last step.
        step: from the point.
        point: the point.
        multipliers: at the point.
    """
    most = 0.0
    for nu in multipliers.nu:
        most = max(most, abs(nu))
    for mu in multipliers.mu:
        most = max(most, mu)
    total = sum_violation(point)
    gain = total - linear_violation(point, step.step)
    if not 1.5 * most <= penalty <= 6.0 * most:
        penalty = 2.0 * most + 1e-3
    if gain > 0.0:
        penalty = max(penalty, 2.0 * (step.first_order + step.second_order) / gain)
    return Merit(
        penalty, f + penalty * total, penalty * gain - step.first_order - step.second_order
    )


@allocating
def try_step(
    step: Array, trial: Array, merit: Merit, problem: Problem, workspace: Workspace
) -> float:
    """Return the merit at a trial point, after second-order corrections where they help.

    Args:
        step: shape (n,), the step to the trial point.
        trial: shape (n,), changed by second-order corrections: the same Jacobian on the new
            residuals.
        merit: of the step.
        problem: the flight.
        workspace: ``point`` holds the values before the step; ``other`` is written.
    """
    scratch, point, other = workspace
    found = evaluate(trial, problem, scratch, other)
    found += merit.penalty * sum_violation(other)
    if found <= merit.level - 0.7 * merit.promised + 1e-12 * abs(merit.level):
        return found
    e = point.equations.size
    reached = np.zeros(point.inequalities.size)
    for a in range(reached.size):
        reached[a] = 1.0 if linear_value(point, a, step) > -1e-9 else 0.0
    rows, residuals, index = active_rows(point, reached, math.inf)
    back = trial.copy()
    turn = np.empty(trial.size)
    for _ in range(_CORRECTIONS):
        residuals[:e] = other.equations
        for a in range(e, residuals.size):
            residuals[a] = other.inequalities[index[a]]
        least_step(rows, residuals, 1e-13, turn)
        for j in range(trial.size):
            back[j] += turn[j]
        corrected = evaluate(back, problem, scratch, other)
        corrected += merit.penalty * sum_violation(other)
        if not corrected < found:
            break
        found = corrected
        trial[:] = back
    return found


class TrustDecision(NamedTuple):
    """Hold the decision on a step and the next trust-region radius.

    Attributes:
        accepted: true if the step is taken.
        radius: of the trust region for the next step.
    """

    accepted: bool
    radius: float


@kernel
def assess_step(
    found: float, merit: Merit, length: float, radius: float, first: bool
) -> TrustDecision:
    """Accept or reject a step and resize the trust region.

    Args:
        found: merit after the step.
        merit: before the step, with the predicted decrease.
        length: of the step.
        radius: of the trust region.
        first: true at the first trial from this point.
    """
    level, promised = merit.level, merit.promised
    if not found <= level - 0.05 * promised + 1e-12 * abs(level):
        return TrustDecision(False, 0.3 * min(radius, length))
    if first and found <= level - 0.6 * promised and length > 0.8 * radius:
        return TrustDecision(True, min(2.0 * radius, _LARGEST_RADIUS))
    if found > level - 0.25 * promised:
        return TrustDecision(True, max(0.5 * length, _SMALLEST_RADIUS))
    return TrustDecision(True, radius)


@allocating
def minimise(
    p: Array, problem: Problem, workspace: Workspace, iterations: int, multipliers: Multipliers
) -> tuple[int, int, float, float]:
    """Search for the optimum from a guess.

    Args:
        p: shape (n,), changed.
        problem: the flight.
        workspace: on return its ``point`` holds the values at ``p``.
        iterations: most iterations.
        multipliers: written.

    Returns:
        exit status, iterations, largest violation, and the least eigenvalue of the Hessian of
        the Lagrangian in the null space of the equations.
    """
    point = workspace.point
    curvature = 0.0
    new_mu = np.zeros(multipliers.mu.size)
    trial = np.empty(p.size)
    penalty = 0.0
    radius = _FIRST_RADIUS
    f = evaluate_with_gradients(p, problem, workspace.scratch, point)
    if not math.isfinite(violation(point)):
        return NOT_FINITE, 0, math.inf, curvature
    multipliers.mu[:] = 0.0
    for k in range(iterations):
        miss = violation(point)
        estimate_multipliers(point, multipliers)
        model = build_model(p, problem, workspace, multipliers)
        if problem.stop[0] != 0:
            return STOPPED, k, miss, curvature
        if not math.isfinite(model.curvature):
            return NOT_FINITE, k, miss, curvature
        curvature = model.curvature
        enough = _DECREASE if k < _PATIENCE else _FLAT_DECREASE
        close = _FEASIBLE if k < _PATIENCE else _FLAT_FEASIBLE
        accepted = False
        first = True
        while not accepted:
            step = model_step(point, model, radius, new_mu)
            if miss <= close and abs(step.first_order) + abs(step.second_order) <= enough:
                multipliers.mu[:] = new_mu
                estimate_multipliers(point, multipliers)
                return CONVERGED, k, miss, curvature
            merit = merit_of(f, penalty, step, point, multipliers)
            penalty = merit.penalty
            for j in range(p.size):
                trial[j] = p[j] + step.step[j]
            found = try_step(step.step, trial, merit, problem, workspace)
            accepted, radius = assess_step(found, merit, length_of(step.step), radius, first)
            first = False
            if not accepted and not radius >= _SMALLEST_RADIUS:
                estimate_multipliers(point, multipliers)
                return (NO_PROGRESS if miss <= 1e-6 else NOT_FEASIBLE), k, miss, curvature
        p[:] = trial
        multipliers.mu[:] = new_mu
        f = evaluate_with_gradients(p, problem, workspace.scratch, point)
    return TOO_MANY_ITERATIONS, iterations, violation(point), curvature


@allocating
def search(
    p: Array, problem: Problem, goal: float, iterations: int
) -> tuple[int, int, float, float, Array, Array, Array, Array]:
    """Restore feasibility, then minimise.

    Args:
        p: shape (n,), a guess, changed.
        problem: the flight.
        goal: violation up to which the guess is restored before the search.
        iterations: most iterations of either.

    Returns:
        exit status; iterations; largest violation; least curvature; multipliers of the
        equations (e,) and of the inequalities (i,); the inequalities (i,); the final state
        (8,): time s after the start, position, velocity, mass.
    """
    workspace = Workspace(make_scratch(problem), make_point(problem), make_point(problem))
    point = workspace.point
    multipliers = Multipliers(np.zeros(point.equations.size), np.zeros(point.inequalities.size))
    into_bounds(p, problem)
    used = restore(p, problem, workspace, goal, iterations)
    end, more, miss, curvature = minimise(p, problem, workspace, iterations, multipliers)
    evaluate(p, problem, workspace.scratch, point)
    return (
        end,
        used + more,
        miss,
        curvature,
        multipliers.nu,
        multipliers.mu,
        point.inequalities,
        workspace.scratch.final,
    )
