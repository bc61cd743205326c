"""The flight as a function of the steering parameters, with exact first derivatives.

Thrust enters Eq. 2.1 as a known function of time, so the motion is r'' = g(r) + q(t): a
Nystroem method needs no velocity in its stages. Method: RKN6(4)6FM of Dormand,
El-Mikkawy, Prince (IMA J. Numer. Anal. 7, 1987), order 6, five gravities per step.
Derivatives are those of the discrete method itself: every stage carries the tangents of
its position, including those of the step length where an end of a leg is free in time.
Where a leg begins or ends at a free time, tangents are total ones, of the moving node.
"""

import math

import numpy as np

from ares_models.arrays import Record
from ares_models.jit import kernel
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

STAGES = 6
NODES = (0.0, 0.1, 0.3, 0.7, 0.68, 1.0)
# rows of the tableau for positions, flat: stage i uses the first i entries of row i
WEIGHTS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 200, 0.0, 0.0, 0.0, 0.0],
        [-1 / 2200, 1 / 22, 0.0, 0.0, 0.0],
        [637 / 6600, -7 / 110, 7 / 33, 0.0, 0.0],
        [225437 / 1968750, -30073 / 281250, 65569 / 281250, -9367 / 984375, 0.0],
        [151 / 2142, 5 / 116, 385 / 1368, 55 / 168, -6250 / 28101],
    ]
)
VELOCITY_WEIGHTS = np.array([151 / 2142, 25 / 522, 275 / 684, 275 / 252, -78125 / 112404, 1 / 12])

# what a break is
PIECE = 0
LAW = 1
DROP = 2
CUTOFF = 3
TAIL = 4
PROBE = 5

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
    """Gravity m/s2, and the six entries of its gradient, 1/s2: (xx, xy, xz), (yy, yz, zz)."""
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
    """Column of the time of drop ``j``."""
    return problem.variables - 1 - problem.drops.shape[0] + j


@kernel
def lay_out(p: Array, problem: Problem, probes: Array, times: Array, breaks: Index) -> int:
    """Put everything that happens in order of time.

    Args:
        p: shape (n,), variables.
        problem: the flight.
        probes: shape (k,), s after the start, where states are wanted.
        times: shape (k,), written: time of each break, s after the start.
        breaks: shape (k, 4), written: what it is, its index, the column of its time (or
            FIXED), and the number of integration steps from here to the next break.

    Returns:
        number of breaks. The last one is the end of thrust.
    """
    n = problem.variables
    cutoff = p[n - 1] * TIME_SCALE
    count = 0
    for k in range(problem.profile.shape[0]):
        at = problem.profile[k, P_TIME] - problem.start_time
        if k == 0 or at < cutoff:
            times[count] = at
            breaks[count, 0] = PIECE
            breaks[count, 1] = k
            breaks[count, 2] = FIXED
            count += 1
    for k in range(problem.laws.shape[0]):
        if problem.laws[k, L_BEGINS] == AT_DROP:
            continue
        at = problem.law_time[k] - problem.start_time
        if problem.laws[k, L_BEGINS] == AT_START or at < cutoff:
            times[count] = at
            breaks[count, 0] = LAW
            breaks[count, 1] = k
            breaks[count, 2] = FIXED
            count += 1
    for j in range(problem.drops.shape[0]):
        column = drop_column(problem, j)
        times[count] = min(p[column] * TIME_SCALE, cutoff)
        breaks[count, 0] = DROP
        breaks[count, 1] = j
        breaks[count, 2] = column
        count += 1
    for k in range(probes.size):
        if probes[k] < cutoff:
            times[count] = probes[k]
            breaks[count, 0] = PROBE
            breaks[count, 1] = k
            breaks[count, 2] = FIXED
            count += 1
    times[count] = cutoff
    breaks[count, 0] = CUTOFF
    breaks[count, 1] = 0
    breaks[count, 2] = n - 1
    count += 1
    # insertion sort, stable: at one instant the piece comes before law, drop and cut-off
    for i in range(1, count):
        time = times[i]
        what, index, column = breaks[i, 0], breaks[i, 1], breaks[i, 2]
        k = i
        while k > 0 and times[k - 1] > time:
            times[k] = times[k - 1]
            breaks[k, 0] = breaks[k - 1, 0]
            breaks[k, 1] = breaks[k - 1, 1]
            breaks[k, 2] = breaks[k - 1, 2]
            k -= 1
        times[k] = time
        breaks[k, 0] = what
        breaks[k, 1] = index
        breaks[k, 2] = column
    for k in range(problem.tail.shape[0]):
        times[count] = cutoff + problem.tail[k, P_TIME]
        breaks[count, 0] = TAIL
        breaks[count, 1] = k
        breaks[count, 2] = n - 1
        count += 1
    for i in range(count - 1):
        duration = times[i + 1] - times[i]
        same = breaks[i, 2] == breaks[i + 1, 2]
        if same and duration <= 0.0:
            breaks[i, 3] = 0
        elif duration < MOST_STEPS * problem.longest_step:
            breaks[i, 3] = max(1, int(math.ceil(duration / problem.longest_step)))
        else:
            # nothing that a search should come to, nor wait for
            breaks[i, 3] = MOST_STEPS
    breaks[count - 1, 3] = 0
    return count


@kernel
def break_time(
    p: Array, problem: Problem, time: float, column: int, what: int, index: int
) -> float:
    """Time of a break for other values of the variables, in the same order of breaks."""
    if column == FIXED:
        return time
    if what == TAIL:
        return p[column] * TIME_SCALE + problem.tail[index, P_TIME]
    return p[column] * TIME_SCALE


# rows of the scratch array
W_POSITION = 0
W_VELOCITY = 1
W_BASE = 2
W_RATE = 3
W_STAGE = 4
W_FORCE = 5  # one per stage
WORK_ROWS = W_FORCE + STAGES


@kernel
def combine(weights: Array, forces: Array, count: int) -> Vector:
    """Weighted sum of the first ``count`` stage accelerations, m/s2."""
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
    """Tangents of the position of stage ``m``, the step length held."""
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
    first: Vector,
    second: Vector,
    turn_first: Vector,
    turn_second: Vector,
    dt: float,
) -> None:
    """Tangents of the acceleration of stage ``m``: gravity gradient and steering.

    ``turn_*`` hold the symmetric matrix of the thrust acceleration by the steering vector.
    """
    stage = work[W_STAGE]
    base = work[W_BASE]
    slope = work[W_RATE]
    kt = work[W_FORCE + m]
    gxx, gxy, gxz = first
    gyy, gyz, gzz = second
    qxx, qxy, qxz = turn_first
    qyy, qyz, qzz = turn_second
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


@kernel
def jump_law(
    work: Array,
    n: int,
    column: int,
    x: Array,
    slopes: tuple[float, float],
    environment: Record,
    atmosphere: Array,
) -> tuple[Vector, Vector]:
    """The law after a jettison by the jump condition, tangents in ``work`` included.

    Args:
        work: scratch of :func:`fly`; base and rate rows are those before, moved to the
            instant, and become those after.
        n: columns.
        column: of the instant.
        x: shape (JUMP_INPUTS,), see ``jump``.
        slopes: time derivatives of T/m before and after, m/s3.
        environment, atmosphere: of the mission.

    Returns:
        steering vector and its rate after the jettison.
    """
    y = np.empty(JUMP_OUTPUTS)
    jump(x, environment, atmosphere, y)
    if n > 0:
        jacobian = np.empty((JUMP_OUTPUTS, JUMP_INPUTS))
        jump_jacobian(x, environment, atmosphere, jacobian)
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


@kernel
def put_node(
    node: Array, t: float, r: Vector, v: Vector, force: Array, mass: float, steering: Vector
) -> None:
    """Write one end of a step."""
    node[N_TIME] = t
    store(node[N_POSITION:], r)
    store(node[N_VELOCITY:], v)
    store(node[N_ACCELERATION:], load(force))
    node[N_MASS] = mass
    store(node[N_DIRECTION:], scale(1.0 / norm(steering), steering))


@kernel
def store_state(row: Array, t: float, r: Vector, v: Vector, mass: float) -> None:
    """Write time, position, velocity and mass, shape (8,)."""
    row[0] = t
    store(row[1:], r)
    store(row[4:], v)
    row[7] = mass


@kernel
def put_tangents(tangents: Array, work: Array, n: int) -> None:
    """Copy the tangents of position and velocity, shape (6, n)."""
    for c in range(3):
        for j in range(n):
            tangents[c, j] = work[W_POSITION, c * n + j]
            tangents[3 + c, j] = work[W_VELOCITY, c * n + j]


@kernel
def fly(
    p: Array,
    problem: Problem,
    times: Array,
    breaks: Index,
    count: int,
    n: int,
    work: Array,
    nodes: Array,
    drop_state: Array,
    drop_tangents: Array,
    final: Array,
    final_tangents: Array,
) -> int:
    """Integrate the flight, with its tangents if asked.

    Args:
        p: shape (variables,), see :class:`Problem`.
        problem: the flight.
        times, breaks, count: the order of events, from :func:`lay_out`; it may be that of
            a neighbouring ``p``.
        n: ``problem.variables`` for tangents by every variable, 0 for none.
        work: shape (WORK_ROWS, 3 n): scratch.
        nodes: shape (k, N_COLUMNS), written: the ends of the integration steps as far as
            there are rows.
        drop_state: shape (d + k, 14), written: time s after the start, position, velocity
            and the mass before, at each free drop and at each probe; of a drop, also the
            steering vector and its rate after it.
        drop_tangents: shape (d + k, 6, n): of position and velocity there.
        final: shape (8,): time s after the start, position, velocity, mass at the end.
        final_tangents: shape (6, n).

    Returns:
        number of nodes written.
    """
    environment = problem.environment[0]
    pole = problem.variables - 1
    for row in range(W_STAGE):
        for k in range(3 * n):
            work[row, k] = 0.0
    forces = np.empty((STAGES, 3))
    r = load(problem.state)
    v = load(problem.state[3:])
    direction = (1.0, 0.0, 0.0)
    rate = (0.0, 0.0, 0.0)
    law_time = 0.0
    law_column = FIXED
    in_tail = False
    dropped = 0.0
    thrust0 = 0.0
    thrust1 = 0.0
    flow0 = 0.0
    flow1 = 0.0
    mass0 = problem.profile[0, P_MASS]
    anchor = 0.0
    cutoff_flow = 0.0
    stored = 0
    for b in range(count):
        what = breaks[b, 0]
        index = breaks[b, 1]
        column = breaks[b, 2]
        t = break_time(p, problem, times[b], column, what, index)
        tau = t - anchor
        mass = mass0 - tau * (flow0 + 0.5 * tau * flow1) - dropped
        thrust = thrust0 + tau * thrust1
        flow = flow0 + tau * flow1
        new_law = -1
        if what == PIECE:
            thrust0 = problem.profile[index, P_THRUST]
            thrust1 = problem.profile[index, P_THRUST_SLOPE]
            flow0 = problem.profile[index, P_FLOW]
            flow1 = problem.profile[index, P_FLOW_SLOPE]
            mass0 = problem.profile[index, P_MASS]
            anchor = t
        elif what == LAW:
            new_law = index
        elif what == DROP:
            store_state(drop_state[index], t, r, v, mass)
            put_tangents(drop_tangents[index], work, n)
            for k in range(problem.laws.shape[0]):
                if problem.laws[k, L_BEGINS] == AT_DROP and problem.laws[k, L_DROP] == index:
                    new_law = k
            dropped += problem.drops[index, D_MASS]
        elif what == PROBE:
            store_state(drop_state[problem.drops.shape[0] + index], t, r, v, mass)
            put_tangents(drop_tangents[problem.drops.shape[0] + index], work, n)
        elif what == CUTOFF:
            cutoff_flow = flow
        else:
            # the tail is anchored to the cut-off and takes the mass as it is
            in_tail = True
            thrust0 = problem.tail[index, P_THRUST]
            thrust1 = problem.tail[index, P_THRUST_SLOPE]
            flow0 = problem.tail[index, P_FLOW]
            flow1 = problem.tail[index, P_FLOW_SLOPE]
            mass0 = mass + dropped
            anchor = t
        if new_law >= 0:
            dt = t - law_time
            direction = axpy(dt, rate, direction)
            direction_column = problem.laws[new_law, L_DIRECTION]
            rate_column = problem.laws[new_law, L_RATE]
            if n > 0:
                # tangents of the direction at this moving instant
                for k in range(3 * n):
                    work[W_BASE, k] += dt * work[W_RATE, k]
                if law_column != FIXED:
                    add_column(work[W_BASE], n, law_column, -TIME_SCALE, rate)
                if column != FIXED:
                    add_column(work[W_BASE], n, column, TIME_SCALE, rate)
            if rate_column < 0:
                rest = mass - problem.drops[index, D_MASS]
                x = np.empty(JUMP_INPUTS)
                store(x, r)
                store(x[3:], v)
                store(x[6:], direction)
                store(x[9:], rate)
                x[12] = thrust / mass
                x[13] = thrust / rest
                slopes = (
                    (thrust1 + thrust * flow / mass) / mass,
                    (thrust1 + thrust * flow / rest) / rest,
                )
                direction, rate = jump_law(
                    work, n, column, x, slopes, environment, problem.atmosphere
                )
            else:
                if direction_column >= 0:
                    direction = load(p[direction_column:])
                rate = scale(RATE_SCALE, load(p[rate_column:]))
                if n > 0:
                    if direction_column >= 0:
                        work[W_BASE, : 3 * n] = 0.0
                    work[W_RATE, : 3 * n] = 0.0
                    for c in range(3):
                        if direction_column >= 0:
                            work[W_BASE, c * n + direction_column + c] = 1.0
                        work[W_RATE, c * n + rate_column + c] = RATE_SCALE
            law_time = t
            law_column = column
        if what == DROP:
            store(drop_state[index, 8:], axpy(t - law_time, rate, direction))
            store(drop_state[index, 11:], rate)
        steps = breaks[b, 3]
        if steps == 0:
            continue
        end_column = breaks[b + 1, 2]
        end = break_time(p, problem, times[b + 1], end_column, breaks[b + 1, 0], breaks[b + 1, 1])
        h = (end - t) / steps
        stretches = n > 0 and end_column != column
        for i in range(steps):
            t0 = t + i * h
            for m in range(STAGES):
                if m == 0 and i > 0:
                    # first same as last
                    store(forces[0], load(forces[STAGES - 1]))
                    for k in range(3 * n):
                        work[W_FORCE, k] = work[W_FORCE + STAGES - 1, k]
                    continue
                node = NODES[m]
                shift = combine(WEIGHTS[m], forces, m)
                rs = axpy(h * h, shift, axpy(node * h, v, r))
                g, first, second = gravity_gradient(rs, environment)
                ts = t0 + node * h
                tau = ts - anchor
                mass = mass0 - tau * (flow0 + 0.5 * tau * flow1) - dropped
                thrust = thrust0 + tau * thrust1
                steering = axpy(ts - law_time, rate, direction)
                size = norm(steering)
                u = scale(1.0 / size, steering)
                store(forces[m], axpy(thrust / mass, u, g))
                if n > 0:
                    stage_tangents(work, n, m, h)
                    if stretches:
                        # the step grows by 1/steps of what the ends move
                        grow = axpy(2.0 * h, shift, scale(node, v))
                        if column != FIXED:
                            add_column(work[W_STAGE], n, column, -TIME_SCALE / steps, grow)
                        if end_column != FIXED:
                            add_column(work[W_STAGE], n, end_column, TIME_SCALE / steps, grow)
                    e = thrust / (mass * size)
                    qa = (e * (1.0 - u[0] * u[0]), -e * u[0] * u[1], -e * u[0] * u[2])
                    qb = (e * (1.0 - u[1] * u[1]), -e * u[1] * u[2], e * (1.0 - u[2] * u[2]))
                    force_tangents(work, n, m, first, second, qa, qb, ts - law_time)
                    kt = work[W_FORCE + m]
                    turn = (
                        qa[0] * rate[0] + qa[1] * rate[1] + qa[2] * rate[2],
                        qa[1] * rate[0] + qb[0] * rate[1] + qb[1] * rate[2],
                        qa[2] * rate[0] + qb[1] * rate[1] + qb[2] * rate[2],
                    )
                    if law_column != FIXED:
                        add_column(kt, n, law_column, -TIME_SCALE, turn)
                    if in_tail:
                        # the thrust moves with the leg, the mass falls with the cut-off
                        s = thrust * cutoff_flow / (mass * mass)
                        add_column(kt, n, pole, TIME_SCALE, axpy(s, u, turn))
                    else:
                        flow = flow0 + tau * flow1
                        moved = axpy((thrust1 + thrust * flow / mass) / mass, u, turn)
                        theta = (i + node) / steps
                        if column != FIXED:
                            add_column(kt, n, column, (1.0 - theta) * TIME_SCALE, moved)
                        if end_column != FIXED:
                            add_column(kt, n, end_column, theta * TIME_SCALE, moved)
                if m == 0 and stored < nodes.shape[0]:
                    put_node(nodes[stored], t0, r, v, forces[0], mass, steering)
                    stored += 1
            gain = combine(VELOCITY_WEIGHTS, forces, STAGES)
            # the last stage stands at the new position
            r = rs
            v = axpy(h, gain, v)
            if n > 0:
                for k in range(3 * n):
                    work[W_POSITION, k] = work[W_STAGE, k]
                for q in range(STAGES):
                    w = h * VELOCITY_WEIGHTS[q]
                    for k in range(3 * n):
                        work[W_VELOCITY, k] += w * work[W_FORCE + q, k]
                if stretches:
                    if column != FIXED:
                        add_column(work[W_VELOCITY], n, column, -TIME_SCALE / steps, gain)
                    if end_column != FIXED:
                        add_column(work[W_VELOCITY], n, end_column, TIME_SCALE / steps, gain)
            if stored < nodes.shape[0]:
                put_node(nodes[stored], t0 + h, r, v, forces[STAGES - 1], mass, steering)
                stored += 1
    b = count - 1
    t = break_time(p, problem, times[b], breaks[b, 2], breaks[b, 0], breaks[b, 1])
    tau = t - anchor
    store_state(final, t, r, v, mass0 - tau * (flow0 + 0.5 * tau * flow1) - dropped)
    put_tangents(final_tangents, work, n)
    return stored
