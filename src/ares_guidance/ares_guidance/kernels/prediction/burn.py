# SPDX-License-Identifier: Apache-2.0
"""Predicted effect of thrust and gravity on position and velocity over the burn ahead."""

import math
from typing import NamedTuple

import numpy as np

from ares_guidance.kernels.prediction.segments import (
    Integrals,
    direction_time,
    gain_within,
    time_to_gain,
)
from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.coast import coast
from ares_models.kernels.vectors import (
    Vector,
    add,
    axpy,
    cross,
    dot,
    load,
    scale,
    sub,
    unit,
)

_nodes, _weights = np.polynomial.legendre.leggauss(6)
#: Gauss-Legendre on (0, 1).
NODES = tuple((0.5 * (1.0 + _nodes)).tolist())
WEIGHTS = tuple((0.5 * _weights).tolist())


#: Angle below which a mode is linear in time, and least difference of the two squared rates, as a
#: fraction of w^2.
NO_CHANGE = 1e-9
NO_SPREAD = 1e-6

#: A vector in the plane of flight and its rate: up, ahead, up, ahead.
Plane = tuple[float, float, float, float]


class LinearTangent(NamedTuple):
    """Hold a linear-tangent steering: thrust along unit(direction + rate (t - reference)).

    Attributes:
        direction: unit vector.
        rate: 1/s, normal to the direction; for a primer in any direction.
        reference: s from now.
    """

    direction: Vector
    rate: Vector
    reference: float


@kernel
def steered_thrust(integrals: Integrals, steering: LinearTangent) -> tuple[Vector, Vector]:
    """Compute velocity and displacement by thrust from its integrals.

    The direction is expanded to second order in the turn from the reference.

    Args:
        integrals: (L, J, S, Q, P, H) of :func:`thrust_integrals`.
        steering: thrust direction over time.

    Returns:
        velocity m/s, displacement m.
    """
    l_sum, j_sum, s_sum, q_sum, p_sum, h_sum = integrals
    direction, rate, k = steering
    square = 0.5 * dot(rate, rate)
    along_v = l_sum - square * (h_sum - 2.0 * k * j_sum + k * k * l_sum)
    along_r = s_sum - square * (p_sum - 2.0 * k * q_sum + k * k * s_sum)
    across_v = j_sum - k * l_sum
    across_r = q_sum - k * s_sum
    return (
        add(scale(along_v, direction), scale(across_v, rate)),
        add(scale(along_r, direction), scale(across_r, rate)),
    )


@kernel
def hyperbolic(x: float) -> tuple[float, float]:
    """Return the hyperbolic cosine and sine."""
    grown = math.expm1(x)
    shrunk = grown / (1.0 + grown)
    return 1.0 + 0.5 * grown * shrunk, 0.5 * (grown + shrunk)


@kernel
def mode(square: float, t: float) -> tuple[float, float]:
    """Return the solutions of x'' = square x with initial (x, x') = (1, 0) and (0, 1) at t, s."""
    root = math.sqrt(abs(square))
    angle = root * t
    if abs(angle) < NO_CHANGE:
        return 1.0, t
    if square > 0.0:
        even, odd = hyperbolic(angle)
        return even, odd / root
    return math.cos(angle), math.sin(angle) / root


@kernel
def mode_sums(middle: float, spread: float, t: float) -> tuple[float, float, float, float]:
    """Return the solutions for two squares of a rate, ``middle`` -+ ``spread`` / 2, combined.

    Returns: the polynomials of Cayley and Hamilton of exp(A t) in A^2, whose eigenvalues are the
        squares: for the even part the constant and the factor on A^2, then both of the odd part.
    """
    upper = middle + 0.5 * spread
    c1, s1 = mode(upper, t)
    c2, s2 = mode(upper - spread, t)
    even, odd = (c1 - c2) / spread, (s1 - s2) / spread
    return c1 - upper * even, even, s1 - upper * odd, odd


@kernel
def complex_mode_sums(middle: float, spread: float, t: float) -> tuple[float, float, float, float]:
    """Return :func:`mode_sums` for the squares ``middle`` -+ i ``spread`` / 2."""
    size = math.sqrt(middle * middle + 0.25 * spread * spread)
    root = math.sqrt(0.5 * (size + abs(middle)))
    growth, rate = root, 0.25 * spread / root
    if middle < 0.0:
        growth, rate = rate, growth
    cosh, sinh = hyperbolic(growth * t)
    cos, sin = math.cos(rate * t), math.sin(rate * t)
    even = 2.0 * sinh * sin / spread
    odd = 2.0 * (cosh * sin * growth - sinh * cos * rate) / (size * spread)
    part = (sinh * cos * growth + cosh * sin * rate) / size
    return cosh * cos - middle * even, even, part - middle * odd, odd


@kernel
def in_plane(w: float, n: float, s: float, x: Plane) -> Plane:
    """Propagate the primer in the plane of flight, in axes up and ahead that rotate at ``n``.

    There p'' + 2 n J p' - n^2 p = w^2 (2 p_up, -p_ahead): two modes, of which the squares of the
    rates are the roots of z^2 + (2 n^2 - w^2) z + (n^2 + 2 w^2)(n^2 - w^2).

    Args:
        w: square root of the gradient, 1/s.
        n: rotation rate, rad/s.
        s: time, s.
        x: primer up and ahead, and their rates, at s = 0.

    Returns: primer and rates at ``s``.
    """
    square = w * w * (9.0 * w * w - 8.0 * n * n)
    spread = math.sqrt(abs(square))
    middle = 0.5 * w * w - n * n
    if spread < NO_SPREAD * w * w:
        constant, even, first, odd = mode_sums(middle, NO_SPREAD * w * w, s)
    elif square > 0.0:
        constant, even, first, odd = mode_sums(middle, spread, s)
    else:
        constant, even, first, odd = complex_mode_sums(middle, spread, s)
    terms = constant, first, even, odd
    up, ahead = n * n + 2.0 * w * w, n * n - w * w
    total = (0.0, 0.0, 0.0, 0.0)
    for k in range(4):
        term = terms[k]
        total = (
            total[0] + term * x[0],
            total[1] + term * x[1],
            total[2] + term * x[2],
            total[3] + term * x[3],
        )
        x = (x[2], x[3], up * x[0] + 2.0 * n * x[3], ahead * x[1] - 2.0 * n * x[2])
    return total


@kernel
def primer(solution: Record, steering: LinearTangent, t: float) -> tuple[Vector, Vector]:
    """Propagate the primer and its rate by p'' = w^2 (3 (p . up) up - p).

    That is the gradient of an inverse-square field of constant strength, whose axis rotates at a
    constant rate; with w = 0 it is the linear tangent law.

    Args:
        solution: record SOLUTION, with w and the axis.
        steering: primer and rate at the reference.
        t: s from now.
    """
    direction, rate, reference = steering
    s = t - reference
    field = solution.primer
    w = field.gradient
    if w == 0.0:
        return axpy(s, rate, direction), rate
    n = field.turning
    normal = load(field.normal)
    axis = load(field.axis)
    side = cross(normal, axis)
    c, d = math.cos(n * reference), math.sin(n * reference)
    up = axpy(d, side, scale(c, axis))
    ahead = axpy(-d, axis, scale(c, side))
    # to rotating axes
    x0, x1 = dot(direction, up), dot(direction, ahead)
    x2, x3 = dot(rate, up) + n * x1, dot(rate, ahead) - n * x0
    y0, y1, y2, y3 = in_plane(w, n, s, (x0, x1, x2, x3))
    y2, y3 = y2 - n * y1, y3 + n * y0
    c, d = math.cos(n * t), math.sin(n * t)
    up = axpy(d, side, scale(c, axis))
    ahead = axpy(-d, axis, scale(c, side))
    across, across_rate = dot(direction, normal), dot(rate, normal)
    c, d = math.cos(w * s), math.sin(w * s)
    out, out_rate = across * c + across_rate * d / w, across_rate * c - across * w * d
    return (
        axpy(out, normal, axpy(y1, ahead, scale(y0, up))),
        axpy(out_rate, normal, axpy(y3, ahead, scale(y2, up))),
    )


@kernel
def turned_thrust(
    state: Record, until: float, cutoff: float, steering: LinearTangent
) -> tuple[Vector, Vector]:
    """Compute velocity and displacement by the planned thrust for a turn of any size.

    Gauss-Legendre quadrature over the delta-V of each segment.

    Args:
        state: record GUIDANCE_STATE with planned segments.
        until: s from now.
        cutoff: end of all thrust, s from now.
        steering: thrust direction over time.

    Returns:
        velocity m/s, displacement m.
    """
    thrust_v = (0.0, 0.0, 0.0)
    thrust_r = (0.0, 0.0, 0.0)
    for i in range(state.segment_count):
        segment = state.segments[i]
        burn = min(segment.duration, min(until, cutoff) - segment.start)
        if burn <= 0.0:
            break
        gain = gain_within(segment, burn)
        for k in range(len(NODES)):
            t = segment.start + time_to_gain(segment, NODES[k] * gain)
            direction, _ = primer(state.solution, steering, direction_time(segment, t))
            given = scale(WEIGHTS[k] * gain, unit(direction))
            thrust_v = add(thrust_v, given)
            thrust_r = axpy(until - t, given, thrust_r)
    return thrust_v, thrust_r


@kernel
def gravity_effect(
    r: Vector, v: Vector, thrust_v: Vector, thrust_r: Vector, until: float, environment: Record
) -> tuple[Vector, Vector]:
    """Compute velocity and displacement by gravity, from a coast that shadows the burn.

    The coast is offset to run through the mean of the thrusted path; its deviation from a straight
    line is the effect of gravity.

    Args:
        r: position now, m.
        v: velocity now, m/s.
        thrust_v: velocity gained by thrust, m/s.
        thrust_r: displacement by thrust, m.
        until: s from now.
        environment: record ENVIRONMENT.

    Returns:
        velocity m/s, displacement m.
    """
    if until <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    r_c1 = axpy(-until / 30.0, thrust_v, axpy(-0.1, thrust_r, r))
    v_c1 = axpy(-0.1, thrust_v, axpy(1.2 / until, thrust_r, v))
    r_c2, v_c2 = coast(r_c1, v_c1, until, environment)
    return sub(v_c2, v_c1), axpy(-until, v_c1, sub(r_c2, r_c1))
