"""Sequential quadratic programming on exact gradients, compiled from end to end.

Each step works in the null space of the equations: the part of the step that meets them is
fixed by their Jacobian, the rest minimises a quadratic model whose Hessian, that of the
Lagrangian (second derivatives of the constraints included), comes from differences of exact
gradients along a basis of the null space only. Multipliers are those of least squares at
the point, inequalities enter through the dual of the small quadratic programme, a trust
region with the l1 merit function and a second-order correction guards the steps. Source:
Nocedal and Wright, *Numerical Optimization*, chapters 15 to 18.
"""

import math

import numpy as np

from ares_models.jit import kernel
from ares_optimizer.direct.kernels.evaluate import (
    Point,
    Scratch,
    evaluate,
    make_point,
    make_scratch,
)
from ares_optimizer.direct.kernels.flight import drop_column
from ares_optimizer.direct.kernels.problem import D_EARLIEST, TIME_SCALE, Problem
from ares_optimizer.kernels.algebra import (
    Array,
    dual_multipliers,
    full_qr,
    least_step,
    row_multipliers,
    solve_lower_transposed,
)

# how a search ended
CONVERGED = 0
TOO_MANY_ITERATIONS = 1
NO_PROGRESS = 2
NOT_FEASIBLE = 3
NOT_FINITE = 4
STOPPED = 5

_DIFFERENCE = 1e-6
_FEASIBLE = 1e-8
_DECREASE = 1e-9  # of the objective that the model still sees: 3e-5 kg on the default mission
_PATIENCE = 12
_FLAT_DECREASE = 1e-7  # both after so many iterations, in a flat valley
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
    """Largest amount by which a constraint is missed; inf when something is not finite."""
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
def sum_violation(point: Point, power: int) -> float:
    """Sum of what the constraints miss, or of its squares; inf when not finite."""
    s = 0.0
    for c in point.equations:
        s += abs(c) ** power
    for c in point.inequalities:
        s += max(c, 0.0) ** power
    return s if math.isfinite(s) else math.inf


@kernel
def into_bounds(p: Array, problem: Problem) -> None:
    """Move the times of a guess to where a flight can have them."""
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


@kernel
def active_rows(point: Point, mu: Array, level: float) -> tuple[Array, Array, np.ndarray]:
    """Gradients and values of the equations and of the inequalities that count.

    Args:
        point: the point.
        mu: shape (i,): an inequality with a positive multiplier counts.
        level: so does one above this.

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


@kernel
def restore(
    p: Array,
    problem: Problem,
    scratch: Scratch,
    point: Point,
    other: Point,
    goal: float,
    iterations: int,
) -> tuple[float, int]:
    """Bring a guess near the constraints: Gauss-Newton with damping.

    Args:
        p: shape (n,), changed.
        problem: the flight.
        scratch: from ``make_scratch``.
        point, other: from ``make_point``; ``point`` is that of ``p`` in the end.
        goal: violation at which to stop.
        iterations: at most so many.

    Returns:
        violation reached, and iterations.
    """
    n = problem.variables
    step = np.empty(n)
    trial = np.empty(n)
    none = np.zeros(point.inequalities.size)
    damping = 0.0
    evaluate(p, problem, n, scratch, point)
    square = sum_violation(point, 2)
    for k in range(iterations):
        if violation(point) <= goal or not math.isfinite(square) or problem.stop[0] != 0:
            return violation(point), k
        # what is at its limit is held too, or the step would run into it
        rows, values, _ = active_rows(point, none, -1e-9)
        least_step(rows, values, damping + 1e-13, step)
        size = 0.0
        for s in step:
            size = max(size, abs(s))
        if not math.isfinite(size):
            return violation(point), k
        factor = min(1.0, _RESTORE_STEP / size) if size > 0.0 else 1.0
        better = False
        for _ in range(8):
            for j in range(n):
                trial[j] = p[j] + factor * step[j]
            into_bounds(trial, problem)
            evaluate(trial, problem, 0, scratch, other)
            if sum_violation(other, 2) < square * (1.0 - 1e-3 * factor):
                better = True
                break
            factor *= 0.4
        if better:
            p[:] = trial
            damping = 0.1 * damping if damping > 1e-6 else 0.0
            evaluate(p, problem, n, scratch, point)
            square = sum_violation(point, 2)
        elif damping >= 1.0:
            return violation(point), k
        else:
            damping = max(1e-3, 10.0 * damping)
    return violation(point), iterations


@kernel
def estimate_multipliers(point: Point, nu: Array, mu: Array) -> None:
    """Multipliers by least squares at the point.

    Args:
        point: the point.
        nu: shape (e,), written.
        mu: shape (i,): those positive, and inequalities near their limit, are taken for
            active as long as their multiplier is positive; written, not negative.
    """
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


@kernel
def lagrangian_gradient(point: Point, nu: Array, mu: Array, out: Array) -> None:
    """Gradient of objective + nu . equations + mu . inequalities."""
    out[:] = point.gradient
    for a in range(nu.size):
        for j in range(out.size):
            out[j] += nu[a] * point.equation_rows[a, j]
    for a in range(mu.size):
        if mu[a] != 0.0:
            for j in range(out.size):
                out[j] += mu[a] * point.inequality_rows[a, j]


@kernel
def reduced_hessian(
    p: Array,
    problem: Problem,
    scratch: Scratch,
    other: Point,
    nu: Array,
    mu: Array,
    base: Array,
    basis: Array,
    normal: Array,
    hessian: Array,
    cross: Array,
) -> None:
    """Hessian of the Lagrangian in the null space, and its action on the normal step.

    Args:
        p: shape (n,).
        problem: the flight.
        scratch: from ``make_scratch``.
        other: scratch of a point.
        nu, mu: multipliers.
        base: gradient of the Lagrangian at ``p``.
        basis: shape (n, z), orthonormal columns.
        normal: shape (n,).
        hessian: shape (z, z), written: Z^T H Z.
        cross: shape (z,), written: Z^T H normal.
    """
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
        evaluate(trial, problem, n, scratch, other)
        lagrangian_gradient(other, nu, mu, moved)
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


@kernel
def tangent_step(
    point: Point,
    basis: Array,
    normal: Array,
    slope: Array,
    values: Array,
    vectors: Array,
    radius: float,
    mu: Array,
    free: Array,
) -> None:
    """Minimise the model in the null space, inequalities and trust region included.

    Args:
        point: the point.
        basis: shape (n, z).
        normal: shape (n,), the part of the step that is fixed.
        slope: shape (z,), gradient of the model at the normal step.
        values, vectors: eigenvalues (in modulus) and eigenvectors of the model's Hessian.
        radius: of the trust region.
        mu: shape (i,), written: multipliers of the inequalities.
        free: shape (z,), written.
    """
    n, z = basis.shape
    i = mu.size
    top = 0.0
    for a in range(z):
        top = max(top, values[a])
    floor = max(1e-12, 1e-9 * top)
    rows = np.empty((i, z))
    start = np.empty(i)
    for a in range(i):
        for b in range(z):
            s = 0.0
            for j in range(n):
                s += point.inequality_rows[a, j] * basis[j, b]
            rows[a, b] = s
        s = -point.inequalities[a]
        for j in range(n):
            s -= point.inequality_rows[a, j] * normal[j]
        start[a] = s
    inverse = np.empty((z, z))
    along = np.empty((i, z))
    room = np.empty(i)
    dual = np.empty((i, i))
    size = 0.0
    # what is added to the eigenvalues to keep the step, inequalities met, in the trust region
    shift = 0.0
    low = 0.0
    high = math.inf
    for _ in range(_SHIFTS):
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
            room[a] = start[a]
            for b in range(z):
                room[a] -= rows[a, b] * free[b]
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
        dual_multipliers(dual, room, mu)
        size = 0.0
        for b in range(z):
            for a in range(i):
                if mu[a] != 0.0:
                    free[b] -= along[a, b] * mu[a]
            size += free[b] * free[b]
        size = math.sqrt(size)
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
    for b in range(z):
        free[b] *= 1.2 * radius / size


@kernel
def linear_value(point: Point, a: int, step: Array) -> float:
    """Inequality ``a`` after a step, linearised."""
    c: float = point.inequalities[a]
    for j in range(step.size):
        c += point.inequality_rows[a, j] * step[j]
    return c


@kernel
def linear_violation(point: Point, step: Array) -> float:
    """Sum of what the linearised constraints miss after a step."""
    s = 0.0
    for a in range(point.equations.size):
        c = point.equations[a]
        for j in range(step.size):
            c += point.equation_rows[a, j] * step[j]
        s += abs(c)
    for a in range(point.inequalities.size):
        s += max(linear_value(point, a, step), 0.0)
    return s


@kernel
def minimise(
    p: Array,
    problem: Problem,
    scratch: Scratch,
    point: Point,
    other: Point,
    iterations: int,
    nu: Array,
    mu: Array,
    curvature: Array,
) -> tuple[int, int, float, float]:
    """Search for the optimum from a guess.

    Args:
        p: shape (n,), changed.
        problem: the flight.
        scratch: from ``make_scratch``.
        point, other: from ``make_point``; ``point`` is that of ``p`` in the end.
        iterations: at most so many.
        nu: shape (e,), written: multipliers of the equations.
        mu: shape (i,), written: of the inequalities, not negative.
        curvature: shape (1,), written: least eigenvalue of the Hessian of the Lagrangian in
            the null space of the equations.

    Returns:
        how it ended, iterations, largest violation, and the decrease of the objective that
        the model still sees.
    """
    n = problem.variables
    e = nu.size
    i = mu.size
    z = n - e
    q = np.empty((n, n))
    r = np.empty((e, e))
    y = np.empty(e)
    right = np.empty(e)
    whole = np.empty(n)
    normal = np.empty(n)
    base = np.empty(n)
    step = np.empty(n)
    trial = np.empty(n)
    back = np.empty(n)
    turn = np.empty(n)
    hessian = np.empty((z, z))
    cross = np.empty(z)
    slope = np.empty(z)
    free = np.empty(z)
    values = np.empty(z)
    new_mu = np.zeros(i)
    reached = np.zeros(i)
    penalty = 0.0
    radius = _FIRST_RADIUS
    f = evaluate(p, problem, n, scratch, point)
    if not math.isfinite(violation(point)):
        return NOT_FINITE, 0, math.inf, math.inf
    mu[:] = 0.0
    for k in range(iterations):
        miss = violation(point)
        estimate_multipliers(point, nu, mu)
        full_qr(point.equation_rows, q, r)
        for a in range(e):
            right[a] = -point.equations[a]
        solve_lower_transposed(r, right, y)
        size = 0.0
        for j in range(n):
            s = 0.0
            for a in range(e):
                s += q[j, a] * y[a]
            whole[j] = s
            size += s * s
        size = math.sqrt(size)
        lagrangian_gradient(point, nu, mu, base)
        basis = np.ascontiguousarray(q[:, e:])
        reduced_hessian(p, problem, scratch, other, nu, mu, base, basis, whole, hessian, cross)
        if problem.stop[0] != 0:
            return STOPPED, k, miss, math.inf
        if not math.isfinite(np.sum(hessian)):
            return NOT_FINITE, k, miss, math.inf
        eigenvalues, vectors = np.linalg.eigh(hessian)
        for a in range(z):
            values[a] = abs(eigenvalues[a])
        curvature[0] = eigenvalues[0]
        accepted = False
        first = True
        while not accepted:
            shrink = min(1.0, 0.8 * radius / size) if size > 0.0 else 1.0
            for j in range(n):
                normal[j] = shrink * whole[j]
            for a in range(z):
                s = shrink * cross[a]
                for j in range(n):
                    s += basis[j, a] * point.gradient[j]
                slope[a] = s
            tangent_step(point, basis, normal, slope, values, vectors, radius, new_mu, free)
            change = 0.0
            for j in range(n):
                s = normal[j]
                for a in range(z):
                    s += basis[j, a] * free[a]
                step[j] = s
                change += point.gradient[j] * s
            bend = 0.0
            for a in range(z):
                bend += shrink * cross[a] * free[a]
                for b in range(z):
                    bend += 0.5 * free[a] * hessian[a, b] * free[b]
            enough = _DECREASE if k < _PATIENCE else _FLAT_DECREASE
            close = _FEASIBLE if k < _PATIENCE else _FLAT_FEASIBLE
            if miss <= close and abs(change) + abs(bend) <= enough:
                mu[:] = new_mu
                estimate_multipliers(point, nu, mu)
                return CONVERGED, k, miss, abs(change)

            # the merit function as judge
            most = 0.0
            for a in range(e):
                most = max(most, abs(nu[a]))
            for a in range(i):
                most = max(most, mu[a])
            total = sum_violation(point, 1)
            gain = total - linear_violation(point, step)
            if not 1.5 * most <= penalty <= 6.0 * most:
                penalty = 2.0 * most + 1e-3
            if gain > 0.0:
                penalty = max(penalty, 2.0 * (change + bend) / gain)
            promised = penalty * gain - change - bend
            level = f + penalty * total
            for j in range(n):
                trial[j] = p[j] + step[j]
            f2 = evaluate(trial, problem, 0, scratch, other)
            found = f2 + penalty * sum_violation(other, 1)
            slack = 1e-12 * abs(level)
            if not found <= level - 0.7 * promised + slack:
                # second-order corrections: the same Jacobian on the new residuals
                back[:] = trial
                for a in range(i):
                    reached[a] = 1.0 if linear_value(point, a, step) > -1e-9 else 0.0
                rows, residuals, index = active_rows(point, reached, math.inf)
                for _ in range(_CORRECTIONS):
                    residuals[:e] = other.equations
                    for a in range(e, residuals.size):
                        residuals[a] = other.inequalities[index[a]]
                    least_step(rows, residuals, 1e-13, turn)
                    for j in range(n):
                        back[j] += turn[j]
                    f3 = evaluate(back, problem, 0, scratch, other)
                    corrected = f3 + penalty * sum_violation(other, 1)
                    if not corrected < found:
                        break
                    found = corrected
                    trial[:] = back
            length = 0.0
            for j in range(n):
                length += step[j] * step[j]
            length = math.sqrt(length)
            if found <= level - 0.05 * promised + slack:
                accepted = True
                if first and found <= level - 0.6 * promised and length > 0.8 * radius:
                    radius = min(2.0 * radius, _LARGEST_RADIUS)
                elif found > level - 0.25 * promised:
                    radius = max(0.5 * length, _SMALLEST_RADIUS)
            else:
                first = False
                radius = 0.3 * min(radius, length)
                if not radius >= _SMALLEST_RADIUS:
                    estimate_multipliers(point, nu, mu)
                    end = NO_PROGRESS if miss <= 1e-6 else NOT_FEASIBLE
                    return end, k, miss, abs(change)
        p[:] = trial
        mu[:] = new_mu
        f = evaluate(p, problem, n, scratch, point)
    return TOO_MANY_ITERATIONS, iterations, violation(point), math.inf


@kernel
def search(
    p: Array, problem: Problem, goal: float, iterations: int
) -> tuple[int, int, float, float, Array, Array, Array, Array]:
    """Restore, then minimise.

    Args:
        p: shape (n,), a guess, changed.
        problem: the flight.
        goal: violation up to which the guess is restored before the search.
        iterations: at most so many of either.

    Returns:
        how it ended; iterations; largest violation; least curvature; multipliers of the
        equations (e,) and of the inequalities (i,); the inequalities (i,); the final state
        (8,): time s after the start, position, velocity, mass.
    """
    scratch = make_scratch(problem)
    point = make_point(problem)
    other = make_point(problem)
    nu = np.zeros(point.equations.size)
    mu = np.zeros(point.inequalities.size)
    curvature = np.zeros(1)
    into_bounds(p, problem)
    _, used = restore(p, problem, scratch, point, other, goal, iterations)
    end, more, miss, _ = minimise(p, problem, scratch, point, other, iterations, nu, mu, curvature)
    evaluate(p, problem, 0, scratch, point)
    return (
        end,
        used + more,
        miss,
        curvature[0],
        nu,
        mu,
        point.inequalities,
        scratch.final,
    )
