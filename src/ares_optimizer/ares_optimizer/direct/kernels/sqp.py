# SPDX-License-Identifier: Apache-2.0
"""Minimise by sequential quadratic programming on exact gradients, compiled throughout.

Each step is that of a quadratic model (``quadratic``), with multipliers estimated at the point
(``lagrangian``). A trust region with the l1 merit function and second-order corrections
globalises the search. Source: Nocedal and Wright, *Numerical Optimization*, chapters 15 to 18.
"""

import math
from typing import NamedTuple

import numpy as np

from ares_models.jit import allocating, kernel
from ares_optimizer.direct.kernels.breaks import drop_column
from ares_optimizer.direct.kernels.evaluate import (
    Point,
    evaluate,
    evaluate_with_gradients,
    make_point,
    make_scratch,
)
from ares_optimizer.direct.kernels.lagrangian import (
    Multipliers,
    Workspace,
    active_rows,
    estimate_multipliers,
    sum_of_squares,
    sum_violation,
    violation,
)
from ares_optimizer.direct.kernels.problem import D_EARLIEST, TIME_SCALE, Problem
from ares_optimizer.direct.kernels.quadratic import Step, build_model, length_of, model_step
from ares_optimizer.kernels.algebra import Array, least_step

# exit status of a search
CONVERGED = 0
TOO_MANY_ITERATIONS = 1
NO_PROGRESS = 2
NOT_FEASIBLE = 3
NOT_FINITE = 4
STOPPED = 5
_FEASIBLE = 1e-8
_DECREASE = 1e-9  # predicted decrease of the objective: 3e-5 kg on the default mission
_PATIENCE = 12
_FLAT_DECREASE = 1e-7  # this and the next replace the two above after _PATIENCE iterations
_FLAT_FEASIBLE = 1e-7
_FIRST_RADIUS = 1.0
_LARGEST_RADIUS = 10.0
_SMALLEST_RADIUS = 1e-7
_RESTORE_STEP = 0.6
_CORRECTIONS = 3


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
