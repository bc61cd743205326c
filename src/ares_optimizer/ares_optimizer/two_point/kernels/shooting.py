"""The optimum as a root: shooting and its Jacobian.

Unknowns: lambda_v and lambda_r at the start, the cut-off time, and for every heating
jettison still to come its time and pi. Equations: |lambda_v| = 1 at the start (the scale is
free; printed: H_f = 1, Eq. 3.30), the terminal set with its reduced transversality
conditions, and per heating jettison log heating = log limit and a continuous Hamiltonian.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    HEATING_LIMIT,
    TARGET_KEPLERIAN,
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
    norm,
    scale,
    sub,
)
from ares_optimizer.kernels.terminal import SCALE, terminal_rows
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    HEATING_OPTIMAL,
    build_timetable,
    heating_count,
)
from ares_optimizer.two_point.arrays import AT_ONCE, LINEAR, ROWS, RUNGE_KUTTA
from ares_optimizer.two_point.kernels.closed_form import closed_form_segment
from ares_optimizer.two_point.kernels.costates import (
    integrate_segment,
    log_heating_hessian_product,
    thrust_acceleration_tangents,
)


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
            by_r[0] * tangent[c, 0]
            + by_r[1] * tangent[c, 1]
            + by_r[2] * tangent[c, 2]
            + by_v[0] * tangent[c, 3]
            + by_v[1] * tangent[c, 4]
            + by_v[2] * tangent[c, 5]
            + by_p[0] * tangent[c, 6]
            + by_p[1] * tangent[c, 7]
            + by_p[2] * tangent[c, 8]
            + by_q[0] * tangent[c, 9]
            + by_q[1] * tangent[c, 10]
            + by_q[2] * tangent[c, 11]
        )


@kernel
def end_rows(
    target: Record,
    mu: float,
    state: NDArray[np.float64],
    tangent: NDArray[np.float64],
    columns: int,
    work: Record,
) -> None:
    """Terminal set and reduced transversality: residuals and Jacobian rows 1 to 6.

    A motion that the terminal set leaves free must not change the cost: lambda . dx = 0 for
    the turn of the whole state about an axis e, which is e . C = 0 with
    C = r x lambda_r + V x lambda_v. Free downrange: e along h; free node: e along the pole.
    On a Keplerian target the free motion is that along the orbit,
    lambda_r . V + lambda_v . g = 0.

    Args:
        target: record TARGET.
        mu: m3/s2.
        state: shape (12,) at the end of the thrust: r, V, lambda_v, lambda_v'.
        tangent: shape (MAX_COLUMNS, 12).
        columns: how many Jacobian columns to write.
        work: record WORK; rows of ``residual`` and ``jacobian`` are written, without unit.
    """
    r = (state[0], state[1], state[2])
    v = (state[3], state[4], state[5])
    p = (state[6], state[7], state[8])
    q = (state[9], state[10], state[11])
    residual = work.residual
    jacobian = work.jacobian
    rows = terminal_rows(target, mu, r, v, work.terminal, work.terminal_gradient)
    for i in range(rows):
        residual[1 + i] = work.terminal[i] / SCALE
        for c in range(columns):
            total = 0.0
            for n in range(6):
                total += work.terminal_gradient[i, n] * tangent[c, n]
            jacobian[1 + i, c] = total / SCALE
    row = 1 + rows
    radius = norm(r)
    h = cross(r, v)
    # C with lambda_r = -q
    turn = sub(cross(v, p), cross(r, q))
    if rows == 4:
        pole = (0.0, 0.0, 1.0)
        size = 1.0 / target.speed
        residual[row] = size * turn[2]
        _row(
            jacobian[row],
            tangent,
            columns,
            scale(-size, cross(q, pole)),
            scale(size, cross(p, pole)),
            scale(size, cross(pole, v)),
            scale(-size, cross(pole, r)),
        )
        row += 1
    if target.kind == TARGET_KEPLERIAN:
        k = mu / (radius * radius * radius)
        e = scale(1.0 / radius, r)
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
    pinned = work.pinned[index] == 1
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
    # H(-) - H(+): what a second of waiting is worth
    worth = before * length_before - after * length_after + weight * drift
    work.waiting_pays[index] = 1 if worth > 0.0 else 0
    if passive:
        work.residual[row + 1] = pi
    elif pinned:
        # no choice of time, no condition on the Hamiltonian
        work.residual[row + 1] = (segment.end - work.floor[row] - AT_ONCE) / 100.0
    else:
        work.residual[row + 1] = size * worth
    u_before = scale(1.0 / length_before, p)
    u_after = scale(1.0 / length_after, p_after)
    jacobian = work.jacobian
    for c in range(columns):
        dr = (tangent[c, 0], tangent[c, 1], tangent[c, 2])
        dv = (tangent[c, 3], tangent[c, 4], tangent[c, 5])
        dp = (tangent[c, 6], tangent[c, 7], tangent[c, 8])
        dq = (tangent[c, 9], tangent[c, 10], tangent[c, 11])
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
            if pinned:
                jacobian[row + 1, c] = 0.01 if c == row else 0.0
            else:
                jacobian[row + 1, c] = size * (
                    scratch[0, c] * length_before
                    + before * dot(u_before, dp)
                    - scratch[1, c] * length_after
                    - after * dot(u_after, dp_after)
                    + change
                )
                # the scale follows the acceleration
                jacobian[row + 1, c] -= work.residual[row + 1] * size * scratch[1, c]
            for n in range(3):
                tangent[c, 6 + n] = dp_after[n]
                tangent[c, 9 + n] = dq_after[n]
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
def search_is_over(options: Record, work: Record) -> bool:
    """Whether the time or the work that a search may take has ended."""
    return work.stop != 0 or 0 < options.max_steps <= work.spent


@kernel
def begin_state(
    start: Record, mu: float, options: Record, unknowns: NDArray[np.float64], work: Record
) -> float:
    """State and costates at the start into ``work.state``; omega^2 of linear gravity, or 0."""
    state = work.state
    for i in range(3):
        state[i] = start.position[i]
        state[3 + i] = start.velocity[i]
        state[6 + i] = unknowns[i]
        state[9 + i] = -unknowns[3 + i]
    square = state[0] * state[0] + state[1] * state[1] + state[2] * state[2]
    work.lowest = math.sqrt(square)
    if options.gravity == LINEAR:
        # omega0 of the radius at the start (Eq. 3.4; printed without the root)
        return mu / (square * work.lowest)
    return 0.0


@kernel
def fly_segment(
    segment: Record,
    steps: int,
    mu: float,
    omega_square: float,
    options: Record,
    columns: int,
    work: Record,
) -> None:
    """Carry ``work.state`` and ``work.tangent`` over a segment by the chosen propagator."""
    state = work.state
    if options.propagator == RUNGE_KUTTA:
        integrate_segment(
            segment,
            steps,
            mu,
            omega_square,
            options.gravity,
            columns,
            state,
            work.tangent,
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
            options.corrected == 1,
            columns,
            state,
            work.tangent,
            work.stage[0],
            work.stage_tangent[0],
            work.scratch,
        )
    radius = math.sqrt(state[0] * state[0] + state[1] * state[1] + state[2] * state[2])
    work.lowest = min(work.lowest, radius)


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
    omega_square = begin_state(start, mu, options, unknowns, work)
    all_columns = 0
    columns = 0
    if tangents:
        all_columns = n
        columns = 6
        for i in range(ROWS):
            for c in range(n):
                tangent[c, i] = 0.0
        for i in range(3):
            tangent[i, 6 + i] = 1.0
            tangent[3 + i, 9 + i] = -1.0
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
        work.spent += steps
        fly_segment(segment, steps, mu, omega_square, options, columns, work)
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
    end_rows(target, mu, state, tangent, all_columns, work)
    total = 0.0
    for i in range(n):
        total += residual[i]
    return math.isfinite(total)
