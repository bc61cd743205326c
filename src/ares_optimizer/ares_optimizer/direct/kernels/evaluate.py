# SPDX-License-Identifier: Apache-2.0
"""Evaluate objective and constraints of the finite problem, with gradients."""

import math
from typing import NamedTuple

import numpy as np

from ares_models.jit import allocating, kernel
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.vectors import load
from ares_optimizer.direct.kernels.breaks import MOST_STEPS, drop_column, lay_out
from ares_optimizer.direct.kernels.flight import fly
from ares_optimizer.direct.kernels.heating import heating_peaks
from ares_optimizer.direct.kernels.problem import (
    D_EARLIEST,
    D_LOG_LIMIT,
    HEATING_FROM_JETTISON,
    L_DIRECTION,
    MINIMISE_HEATING,
    PEAKS,
    TIME_SCALE,
    Problem,
)
from ares_optimizer.direct.kernels.scratch import (
    COLUMNS,
    LATER_PEAKS,
    N_COLUMNS,
    STORED,
    WORK_ROWS,
    Scratch,
)
from ares_optimizer.kernels.algebra import Array
from ares_optimizer.kernels.nystroem import STAGES
from ares_optimizer.kernels.terminal import MAX_ROWS, terminal_rows

_INACTIVE = -1.0
# least time from a jettison to the cut-off, s
_MARGIN = 0.1


class Point(NamedTuple):
    """Hold the constraints and the gradients at a point.

    Attributes:
        gradient: shape (n,), of the objective.
        equations: shape (e,), zero at a solution.
        equation_rows: shape (e, n), their gradients.
        inequalities: shape (i,), not above zero at a solution.
        inequality_rows: shape (i, n).
    """

    gradient: Array
    equations: Array
    equation_rows: Array
    inequalities: Array
    inequality_rows: Array


@kernel
def most_breaks(problem: Problem) -> int:
    """Return the most breaks that ``lay_out`` can write for a problem."""
    pieces = problem.profile.shape[0] + problem.tail.shape[0]
    laws = problem.laws.shape[0] + 2 * problem.held.shape[0]
    return pieces + laws + problem.drops.shape[0] + PEAKS + 1


@allocating
def make_scratch(problem: Problem) -> Scratch:
    """Allocate the work arrays for one problem."""
    n = problem.variables
    d = problem.drops.shape[0] + PEAKS
    breaks = most_breaks(problem)
    return Scratch(
        np.zeros(breaks),
        np.zeros((breaks, 4), np.int64),
        np.zeros((WORK_ROWS, 3 * n)),
        np.empty((breaks * (MOST_STEPS + 1), N_COLUMNS)),
        np.zeros((d, 14)),
        np.zeros((d, 6, n)),
        np.zeros(8),
        np.zeros((6, n)),
        np.zeros((MAX_ROWS, 6)),
        np.zeros(6),
        np.zeros((STAGES, 3)),
        np.zeros(4, np.int64),
        np.full(PEAKS, math.nan),
    )


@allocating
def count_rows(problem: Problem) -> tuple[int, int]:
    """Return the numbers of equations and of inequalities.

    Equations: terminal rows, then |B| = 1 (Eq. 3.42) per free or held direction. Inequalities:
    three per free drop (heating limit, earliest time, cut-off as latest time); one per pair of
    successive free drops (their order); two bounds of the cut-off time; where the limit holds
    from the jettison on, the heating at PEAKS later peaks.
    """
    c = np.empty(MAX_ROWS)
    rows = np.empty((MAX_ROWS, 6))
    environment = problem.environment[0]
    r = load(problem.state)
    v = load(problem.state[3:])
    equations = terminal_rows(problem.target[0], environment.mu, r, v, c, rows)
    for k in range(problem.laws.shape[0]):
        if problem.laws[k, L_DIRECTION] >= 0:
            equations += 1
    equations += problem.held.shape[0]
    drops = problem.drops.shape[0]
    inequalities = 3 * drops + max(0, drops - 1) + 2
    if problem.heating == HEATING_FROM_JETTISON and drops > 0:
        inequalities += PEAKS
    return equations, inequalities


@allocating
def make_point(problem: Problem) -> Point:
    """Allocate the values at one point."""
    n = problem.variables
    e, i = count_rows(problem)
    return Point(np.zeros(n), np.zeros(e), np.zeros((e, n)), np.zeros(i), np.zeros((i, n)))


@kernel
def heating_row(state: Array, tangents: Array, problem: Problem, row: Array, columns: int) -> float:
    """Return log heating at a node and write its gradient by the variables.

    Args:
        state: shape (>= 7,), from ``fly``.
        tangents: shape (6, n).
        problem: the flight.
        row: shape (n,), written if ``columns`` is not 0.
        columns: n with gradients, 0 without.
    """
    value, by_position, by_velocity = log_heating_gradient(
        load(state[1:]), load(state[4:]), problem.environment[0], problem.atmosphere
    )
    for j in range(columns):
        s = 0.0
        for c in range(3):
            s += by_position[c] * tangents[c, j] + by_velocity[c] * tangents[3 + c, j]
        row[j] = s
    return value


@kernel
def unit_equation(e: int, column: int, columns: int, p: Array, point: Point) -> None:
    """Write equation ``e``: a direction has unit length."""
    square = 0.0
    for c in range(3):
        square += p[column + c] * p[column + c]
    point.equations[e] = 0.5 * (square - 1.0)
    for j in range(columns):
        point.equation_rows[e, j] = 0.0
    if columns > 0:
        for c in range(3):
            point.equation_rows[e, column + c] = p[column + c]


@kernel
def terminal_equations(p: Array, problem: Problem, scratch: Scratch, point: Point) -> None:
    """Write the terminal rows, then |B| = 1 (Eq. 3.42) per free or held direction."""
    columns = scratch.counts[COLUMNS]
    equations = point.equations
    equation_rows = point.equation_rows
    r = load(scratch.final[1:])
    v = load(scratch.final[4:])
    mu = problem.environment[0].mu
    e = terminal_rows(problem.target[0], mu, r, v, equations, scratch.rows)
    for i in range(e):
        for j in range(columns):
            s = 0.0
            for c in range(6):
                s += scratch.rows[i, c] * scratch.final_tangents[c, j]
            equation_rows[i, j] = s
    for k in range(problem.laws.shape[0]):
        column = problem.laws[k, L_DIRECTION]
        if column >= 0:
            unit_equation(e, column, columns, p, point)
            e += 1
    for k in range(problem.held.shape[0]):
        unit_equation(e, problem.held[k], columns, p, point)
        e += 1


@kernel
def drop_inequalities(p: Array, problem: Problem, scratch: Scratch, point: Point) -> int:
    """Write the limits of the free drops and of the cut-off; return the row count."""
    columns = scratch.counts[COLUMNS]
    inequalities = point.inequalities
    rows = point.inequality_rows
    drops = problem.drops.shape[0]
    last = problem.variables - 1
    i = 0
    for d in range(drops):
        column = drop_column(problem, d)
        level = heating_row(scratch.drops[d], scratch.drop_tangents[d], problem, rows[i], columns)
        inequalities[i] = level - problem.drops[d, D_LOG_LIMIT]
        earliest = (problem.drops[d, D_EARLIEST] - problem.start_time) / TIME_SCALE
        inequalities[i + 1] = earliest - p[column]
        inequalities[i + 2] = p[column] - p[last] + _MARGIN / TIME_SCALE
        if columns > 0:
            rows[i + 1, column] = -1.0
            rows[i + 2, column] = 1.0
            rows[i + 2, last] = -1.0
        i += 3
    for d in range(drops - 1):
        column = drop_column(problem, d)
        inequalities[i] = p[column] - p[column + 1]
        if columns > 0:
            rows[i, column] = 1.0
            rows[i, column + 1] = -1.0
        i += 1
    inequalities[i] = (problem.earliest_cutoff - problem.start_time) / TIME_SCALE - p[last]
    inequalities[i + 1] = p[last] - (problem.latest_cutoff - problem.start_time) / TIME_SCALE
    if columns > 0:
        rows[i, last] = -1.0
        rows[i + 1, last] = 1.0
    return i + 2


@kernel
def peak_inequalities(
    first: int, p: Array, problem: Problem, scratch: Scratch, point: Point
) -> None:
    """Write the heating at later peaks, from row ``first`` on.

    The last peak may be the end of thrust. Unused rows are inactive.
    """
    columns = scratch.counts[COLUMNS]
    peaks = scratch.counts[LATER_PEAKS]
    drops = problem.drops.shape[0]
    limit = problem.drops[drops - 1, D_LOG_LIMIT]
    for k in range(PEAKS):
        row = point.inequality_rows[first + k]
        point.inequalities[first + k] = _INACTIVE
        if k >= peaks:
            continue
        state = scratch.final
        tangents = scratch.final_tangents
        if scratch.peaks[k] < p[problem.variables - 1] * TIME_SCALE:
            state = scratch.drops[drops + k]
            tangents = scratch.drop_tangents[drops + k]
        level = heating_row(state, tangents, problem, row, columns)
        point.inequalities[first + k] = level - limit


@kernel
def _evaluate(p: Array, problem: Problem, scratch: Scratch, point: Point) -> float:
    """Fly and evaluate, with the gradients that the COLUMNS of ``scratch`` ask for."""
    columns = scratch.counts[COLUMNS]
    drops = problem.drops.shape[0]
    path = problem.heating == HEATING_FROM_JETTISON and drops > 0
    scratch.counts[LATER_PEAKS] = 0
    if path:
        scratch.counts[COLUMNS] = 0
        lay_out(p, problem, scratch)
        fly(p, problem, scratch)
        scratch.counts[LATER_PEAKS] = heating_peaks(
            scratch.nodes,
            scratch.counts[STORED],
            scratch.drops[drops - 1, 0],
            problem.environment[0],
            problem.atmosphere,
            scratch.peaks,
        )
    scratch.counts[COLUMNS] = columns
    lay_out(p, problem, scratch)
    fly(p, problem, scratch)
    terminal_equations(p, problem, scratch, point)
    for i in range(point.inequalities.shape[0]):
        for j in range(columns):
            point.inequality_rows[i, j] = 0.0
    i = drop_inequalities(p, problem, scratch, point)
    if path:
        peak_inequalities(i, p, problem, scratch, point)
    for j in range(columns):
        point.gradient[j] = 0.0
    last = problem.variables - 1
    if problem.objective == MINIMISE_HEATING and drops > 0:
        # the heating at the last drop is the objective, not a constraint
        row = 3 * (drops - 1)
        value = point.inequalities[row] + problem.drops[drops - 1, D_LOG_LIMIT]
        point.inequalities[row] = _INACTIVE
        for j in range(columns):
            point.gradient[j] = point.inequality_rows[row, j]
            point.inequality_rows[row, j] = 0.0
        return value
    if columns > 0:
        point.gradient[last] = 1.0
    return p[last]


@kernel
def evaluate(p: Array, problem: Problem, scratch: Scratch, point: Point) -> float:
    """Fly and evaluate without gradients.

    Args:
        p: shape (n,).
        problem: the flight.
        scratch: from :func:`make_scratch`, written.
        point: from :func:`make_point`, written.

    Returns:
        objective: cut-off time after the start in TIME_SCALE s, or log heating at the last
        free drop.
    """
    scratch.counts[COLUMNS] = 0
    return _evaluate(p, problem, scratch, point)


@kernel
def evaluate_with_gradients(p: Array, problem: Problem, scratch: Scratch, point: Point) -> float:
    """Fly and evaluate with gradients; arguments and result as :func:`evaluate`."""
    scratch.counts[COLUMNS] = problem.variables
    return _evaluate(p, problem, scratch, point)
