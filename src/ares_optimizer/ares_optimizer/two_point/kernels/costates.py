# SPDX-License-Identifier: Apache-2.0
"""Integrate states and costates along a segment, with their derivatives by the unknowns.

The kernels integrate the rate of the primer, lambda_v' = -lambda_r (Eq. 3.17), in place of
lambda_r. Position r and primer p = lambda_v then obey two equations of second order,

    r'' = g(r) + (T/m) p/|p|        p'' = G(r) p,        G = dg/dr,

(with w for p/|p| in a burn in held attitude, see ``held_burns``). These are Eqs. 3.14-3.17 with
lambda_r' = -G^T lambda_v for any gravity; under linear gravity G = -omega^2 and the second is
Eq. 3.18. The right-hand sides contain no first derivative, so a Runge-Kutta-Nystroem method
(``kernels/nystroem.py``) of order 6 needs five evaluations.

Tangents are exact derivatives of the discrete map, one column per unknown; an unknown time
changes the step length of the segments that it bounds.

Source: Bryson and Ho, *Applied Optimal Control*, section 3.5 for the interior condition (Eqs.
3.44, 3.45).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import ALTITUDE_SPHERICAL, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import (
    altitude,
    altitude_gradient,
    log_density,
    relative_velocity,
)
from ares_models.kernels.vectors import Vector, axpy, dot, load, scale
from ares_optimizer.kernels.nystroem import NODES, STAGES, VELOCITY_WEIGHTS, WEIGHTS
from ares_optimizer.kernels.timetable import COLUMN_CUTOFF
from ares_optimizer.two_point.arrays import LINEAR, Gravity
from ares_optimizer.two_point.kernels.gravity import oblate_curvature, oblate_terms
from ares_optimizer.two_point.kernels.held_burns import (
    add_primer_impulse,
    along_by_direction,
    along_thrust,
    direction_column,
    store_primer_thrust,
)


@kernel
def thrust_acceleration_tangents(
    segment: Record,
    s: float,
    fraction: float,
    columns: int,
    tangents: NDArray[np.float64],
) -> float:
    """Return T/m at ``s`` seconds into a segment; write its derivatives.

    Args:
        segment: record SEGMENT.
        s: s from its start.
        fraction: s over the length of the segment, constant when the ends move.
        columns: number of columns.
        tangents: shape (columns,), written: derivative by each unknown.

    Returns:
        m/s2.
    """
    for c in range(columns):
        tangents[c] = 0.0
    if segment.fading > 0.0:
        return segment.thrust / segment.mass
    thrust = segment.thrust + segment.thrust_slope * s
    flow = segment.flow + segment.flow_slope * s
    mass = segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)
    value = thrust / mass
    if segment.moves == 0:
        return value
    by_s = (segment.thrust_slope + value * flow) / mass
    for c in range(COLUMN_CUTOFF, columns):
        i = c - COLUMN_CUTOFF
        tangents[c] = (
            segment.thrust_by[i] - value * (segment.mass_by[i] - s * segment.flow_by[i])
        ) / mass + fraction * (segment.end_by[i] - segment.start_by[i]) * by_s
    return value


#: Longest part of a step, as a fraction of the time within which the direction of the primer is
#: analytic; and its least fraction of the step.
_SMOOTH = 0.5
_LEAST_SHARE = 1e-7


class _Stage(NamedTuple):
    """Hold a stage of an integration step.

    Attributes:
        number: row of the tableau.
        h: step length, s.
        r: position, m.
        p: primer.
        by_r, by_p: weighted sums of the earlier stages' accelerations, the factors of h^2.
    """

    number: int
    h: float
    r: Vector
    p: Vector
    by_r: Vector
    by_p: Vector


@kernel
def _stage_at(index: int, h: float, work: Record) -> _Stage:
    """Return position and primer at a stage, from the accelerations of the earlier stages."""
    state = work.state
    stage = work.stage
    ch = NODES[index] * h
    h_square = h * h
    x0 = x1 = x2 = x3 = x4 = x5 = 0.0
    for q in range(index):
        a = WEIGHTS[index, q]
        x0 += a * stage[q, 0]
        x1 += a * stage[q, 1]
        x2 += a * stage[q, 2]
        x3 += a * stage[q, 3]
        x4 += a * stage[q, 4]
        x5 += a * stage[q, 5]
    return _Stage(
        index,
        h,
        (
            state[0] + ch * state[3] + h_square * x0,
            state[1] + ch * state[4] + h_square * x1,
            state[2] + ch * state[5] + h_square * x2,
        ),
        (
            state[6] + ch * state[9] + h_square * x3,
            state[7] + ch * state[10] + h_square * x4,
            state[8] + ch * state[11] + h_square * x5,
        ),
        (x0, x1, x2),
        (x3, x4, x5),
    )


@kernel
def _stage_tangents(at: _Stage, work: Record) -> None:
    """Write derivatives of position and primer at a stage into ``work.moved``."""
    state = work.state
    tangent = work.tangent
    stage_tangent = work.stage_tangent
    moved = work.moved
    ch = NODES[at.number] * at.h
    h_square = at.h * at.h
    for c in range(work.columns):
        a0 = tangent[c, 0] + ch * tangent[c, 3]
        a1 = tangent[c, 1] + ch * tangent[c, 4]
        a2 = tangent[c, 2] + ch * tangent[c, 5]
        b0 = tangent[c, 6] + ch * tangent[c, 9]
        b1 = tangent[c, 7] + ch * tangent[c, 10]
        b2 = tangent[c, 8] + ch * tangent[c, 11]
        for q in range(at.number):
            a = h_square * WEIGHTS[at.number, q]
            a0 += a * stage_tangent[q, c, 0]
            a1 += a * stage_tangent[q, c, 1]
            a2 += a * stage_tangent[q, c, 2]
            b0 += a * stage_tangent[q, c, 3]
            b1 += a * stage_tangent[q, c, 4]
            b2 += a * stage_tangent[q, c, 5]
        w = work.stretch[c]
        if w != 0.0:
            # derivative of the step length
            x = w * NODES[at.number]
            z = 2.0 * w * at.h
            a0 += x * state[3] + z * at.by_r[0]
            a1 += x * state[4] + z * at.by_r[1]
            a2 += x * state[5] + z * at.by_r[2]
            b0 += x * state[9] + z * at.by_p[0]
            b1 += x * state[10] + z * at.by_p[1]
            b2 += x * state[11] + z * at.by_p[2]
        moved[c, 0] = a0
        moved[c, 1] = a1
        moved[c, 2] = a2
        moved[c, 3] = b0
        moved[c, 4] = b1
        moved[c, 5] = b2


@kernel
def _field(r: Vector, gravity: Gravity) -> tuple[float, float, float, Vector]:
    """Return k = -g/r, 1/s2; 3 k and 3 k / r; unit vector up: 0 but for k under linear gravity."""
    if gravity.model == LINEAR:
        return gravity.omega_square, 0.0, 0.0, (0.0, 0.0, 0.0)
    x, y, z = r
    inverse = 1.0 / math.sqrt(x * x + y * y + z * z)
    k = gravity.mu * inverse * inverse * inverse
    three = 3.0 * k
    return k, three, three * inverse, (x * inverse, y * inverse, z * inverse)


@kernel
def _add_oblateness(at: _Stage, oblateness: float, work: Record) -> None:
    """Add the oblate terms to the accelerations at a stage, and to their tangents."""
    m = at.number
    g, gradient_p = oblate_terms(at.r, oblateness, at.p)
    for n in range(3):
        work.stage[m, n] += g[n]
        work.stage[m, 3 + n] += gradient_p[n]
    for c in range(work.columns):
        dr = load(work.moved[c])
        _, by_place = oblate_terms(at.r, oblateness, dr)
        _, by_primer = oblate_terms(at.r, oblateness, load(work.moved[c, 3:]))
        curved = oblate_curvature(at.r, oblateness, at.p, dr)
        for n in range(3):
            work.stage_tangent[m, c, n] += by_place[n]
            work.stage_tangent[m, c, 3 + n] += by_primer[n] + curved[n]


@kernel
def _put_accelerations(
    at: _Stage, thrust: float, held: int, gravity: Gravity, work: Record
) -> None:
    """Write the accelerations of position and primer at a stage, with tangents.

    Args:
        at: the stage.
        thrust: T/m, m/s2; its tangents are in ``work.thrust``.
        held: number of the held burn that sets the direction; 0: thrust along the primer.
        gravity: the field.
        work: record WORK.
    """
    y0, y1, y2 = at.r
    y3, y4, y5 = at.p
    inverse_p = 1.0 / math.sqrt(y3 * y3 + y4 * y4 + y5 * y5)
    u0, u1, u2 = y3 * inverse_p, y4 * inverse_p, y5 * inverse_p
    turn = thrust * inverse_p
    if held > 0:
        u0, u1, u2 = load(work.aims[held - 1].direction)
        turn = 0.0
    k, three, third, (e0, e1, e2) = _field(at.r, gravity)
    ep = e0 * y3 + e1 * y4 + e2 * y5
    stage = work.stage
    m = at.number
    stage[m, 0] = thrust * u0 - k * y0
    stage[m, 1] = thrust * u1 - k * y1
    stage[m, 2] = thrust * u2 - k * y2
    stage[m, 3] = three * ep * e0 - k * y3
    stage[m, 4] = three * ep * e1 - k * y4
    stage[m, 5] = three * ep * e2 - k * y5
    stage_tangent = work.stage_tangent
    moved = work.moved
    _stage_tangents(at, work)
    for c in range(work.columns):
        a0, a1, a2 = moved[c, 0], moved[c, 1], moved[c, 2]
        b0, b1, b2 = moved[c, 3], moved[c, 4], moved[c, 5]
        ea = e0 * a0 + e1 * a1 + e2 * a2
        eb = e0 * b0 + e1 * b1 + e2 * b2
        ub = u0 * b0 + u1 * b1 + u2 * b2
        pa = y3 * a0 + y4 * a1 + y5 * a2
        along = work.thrust[c] - turn * ub
        w = three * ea
        stage_tangent[m, c, 0] = turn * b0 + along * u0 + w * e0 - k * a0
        stage_tangent[m, c, 1] = turn * b1 + along * u1 + w * e1 - k * a1
        stage_tangent[m, c, 2] = turn * b2 + along * u2 + w * e2 - k * a2
        w = three * eb + third * (pa - 5.0 * ea * ep)
        x = third * ea
        z = third * ep
        stage_tangent[m, c, 3] = w * e0 - k * b0 + x * y3 + z * a0
        stage_tangent[m, c, 4] = w * e1 - k * b1 + x * y4 + z * a1
        stage_tangent[m, c, 5] = w * e2 - k * b2 + x * y5 + z * a2
    if gravity.model != LINEAR and gravity.oblateness != 0.0:
        _add_oblateness(at, gravity.oblateness, work)
    if held > 0 and work.columns > 0:
        for n in range(3):
            stage_tangent[m, direction_column(held, work) + n, n] += thrust


@kernel
def _end_step(last: _Stage, work: Record) -> None:
    """Compute state and tangents at the end of a step; ``last`` is its last stage."""
    state = work.state
    stage = work.stage
    tangent = work.tangent
    stage_tangent = work.stage_tangent
    h = last.h
    x0 = x1 = x2 = x3 = x4 = x5 = 0.0
    for q in range(STAGES):
        b = VELOCITY_WEIGHTS[q]
        x0 += b * stage[q, 0]
        x1 += b * stage[q, 1]
        x2 += b * stage[q, 2]
        x3 += b * stage[q, 3]
        x4 += b * stage[q, 4]
        x5 += b * stage[q, 5]
    for c in range(work.columns):
        a0 = a1 = a2 = b0 = b1 = b2 = 0.0
        for q in range(STAGES):
            b = VELOCITY_WEIGHTS[q]
            a0 += b * stage_tangent[q, c, 0]
            a1 += b * stage_tangent[q, c, 1]
            a2 += b * stage_tangent[q, c, 2]
            b0 += b * stage_tangent[q, c, 3]
            b1 += b * stage_tangent[q, c, 4]
            b2 += b * stage_tangent[q, c, 5]
        w = work.stretch[c]
        # the last stage is the end of the step
        for n in range(3):
            tangent[c, n] = work.moved[c, n]
            tangent[c, 6 + n] = work.moved[c, 3 + n]
        tangent[c, 3] += h * a0 + w * x0
        tangent[c, 4] += h * a1 + w * x1
        tangent[c, 5] += h * a2 + w * x2
        tangent[c, 9] += h * b0 + w * x3
        tangent[c, 10] += h * b1 + w * x4
        tangent[c, 11] += h * b2 + w * x5
    for n in range(3):
        state[n] = last.r[n]
        state[6 + n] = last.p[n]
    state[3] += h * x0
    state[4] += h * x1
    state[5] += h * x2
    state[9] += h * x3
    state[10] += h * x4
    state[11] += h * x5


@kernel
def set_stretch(segment: Record, parts: float, work: Record) -> None:
    """Write the derivative of the length of 1 / ``parts`` of a segment into ``work.stretch``."""
    for c in range(work.columns):
        work.stretch[c] = 0.0
    if segment.moves == 0:
        return
    for c in range(COLUMN_CUTOFF, work.columns):
        i = c - COLUMN_CUTOFF
        work.stretch[c] = (segment.end_by[i] - segment.start_by[i]) / parts


@kernel
def _store_costate_rate(
    segment: Record, s: float, fraction: float, at: _Stage, work: Record
) -> None:
    """Write lambda_v . u T/m^2 at a stage, u: thrust direction, and its tangents.

    Args:
        segment: record SEGMENT.
        s: s from its start.
        fraction: s over the segment's length.
        at: the stage; tangents of T/m are in ``work.thrust``, of the primer in ``work.moved``.
        work: record WORK.
    """
    mass = segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)
    flow = segment.flow + segment.flow_slope * s
    acceleration = (segment.thrust + segment.thrust_slope * s) / mass
    length, u = along_thrust(segment, at.p, work)
    work.costate_rate = length * acceleration / mass
    for c in range(work.columns):
        along = u[0] * work.moved[c, 3] + u[1] * work.moved[c, 4] + u[2] * work.moved[c, 5]
        along += along_by_direction(c, segment, at.p, work)
        by_mass = 0.0
        if c >= COLUMN_CUTOFF and segment.moves == 1:
            i = c - COLUMN_CUTOFF
            by_mass = segment.mass_by[i] - s * segment.flow_by[i]
            by_mass -= flow * fraction * (segment.end_by[i] - segment.start_by[i])
        work.costate_rate_by[c] = (
            along * acceleration + length * work.thrust[c] - length * acceleration * by_mass / mass
        ) / mass


@kernel
def _add_costate_rate(weight: float, h: float, work: Record) -> None:
    """Add the contribution of a stage to the rise of the mass costate."""
    work.costate_rise += h * weight * work.costate_rate
    for c in range(work.columns):
        work.costate_rise_by[c] += weight * (
            h * work.costate_rate_by[c] + work.stretch[c] * work.costate_rate
        )


@kernel
def smooth_share(h: float, done: float, work: Record) -> float:
    """Return the next part of a step, a fraction of ``h``: all the rest unless the thrust flips.

    Where the primer nearly vanishes the thrust turns half round in less than a step. The direction
    of a primer p with rate q is analytic in time within |p| / |q| of now.

    Args:
        h: length of the step, s.
        done: fraction of the step that is integrated.
        work: record WORK, with the state there.
    """
    state = work.state
    rest = 1.0 - done
    square = state[6] * state[6] + state[7] * state[7] + state[8] * state[8]
    rate = state[9] * state[9] + state[10] * state[10] + state[11] * state[11]
    share = _SMOOTH * math.sqrt(square / rate) / h
    if not share < rest:
        return rest
    return min(max(share, _LEAST_SHARE), rest)


@kernel
def _reuse_last_stage(work: Record) -> None:
    """Take the last stage for the first (FSAL): thrust is continuous within a segment."""
    for n in range(6):
        work.stage[0, n] = work.stage[STAGES - 1, n]
    for c in range(work.columns):
        for n in range(6):
            work.stage_tangent[0, c, n] = work.stage_tangent[STAGES - 1, c, n]


@kernel
def integrate_segment(segment: Record, steps: int, gravity: Gravity, work: Record) -> None:
    """Integrate ``work.state`` and ``work.tangent`` over a segment in equal steps.

    A step in which the thrust flips is divided (:func:`smooth_share`).

    Args:
        segment: record SEGMENT.
        steps: number of steps.
        gravity: the field.
        work: record WORK; ``columns`` is the number of tangents. If ``planned``, the rise of
            the mass costate is written too.
    """
    length = (segment.end - segment.start) / steps
    # throttled to constant acceleration, the mass costate has a closed form (free_arcs)
    costate = work.planned == 1 and segment.fading == 0.0
    held = segment.held
    flown = held if work.aiming == 0 else 0
    along = held == 0 and (segment.thrust > 0.0 or segment.thrust_slope != 0.0)
    work.costate_rise = 0.0
    for c in range(work.columns):
        work.costate_rise_by[c] = 0.0
    first = 0
    for step in range(steps):
        done = 0.0
        while done < 1.0:
            share = smooth_share(length, done, work) if along else 1.0
            h = share * length
            set_stretch(segment, steps / share, work)
            if first == 1:
                _reuse_last_stage(work)
                if costate:
                    _add_costate_rate(VELOCITY_WEIGHTS[0], h, work)
                if held > 0:
                    add_primer_impulse(work.aims[held - 1], VELOCITY_WEIGHTS[0], h, work)
            for m in range(first, STAGES):
                at = _stage_at(m, h, work)
                into = step + done + share * NODES[m]
                thrust = thrust_acceleration_tangents(
                    segment, into * length, into / steps, work.columns, work.thrust
                )
                _put_accelerations(at, thrust, flown, gravity, work)
                if held > 0:
                    store_primer_thrust(at.p, thrust, work)
                    add_primer_impulse(work.aims[held - 1], VELOCITY_WEIGHTS[m], h, work)
                if costate:
                    _store_costate_rate(segment, into * length, into / steps, at, work)
                    _add_costate_rate(VELOCITY_WEIGHTS[m], h, work)
                if m == STAGES - 1:
                    _end_step(at, work)
            first = 1
            done = done + share if share < 1.0 - done else 1.0
        if work.planned == 1:
            # the perigee of a coast may lie between its ends
            r = (work.state[0], work.state[1], work.state[2])
            work.lowest = min(work.lowest, math.sqrt(dot(r, r)))


@kernel
def log_density_curvature(h: float, atmosphere: NDArray[np.float64]) -> float:
    """Return the second derivative of log density by altitude, 1/m2; 0 below the table.

    Args:
        h: altitude, m.
        atmosphere: shape (n, 9), see ``ares_models.arrays``.
    """
    low = 0
    high = atmosphere.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if h >= atmosphere[middle, 0]:
            low = middle
        else:
            high = middle
    x = h - atmosphere[low, 0]
    if x < 0.0:
        return 0.0
    return 2.0 * atmosphere[low, 3] + 6.0 * atmosphere[low, 4] * x


@kernel
def altitude_hessian_product(r: Vector, dr: Vector, environment: Record) -> Vector:
    """Return the Hessian of altitude (Eq. 2.15) by position, times ``dr``.

    Args:
        r: position, m.
        dr: any vector.
        environment: record ENVIRONMENT.
    """
    square = dot(r, r)
    inverse = 1.0 / math.sqrt(square)
    up = scale(inverse, r)
    out = scale(inverse, axpy(-dot(up, dr), up, dr))
    if environment.altitude_model == ALTITUDE_SPHERICAL:
        return out
    ratio = environment.polar_radius / environment.equatorial_radius
    k = 1.0 - ratio * ratio
    z = r[2]
    base = 1.0 - k * (r[0] * r[0] + r[1] * r[1]) / square
    # surface radius as a function of w = cos^2 of the latitude
    first = environment.polar_radius * 0.5 * k / (base * math.sqrt(base))
    second = first * 1.5 * k / base
    zz = z * z / square
    along = dot(r, dr) / square
    w_gradient = (
        2.0 * zz * r[0] / square,
        2.0 * zz * r[1] / square,
        2.0 * zz * r[2] / square - 2.0 * z / square,
    )
    radial = 4.0 * z * dr[2] / square - 8.0 * zz * along
    pole = -2.0 * dr[2] + 4.0 * z * along
    w_change = (
        (radial * r[0] + 2.0 * zz * dr[0]) / square,
        (radial * r[1] + 2.0 * zz * dr[1]) / square,
        (radial * r[2] + 2.0 * zz * dr[2] + pole) / square,
    )
    return axpy(-first, w_change, axpy(-second * dot(w_gradient, dr), w_gradient, out))


@kernel
def log_heating_hessian_product(
    r: Vector,
    v: Vector,
    dr: Vector,
    dv: Vector,
    environment: Record,
    atmosphere: NDArray[np.float64],
) -> tuple[Vector, Vector]:
    """Return the change of the gradient of log heating with the state.

    Args:
        r: position, m.
        v: velocity, m/s.
        dr: change of position, m.
        dv: change of velocity, m/s.
        environment: record ENVIRONMENT.
        atmosphere: shape (n, 9).

    Returns:
        changes of the gradients by position and by velocity, 1/m and s/m.
    """
    rate = environment.rotation_rate
    relative = relative_velocity(r, v, environment)
    d_relative = relative_velocity(dr, dv, environment)
    square = dot(relative, relative)
    d_velocity = axpy(
        -6.0 * dot(relative, d_relative) / (square * square),
        relative,
        scale(3.0 / square, d_relative),
    )
    h = altitude(r, environment)
    _, slope = log_density(h, atmosphere)
    curvature = log_density_curvature(h, atmosphere)
    up = altitude_gradient(r, environment)
    d_position = axpy(
        curvature * dot(up, dr),
        up,
        scale(slope, altitude_hessian_product(r, dr, environment)),
    )
    return (
        (
            d_position[0] - rate * d_velocity[1],
            d_position[1] + rate * d_velocity[0],
            d_position[2],
        ),
        d_velocity,
    )
