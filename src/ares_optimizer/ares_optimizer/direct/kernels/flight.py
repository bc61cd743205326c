# SPDX-License-Identifier: Apache-2.0
"""Integrate the flight for given steering parameters, with exact first derivatives.

Thrust enters Eq. 2.1 as a known function of time, so the motion is r'' = g(r) + q(t). A Nystroem
method (``kernels/nystroem.py``) needs no velocity in its stages and five gravities per step.
Derivatives are those of the discrete method: every stage carries the tangents of its position,
those of the step length included where a leg ends at a free time. Tangents at such an end are
total derivatives at the moving node.
"""

import math
from typing import NamedTuple

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, axpy, dot, load, norm, scale, store
from ares_optimizer.direct.kernels.breaks import DROP, FIXED, HELD, HELD_END, PROBE, break_at
from ares_optimizer.direct.kernels.engine import Engine, change_engine, mass_at
from ares_optimizer.direct.kernels.laws import Steering, add_column, change_law, held_law, law_at
from ares_optimizer.direct.kernels.problem import P_MASS, TIME_SCALE, Problem
from ares_optimizer.direct.kernels.scratch import (
    BREAKS,
    COLUMNS,
    N_ACCELERATION,
    N_DIRECTION,
    N_MASS,
    N_POSITION,
    N_TIME,
    N_VELOCITY,
    STORED,
    W_BASE,
    W_FORCE,
    W_POSITION,
    W_STAGE,
    W_VELOCITY,
    Run,
    Scratch,
)
from ares_optimizer.kernels.algebra import Array
from ares_optimizer.kernels.nystroem import NODES, STAGES, VELOCITY_WEIGHTS, WEIGHTS


@kernel
def gravity_gradient(r: Vector, environment: Record) -> tuple[Vector, Vector, Vector]:
    """Return gravity, m/s2, and its gradient, 1/s2: (xx, xy, xz), (yy, yz, zz)."""
    square = dot(r, r)
    radius = math.sqrt(square)
    k = environment.mu / (square * radius)
    x, y, z = r
    s = 3.0 * k / square
    g = scale(-k, r)
    first = (s * x * x - k, s * x * y, s * x * z)
    second = (s * y * y - k, s * y * z, s * z * z - k)
    j2 = environment.j2
    if j2 == 0.0:
        return g, first, second
    # g += -k q [(1 - 5 w) r + 2 z e_z], q = 1.5 j2 (R/r)^2, w = (z/r)^2
    radius_e = environment.equatorial_radius
    q = 1.5 * j2 * radius_e * radius_e / square
    kq = k * q
    w = z * z / square
    a = 1.0 - 5.0 * w
    g = (g[0] - kq * a * x, g[1] - kq * a * y, g[2] - kq * (a + 2.0) * z)
    # d(k q)/dr = -5 k q r / r^2; dw/dr = 2 z e_z / r^2 - 2 w r / r^2
    p = kq / square
    fx = p * (5.0 * a * x - 10.0 * w * x)
    fy = p * (5.0 * a * y - 10.0 * w * y)
    fz = p * (5.0 * a * z - 10.0 * w * z + 10.0 * z)
    first = (
        first[0] + fx * x - kq * a,
        first[1] + fx * y,
        first[2] + x * fz,
    )
    second = (
        second[0] + fy * y - kq * a,
        second[1] + y * fz,
        second[2] + fz * z - kq * (a + 2.0) + 10.0 * p * z * z,
    )
    return g, first, second


@kernel
def combine(weights: Array, forces: Array, count: int) -> Vector:
    """Return the weighted sum of the first ``count`` stage accelerations, m/s2."""
    x = 0.0
    y = 0.0
    z = 0.0
    for q in range(count):
        w = weights[q]
        x += w * forces[q, 0]
        y += w * forces[q, 1]
        z += w * forces[q, 2]
    return (x, y, z)


@kernel
def stage_tangents(work: Array, n: int, m: int, h: float) -> None:
    """Compute the tangents of the position of stage ``m`` at fixed step length."""
    stage = work[W_STAGE]
    sr = work[W_POSITION]
    sv = work[W_VELOCITY]
    ch = NODES[m] * h
    for k in range(3 * n):
        stage[k] = sr[k] + ch * sv[k]
    for q in range(m):
        w = h * h * WEIGHTS[m, q]
        kt = work[W_FORCE + q]
        for k in range(3 * n):
            stage[k] += w * kt[k]


@kernel
def force_tangents(
    work: Array,
    n: int,
    m: int,
    gradient: tuple[Vector, Vector],
    turn: tuple[Vector, Vector],
    dt: float,
    rows: int,
) -> None:
    """Compute the tangents of the acceleration of stage ``m``: gravity and steering.

    Args:
        work: scratch of the integration.
        n: columns.
        m: stage.
        gradient: of gravity, 1/s2: (xx, xy, xz), (yy, yz, zz).
        turn: derivative of the thrust acceleration by the steering vector, m/s2, likewise.
        dt: s since the law began.
        rows: first row of the law's tangents.
    """
    stage = work[W_STAGE]
    base = work[rows]
    slope = work[rows + 1]
    kt = work[W_FORCE + m]
    gxx, gxy, gxz = gradient[0]
    gyy, gyz, gzz = gradient[1]
    qxx, qxy, qxz = turn[0]
    qyy, qyz, qzz = turn[1]
    for j in range(n):
        x = stage[j]
        y = stage[n + j]
        z = stage[2 * n + j]
        lx = base[j] + dt * slope[j]
        ly = base[n + j] + dt * slope[n + j]
        lz = base[2 * n + j] + dt * slope[2 * n + j]
        kt[j] = gxx * x + gxy * y + gxz * z + (qxx * lx + qxy * ly + qxz * lz)
        kt[n + j] = gxy * x + gyy * y + gyz * z + (qxy * lx + qyy * ly + qyz * lz)
        kt[2 * n + j] = gxz * x + gyz * y + gzz * z + (qxz * lx + qyz * ly + qzz * lz)


class Leg(NamedTuple):
    """Hold the interval between two breaks.

    Attributes:
        begin: s after the start.
        h: step length, s.
        steps: number of steps.
        column, end_column: variables that set its two ends; FIXED: none.
    """

    begin: float
    h: float
    steps: int
    column: int
    end_column: int


class AppliedThrust(NamedTuple):
    """Hold the thrust at a stage of a step.

    Attributes:
        time: s after the start.
        thrust: N.
        mass: kg.
        steering: steering vector, not normalised.
        size: its length.
        u: its unit vector, the thrust direction.
    """

    time: float
    thrust: float
    mass: float
    steering: Vector
    size: float
    u: Vector


@kernel
def store_state(row: Array, tangents: Array, t: float, mass: float, run: Run) -> None:
    """Write time, position, velocity and mass, shape (8,), and the tangents, shape (6, n)."""
    n = run.counts[COLUMNS]
    row[0] = t
    for c in range(6):
        row[1 + c] = run.state[c]
    row[7] = mass
    for c in range(3):
        for j in range(n):
            tangents[c, j] = run.work[W_POSITION, c * n + j]
            tangents[3 + c, j] = run.work[W_VELOCITY, c * n + j]


@kernel
def put_node(
    node: Array, t: float, r: Vector, v: Vector, force: Vector, applied: AppliedThrust
) -> None:
    """Write the node at one end of a step."""
    node[N_TIME] = t
    store(node[N_POSITION:], r)
    store(node[N_VELOCITY:], v)
    store(node[N_ACCELERATION:], force)
    node[N_MASS] = applied.mass
    store(node[N_DIRECTION:], applied.u)


@kernel
def thrust_at(t: float, engine: Engine, law: Steering) -> AppliedThrust:
    """Return the thrust at ``t`` s after the start."""
    thrust = engine.thrust + (t - engine.anchor) * engine.thrust_slope
    steering = axpy(t - law.time, law.rate, law.direction)
    size = norm(steering)
    return AppliedThrust(t, thrust, mass_at(engine, t), steering, size, scale(1.0 / size, steering))


@kernel
def steering_derivative(applied: AppliedThrust) -> tuple[Vector, Vector]:
    """Return the derivative of the thrust acceleration by the steering vector, m/s2.

    Symmetric, so six entries: (xx, xy, xz), (yy, yz, zz).
    """
    u = applied.u
    e = applied.thrust / (applied.mass * applied.size)
    return (
        (e * (1.0 - u[0] * u[0]), -e * u[0] * u[1], -e * u[0] * u[2]),
        (e * (1.0 - u[1] * u[1]), -e * u[1] * u[2], e * (1.0 - u[2] * u[2])),
    )


@kernel
def add_moving_times(
    kt: Array, n: int, into: float, applied: AppliedThrust, leg: Leg, engine: Engine, law: Steering
) -> None:
    """Add the effect of moving law, leg and cut-off times on a stage's acceleration.

    Args:
        kt: flat tangents of the acceleration, added to.
        n: columns.
        into: number of steps from the begin of the leg, with fraction.
        applied: the thrust at that time.
        leg, engine, law: in force.
    """
    qa, qb = steering_derivative(applied)
    rate = law.rate
    turn = (
        qa[0] * rate[0] + qa[1] * rate[1] + qa[2] * rate[2],
        qa[1] * rate[0] + qb[0] * rate[1] + qb[1] * rate[2],
        qa[2] * rate[0] + qb[1] * rate[1] + qb[2] * rate[2],
    )
    if law.column != FIXED:
        add_column(kt, n, law.column, -TIME_SCALE, turn)
    if engine.in_tail:
        # thrust is a function of the time after cut-off; mass falls as the cut-off moves later
        s = applied.thrust * engine.cutoff_flow / (applied.mass * applied.mass)
        add_column(kt, n, n - 1, TIME_SCALE, axpy(s, applied.u, turn))
        return
    flow = engine.flow + (applied.time - engine.anchor) * engine.flow_slope
    along = (engine.thrust_slope + applied.thrust * flow / applied.mass) / applied.mass
    moved = axpy(along, applied.u, turn)
    theta = into / leg.steps
    if leg.column != FIXED:
        add_column(kt, n, leg.column, (1.0 - theta) * TIME_SCALE, moved)
    if leg.end_column != FIXED:
        add_column(kt, n, leg.end_column, theta * TIME_SCALE, moved)


@kernel
def add_step_change(row: Array, n: int, leg: Leg, grow: Vector) -> None:
    """Add the effect of the changing step length of a leg to a flat tangent.

    A step grows by 1/steps of the motion of the ends; ``grow`` is the derivative by its length.
    """
    if leg.end_column == leg.column:
        return
    if leg.column != FIXED:
        add_column(row, n, leg.column, -TIME_SCALE / leg.steps, grow)
    if leg.end_column != FIXED:
        add_column(row, n, leg.end_column, TIME_SCALE / leg.steps, grow)


@kernel
def end_tangents(work: Array, n: int, leg: Leg, gain: Vector) -> None:
    """Compute the tangents at the end of a step, where the last stage is."""
    for k in range(3 * n):
        work[W_POSITION, k] = work[W_STAGE, k]
    for q in range(STAGES):
        w = leg.h * VELOCITY_WEIGHTS[q]
        for k in range(3 * n):
            work[W_VELOCITY, k] += w * work[W_FORCE + q, k]
    add_step_change(work[W_VELOCITY], n, leg, gain)


@kernel
def fly_leg(leg: Leg, engine: Engine, law: Steering, environment: Record, run: Run) -> None:
    """Integrate from one break to the next with tangents; store the ends of steps as nodes."""
    # read once: each access of an array in a record counts references
    n = run.counts[COLUMNS]
    stored = run.counts[STORED]
    work = run.work
    forces = run.forces
    nodes = run.nodes
    h = leg.h
    r = load(run.state)
    v = load(run.state[3:])
    rs = r
    applied = thrust_at(leg.begin, engine, law)
    for i in range(leg.steps):
        t0 = leg.begin + i * h
        first = 0
        if i > 0:
            # first stage same as last (FSAL)
            first = 1
            store(forces[0], load(forces[STAGES - 1]))
            for k in range(3 * n):
                work[W_FORCE, k] = work[W_FORCE + STAGES - 1, k]
        for m in range(first, STAGES):
            node = NODES[m]
            shift = combine(WEIGHTS[m], forces, m)
            rs = axpy(h * h, shift, axpy(node * h, v, r))
            g, gradient, gradient_rest = gravity_gradient(rs, environment)
            applied = thrust_at(t0 + node * h, engine, law)
            store(forces[m], axpy(applied.thrust / applied.mass, applied.u, g))
            if n > 0:
                stage_tangents(work, n, m, h)
                add_step_change(work[W_STAGE], n, leg, axpy(2.0 * h, shift, scale(node, v)))
                turn = steering_derivative(applied)
                force_tangents(
                    work, n, m, (gradient, gradient_rest), turn, applied.time - law.time, law.rows
                )
                add_moving_times(work[W_FORCE + m], n, i + node, applied, leg, engine, law)
            if m == 0 and stored < nodes.shape[0]:
                put_node(nodes[stored], t0, r, v, load(forces[0]), applied)
                stored += 1
        gain = combine(VELOCITY_WEIGHTS, forces, STAGES)
        # the last stage is at the new position
        r = rs
        v = axpy(h, gain, v)
        if n > 0:
            end_tangents(work, n, leg, gain)
        if stored < nodes.shape[0]:
            put_node(nodes[stored], t0 + h, r, v, load(forces[STAGES - 1]), applied)
            stored += 1
    store(run.state, r)
    store(run.state[3:], v)
    run.counts[STORED] = stored


@kernel
def fly(p: Array, problem: Problem, scratch: Scratch) -> None:
    """Integrate the flight.

    Args:
        p: shape (variables,), see :class:`Problem`.
        problem: the flight.
        scratch: its COLUMNS are ``problem.variables`` with tangents, 0 without; its order of
            events, from :func:`lay_out`, may be that of a neighbouring ``p``. Written:
            ``nodes``, the ends of the integration steps as far as there are rows, and the
            count STORED; ``drops`` and ``drop_tangents``: time s after the start, position,
            velocity and mass before each free drop and at each probe, and for a drop the
            steering vector and its rate after it; ``final`` and ``final_tangents``: time, position,
            velocity, mass at the end.
    """
    run = Run(scratch.work, scratch.nodes, scratch.state, scratch.forces, scratch.counts)
    n = scratch.counts[COLUMNS]
    count = scratch.counts[BREAKS]
    scratch.counts[STORED] = 0
    for row in range(W_STAGE):
        for k in range(3 * n):
            scratch.work[row, k] = 0.0
    for c in range(6):
        scratch.state[c] = problem.state[c]
    law = Steering(0.0, FIXED, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), W_BASE)
    held = law
    holds = False
    engine = Engine(0.0, 0.0, 0.0, 0.0, 0.0, problem.profile[0, P_MASS], 0.0, False, 0.0)
    # each call counts references of all arrays in a record: pass single arrays in the loop
    times, breaks, tail, laws = scratch.times, scratch.breaks, problem.tail, problem.laws
    for b in range(count):
        at = break_at(b, p, tail, times, breaks)
        if at.kind == DROP or at.kind == PROBE:
            row = at.number if at.kind == DROP else problem.drops.shape[0] + at.number
            mass = mass_at(engine, at.time)
            store_state(scratch.drops[row], scratch.drop_tangents[row], at.time, mass, run)
        k = law_at(at, laws)
        if k >= 0:
            law = change_law(k, at, law, engine, p, problem, run)
        if at.kind == HELD:
            held = held_law(at, p, problem.held, run)
            holds = True
        elif at.kind == HELD_END:
            holds = False
        elif at.kind == DROP:
            steering = axpy(at.time - law.time, law.rate, law.direction)
            store(scratch.drops[at.number, 8:], steering)
            store(scratch.drops[at.number, 11:], law.rate)
        engine = change_engine(at, engine, problem.profile, tail, problem.drops)
        steps = breaks[b, 3]
        if steps > 0:
            end = break_at(b + 1, p, tail, times, breaks)
            h = (end.time - at.time) / steps
            leg = Leg(at.time, h, steps, at.column, end.column)
            fly_leg(leg, engine, held if holds else law, problem.environment[0], run)
    end = break_at(count - 1, p, tail, times, breaks)
    mass = mass_at(engine, end.time)
    store_state(scratch.final, scratch.final_tangents, end.time, mass, run)
