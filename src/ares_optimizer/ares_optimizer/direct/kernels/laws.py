# SPDX-License-Identifier: Apache-2.0
"""Steering laws of a flight, with their tangents.

A burn in held attitude has a law of its own, which overrides the law in force; that one continues
afterwards.
"""

from typing import NamedTuple

import numpy as np

from ares_models.jit import allocating, kernel
from ares_models.kernels.vectors import Vector, axpy, load, scale, store
from ares_optimizer.direct.kernels.breaks import DROP, FIXED, LAW, Break
from ares_optimizer.direct.kernels.engine import Engine, mass_at
from ares_optimizer.direct.kernels.jump import JUMP_INPUTS, JUMP_OUTPUTS, jump, jump_jacobian
from ares_optimizer.direct.kernels.problem import (
    AT_DROP,
    D_MASS,
    L_BEGINS,
    L_DIRECTION,
    L_DROP,
    L_RATE,
    RATE_SCALE,
    TIME_SCALE,
    Problem,
)
from ares_optimizer.direct.kernels.scratch import (
    COLUMNS,
    W_BASE,
    W_HELD,
    W_POSITION,
    W_RATE,
    W_VELOCITY,
    Run,
)
from ares_optimizer.kernels.algebra import Array, Index


@kernel
def add_column(row: Array, n: int, column: int, factor: float, x: Vector) -> None:
    """Add ``factor`` x to one column of a flat (3, n) tangent."""
    row[column] += factor * x[0]
    row[n + column] += factor * x[1]
    row[2 * n + column] += factor * x[2]


@allocating
def jump_law(
    x: Array, slopes: tuple[float, float], column: int, problem: Problem, run: Run
) -> tuple[Vector, Vector]:
    """Apply the jump condition at a jettison to the law and its tangents.

    Args:
        x: shape (JUMP_INPUTS,), see ``jump``.
        slopes: time derivatives of T/m before and after, m/s3.
        column: of the jettison time.
        problem: the flight.
        run: of :func:`fly`; its base and rate rows hold the tangents before the jettison, at
            that instant, and are overwritten with those after.

    Returns:
        steering vector and its rate after the jettison.
    """
    n = run.counts[COLUMNS]
    work = run.work
    environment = problem.environment[0]
    y = np.empty(JUMP_OUTPUTS)
    jump(x, environment, problem.atmosphere, y)
    if n > 0:
        jacobian = np.empty((JUMP_OUTPUTS, JUMP_INPUTS))
        jump_jacobian(x, environment, problem.atmosphere, jacobian)
        inputs = np.empty(JUMP_INPUTS)
        for j in range(n):
            for c in range(3):
                inputs[c] = work[W_POSITION, c * n + j]
                inputs[3 + c] = work[W_VELOCITY, c * n + j]
                inputs[6 + c] = work[W_BASE, c * n + j]
                inputs[9 + c] = work[W_RATE, c * n + j]
            inputs[12] = slopes[0] * TIME_SCALE if j == column else 0.0
            inputs[13] = slopes[1] * TIME_SCALE if j == column else 0.0
            for c in range(6):
                s = 0.0
                for k in range(JUMP_INPUTS):
                    s += jacobian[c, k] * inputs[k]
                work[W_BASE + c // 3, c % 3 * n + j] = s
    return (y[0], y[1], y[2]), (y[3], y[4], y[5])


class Steering(NamedTuple):
    """Hold the steering law in force: direction + rate (t - time).

    Attributes:
        time: begin, s after the start.
        column: variable that sets this time; FIXED: none.
        direction: steering vector at that time, no unit.
        rate: 1/s.
        rows: first of the two rows of its tangents in the scratch.
    """

    time: float
    column: int
    direction: Vector
    rate: Vector
    rows: int


@kernel
def law_at(at: Break, laws: Index) -> int:
    """Return the index of the law that begins at a break; -1: none."""
    if at.kind == LAW:
        return at.number
    found = -1
    if at.kind == DROP:
        for k in range(laws.shape[0]):
            if laws[k, L_BEGINS] == AT_DROP and laws[k, L_DROP] == at.number:
                found = k
    return found


@kernel
def free_law(k: int, p: Array, laws: Index, direction: Vector, run: Run) -> Steering:
    """Return a law with free rate, and free direction unless it is continuous."""
    n = run.counts[COLUMNS]
    work = run.work
    direction_column = laws[k, L_DIRECTION]
    rate_column = laws[k, L_RATE]
    if direction_column >= 0:
        direction = load(p[direction_column:])
    if n > 0:
        if direction_column >= 0:
            work[W_BASE, : 3 * n] = 0.0
        work[W_RATE, : 3 * n] = 0.0
        for c in range(3):
            if direction_column >= 0:
                work[W_BASE, c * n + direction_column + c] = 1.0
            work[W_RATE, c * n + rate_column + c] = RATE_SCALE
    rate = scale(RATE_SCALE, load(p[rate_column:]))
    return Steering(0.0, int(FIXED), direction, rate, int(W_BASE))


@allocating
def law_of_jump(
    at: Break, law: Steering, direction: Vector, engine: Engine, problem: Problem, run: Run
) -> Steering:
    """Return the law after a jettison by the jump condition; ``engine`` is before it."""
    tau = at.time - engine.anchor
    thrust = engine.thrust + tau * engine.thrust_slope
    flow = engine.flow + tau * engine.flow_slope
    mass = mass_at(engine, at.time)
    rest = mass - problem.drops[at.number, D_MASS]
    x = np.empty(JUMP_INPUTS)
    for c in range(6):
        x[c] = run.state[c]
    store(x[6:], direction)
    store(x[9:], law.rate)
    x[12] = thrust / mass
    x[13] = thrust / rest
    slopes = (
        (engine.thrust_slope + thrust * flow / mass) / mass,
        (engine.thrust_slope + thrust * flow / rest) / rest,
    )
    after, rate = jump_law(x, slopes, at.column, problem, run)
    return Steering(0.0, int(FIXED), after, rate, int(W_BASE))


@kernel
def change_law(
    k: int, at: Break, law: Steering, engine: Engine, p: Array, problem: Problem, run: Run
) -> Steering:
    """Return law ``k`` from a break on and set its tangents.

    ``law`` and ``engine`` are those before the break.
    """
    n = run.counts[COLUMNS]
    work = run.work
    dt = at.time - law.time
    direction = axpy(dt, law.rate, law.direction)
    if n > 0:
        # tangents of the direction at this moving instant
        for c in range(3 * n):
            work[W_BASE, c] += dt * work[W_RATE, c]
        if law.column != FIXED:
            add_column(work[W_BASE], n, law.column, -TIME_SCALE, law.rate)
        if at.column != FIXED:
            add_column(work[W_BASE], n, at.column, TIME_SCALE, law.rate)
    if problem.laws[k, L_RATE] < 0:
        new = law_of_jump(at, law, direction, engine, problem, run)
    else:
        new = free_law(k, p, problem.laws, direction, run)
    return Steering(at.time, at.column, new.direction, new.rate, int(W_BASE))


@kernel
def held_law(at: Break, p: Array, held: Index, run: Run) -> Steering:
    """Return the law of a burn in held attitude and set its tangents."""
    n = run.counts[COLUMNS]
    column = held[at.number]
    for row in range(W_HELD, W_HELD + 2):
        for k in range(3 * n):
            run.work[row, k] = 0.0
    if n > 0:
        for c in range(3):
            run.work[W_HELD, c * n + column + c] = 1.0
    return Steering(at.time, int(FIXED), load(p[column:]), (0.0, 0.0, 0.0), int(W_HELD))
