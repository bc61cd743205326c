"""What thrust and gravity do to position and velocity over the burn to come."""

from typing import NamedTuple

from ares_guidance.kernels.segments import (
    Integrals,
)
from ares_models.jit import kernel
from ares_models.kernels.kepler import kepler
from ares_models.kernels.vectors import (
    Vector,
    add,
    axpy,
    dot,
    scale,
    sub,
)


class LinearTangent(NamedTuple):
    """Steering ahead: thrust along unit(direction + rate (t - reference)).

    Attributes:
        direction: unit vector.
        rate: 1/s, normal to it.
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
def gravity_effect(
    r: Vector, v: Vector, thrust_v: Vector, thrust_r: Vector, until: float, mu: float
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
        mu: m3/s2.

    Returns:
        velocity m/s, displacement m.
    """
    if until <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    r_c1 = axpy(-until / 30.0, thrust_v, axpy(-0.1, thrust_r, r))
    v_c1 = axpy(-0.1, thrust_v, axpy(1.2 / until, thrust_r, v))
    r_c2, v_c2 = kepler(r_c1, v_c1, until, mu)
    return sub(v_c2, v_c1), axpy(-until, v_c1, sub(r_c2, r_c1))
