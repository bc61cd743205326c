"""States and costates along a segment, with their derivatives by the unknowns.

In place of lambda_r the kernels carry the rate of the primer, lambda_v' = -lambda_r
(Eq. 3.17): position r and primer p = lambda_v then obey two equations of second order,

    r'' = g(r) + (T/m) p/|p|        p'' = G(r) p,        G = dg/dr,

Eqs. 3.14-3.17 with lambda_r' = -G^T lambda_v for any gravity; under linear gravity
G = -omega^2 and the second is Eq. 3.18. No first derivative stands on the right, so a
Runge-Kutta-Nystroem method takes five evaluations for order 6.

Tangents are exact derivatives of the discrete map: every column follows one unknown, and
the unknown times stretch the steps of the segments that they bound.

Sources: Dormand, El-Mikkawy, Prince, "Families of Runge-Kutta-Nystrom formulae", IMA J.
Numer. Anal. 7 (1987), the 6(4) pair with six stages, first same as last; Bryson and Ho,
*Applied Optimal Control*, section 3.5 for the interior condition (Eqs. 3.44, 3.45).
"""

import math

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
from ares_models.kernels.vectors import Vector, axpy, dot, scale
from ares_optimizer.two_point.arrays import LINEAR, STAGES

_C = np.array([0.0, 1.0 / 10.0, 3.0 / 10.0, 7.0 / 10.0, 17.0 / 25.0, 1.0])
_A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0 / 200.0, 0.0, 0.0, 0.0, 0.0],
        [-1.0 / 2200.0, 1.0 / 22.0, 0.0, 0.0, 0.0],
        [637.0 / 6600.0, -7.0 / 110.0, 7.0 / 33.0, 0.0, 0.0],
        [
            225437.0 / 1968750.0,
            -30073.0 / 281250.0,
            65569.0 / 281250.0,
            -9367.0 / 984375.0,
            0.0,
        ],
        [151.0 / 2142.0, 5.0 / 116.0, 385.0 / 1368.0, 55.0 / 168.0, -6250.0 / 28101.0],
    ]
)
_B = np.array(
    [
        151.0 / 2142.0,
        25.0 / 522.0,
        275.0 / 684.0,
        275.0 / 252.0,
        -78125.0 / 112404.0,
        1.0 / 12.0,
    ]
)


@kernel
def thrust_acceleration_tangents(
    segment: Record,
    s: float,
    fraction: float,
    columns: int,
    acceleration_tangent: NDArray[np.float64],
) -> float:
    """T/m at ``s`` seconds into a segment, and its derivative by column.

    Args:
        segment: record SEGMENT.
        s: s from its start.
        fraction: s over the segment's length; a moving end carries it along.
        columns: how many columns to carry.
        acceleration_tangent: shape (columns,), written.

    Returns:
        m/s2.
    """
    thrust = segment.thrust + segment.thrust_slope * s
    flow = segment.flow + segment.flow_slope * s
    mass = segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)
    value = thrust / mass
    for c in range(columns):
        acceleration_tangent[c] = 0.0
    i = segment.start_column
    j = segment.end_column
    by_s = (segment.thrust_slope + value * flow) / mass
    if 0 <= i < columns:
        by_start = (
            segment.thrust_by_start - value * (segment.mass_by_start - s * segment.flow_by_start)
        ) / mass
        acceleration_tangent[i] += by_start - fraction * by_s
    if 0 <= j < columns:
        acceleration_tangent[j] += fraction * by_s
    return value


@kernel
def integrate_segment(
    segment: Record,
    steps: int,
    mu: float,
    omega_square: float,
    gravity: int,
    columns: int,
    state: NDArray[np.float64],
    tangent: NDArray[np.float64],
    stage: NDArray[np.float64],
    stage_tangent: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> None:
    """Carry state and tangents over one segment, in equal steps.

    Args:
        segment: record SEGMENT.
        steps: number of steps.
        mu: m3/s2.
        omega_square: 1/s2, under linear gravity.
        gravity: INVERSE_SQUARE or LINEAR.
        columns: how many tangents to carry; 0 for none.
        state: shape (12,), changed: r, V, lambda_v, lambda_v'.
        tangent: shape (MAX_COLUMNS, 12), changed: derivative of the state by each unknown.
        stage: shape (6, 6), scratch.
        stage_tangent: shape (6, MAX_COLUMNS, 6), scratch.
        scratch: shape (>= 2, MAX_COLUMNS), scratch.
    """
    h = (segment.end - segment.start) / steps
    h_square = h * h
    start_column = segment.start_column if segment.start_column < columns else -1
    end_column = segment.end_column if segment.end_column < columns else -1
    if start_column == end_column:
        stretch = 0.0
    else:
        stretch = 1.0 / steps
    acceleration_tangent = scratch[0]
    stretch_by = scratch[1]
    for c in range(columns):
        stretch_by[c] = 0.0
    if start_column >= 0:
        stretch_by[start_column] = -stretch
    if end_column >= 0:
        stretch_by[end_column] = stretch
    y0 = y1 = y2 = y3 = y4 = y5 = 0.0
    x0 = x1 = x2 = x3 = x4 = x5 = 0.0
    for step in range(steps):
        first = 0
        if step > 0:
            # first same as last: thrust is continuous within a segment
            first = 1
            for n in range(6):
                stage[0, n] = stage[5, n]
            for c in range(columns):
                for n in range(6):
                    stage_tangent[0, c, n] = stage_tangent[5, c, n]
        for m in range(first, STAGES):
            ch = _C[m] * h
            x0 = x1 = x2 = x3 = x4 = x5 = 0.0
            for q in range(m):
                a = _A[m, q]
                x0 += a * stage[q, 0]
                x1 += a * stage[q, 1]
                x2 += a * stage[q, 2]
                x3 += a * stage[q, 3]
                x4 += a * stage[q, 4]
                x5 += a * stage[q, 5]
            y0 = state[0] + ch * state[3] + h_square * x0
            y1 = state[1] + ch * state[4] + h_square * x1
            y2 = state[2] + ch * state[5] + h_square * x2
            y3 = state[6] + ch * state[9] + h_square * x3
            y4 = state[7] + ch * state[10] + h_square * x4
            y5 = state[8] + ch * state[11] + h_square * x5
            fraction = (step + _C[m]) * stretch
            thrust = thrust_acceleration_tangents(
                segment, (step + _C[m]) * h, fraction, columns, acceleration_tangent
            )
            inverse_p = 1.0 / math.sqrt(y3 * y3 + y4 * y4 + y5 * y5)
            u0, u1, u2 = y3 * inverse_p, y4 * inverse_p, y5 * inverse_p
            if gravity == LINEAR:
                k = omega_square
                three = 0.0
                third = 0.0
                e0, e1, e2 = 0.0, 0.0, 0.0
            else:
                inverse_r = 1.0 / math.sqrt(y0 * y0 + y1 * y1 + y2 * y2)
                k = mu * inverse_r * inverse_r * inverse_r
                three = 3.0 * k
                third = three * inverse_r
                e0, e1, e2 = y0 * inverse_r, y1 * inverse_r, y2 * inverse_r
            ep = e0 * y3 + e1 * y4 + e2 * y5
            stage[m, 0] = thrust * u0 - k * y0
            stage[m, 1] = thrust * u1 - k * y1
            stage[m, 2] = thrust * u2 - k * y2
            stage[m, 3] = three * ep * e0 - k * y3
            stage[m, 4] = three * ep * e1 - k * y4
            stage[m, 5] = three * ep * e2 - k * y5
            turn = thrust * inverse_p
            for c in range(columns):
                a0 = tangent[c, 0] + ch * tangent[c, 3]
                a1 = tangent[c, 1] + ch * tangent[c, 4]
                a2 = tangent[c, 2] + ch * tangent[c, 5]
                b0 = tangent[c, 6] + ch * tangent[c, 9]
                b1 = tangent[c, 7] + ch * tangent[c, 10]
                b2 = tangent[c, 8] + ch * tangent[c, 11]
                for q in range(m):
                    a = h_square * _A[m, q]
                    a0 += a * stage_tangent[q, c, 0]
                    a1 += a * stage_tangent[q, c, 1]
                    a2 += a * stage_tangent[q, c, 2]
                    b0 += a * stage_tangent[q, c, 3]
                    b1 += a * stage_tangent[q, c, 4]
                    b2 += a * stage_tangent[q, c, 5]
                w = stretch_by[c]
                if w != 0.0:
                    # a moving end changes the step itself
                    x = w * _C[m]
                    z = 2.0 * w * h
                    a0 += x * state[3] + z * x0
                    a1 += x * state[4] + z * x1
                    a2 += x * state[5] + z * x2
                    b0 += x * state[9] + z * x3
                    b1 += x * state[10] + z * x4
                    b2 += x * state[11] + z * x5
                if m == STAGES - 1:
                    # the last stage is the end of the step
                    tangent[c, 0] = a0
                    tangent[c, 1] = a1
                    tangent[c, 2] = a2
                    tangent[c, 6] = b0
                    tangent[c, 7] = b1
                    tangent[c, 8] = b2
                ea = e0 * a0 + e1 * a1 + e2 * a2
                eb = e0 * b0 + e1 * b1 + e2 * b2
                ub = u0 * b0 + u1 * b1 + u2 * b2
                pa = y3 * a0 + y4 * a1 + y5 * a2
                along = acceleration_tangent[c] - turn * ub
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
        x0 = x1 = x2 = x3 = x4 = x5 = 0.0
        for q in range(STAGES):
            b = _B[q]
            x0 += b * stage[q, 0]
            x1 += b * stage[q, 1]
            x2 += b * stage[q, 2]
            x3 += b * stage[q, 3]
            x4 += b * stage[q, 4]
            x5 += b * stage[q, 5]
        for c in range(columns):
            a0 = a1 = a2 = b0 = b1 = b2 = 0.0
            for q in range(STAGES):
                b = _B[q]
                a0 += b * stage_tangent[q, c, 0]
                a1 += b * stage_tangent[q, c, 1]
                a2 += b * stage_tangent[q, c, 2]
                b0 += b * stage_tangent[q, c, 3]
                b1 += b * stage_tangent[q, c, 4]
                b2 += b * stage_tangent[q, c, 5]
            w = stretch_by[c]
            tangent[c, 3] += h * a0 + w * x0
            tangent[c, 4] += h * a1 + w * x1
            tangent[c, 5] += h * a2 + w * x2
            tangent[c, 9] += h * b0 + w * x3
            tangent[c, 10] += h * b1 + w * x4
            tangent[c, 11] += h * b2 + w * x5
        state[0] = y0
        state[1] = y1
        state[2] = y2
        state[6] = y3
        state[7] = y4
        state[8] = y5
        state[3] += h * x0
        state[4] += h * x1
        state[5] += h * x2
        state[9] += h * x3
        state[10] += h * x4
        state[11] += h * x5


@kernel
def log_density_curvature(h: float, atmosphere: NDArray[np.float64]) -> float:
    """Second derivative of log density with altitude, 1/m2; 0 beyond the table's ends.

    Args:
        h: altitude, m.
        atmosphere: shape (n, 5), see ``ares_models.arrays``.
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
    """Second derivative of altitude (Eq. 2.15) by position, times ``dr``; 1/m times m.

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
    """Change of the gradient of log heating when the state changes by (dr, dv).

    Args:
        r: position, m.
        v: velocity, m/s.
        dr: change of position, m.
        dv: change of velocity, m/s.
        environment: record ENVIRONMENT.
        atmosphere: shape (n, 5).

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
