"""What thrust and gravity do to position and velocity over the burn to come."""

import math
from typing import NamedTuple

import numpy as np

from ares_guidance.kernels.segments import (
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


class LinearTangent(NamedTuple):
    """Steering ahead: thrust along unit(direction + rate (t - reference)).

    Attributes:
        direction: unit vector.
        rate: 1/s, normal to it; of a primer, any.
        reference: s from now.
    """

    direction: Vector
    rate: Vector
    reference: float


@kernel
def steered_thrust(integrals: Integrals, steering: LinearTangent) -> tuple[Vector, Vector]:
    """Velocity and displacement that the thrust behind the integrals gives.

    Expanded to second order in the turn from the reference direction.

    Args:
        integrals: (L, J, S, Q, P, H) of :func:`thrust_integrals`.
        steering: how the thrust turns.

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
def primer(solution: Record, steering: LinearTangent, t: float) -> tuple[Vector, Vector]:
    """Primer at a time, and its rate: p'' = w^2 (3 (p . axis) axis - p).

    That is the gradient of an inverse-square field whose direction and strength stay; with
    w = 0 it is the linear tangent.

    Args:
        solution: record SOLUTION, with w and the axis.
        steering: its value and rate at the reference.
        t: s from now.
    """
    direction, rate, reference = steering
    s = t - reference
    w = solution.primer_rate
    if w == 0.0:
        return axpy(s, rate, direction), rate
    up = load(solution.primer_axis)
    k = math.sqrt(2.0) * w
    a, b = dot(direction, up), dot(rate, up)
    c, sine = math.cos(w * s), math.sin(w * s)
    ch, sh = math.cosh(k * s), math.sinh(k * s)
    along = a * (ch - c) + b * (sh / k - sine / w)
    along_rate = a * (k * sh + w * sine) + b * (ch - c)
    return (
        axpy(along, up, axpy(sine / w, rate, scale(c, direction))),
        axpy(along_rate, up, axpy(c, rate, scale(-w * sine, direction))),
    )


@kernel
def turned_thrust(
    state: Record, until: float, cutoff: float, steering: LinearTangent
) -> tuple[Vector, Vector]:
    """Velocity and displacement that the planned thrust gives, however far it turns.

    Gauss-Legendre over the velocity that each segment gives.

    Args:
        state: record GUIDANCE_STATE with planned segments.
        until: s from now.
        cutoff: end of all thrust, s from now.
        steering: how the thrust turns.

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
    """Velocity and displacement due to gravity, from a coast that shadows the burn.

    The coast starts so that it runs through the mean of the thrusted path; gravity is
    what it adds to a straight line.

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
