"""The optimum as a root: shooting, its Jacobian, Newton, and a first guess.

Unknowns: lambda_v and lambda_r at the start, the cut-off time, and for every heating
jettison still to come its time and pi. Equations: |lambda_v| = 1 at the start (the scale is
free; printed: H_f = 1, Eq. 3.30), the terminal set with its reduced transversality
conditions, and per heating jettison log heating = log limit and a continuous Hamiltonian.
"""

import math
from typing import Any

import numpy as np
from ares_models.arrays import (
    BURN,
    HEATING_LIMIT,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.vectors import (
    Vector,
    add,
    axpy,
    cross,
    dot,
    load,
    norm,
    scale,
    sub,
    unit,
)
from numpy.typing import NDArray

from ares_optimizer.kernels.closed_form import closed_form_segment
from ares_optimizer.kernels.costates import (
    LINEAR,
    MAX_COLUMNS,
    ROWS,
    STAGES,
    integrate_segment,
    log_heating_hessian_product,
    thrust_acceleration_tangents,
)
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    HEATING_IGNORED,
    HEATING_OPTIMAL,
    MAX_SEGMENTS,
    SEGMENT,
    build_timetable,
    heating_count,
    segment_mass,
)

MAX_UNKNOWNS = COLUMN_JETTISON + 2 * 8

CONVERGED = 0
ITERATION_LIMIT = 1
STALLED = 2
SINGULAR = 3
BAD_TIMETABLE = 4

#: Propagators: Runge-Kutta-Nystroem, closed form with Simpson's or with Milne's rule.
RUNGE_KUTTA = 0

OPTIONS = np.dtype(
    [
        ("gravity", np.int64),  # costates.INVERSE_SQUARE or LINEAR
        ("propagator", np.int64),  # RUNGE_KUTTA, closed_form.SIMPSON or MILNE
        ("heating", np.int64),  # timetable.HEATING_*
        ("step", np.float64),  # s, longest step or closed-form arc
        ("max_iterations", np.int64),
        ("tolerance", np.float64),  # of the last Newton step, in scaled unknowns
    ],
    align=True,
)

WORK = np.dtype(
    [
        ("state", np.float64, (ROWS,)),
        ("tangent", np.float64, (ROWS, MAX_COLUMNS)),
        ("stage", np.float64, (STAGES, 6)),
        ("stage_tangent", np.float64, (STAGES, 6, MAX_COLUMNS)),
        ("scratch", np.float64, (9, MAX_COLUMNS)),
        ("residual", np.float64, (MAX_COLUMNS,)),
        ("jacobian", np.float64, (MAX_COLUMNS, MAX_COLUMNS)),
        ("factors", np.float64, (MAX_COLUMNS, MAX_COLUMNS)),
        ("pivots", np.int64, (MAX_COLUMNS,)),
        ("step", np.float64, (MAX_COLUMNS,)),
        ("correction", np.float64, (MAX_COLUMNS,)),
        ("trial", np.float64, (MAX_COLUMNS,)),
        ("unit", np.float64, (MAX_COLUMNS,)),  # size of each unknown
        ("floor", np.float64, (MAX_COLUMNS,)),  # earliest time of each unknown time
        ("ceiling", np.float64),  # latest cut-off: the mass is gone
        ("heating_times", np.float64, (8,)),
        ("segments", SEGMENT, (MAX_SEGMENTS,)),
        ("steps", np.int64, (MAX_SEGMENTS,)),
        ("segment_count", np.int64),
        ("evaluations", np.int64),
    ],
    align=True,
)

_POLE = (0.0, 0.0, 1.0)


@kernel
def gravity_terms(
    r: Vector, mu: float, omega_square: float, gravity: int, p: Vector
) -> tuple[Vector, Vector]:
    """Gravity g, m/s2, and its gradient times ``p``."""
    if gravity == LINEAR:
        return scale(-omega_square, r), scale(-omega_square, p)
    square = dot(r, r)
    k = mu / (square * math.sqrt(square))
    return scale(-k, r), axpy(3.0 * k * dot(r, p) / square, r, scale(-k, p))


@kernel
def _row(
    out: NDArray[np.float64],
    tangent: NDArray[np.float64],
    columns: int,
    by_r: Vector,
    by_v: Vector,
    by_p: Vector,
    by_q: Vector,
) -> None:
    """A row of the Jacobian from the gradient by the state."""
    for c in range(columns):
        out[c] = (
            by_r[0] * tangent[0, c]
            + by_r[1] * tangent[1, c]
            + by_r[2] * tangent[2, c]
            + by_v[0] * tangent[3, c]
            + by_v[1] * tangent[4, c]
            + by_v[2] * tangent[5, c]
            + by_p[0] * tangent[6, c]
            + by_p[1] * tangent[7, c]
            + by_p[2] * tangent[8, c]
            + by_q[0] * tangent[9, c]
            + by_q[1] * tangent[10, c]
            + by_q[2] * tangent[11, c]
        )


@kernel
def fixed_plane(target: Record) -> tuple[bool, Vector]:
    """Whether the target fixes the plane of the orbit, and its normal.

    A free node at inclination 0 or 180 deg is a fixed plane.
    """
    si = math.sin(target.inclination)
    ci = math.cos(target.inclination)
    if target.kind == TARGET_RADIUS_SPEED_ANGLE_INCLINATION:
        if abs(si) < 1e-7:
            return True, (0.0, 0.0, 1.0 if ci > 0.0 else -1.0)
        return False, _POLE
    node = target.ascending_node
    return True, (si * math.sin(node), -si * math.cos(node), ci)


@kernel
def perifocal(target: Record, normal: Vector) -> tuple[Vector, Vector]:
    """Unit vectors to the perigee and 90 deg ahead of it, in the plane of ``normal``."""
    node = (math.cos(target.ascending_node), math.sin(target.ascending_node), 0.0)
    ahead = cross(normal, node)
    c = math.cos(target.argument_of_perigee)
    s = math.sin(target.argument_of_perigee)
    return add(scale(c, node), scale(s, ahead)), add(scale(-s, node), scale(c, ahead))


@kernel
def terminal_rows(
    target: Record,
    mu: float,
    state: NDArray[np.float64],
    tangent: NDArray[np.float64],
    columns: int,
    residual: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Terminal set and reduced transversality, with their Jacobian rows.

    A motion that the terminal set leaves free must not change the cost: lambda . dx = 0 for
    the turn of the whole state about the axis e, which is e . C = 0 with
    C = r x lambda_r + V x lambda_v. Free downrange angle: e along h; free node: e along the
    pole. On a Keplerian target the free motion is that along the orbit,
    lambda_r . V + lambda_v . g = 0.

    Args:
        target: record TARGET.
        mu: m3/s2.
        state: shape (12,) at the end of the thrust: r, V, lambda_v, lambda_v'.
        tangent: shape (12, MAX_COLUMNS).
        columns: how many Jacobian columns to write.
        residual: rows 1 to 6 are written, without unit.
        jacobian: rows 1 to 6 are written.
    """
    zero = (0.0, 0.0, 0.0)
    r = (state[0], state[1], state[2])
    v = (state[3], state[4], state[5])
    p = (state[6], state[7], state[8])
    q = (state[9], state[10], state[11])
    radius = norm(r)
    speed = norm(v)
    e = scale(1.0 / radius, r)
    d = scale(1.0 / speed, v)
    h = cross(r, v)
    # C = r x lambda_r + V x lambda_v with lambda_r = -q
    turn = sub(cross(v, p), cross(r, q))
    planar, normal = fixed_plane(target)
    row = 1
    if target.kind == TARGET_KEPLERIAN:
        a = target.semi_major_axis
        first, second = perifocal(target, normal)
        # energy
        size = abs(a) / mu
        residual[row] = size * (0.5 * speed * speed - mu / radius + 0.5 * mu / a)
        _row(
            jacobian[row],
            tangent,
            columns,
            scale(size * mu / (radius * radius), e),
            scale(size, v),
            zero,
            zero,
        )
        row += 1
        # eccentricity vector
        rv = dot(r, v)
        factor = speed * speed - mu / radius
        for i in range(2):
            axis = first if i == 0 else second
            ra = dot(r, axis)
            va = dot(v, axis)
            residual[row] = (factor * ra - rv * va) / mu
            if i == 0:
                residual[row] -= target.eccentricity
            by_r = axpy(factor, axis, scale(-va, v))
            by_r = axpy(mu * ra / (radius * radius), e, by_r)
            by_v = axpy(-rv, axis, axpy(2.0 * ra, v, scale(-va, r)))
            _row(
                jacobian[row],
                tangent,
                columns,
                scale(1.0 / mu, by_r),
                scale(1.0 / mu, by_v),
                zero,
                zero,
            )
            row += 1
    else:
        residual[row] = radius / target.radius - 1.0
        _row(jacobian[row], tangent, columns, scale(1.0 / target.radius, e), zero, zero, zero)
        row += 1
        residual[row] = speed / target.speed - 1.0
        _row(jacobian[row], tangent, columns, zero, scale(1.0 / target.speed, d), zero, zero)
        row += 1
        sine = dot(e, d)
        residual[row] = sine - math.sin(target.flight_path_angle)
        _row(
            jacobian[row],
            tangent,
            columns,
            scale(1.0 / radius, axpy(-sine, e, d)),
            scale(1.0 / speed, axpy(-sine, d, e)),
            zero,
            zero,
        )
        row += 1
    if planar:
        residual[row] = dot(e, normal)
        _row(
            jacobian[row],
            tangent,
            columns,
            scale(1.0 / radius, axpy(-residual[row], e, normal)),
            zero,
            zero,
            zero,
        )
        row += 1
        residual[row] = dot(d, normal)
        _row(
            jacobian[row],
            tangent,
            columns,
            zero,
            scale(1.0 / speed, axpy(-residual[row], d, normal)),
            zero,
            zero,
        )
        row += 1
    else:
        length = norm(h)
        axis = scale(1.0 / length, h)
        cosine = axis[2]
        residual[row] = cosine - math.cos(target.inclination)
        by_h = scale(1.0 / length, axpy(-cosine, axis, _POLE))
        _row(jacobian[row], tangent, columns, cross(v, by_h), cross(by_h, r), zero, zero)
        row += 1
        # the turn about the pole
        size = 1.0 / target.speed
        residual[row] = size * turn[2]
        _row(
            jacobian[row],
            tangent,
            columns,
            scale(-size, cross(q, _POLE)),
            scale(size, cross(p, _POLE)),
            scale(size, cross(_POLE, v)),
            scale(-size, cross(_POLE, r)),
        )
        row += 1
    if target.kind == TARGET_KEPLERIAN:
        k = mu / (radius * radius * radius)
        size = target.semi_major_axis * target.semi_major_axis / mu
        ep = dot(e, p)
        residual[row] = size * (-dot(q, v) - k * radius * ep)
        _row(
            jacobian[row],
            tangent,
            columns,
            scale(size * k, axpy(3.0 * ep, e, scale(-1.0, p))),
            scale(-size, q),
            scale(-size * k, r),
            scale(-size, v),
        )
    else:
        size = 1.0 / (target.radius * target.speed * target.speed)
        residual[row] = size * dot(turn, h)
        by_r = sub(cross(v, turn), cross(q, h))
        by_v = add(cross(turn, r), cross(p, h))
        _row(
            jacobian[row],
            tangent,
            columns,
            scale(size, by_r),
            scale(size, by_v),
            scale(size, cross(h, v)),
            scale(-size, cross(h, r)),
        )


@kernel
def _jettison_rows(
    index: int,
    segment: Record,
    following: Record,
    limit: float,
    omega_square: float,
    environment: Record,
    atmosphere: NDArray[np.float64],
    options: Record,
    pi: float,
    columns: int,
    work: Record,
) -> None:
    """Interior condition at a heating jettison: residuals, Jacobian rows, costate jump.

    lambda_r(-) = lambda_r(+) + pi N_r and lambda_v(-) = lambda_v(+) + pi N_v with N the
    logarithm of heating, and H(-) = H(+) across the mass drop (printed in 3.44-3.51:
    without N_v). As a mass costate does not jump, it cancels.
    """
    state = work.state
    tangent = work.tangent
    scratch = work.scratch
    mu = environment.mu
    r = (state[0], state[1], state[2])
    v = (state[3], state[4], state[5])
    p = (state[6], state[7], state[8])
    q = (state[9], state[10], state[11])
    before = thrust_acceleration_tangents(
        segment, segment.end - segment.start, 1.0, columns, scratch[0]
    )
    after = thrust_acceleration_tangents(following, 0.0, 0.0, columns, scratch[1])
    rate, by_r, by_v = log_heating_gradient(r, v, environment, atmosphere)
    passive = options.heating != HEATING_OPTIMAL
    weight = 0.0 if passive else pi
    gravity, _ = gravity_terms(r, mu, omega_square, options.gravity, p)
    p_after = axpy(-weight, by_v, p)
    q_after = axpy(weight, by_r, q)
    length_before = norm(p)
    length_after = norm(p_after)
    drift = dot(by_r, v) + dot(by_v, gravity)
    row = COLUMN_JETTISON + 2 * index
    size = 1.0 / after if after > 0.0 else 1.0
    work.residual[row] = rate - math.log(limit)
    if passive:
        work.residual[row + 1] = pi
    else:
        work.residual[row + 1] = size * (
            before * length_before - after * length_after + weight * drift
        )
    u_before = scale(1.0 / length_before, p)
    u_after = scale(1.0 / length_after, p_after)
    jacobian = work.jacobian
    for c in range(columns):
        dr = (tangent[0, c], tangent[1, c], tangent[2, c])
        dv = (tangent[3, c], tangent[4, c], tangent[5, c])
        dp = (tangent[6, c], tangent[7, c], tangent[8, c])
        dq = (tangent[9, c], tangent[10, c], tangent[11, c])
        jacobian[row, c] = dot(by_r, dr) + dot(by_v, dv)
        jacobian[row + 1, c] = 0.0
        if not passive:
            d_by_r, d_by_v = log_heating_hessian_product(r, v, dr, dv, environment, atmosphere)
            dp_after = axpy(-weight, d_by_v, dp)
            dq_after = axpy(weight, d_by_r, dq)
            _, d_gravity = gravity_terms(r, mu, omega_square, options.gravity, dr)
            change = weight * (
                dot(d_by_r, v) + dot(by_r, dv) + dot(d_by_v, gravity) + dot(by_v, d_gravity)
            )
            if c == row + 1:
                dp_after = axpy(-1.0, by_v, dp_after)
                dq_after = axpy(1.0, by_r, dq_after)
                change += drift
            # the scale follows a, but its change times a zero is nothing
            jacobian[row + 1, c] = size * (
                scratch[0, c] * length_before
                + before * dot(u_before, dp)
                - scratch[1, c] * length_after
                - after * dot(u_after, dp_after)
                + change
            )
            jacobian[row + 1, c] -= work.residual[row + 1] * size * scratch[1, c]
            for n in range(3):
                tangent[6 + n, c] = dp_after[n]
                tangent[9 + n, c] = dq_after[n]
        elif c == row + 1:
            jacobian[row + 1, c] = 1.0
    for n in range(3):
        state[6 + n] = p_after[n]
        state[9 + n] = q_after[n]


@kernel
def unknown_count(start: Record, jettisons: NDArray[Any], options: Record) -> int:
    """Number of unknowns: 7, and 2 per heating jettison still to come."""
    return COLUMN_JETTISON + 2 * heating_count(start, jettisons, options.heating)


@kernel
def shoot(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    options: Record,
    unknowns: NDArray[np.float64],
    tangents: bool,
    work: Record,
) -> bool:
    """Fly the unknowns to the end; residuals and, if asked, their Jacobian.

    Args:
        start: record NAVIGATION.
        environment: record ENVIRONMENT; its J2 plays no part.
        atmosphere: log-density table.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        target: record TARGET.
        options: record OPTIONS.
        unknowns: shape (at least n,): lambda_v (3), lambda_r (3, 1/s), cut-off time (s), then
            per heating jettison its time (s) and pi (per unit of log heating).
        tangents: also write ``work.jacobian``.
        work: record WORK; ``residual`` and ``jacobian`` are written, ``state`` holds the end.

    Returns:
        False if the times make no flight, or something is not finite.
    """
    n = unknown_count(start, jettisons, options)
    for i in range((n - COLUMN_JETTISON) // 2):
        work.heating_times[i] = unknowns[COLUMN_JETTISON + 2 * i]
    work.evaluations += 1
    count = build_timetable(
        start,
        arcs,
        jettisons,
        options.heating,
        work.heating_times,
        unknowns[COLUMN_CUTOFF],
        work.segments,
    )
    work.segment_count = count
    if count == 0:
        return False
    state = work.state
    tangent = work.tangent
    residual = work.residual
    jacobian = work.jacobian
    mu = environment.mu
    for i in range(3):
        state[i] = start.position[i]
        state[3 + i] = start.velocity[i]
        state[6 + i] = unknowns[i]
        state[9 + i] = -unknowns[3 + i]
    omega_square = 0.0
    if options.gravity == LINEAR:
        square = state[0] * state[0] + state[1] * state[1] + state[2] * state[2]
        omega_square = mu / (square * math.sqrt(square))
    all_columns = 0
    columns = 0
    if tangents:
        all_columns = n
        columns = 6
        for i in range(ROWS):
            for c in range(n):
                tangent[i, c] = 0.0
        for i in range(3):
            tangent[6 + i, i] = 1.0
            tangent[9 + i, 3 + i] = -1.0
    residual[0] = 0.5 * (
        unknowns[0] * unknowns[0] + unknowns[1] * unknowns[1] + unknowns[2] * unknowns[2] - 1.0
    )
    for c in range(all_columns):
        jacobian[0, c] = unknowns[c] if c < 3 else 0.0
    met = 0
    for i in range(count):
        segment = work.segments[i]
        if segment.end_column >= 0:
            columns = all_columns
        # the number of steps only grows within a solve: no chatter between two grids
        steps = int(math.ceil((segment.end - segment.start) / options.step - 1e-9))
        steps = max(1, steps, work.steps[i])
        work.steps[i] = steps
        if options.propagator == RUNGE_KUTTA:
            integrate_segment(
                segment,
                steps,
                mu,
                omega_square,
                options.gravity,
                columns,
                state,
                tangent,
                work.stage,
                work.stage_tangent,
                work.scratch,
            )
        else:
            closed_form_segment(
                segment,
                steps,
                mu,
                omega_square,
                options.propagator,
                columns,
                state,
                tangent,
                work.stage[0],
                work.stage_tangent[0],
                work.scratch,
            )
        if segment.end_heating >= 0 and i + 1 < count:
            index = segment.end_heating
            met += 1
            limit = 1.0
            unknown = 0
            for j in range(jettisons.shape[0]):
                if jettisons[j].criterion == HEATING_LIMIT and (start.jettisoned >> j) & 1 == 0:
                    if unknown == index:
                        limit = jettisons[j].value
                    unknown += 1
            _jettison_rows(
                index,
                segment,
                work.segments[i + 1],
                limit,
                omega_square,
                environment,
                atmosphere,
                options,
                unknowns[COLUMN_JETTISON + 2 * index + 1],
                all_columns,
                work,
            )
    if COLUMN_JETTISON + 2 * met != n:
        return False
    terminal_rows(target, mu, state, tangent, all_columns, residual, jacobian)
    total = 0.0
    for i in range(n):
        total += residual[i]
    return math.isfinite(total)


@kernel
def factor(n: int, a: NDArray[np.float64], pivots: NDArray[np.int64]) -> bool:
    """LU factors of ``a`` in place, rows exchanged; False if singular."""
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        pivots[k] = best
        if not abs(a[best, k]) > 0.0:
            return False
        if best != k:
            for j in range(n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            a[i, k] *= inverse
            x = a[i, k]
            if x != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= x * a[k, j]
    return math.isfinite(a[n - 1, n - 1])


@kernel
def solve(
    n: int, a: NDArray[np.float64], pivots: NDArray[np.int64], b: NDArray[np.float64]
) -> None:
    """Solve with the factors of :func:`factor`; ``b`` is replaced by the answer."""
    for k in range(n):
        i = pivots[k]
        if i != k:
            b[k], b[i] = b[i], b[k]
    for i in range(n):
        total = b[i]
        for j in range(i):
            total -= a[i, j] * b[j]
        b[i] = total
    for i in range(n - 1, -1, -1):
        total = b[i]
        for j in range(i + 1, n):
            total -= a[i, j] * b[j]
        b[i] = total / a[i, i]


@kernel
def find_floors(start: Record, arcs: NDArray[Any], jettisons: NDArray[Any], work: Record) -> bool:
    """Earliest time of every unknown time, and the latest cut-off, into ``work``.

    Returns:
        False if the sequence makes no flight.
    """
    last = arcs.shape[0] - 1
    count = build_timetable(
        start, arcs, jettisons, HEATING_IGNORED, work.heating_times, 1e12, work.segments
    )
    if count == 0:
        return False
    index = 0
    for j in range(jettisons.shape[0]):
        if jettisons[j].criterion != HEATING_LIMIT or (start.jettisoned >> j) & 1 == 1:
            continue
        earliest = start.time
        for i in range(count):
            arc = arcs[work.segments[i].arc]
            if arc.kind == BURN and arc.stage >= jettisons[j].stage:
                earliest = work.segments[i].start
                break
        work.floor[COLUMN_JETTISON + 2 * index] = earliest
        index += 1
    for i in range(count):
        if work.segments[i].arc == last:
            work.floor[COLUMN_CUTOFF] = work.segments[i].start
            break
    final = work.segments[count - 1]
    # 2 % of the mass is left: beyond that nothing flies
    work.ceiling = final.start + 0.98 * final.mass / final.flow
    return True


@kernel
def _prepare(start: Record, options: Record, n: int, work: Record) -> None:
    """Units of the unknowns; step counts start anew."""
    for i in range(n):
        work.unit[i] = 1.0
    for i in range(3):
        work.unit[3 + i] = 1e-3
    for i in range(COLUMN_CUTOFF, n):
        work.unit[i] = 100.0
    for i in range(COLUMN_JETTISON + 1, n, 2):
        work.unit[i] = 5.0
    for i in range(MAX_SEGMENTS):
        work.steps[i] = 0
    work.evaluations = 0


@kernel
def _length(n: int, x: NDArray[np.float64], unit: NDArray[np.float64]) -> float:
    """Norm of a step in scaled unknowns."""
    total = 0.0
    for i in range(n):
        total += (x[i] / unit[i]) ** 2
    return math.sqrt(total)


@kernel
def _step_limit(n: int, x: NDArray[np.float64], work: Record) -> float:
    """Largest fraction of the Newton step that keeps the flight a flight."""
    step = work.step
    limit = 1.0
    # no more than about 30 deg, 1e-3 1/s, 100 s at once
    for i in range(n):
        size = abs(step[i]) / work.unit[i]
        bound = 1.0
        if i < 3:
            bound = 0.5
        if size * limit > bound:
            limit = bound / size
    cutoff = x[COLUMN_CUTOFF]
    move = step[COLUMN_CUTOFF]
    gap = cutoff - work.floor[COLUMN_CUTOFF]
    if gap + limit * move < 0.2 * gap:
        limit = -0.8 * gap / move
    gap = work.ceiling - cutoff
    if gap - limit * move < 0.2 * gap:
        limit = 0.8 * gap / move
    for i in range(COLUMN_JETTISON, n, 2):
        gap = x[i] - work.floor[i]
        if gap + limit * step[i] < 0.2 * gap:
            limit = -0.8 * gap / step[i]
        gap = cutoff - x[i]
        if gap + limit * (move - step[i]) < 0.2 * gap:
            limit = 0.8 * gap / (step[i] - move)
    return limit


@kernel
def solve_two_point(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    options: Record,
    unknowns: NDArray[np.float64],
    work: Record,
) -> tuple[int, float, int]:
    """Newton with backtracking from ``unknowns``, which are improved in place.

    A step is taken when the next simplified Newton correction is shorter than the step
    (Deuflhard, *Newton Methods for Nonlinear Problems*, section 3.3): the test does not
    depend on how the equations are scaled.

    Args:
        start: record NAVIGATION: time, position, velocity, mass (0: that of the stack), arc,
            arc_start_time, jettisoned.
        environment: record ENVIRONMENT.
        atmosphere: log-density table.
        arcs: dtype ARC; the last one is the burn that the cut-off ends.
        jettisons: dtype JETTISON.
        target: record TARGET.
        options: record OPTIONS.
        unknowns: shape (at least n,), see :func:`shoot`; guess in, answer out.
        work: record WORK.

    Returns:
        iterations, norm of the last residuals, status (CONVERGED or what went wrong).
    """
    n = unknown_count(start, jettisons, options)
    _prepare(start, options, n, work)
    if not find_floors(start, arcs, jettisons, work):
        return 0, math.inf, BAD_TIMETABLE
    # a guess outside the possible times is moved inside
    floor = work.floor[COLUMN_CUTOFF]
    unknowns[COLUMN_CUTOFF] = min(
        max(unknowns[COLUMN_CUTOFF], floor + 1e-3 * (work.ceiling - floor)),
        work.ceiling - 0.01 * (work.ceiling - floor),
    )
    for i in range(COLUMN_JETTISON, n, 2):
        span = unknowns[COLUMN_CUTOFF] - work.floor[i]
        unknowns[i] = min(
            max(unknowns[i], work.floor[i] + 0.01 * span), unknowns[COLUMN_CUTOFF] - 0.01 * span
        )
    good = shoot(
        start, environment, atmosphere, arcs, jettisons, target, options, unknowns, True, work
    )
    if not good:
        return 0, math.inf, BAD_TIMETABLE
    for iteration in range(1, options.max_iterations + 1):
        residual_norm = 0.0
        for i in range(n):
            residual_norm += work.residual[i] ** 2
            work.step[i] = -work.residual[i]
            for j in range(n):
                work.factors[i, j] = work.jacobian[i, j]
        residual_norm = math.sqrt(residual_norm)
        if not factor(n, work.factors, work.pivots):
            return iteration, residual_norm, SINGULAR
        solve(n, work.factors, work.pivots, work.step)
        length = _length(n, work.step, work.unit)
        if not math.isfinite(length):
            return iteration, residual_norm, SINGULAR
        if length <= options.tolerance:
            for i in range(n):
                unknowns[i] += work.step[i]
            return iteration, residual_norm, CONVERGED
        fraction = _step_limit(n, unknowns, work)
        first = True
        while True:
            for i in range(n):
                work.trial[i] = unknowns[i] + fraction * work.step[i]
            # the first trial is nearly always taken: have its Jacobian at once
            good = shoot(
                start,
                environment,
                atmosphere,
                arcs,
                jettisons,
                target,
                options,
                work.trial,
                first,
                work,
            )
            accepted = False
            if good:
                for i in range(n):
                    work.correction[i] = -work.residual[i]
                solve(n, work.factors, work.pivots, work.correction)
                shorter = _length(n, work.correction, work.unit)
                accepted = shorter <= (1.0 - 0.25 * fraction) * length
            if accepted:
                break
            first = False
            fraction *= 0.5
            if fraction < 1e-3:
                return iteration, residual_norm, STALLED
        for i in range(n):
            unknowns[i] = work.trial[i]
        if not first:
            good = shoot(
                start,
                environment,
                atmosphere,
                arcs,
                jettisons,
                target,
                options,
                unknowns,
                True,
                work,
            )
    residual_norm = 0.0
    for i in range(n):
        residual_norm += work.residual[i] ** 2
    return options.max_iterations, math.sqrt(residual_norm), ITERATION_LIMIT


@kernel
def _steering_integrals(
    omega: float, origin: float, work: Record
) -> tuple[float, float, float, float]:
    """Integrals of a, a cos^2, a cos sin, a sin^2 of omega (t - origin) over the segments."""
    total = 0.0
    cc = 0.0
    cs = 0.0
    ss = 0.0
    for i in range(work.segment_count):
        segment = work.segments[i]
        length = segment.end - segment.start
        panels = max(1, int(math.ceil(length / 60.0)))
        h = length / panels
        for j in range(2 * panels + 1):
            weight = h / 6.0
            if j % 2 == 1:
                weight = 4.0 * weight
            elif 0 < j < 2 * panels:
                weight = 2.0 * weight
            s = 0.5 * j * h
            thrust = segment.thrust + segment.thrust_slope * s
            mass = segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)
            wa = weight * thrust / mass
            angle = omega * (segment.start + s - origin)
            cos = math.cos(angle)
            sin = math.sin(angle)
            total += wa
            cc += wa * cos * cos
            cs += wa * cos * sin
            ss += wa * sin * sin
    return total, cc, cs, ss


@kernel
def _wanted_state(target: Record, mu: float, r: Vector, v: Vector) -> tuple[Vector, Vector, Vector]:
    """State of the terminal set nearest to downrange of ``r``, and the downrange direction."""
    planar, normal = fixed_plane(target)
    if not planar:
        # the plane of exact inclination through r, on the branch of the motion
        up = unit(r)
        north = axpy(-up[2], up, _POLE)
        cos_latitude = max(1e-9, norm(north))
        north = scale(1.0 / cos_latitude, north)
        west = cross(up, north)
        along_north = min(1.0, max(-1.0, math.cos(target.inclination) / cos_latitude))
        along_west = math.sqrt(1.0 - along_north * along_north)
        if dot(cross(r, v), west) < 0.0:
            along_west = -along_west
        normal = add(scale(along_north, north), scale(along_west, west))
    radial = unit(axpy(-dot(r, normal), normal, r))
    downrange = cross(normal, radial)
    if target.kind == TARGET_KEPLERIAN:
        first, second = perifocal(target, normal)
        c = dot(radial, first)
        s = dot(radial, second)
        e = target.eccentricity
        parameter = target.semi_major_axis * (1.0 - e * e)
        radius = parameter / max(1e-3, 1.0 + e * c)
        root = math.sqrt(mu / parameter)
        rise = root * e * s
        along = root * (1.0 + e * c)
    else:
        radius = target.radius
        rise = target.speed * math.sin(target.flight_path_angle)
        along = target.speed * math.cos(target.flight_path_angle)
    return (
        scale(radius, radial),
        add(scale(rise, radial), scale(along, downrange)),
        downrange,
    )


@kernel
def guess_two_point(
    start: Record,
    environment: Record,
    atmosphere: NDArray[np.float64],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    options: Record,
    wait: float,
    unknowns: NDArray[np.float64],
    work: Record,
) -> bool:
    """A first guess from the state alone.

    Under linear gravity the primer is lambda_v = B cos wt + (A/w) sin wt (Eq. 3.34), and the
    integrals Ic, Is that lead to a wanted end state are known from Eqs. 3.27-3.29. With
    |lambda_v| = 1 inside them they are linear in A and B. The burn time is then moved until
    |lambda_v| is 1 at the middle of the impulse, the downrange until its rate there is at
    right angles to it (nothing is gained by a rate along the thrust), and what a true
    flight misses is given back to the wanted state.

    Args:
        start: record NAVIGATION.
        environment: record ENVIRONMENT.
        atmosphere: log-density table.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        target: record TARGET.
        options: record OPTIONS.
        wait: s from the earliest drop to the guessed time of a heating jettison.
        unknowns: shape (at least n,), written.
        work: record WORK.

    Returns:
        False if the sequence makes no flight.
    """
    n = unknown_count(start, jettisons, options)
    _prepare(start, options, n, work)
    if not find_floors(start, arcs, jettisons, work):
        return False
    mu = environment.mu
    r0 = load(start.position)
    v0 = load(start.velocity)
    radius = norm(r0)
    floor = work.floor[COLUMN_CUTOFF]
    span = work.ceiling - floor
    final = arcs[arcs.shape[0] - 1]
    r_wanted, v_wanted, downrange = _wanted_state(target, mu, r0, v0)
    mean = 0.5 * (radius + min(norm(r_wanted), 1.5 * radius))
    omega = math.sqrt(mu / (mean * mean * mean))
    r_miss = (0.0, 0.0, 0.0)
    v_miss = (0.0, 0.0, 0.0)
    r_reached = r0
    v_reached = v0
    cutoff = floor + 0.5 * span
    shift = 0.0
    for iteration in range(12):
        cutoff = min(max(cutoff, floor + 0.02 * span), work.ceiling - 0.02 * span)
        unknowns[COLUMN_CUTOFF] = cutoff
        for i in range(COLUMN_JETTISON, n, 2):
            earliest = work.floor[i]
            unknowns[i] = earliest + min(wait, 0.5 * (cutoff - earliest))
            unknowns[i + 1] = 0.0
            work.heating_times[(i - COLUMN_JETTISON) // 2] = unknowns[i]
        count = build_timetable(
            start, arcs, jettisons, options.heating, work.heating_times, cutoff, work.segments
        )
        work.segment_count = count
        if count == 0:
            return False
        total, cc, cs, ss = _steering_integrals(omega, start.time, work)
        # |lambda_v| stands for 1 where the impulse has its middle
        middle = math.atan2(cs, cc)
        angle = omega * (work.segments[count - 1].end - start.time)
        cos = math.cos(angle)
        sin = math.sin(angle)
        if iteration == 0:
            # half the way round that the target speed makes, less at the start
            way = 0.5 * (norm(v0) + norm(v_wanted)) * (cutoff - start.time) / radius
            way = min(way, 1.5)
            ahead = unit(cross(cross(r0, v0), r0))
            r_reached = add(
                scale(radius * math.cos(way), unit(r0)), scale(radius * math.sin(way), ahead)
            )
            v_reached = v0
        r_wanted, v_wanted, downrange = _wanted_state(target, mu, r_reached, v_reached)
        a = axpy(omega, sub(r_wanted, r_miss), scale(-1.0, axpy(omega * cos, r0, scale(sin, v0))))
        b = add(sub(v_wanted, v_miss), axpy(omega * sin, r0, scale(-cos, v0)))
        determinant = cc * ss - cs * cs
        first = 1.0
        shift = 0.0
        p = v0
        q = v0
        for _ in range(3):
            x = axpy(omega * shift, downrange, a)
            ic = add(scale(sin, x), scale(cos, b))
            js = sub(scale(sin, b), scale(cos, x))
            p = scale(1.0 / determinant, sub(scale(ss, ic), scale(cs, js)))
            q = scale(1.0 / determinant, sub(scale(cc, js), scale(cs, ic)))
            p_middle = add(scale(math.cos(middle), p), scale(math.sin(middle), q))
            q_middle = sub(scale(math.cos(middle), q), scale(math.sin(middle), p))
            first = norm(p_middle)
            # rate at the middle per metre of downrange
            ic = scale(omega * sin, downrange)
            js = scale(-omega * cos, downrange)
            dp = scale(1.0 / determinant, sub(scale(ss, ic), scale(cs, js)))
            dq = scale(1.0 / determinant, sub(scale(cc, js), scale(cs, ic)))
            dq_middle = sub(scale(math.cos(middle), dq), scale(math.sin(middle), dp))
            slope = dot(dq_middle, p_middle)
            if slope == 0.0:
                break
            shift -= dot(q_middle, p_middle) / slope
        limit = 0.3 * radius
        shift = min(max(shift, -limit), limit)
        size = norm(p)
        for i in range(3):
            unknowns[i] = p[i] / size
            unknowns[3 + i] = -omega * q[i] / size
        # rocket equation on the last burn
        gain = (min(max(first, 0.5), 2.0) - 1.0) * total
        mass = segment_mass(work.segments[count - 1], work.segments[count - 1].end)
        move = -math.expm1(-gain / final.exhaust_velocity) * mass / final.mass_flow
        good = shoot(
            start,
            environment,
            atmosphere,
            arcs,
            jettisons,
            target,
            options,
            unknowns,
            False,
            work,
        )
        if not good:
            return True
        r_reached = (work.state[0], work.state[1], work.state[2])
        v_reached = (work.state[3], work.state[4], work.state[5])
        aim = axpy(shift, downrange, r_wanted)
        r_miss = add(r_miss, sub(r_reached, aim))
        v_miss = add(v_miss, sub(v_reached, v_wanted))
        if abs(move) < 2.0 and norm(sub(r_reached, aim)) < 0.01 * radius:
            break
        cutoff += move
    return True
