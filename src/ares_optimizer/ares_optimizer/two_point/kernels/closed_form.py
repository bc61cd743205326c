# SPDX-License-Identifier: Apache-2.0
"""Propagate states and costates in closed form under linear gravity.

Eqs. 3.20-3.23 and 3.27-3.29. Printed: mixed arguments and scaling in 3.22, 3.23 and
3.27-3.29, omega0 = mu/r0^3 in 3.4. Corrected, with w = sqrt(mu/r0^3):

    r(t) = r0 cos wt + (V0/w) sin wt + (1/w)(sin wt Ic - cos wt Is)
    V(t) = -w r0 sin wt + V0 cos wt + cos wt Ic + sin wt Is
    Ic = int u a cos wt dt,  Is = int u a sin wt dt,  u = lambda_v/|lambda_v|

with the integrals by Simpson's rule or by Milne's (the five-point rule also called
Boole's). On a long burn the linear field is wrong by kilometres; the segment is then divided into
arcs, each with w at the radius of its start.
"""

import math
from typing import NamedTuple

import numpy as np

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_optimizer.two_point.arrays import Gravity
from ares_optimizer.two_point.kernels.costates import set_stretch, thrust_acceleration_tangents

SIMPSON = 1
MILNE = 2

_NODES = 5
#: Quadrature weights at 0, 1/4, 1/2, 3/4, 1 of the arc.
_WEIGHTS = np.array(
    [
        [1.0 / 6.0, 0.0, 4.0 / 6.0, 0.0, 1.0 / 6.0],
        [7.0 / 90.0, 32.0 / 90.0, 12.0 / 90.0, 32.0 / 90.0, 7.0 / 90.0],
    ]
)


@kernel
def correct_gravity(mu: float, omega: float, h: float, work: Record) -> None:
    """Apply half an arc of the nonlinear part of gravity as an impulse.

    V += h/2 (g(r) + w^2 r) and lambda_v' += h/2 (G(r) + w^2) lambda_v. Applied at both ends of an
    arc, this makes the error second order in its length instead of first.

    Args:
        mu: m3/s2.
        omega: w of the arc, 1/s.
        h: length of the arc, s.
        work: record WORK; ``state`` and ``tangent`` are changed.
    """
    state = work.state
    tangent = work.tangent
    omega_square = omega * omega
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
    for c in range(work.columns):
        a0, a1, a2 = tangent[c, 0], tangent[c, 1], tangent[c, 2]
        b0, b1, b2 = tangent[c, 6], tangent[c, 7], tangent[c, 8]
        ea = e0 * a0 + e1 * a1 + e2 * a2
        eb = e0 * b0 + e1 * b1 + e2 * b2
        pa = p0 * a0 + p1 * a1 + p2 * a2
        dw = half * work.omega_square[c]
        dh = 0.5 * work.stretch[c]
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


class _Arc(NamedTuple):
    """Hold one of the equal arcs of a segment.

    Attributes:
        number: index of the arc.
        parts: number of arcs.
        h: length, s.
        omega: w of the arc, 1/s.
    """

    number: int
    parts: int
    h: float
    omega: float


@kernel
def _omega_here(gravity: Gravity, work: Record) -> float:
    """Return w, 1/s, of an arc that begins at ``work.state``; write its tangents."""
    if gravity.omega_square > 0.0:
        return math.sqrt(gravity.omega_square)
    state = work.state
    tangent = work.tangent
    r0, r1, r2 = state[0], state[1], state[2]
    square = r0 * r0 + r1 * r1 + r2 * r2
    omega = math.sqrt(gravity.mu / (square * math.sqrt(square)))
    for c in range(work.columns):
        along = r0 * tangent[c, 0] + r1 * tangent[c, 1] + r2 * tangent[c, 2]
        work.omega[c] = -1.5 * omega * along / square
        work.omega_square[c] = 2.0 * omega * work.omega[c]
    return omega


@kernel
def _add_node(segment: Record, arc: _Arc, node: int, weight: float, work: Record) -> None:
    """Add one quadrature node to the thrust integrals Ic, Is of an arc and their tangents."""
    state = work.state
    tangent = work.tangent
    integrals = work.stage[0]
    integral_tangents = work.stage_tangent[0]
    omega = arc.omega
    h = arc.h
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
    fraction = (arc.number + 0.25 * node) / arc.parts
    a = thrust_acceleration_tangents(
        segment, arc.number * h + t, fraction, work.columns, work.thrust
    )
    wa = weight * h * a
    integrals[0] += wa * cos * u0
    integrals[1] += wa * cos * u1
    integrals[2] += wa * cos * u2
    integrals[3] += wa * sin * u0
    integrals[4] += wa * sin * u1
    integrals[5] += wa * sin * u2
    for c in range(work.columns):
        d_omega = work.omega[c]
        d_h = work.stretch[c]
        d_angle = d_omega * t + omega * 0.25 * node * d_h
        slow = sin * d_omega / (omega * omega)
        b0 = cos * tangent[c, 6] + sin * tangent[c, 9] / omega
        b1 = cos * tangent[c, 7] + sin * tangent[c, 10] / omega
        b2 = cos * tangent[c, 8] + sin * tangent[c, 11] / omega
        b0 += d_angle * z0 - slow * state[9]
        b1 += d_angle * z1 - slow * state[10]
        b2 += d_angle * z2 - slow * state[11]
        ub = u0 * b0 + u1 * b1 + u2 * b2
        d_wa = weight * (h * work.thrust[c] + d_h * a)
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


@kernel
def _end_arc(arc: _Arc, work: Record) -> None:
    """Compute state and tangents at the end of an arc from its integrals."""
    state = work.state
    tangent = work.tangent
    omega = arc.omega
    cos = math.cos(omega * arc.h)
    sin = math.sin(omega * arc.h)
    for n in range(3):
        ic = work.stage[0, n]
        js = work.stage[0, n + 3]
        r = state[n]
        v = state[n + 3]
        p = state[n + 6]
        q = state[n + 9]
        across = sin * ic - cos * js
        along = cos * ic + sin * js
        for c in range(work.columns):
            dw = work.omega[c]
            d_angle = dw * arc.h + omega * work.stretch[c]
            dr = tangent[c, n]
            dv = tangent[c, n + 3]
            dp = tangent[c, n + 6]
            dq = tangent[c, n + 9]
            d_ic = work.stage_tangent[0, c, n]
            d_js = work.stage_tangent[0, c, n + 3]
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
                cos * dq - sin * d_angle * q - omega * (sin * dp + cos * d_angle * p) - dw * sin * p
            )
        state[n] = cos * r + (sin * v + across) / omega
        state[n + 3] = cos * v - omega * sin * r + along
        state[n + 6] = cos * p + sin * q / omega
        state[n + 9] = cos * q - omega * sin * p


@kernel
def closed_form_segment(
    segment: Record, arcs: int, gravity: Gravity, options: Record, work: Record
) -> None:
    """Propagate ``work.state`` and ``work.tangent`` over equal closed-form arcs.

    Args:
        segment: record SEGMENT.
        arcs: number of arcs.
        gravity: its omega_square, constant over the segment; 0: mu/r^3 at the start of each arc.
        options: record OPTIONS: ``propagator`` selects the rule; with ``corrected`` the nonlinear
            part of gravity is applied as impulses at the ends of the arcs.
        work: record WORK; ``columns`` is the number of tangents. On return ``stage[0]`` holds Ic
            and Is of the last arc.
    """
    h = (segment.end - segment.start) / arcs
    set_stretch(segment, arcs, work)
    for c in range(work.columns):
        work.omega[c] = 0.0
        work.omega_square[c] = 0.0
    for index in range(arcs):
        arc = _Arc(index, arcs, h, _omega_here(gravity, work))
        if options.corrected == 1:
            correct_gravity(gravity.mu, arc.omega, h, work)
        for n in range(6):
            work.stage[0, n] = 0.0
            for c in range(work.columns):
                work.stage_tangent[0, c, n] = 0.0
        for node in range(_NODES):
            weight = _WEIGHTS[options.propagator - 1, node]
            if weight != 0.0:
                _add_node(segment, arc, node, weight, work)
        _end_arc(arc, work)
        if options.corrected == 1:
            correct_gravity(gravity.mu, arc.omega, h, work)
