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
from ares_models.arrays import ALTITUDE_SPHERICAL, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import (
    altitude,
    altitude_gradient,
    log_density,
    relative_velocity,
)
from ares_models.kernels.vectors import Vector, axpy, dot, scale
from numpy.typing import NDArray

INVERSE_SQUARE = 0
LINEAR = 1

#: Rows of a state: position, velocity, primer, rate of the primer.
ROWS = 12
MAX_COLUMNS = 24
STAGES = 6

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
def _accelerate(
    y: NDArray[np.float64],
    thrust_acceleration: float,
    acceleration_tangent: NDArray[np.float64],
    mu: float,
    omega_square: float,
    gravity: int,
    columns: int,
    tangent: NDArray[np.float64],
    out: NDArray[np.float64],
    out_tangent: NDArray[np.float64],
) -> None:
    """Right-hand side r'', p'' and its derivative along every column.

    Args:
        y: shape (6,): position m, primer.
        thrust_acceleration: T/m, m/s2.
        acceleration_tangent: its derivative by column, shape (columns,).
        mu: m3/s2.
        omega_square: 1/s2, used under linear gravity.
        gravity: INVERSE_SQUARE or LINEAR.
        columns: how many to carry.
        tangent: shape (6, columns), derivative of y.
        out: shape (6,), written: r'', p''.
        out_tangent: shape (6, columns), written.
    """
    r0, r1, r2 = y[0], y[1], y[2]
    p0, p1, p2 = y[3], y[4], y[5]
    inverse_p = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
    u0, u1, u2 = p0 * inverse_p, p1 * inverse_p, p2 * inverse_p
    if gravity == LINEAR:
        k = omega_square
        three = 0.0
        e0, e1, e2 = 0.0, 0.0, 0.0
        third = 0.0
    else:
        square = r0 * r0 + r1 * r1 + r2 * r2
        inverse_r = 1.0 / math.sqrt(square)
        k = mu * inverse_r * inverse_r * inverse_r
        three = 3.0 * k
        e0, e1, e2 = r0 * inverse_r, r1 * inverse_r, r2 * inverse_r
        third = three * inverse_r
    ep = e0 * p0 + e1 * p1 + e2 * p2
    out[0] = thrust_acceleration * u0 - k * r0
    out[1] = thrust_acceleration * u1 - k * r1
    out[2] = thrust_acceleration * u2 - k * r2
    out[3] = three * ep * e0 - k * p0
    out[4] = three * ep * e1 - k * p1
    out[5] = three * ep * e2 - k * p2
    turn = thrust_acceleration * inverse_p
    for c in range(columns):
        a0, a1, a2 = tangent[0, c], tangent[1, c], tangent[2, c]
        b0, b1, b2 = tangent[3, c], tangent[4, c], tangent[5, c]
        ea = e0 * a0 + e1 * a1 + e2 * a2
        eb = e0 * b0 + e1 * b1 + e2 * b2
        ub = u0 * b0 + u1 * b1 + u2 * b2
        pa = p0 * a0 + p1 * a1 + p2 * a2
        along = acceleration_tangent[c] - turn * ub
        w = three * ea
        out_tangent[0, c] = turn * b0 + along * u0 + w * e0 - k * a0
        out_tangent[1, c] = turn * b1 + along * u1 + w * e1 - k * a1
        out_tangent[2, c] = turn * b2 + along * u2 + w * e2 - k * a2
        w = three * eb + third * (pa - 5.0 * ea * ep)
        x = third * ea
        z = third * ep
        out_tangent[3, c] = w * e0 - k * b0 + x * p0 + z * a0
        out_tangent[4, c] = w * e1 - k * b1 + x * p1 + z * a1
        out_tangent[5, c] = w * e2 - k * b2 + x * p2 + z * a2


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
        tangent: shape (12, MAX_COLUMNS), changed.
        stage: shape (6, 6), scratch.
        stage_tangent: shape (6, 6, MAX_COLUMNS), scratch.
        scratch: shape (9, MAX_COLUMNS), scratch.
    """
    length = segment.end - segment.start
    h = length / steps
    h_square = h * h
    # d h by column
    i = segment.start_column if segment.start_column < columns else -1
    j = segment.end_column if segment.end_column < columns else -1
    stretched = i != j
    y = np.empty(6)
    half = scratch[:6]
    acceleration_tangent = scratch[6]
    for step in range(steps):
        first = 0
        if step > 0:
            # first same as last: thrust is continuous within a segment
            first = 1
            for n in range(6):
                stage[0, n] = stage[5, n]
                for c in range(columns):
                    stage_tangent[0, n, c] = stage_tangent[5, n, c]
        for m in range(first, STAGES):
            ch = _C[m] * h
            for n in range(6):
                low = n if n < 3 else n + 3
                total = 0.0
                for q in range(m):
                    total += _A[m, q] * stage[q, n]
                y[n] = state[low] + ch * state[low + 3] + h_square * total
                for c in range(columns):
                    half[n, c] = tangent[low, c] + ch * tangent[low + 3, c]
                for q in range(m):
                    a = h_square * _A[m, q]
                    for c in range(columns):
                        half[n, c] += a * stage_tangent[q, n, c]
                if stretched:
                    change = (_C[m] * state[low + 3] + 2.0 * h * total) / steps
                    if i >= 0:
                        half[n, i] -= change
                    if j >= 0:
                        half[n, j] += change
            s = (step + _C[m]) * h
            value = thrust_acceleration_tangents(
                segment,
                s,
                (step + _C[m]) / steps if stretched else 0.0,
                columns,
                acceleration_tangent,
            )
            _accelerate(
                y,
                value,
                acceleration_tangent,
                mu,
                omega_square,
                gravity,
                columns,
                half,
                stage[m],
                stage_tangent[m],
            )
        for n in range(6):
            low = n if n < 3 else n + 3
            total = 0.0
            for q in range(STAGES):
                total += _B[q] * stage[q, n]
            for c in range(columns):
                tangent[low, c] = half[n, c]
            for q in range(STAGES):
                b = h * _B[q]
                for c in range(columns):
                    tangent[low + 3, c] += b * stage_tangent[q, n, c]
            if stretched:
                if i >= 0:
                    tangent[low + 3, i] -= total / steps
                if j >= 0:
                    tangent[low + 3, j] += total / steps
            state[low] = y[n]
            state[low + 3] += h * total


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
