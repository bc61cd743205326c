# SPDX-License-Identifier: Apache-2.0
"""Integrate the flight for given steering parameters, with exact first derivatives.

Thrust enters Eq. 2.1 as a known function of time, so the motion is r'' = g(r) + q(t). A Nystroem
method (``kernels/nystroem.py``) needs no velocity in its stages and five gravities per step.
Derivatives are those of the discrete method: every stage carries the tangents of its position,
those of the step length included where a leg ends at a free time. Tangents at such an end are
total derivatives at the moving node. A burn in held attitude has a law of its own, which overrides
the law in force; that one continues afterwards.
"""

import math
from typing import NamedTuple

import numpy as np

from ares_models.arrays import Record
from ares_models.jit import allocating, kernel
from ares_models.kernels.vectors import Vector, axpy, dot, load, norm, scale, store
from ares_optimizer.direct.kernels.jump import JUMP_INPUTS, JUMP_OUTPUTS, jump, jump_jacobian
from ares_optimizer.direct.kernels.problem import (
    AT_DROP,
    AT_START,
    D_MASS,
    L_BEGINS,
    L_DIRECTION,
    L_DROP,
    L_RATE,
    P_FLOW,
    P_FLOW_SLOPE,
    P_MASS,
    P_THRUST,
    P_THRUST_SLOPE,
    P_TIME,
    RATE_SCALE,
    TIME_SCALE,
    Problem,
)
from ares_optimizer.kernels.algebra import Array, Index
from ares_optimizer.kernels.nystroem import NODES, STAGES, VELOCITY_WEIGHTS, WEIGHTS

# kinds of breaks
PIECE = 0
LAW = 1
DROP = 2
CUTOFF = 3
TAIL = 4
PROBE = 5
HELD = 6
HELD_END = 7

FIXED = -1
MOST_STEPS = 200

# columns of a node: time, position, velocity, acceleration, mass, thrust direction
N_TIME = 0
N_POSITION = 1
N_VELOCITY = 4
N_ACCELERATION = 7
N_MASS = 10
N_DIRECTION = 11
N_COLUMNS = 14


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
def drop_column(problem: Problem, j: int) -> int:
    """Return the column of the time of drop ``j``."""
    return problem.variables - 1 - problem.drops.shape[0] + j


# indices into ``Scratch.counts``
BREAKS = 0
STORED = 1
LATER_PEAKS = 2
COLUMNS = 3


class Scratch(NamedTuple):
    """Hold the work arrays of a flight and its evaluation, sized for one problem.

    Attributes:
        times, breaks: events in order of time, see :func:`lay_out`.
        work: scratch of the integration.
        nodes: shape (k, N_COLUMNS), room for every step of every break.
        drops: shape (d + PEAKS, 14), states at the free drops and at later heating peaks.
        drop_tangents: shape (d + PEAKS, 6, n).
        final: shape (8,).
        final_tangents: shape (6, n).
        rows: shape (MAX_ROWS, 6), terminal gradients by the state.
        state: shape (6,), current position and velocity of the integration.
        forces: shape (STAGES, 3), accelerations at the stages of a step.
        counts: shape (4,): numbers of BREAKS, STORED nodes, LATER_PEAKS of the heating after the
            last free drop, and COLUMNS of the tangents.
        peaks: shape (PEAKS,), times of these peaks, s after the start; set only where the limit
            holds from the jettison on.
    """

    times: Array
    breaks: Index
    work: Array
    nodes: Array
    drops: Array
    drop_tangents: Array
    final: Array
    final_tangents: Array
    rows: Array
    state: Array
    forces: Array
    counts: Index
    peaks: Array


class Run(NamedTuple):
    """Hold the arrays of a :class:`Scratch` that the integration writes.

    A record of few arrays: each call counts the references of every array in its arguments.
    """

    work: Array
    nodes: Array
    state: Array
    forces: Array
    counts: Index


class Break(NamedTuple):
    """Hold an event of the flight.

    Attributes:
        kind: PIECE, LAW, DROP, CUTOFF, TAIL, PROBE, HELD or HELD_END.
        number: index within its kind.
        column: variable that sets its time; FIXED: none.
        time: s after the start.
    """

    kind: int
    number: int
    column: int
    time: float


@kernel
def add_break(at: Break, count: int, times: Array, breaks: Index) -> int:
    """Store an event; return the number of events."""
    times[count] = at.time
    breaks[count, 0] = at.kind
    breaks[count, 1] = at.number
    breaks[count, 2] = at.column
    return count + 1


@kernel
def sort_breaks(count: int, times: Array, breaks: Index) -> None:
    """Sort events by time, stable: at one instant pieces precede laws, drops and cut-off."""
    for i in range(1, count):
        time = times[i]
        kind, number, column = breaks[i, 0], breaks[i, 1], breaks[i, 2]
        k = i
        while k > 0 and times[k - 1] > time:
            times[k] = times[k - 1]
            breaks[k, 0] = breaks[k - 1, 0]
            breaks[k, 1] = breaks[k - 1, 1]
            breaks[k, 2] = breaks[k - 1, 2]
            k -= 1
        times[k] = time
        breaks[k, 0] = kind
        breaks[k, 1] = number
        breaks[k, 2] = column


@kernel
def count_steps(count: int, longest: float, times: Array, breaks: Index) -> None:
    """Set the number of integration steps from each break to the next."""
    for i in range(count - 1):
        duration = times[i + 1] - times[i]
        same = breaks[i, 2] == breaks[i + 1, 2]
        if same and duration <= 0.0:
            breaks[i, 3] = 0
        elif duration < MOST_STEPS * longest:
            breaks[i, 3] = max(1, int(math.ceil(duration / longest)))
        else:
            # not a plausible flight: bound the work
            breaks[i, 3] = MOST_STEPS
    breaks[count - 1, 3] = 0


@kernel
def lay_out(p: Array, problem: Problem, scratch: Scratch) -> None:
    """List all events of the flight in order of time.

    Args:
        p: shape (n,), variables.
        problem: the flight.
        scratch: its LATER_PEAKS ``peaks`` are listed as probes. Written: ``times`` of the
            breaks, s after the start; ``breaks``: kind, index within the kind, column of the
            time (or FIXED), number of integration steps to the next break; and the count of
            BREAKS. The last break is the end of thrust.
    """
    times = scratch.times
    breaks = scratch.breaks
    last = problem.variables - 1
    cutoff = p[last] * TIME_SCALE
    scratch.counts[BREAKS] = 0
    count = scratch.counts[BREAKS]
    for k in range(problem.profile.shape[0]):
        at = problem.profile[k, P_TIME] - problem.start_time
        if k == 0 or at < cutoff:
            count = add_break(Break(PIECE, k, FIXED, at), count, times, breaks)
    for k in range(problem.laws.shape[0]):
        if problem.laws[k, L_BEGINS] == AT_DROP:
            continue
        at = problem.law_time[k] - problem.start_time
        if problem.laws[k, L_BEGINS] == AT_START or at < cutoff:
            count = add_break(Break(LAW, k, FIXED, at), count, times, breaks)
    for k in range(problem.held.shape[0]):
        for kind, end in ((HELD, 0), (HELD_END, 1)):
            at = problem.held_time[k, end] - problem.start_time
            if at < cutoff:
                count = add_break(Break(kind, k, FIXED, at), count, times, breaks)
    for j in range(problem.drops.shape[0]):
        column = drop_column(problem, j)
        at = min(p[column] * TIME_SCALE, cutoff)
        count = add_break(Break(DROP, j, column, at), count, times, breaks)
    for k in range(scratch.counts[LATER_PEAKS]):
        if scratch.peaks[k] < cutoff:
            count = add_break(Break(PROBE, k, FIXED, scratch.peaks[k]), count, times, breaks)
    count = add_break(Break(CUTOFF, 0, last, cutoff), count, times, breaks)
    sort_breaks(count, times, breaks)
    for k in range(problem.tail.shape[0]):
        at = cutoff + problem.tail[k, P_TIME]
        count = add_break(Break(TAIL, k, last, at), count, times, breaks)
    count_steps(count, problem.longest_step, times, breaks)
    scratch.counts[BREAKS] = count


@kernel
def break_at(b: int, p: Array, tail: Array, times: Array, breaks: Index) -> Break:
    """Return a break at its time by ``p``, whose order may be that of another ``p``."""
    kind, number, column = breaks[b, 0], breaks[b, 1], breaks[b, 2]
    time = times[b]
    if column != FIXED:
        time = p[column] * TIME_SCALE
    if kind == TAIL:
        time += tail[number, P_TIME]
    return Break(kind, number, column, time)


# rows of the scratch array
W_POSITION = 0
W_VELOCITY = 1
W_BASE = 2
W_RATE = 3
W_STAGE = 4
W_FORCE = 5  # one per stage
W_HELD = W_FORCE + STAGES  # base and rate of a held direction
WORK_ROWS = W_HELD + 2


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
def add_column(row: Array, n: int, column: int, factor: float, x: Vector) -> None:
    """Add ``factor`` x to one column of a flat (3, n) tangent."""
    row[column] += factor * x[0]
    row[n + column] += factor * x[1]
    row[2 * n + column] += factor * x[2]


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


class Engine(NamedTuple):
    """Hold thrust and mass from a break on.

    Attributes:
        anchor: time at which the values hold, s after the start.
        thrust, thrust_slope: N, N/s.
        flow, flow_slope: kg/s, kg/s2.
        mass: kg, free drops aboard.
        dropped: kg.
        in_tail: true after the cut-off.
        cutoff_flow: kg/s, just before the cut-off.
    """

    anchor: float
    thrust: float
    thrust_slope: float
    flow: float
    flow_slope: float
    mass: float
    dropped: float
    in_tail: bool
    cutoff_flow: float


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
def mass_at(engine: Engine, t: float) -> float:
    """Return the mass, kg, at ``t`` s after the start."""
    tau = t - engine.anchor
    burnt = tau * (engine.flow + 0.5 * tau * engine.flow_slope)
    return engine.mass - burnt - engine.dropped


@kernel
def engine_from(row: Array, at: Break, mass: float, engine: Engine) -> Engine:
    """Return the engine after a break, thrust and flow from a row of profile or tail.

    Args:
        row: P_THRUST to P_FLOW_SLOPE are read.
        at: the break.
        mass: kg, free drops aboard.
        engine: before the break.
    """
    return Engine(
        at.time,
        row[P_THRUST],
        row[P_THRUST_SLOPE],
        row[P_FLOW],
        row[P_FLOW_SLOPE],
        mass,
        engine.dropped,
        at.kind == TAIL,
        engine.cutoff_flow,
    )


@kernel
def replaced_engine(engine: Engine, dropped: float, cutoff_flow: float) -> Engine:
    """Return the engine with another dropped mass, kg, and cut-off flow, kg/s."""
    return Engine(
        engine.anchor,
        engine.thrust,
        engine.thrust_slope,
        engine.flow,
        engine.flow_slope,
        engine.mass,
        dropped,
        engine.in_tail,
        cutoff_flow,
    )


@kernel
def change_engine(at: Break, engine: Engine, profile: Array, tail: Array, drops: Array) -> Engine:
    """Return the engine from a break on."""
    if at.kind == PIECE:
        piece = profile[at.number]
        return engine_from(piece, at, piece[P_MASS], engine)
    if at.kind == TAIL:
        # the tail begins at the cut-off with the mass at that time
        mass = mass_at(engine, at.time) + engine.dropped
        return engine_from(tail[at.number], at, mass, engine)
    if at.kind == DROP:
        dropped = engine.dropped + drops[at.number, D_MASS]
        return replaced_engine(engine, dropped, engine.cutoff_flow)
    if at.kind == CUTOFF:
        flow = engine.flow + (at.time - engine.anchor) * engine.flow_slope
        return replaced_engine(engine, engine.dropped, flow)
    return engine


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
