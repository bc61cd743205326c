"""Thrust integrals, states and costates in closed form under linear gravity.

Eqs. 3.20-3.23 and 3.27-3.29. Printed: mixed arguments and scaling in 3.22, 3.23 and
3.27-3.29, omega0 = mu/r0^3 in 3.4. What holds, with w = sqrt(mu/r0^3):

    r(t) = r0 cos wt + (V0/w) sin wt + (1/w)(sin wt Ic - cos wt Is)
    V(t) = -w r0 sin wt + V0 cos wt + cos wt Ic + sin wt Is
    Ic = int u a cos wt dt,  Is = int u a sin wt dt,  u = lambda_v/|lambda_v|

with the integrals by Simpson's rule or by Milne's (the five-point rule also called
Boole's). On a long burn the linear field is wrong by kilometres; w is then taken anew from
the radius at the start of each shorter arc.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_optimizer.two_point.kernels.costates import thrust_acceleration_tangents

SIMPSON = 1
MILNE = 2

_NODES = 5
#: Weights over the arc's length on the points 0, 1/4, 1/2, 3/4, 1.
_WEIGHTS = np.array(
    [
        [1.0 / 6.0, 0.0, 4.0 / 6.0, 0.0, 1.0 / 6.0],
        [7.0 / 90.0, 32.0 / 90.0, 12.0 / 90.0, 32.0 / 90.0, 7.0 / 90.0],
    ]
)


@kernel
def _correct_gravity(
    mu: float,
    omega_square: float,
    h: float,
    columns: int,
    d_h: NDArray[np.float64],
    d_omega_square: NDArray[np.float64],
    state: NDArray[np.float64],
    tangent: NDArray[np.float64],
) -> None:
    """Half an arc's worth of what the linear field leaves out, as an impulse.

    V += h/2 (g(r) + w^2 r) and lambda_v' += h/2 (G(r) + w^2) lambda_v: made at both ends of
    an arc, the error falls with the square of its length instead of with its length.

    Args:
        mu: m3/s2.
        omega_square: w^2 of the arc, 1/s2.
        h: length of the arc, s.
        columns: how many tangents to carry.
        d_h: derivative of h by column.
        d_omega_square: derivative of w^2 by column.
        state: shape (12,), changed.
        tangent: shape (MAX_COLUMNS, 12), changed.
    """
    half = 0.5 * h
    r0, r1, r2 = state[0], state[1], state[2]
    p0, p1, p2 = state[6], state[7], state[8]
    square = r0 * r0 + r1 * r1 + r2 * r2
    inverse = 1.0 / math.sqrt(square)
    k = mu * inverse * inverse * inverse
    rest = omega_square - k
    three = 3.0 * k
    third = three * inverse
    e0, e1, e2 = r0 * inverse, r1 * inverse, r2 * inverse
    ep = e0 * p0 + e1 * p1 + e2 * p2
    for c in range(columns):
        a0, a1, a2 = tangent[c, 0], tangent[c, 1], tangent[c, 2]
        b0, b1, b2 = tangent[c, 6], tangent[c, 7], tangent[c, 8]
        ea = e0 * a0 + e1 * a1 + e2 * a2
        eb = e0 * b0 + e1 * b1 + e2 * b2
        pa = p0 * a0 + p1 * a1 + p2 * a2
        dw = half * d_omega_square[c]
        dh = 0.5 * d_h[c]
        w = half * three * ea
        x = dw + dh * rest
        tangent[c, 3] += half * rest * a0 + w * e0 + x * r0
        tangent[c, 4] += half * rest * a1 + w * e1 + x * r1
        tangent[c, 5] += half * rest * a2 + w * e2 + x * r2
        w = half * (three * eb + third * (pa - 5.0 * ea * ep)) + dh * three * ep
        y = half * third * ea + x
        z = half * third * ep
        tangent[c, 9] += w * e0 + half * rest * b0 + y * p0 + z * a0
        tangent[c, 10] += w * e1 + half * rest * b1 + y * p1 + z * a1
        tangent[c, 11] += w * e2 + half * rest * b2 + y * p2 + z * a2
    state[3] += half * rest * r0
    state[4] += half * rest * r1
    state[5] += half * rest * r2
    w = half * three * ep
    state[9] += half * rest * p0 + w * e0
    state[10] += half * rest * p1 + w * e1
    state[11] += half * rest * p2 + w * e2


@kernel
def closed_form_segment(
    segment: Record,
    arcs: int,
    mu: float,
    omega_square: float,
    rule: int,
    correct: bool,
    columns: int,
    state: NDArray[np.float64],
    tangent: NDArray[np.float64],
    integrals: NDArray[np.float64],
    integral_tangents: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> None:
    """Carry state and tangents over one segment, on equal arcs in closed form.

    Args:
        segment: record SEGMENT.
        arcs: number of arcs.
        mu: m3/s2.
        omega_square: 1/s2, held over the segment; 0: mu/r^3 anew at every arc's start.
        rule: SIMPSON or MILNE.
        correct: give the rest of inverse-square gravity as an impulse at the arcs' ends.
        columns: how many tangents to carry; 0 for none.
        state: shape (12,), changed: r, V, lambda_v, lambda_v'.
        tangent: shape (MAX_COLUMNS, 12), changed.
        integrals: at least 6 numbers, written: Ic, Is of the last arc.
        integral_tangents: shape (MAX_COLUMNS, 6), scratch.
        scratch: shape (at least 4, MAX_COLUMNS), scratch.
    """
    h = (segment.end - segment.start) / arcs
    i = segment.start_column if segment.start_column < columns else -1
    j = segment.end_column if segment.end_column < columns else -1
    if i == j:
        i = -1
        j = -1
    acceleration_tangent = scratch[0]
    d_omega = scratch[1]
    d_h = scratch[2]
    d_square = scratch[3]
    for c in range(columns):
        d_h[c] = 0.0
        d_omega[c] = 0.0
        d_square[c] = 0.0
    if i >= 0:
        d_h[i] = -1.0 / arcs
    if j >= 0:
        d_h[j] = 1.0 / arcs
    for arc in range(arcs):
        r0, r1, r2 = state[0], state[1], state[2]
        square = r0 * r0 + r1 * r1 + r2 * r2
        if omega_square > 0.0:
            omega = math.sqrt(omega_square)
        else:
            omega = math.sqrt(mu / (square * math.sqrt(square)))
            for c in range(columns):
                along = r0 * tangent[c, 0] + r1 * tangent[c, 1] + r2 * tangent[c, 2]
                d_omega[c] = -1.5 * omega * along / square
                d_square[c] = 2.0 * omega * d_omega[c]
        if correct:
            _correct_gravity(mu, omega * omega, h, columns, d_h, d_square, state, tangent)
        for n in range(6):
            integrals[n] = 0.0
            for c in range(columns):
                integral_tangents[c, n] = 0.0
        for node in range(_NODES):
            weight = _WEIGHTS[rule - 1, node]
            if weight == 0.0:
                continue
            t = 0.25 * node * h
            cos = math.cos(omega * t)
            sin = math.sin(omega * t)
            p0 = state[6] * cos + state[9] * sin / omega
            p1 = state[7] * cos + state[10] * sin / omega
            p2 = state[8] * cos + state[11] * sin / omega
            inverse = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
            u0, u1, u2 = p0 * inverse, p1 * inverse, p2 * inverse
            # derivative of the primer by wt
            z0 = -state[6] * sin + state[9] * cos / omega
            z1 = -state[7] * sin + state[10] * cos / omega
            z2 = -state[8] * sin + state[11] * cos / omega
            fraction = (arc + 0.25 * node) / arcs if i >= 0 or j >= 0 else 0.0
            a = thrust_acceleration_tangents(
                segment, arc * h + t, fraction, columns, acceleration_tangent
            )
            wa = weight * h * a
            integrals[0] += wa * cos * u0
            integrals[1] += wa * cos * u1
            integrals[2] += wa * cos * u2
            integrals[3] += wa * sin * u0
            integrals[4] += wa * sin * u1
            integrals[5] += wa * sin * u2
            for c in range(columns):
                d_angle = d_omega[c] * t + omega * 0.25 * node * d_h[c]
                slow = sin * d_omega[c] / (omega * omega)
                b0 = cos * tangent[c, 6] + sin * tangent[c, 9] / omega
                b1 = cos * tangent[c, 7] + sin * tangent[c, 10] / omega
                b2 = cos * tangent[c, 8] + sin * tangent[c, 11] / omega
                b0 += d_angle * z0 - slow * state[9]
                b1 += d_angle * z1 - slow * state[10]
                b2 += d_angle * z2 - slow * state[11]
                ub = u0 * b0 + u1 * b1 + u2 * b2
                d_wa = weight * (h * acceleration_tangent[c] + d_h[c] * a)
                x = wa * inverse
                y = d_wa - x * ub
                b0 = x * b0 + y * u0
                b1 = x * b1 + y * u1
                b2 = x * b2 + y * u2
                w = wa * d_angle
                integral_tangents[c, 0] += cos * b0 - w * sin * u0
                integral_tangents[c, 1] += cos * b1 - w * sin * u1
                integral_tangents[c, 2] += cos * b2 - w * sin * u2
                integral_tangents[c, 3] += sin * b0 + w * cos * u0
                integral_tangents[c, 4] += sin * b1 + w * cos * u1
                integral_tangents[c, 5] += sin * b2 + w * cos * u2
        cos = math.cos(omega * h)
        sin = math.sin(omega * h)
        for n in range(3):
            ic = integrals[n]
            js = integrals[n + 3]
            r = state[n]
            v = state[n + 3]
            p = state[n + 6]
            q = state[n + 9]
            across = sin * ic - cos * js
            along = cos * ic + sin * js
            for c in range(columns):
                dw = d_omega[c]
                d_angle = dw * h + omega * d_h[c]
                dr = tangent[c, n]
                dv = tangent[c, n + 3]
                dp = tangent[c, n + 6]
                dq = tangent[c, n + 9]
                d_ic = integral_tangents[c, n]
                d_js = integral_tangents[c, n + 3]
                tangent[c, n] = (
                    cos * dr
                    - sin * d_angle * r
                    + (sin * dv + cos * d_angle * v) / omega
                    + (sin * d_ic - cos * d_js + d_angle * along) / omega
                    - dw * (sin * v + across) / (omega * omega)
                )
                tangent[c, n + 3] = (
                    cos * (dv + d_ic)
                    + sin * (d_js - omega * dr)
                    - sin * d_angle * v
                    - (dw * sin + omega * cos * d_angle) * r
                    - d_angle * across
                )
                tangent[c, n + 6] = (
                    cos * dp
                    - sin * d_angle * p
                    + (sin * dq + cos * d_angle * q) / omega
                    - dw * sin * q / (omega * omega)
                )
                tangent[c, n + 9] = (
                    cos * dq
                    - sin * d_angle * q
                    - omega * (sin * dp + cos * d_angle * p)
                    - dw * sin * p
                )
            state[n] = cos * r + (sin * v + across) / omega
            state[n + 3] = cos * v - omega * sin * r + along
            state[n + 6] = cos * p + sin * q / omega
            state[n + 9] = cos * q - omega * sin * p
        if correct:
            _correct_gravity(mu, omega * omega, h, columns, d_h, d_square, state, tangent)


@kernel
def exact_beside(
    segment: Record,
    arcs: int,
    mu: float,
    rule: int,
    correct: bool,
    substep: float,
    piece: Record,
    state: NDArray[np.float64],
    exact: NDArray[np.float64],
    tangent: NDArray[np.float64],
    integrals: NDArray[np.float64],
    integral_tangents: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> None:
    """One segment twice: in closed form, and its steering flown in inverse-square gravity.

    The exact flight is integrated by Runge-Kutta 4 and thrusts along the primer that the
    closed form has at each instant.

    Args:
        segment: record SEGMENT.
        arcs: number of closed-form arcs.
        mu: m3/s2.
        rule: SIMPSON or MILNE.
        correct: see :func:`closed_form_segment`.
        substep: longest Runge-Kutta step, s.
        piece: record SEGMENT, scratch.
        state: shape (12,), changed: the closed form's.
        exact: shape (6,), changed: r, V of the exact flight.
        tangent: as for :func:`closed_form_segment`; none are carried.
        integrals: the same.
        integral_tangents: the same.
        scratch: the same.
    """
    h = (segment.end - segment.start) / arcs
    count = max(1, int(math.ceil(h / substep - 1e-9)))
    step = h / count
    y = np.empty(6)
    slope = np.empty(6)
    total = np.empty(6)
    start = np.empty(12)
    for arc in range(arcs):
        s = arc * h
        piece.start = segment.start + s
        piece.end = piece.start + h
        piece.thrust = segment.thrust + segment.thrust_slope * s
        piece.thrust_slope = segment.thrust_slope
        piece.flow = segment.flow + segment.flow_slope * s
        piece.flow_slope = segment.flow_slope
        piece.mass = segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)
        piece.start_column = -1
        piece.end_column = -1
        for i in range(12):
            start[i] = state[i]
        square = state[0] * state[0] + state[1] * state[1] + state[2] * state[2]
        omega = math.sqrt(mu / (square * math.sqrt(square)))
        if correct:
            _correct_gravity(mu, omega * omega, h, 0, scratch[0], scratch[0], start, tangent)
        closed_form_segment(
            piece,
            1,
            mu,
            0.0,
            rule,
            correct,
            0,
            state,
            tangent,
            integrals,
            integral_tangents,
            scratch,
        )
        for k in range(count):
            for i in range(6):
                total[i] = 0.0
                slope[i] = 0.0
            for stage in range(4):
                part = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                weight = 1.0 / 6.0 if stage in (0, 3) else 1.0 / 3.0
                for i in range(6):
                    y[i] = exact[i] + part * step * slope[i]
                t = (k + part) * step
                a = (piece.thrust + piece.thrust_slope * t) / (
                    piece.mass - t * (piece.flow + 0.5 * t * piece.flow_slope)
                )
                cos = math.cos(omega * t)
                sin = math.sin(omega * t) / omega
                p0 = start[6] * cos + start[9] * sin
                p1 = start[7] * cos + start[10] * sin
                p2 = start[8] * cos + start[11] * sin
                a /= math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
                square = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
                g = mu / (square * math.sqrt(square))
                slope[0] = y[3]
                slope[1] = y[4]
                slope[2] = y[5]
                slope[3] = a * p0 - g * y[0]
                slope[4] = a * p1 - g * y[1]
                slope[5] = a * p2 - g * y[2]
                for i in range(6):
                    total[i] += weight * slope[i]
            for i in range(6):
                exact[i] += step * total[i]
