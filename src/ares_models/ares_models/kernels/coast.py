# SPDX-License-Identifier: Apache-2.0
"""Propagation of a coast: a conic, and with J2 a conic between kicks by the oblateness.

Source: Wisdom, Holman, "Symplectic maps for the N-body problem", Astron. J. 102 (1991).
"""

import math

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.environment import gravity
from ares_models.kernels.kepler import kepler
from ares_models.kernels.vectors import Vector, axpy, dot

#: Time between kicks, s: the error is 2 m of the 100 km by J2 in a revolution of a low orbit.
STEP = 15.0
_MOST_STEPS = 1000.0


@kernel
def kicked(r: Vector, v: Vector, dt: float, environment: Record) -> Vector:
    """Add the impulse of J2 in ``dt`` s to the velocity, m/s."""
    square = dot(r, r)
    central = environment.mu / (square * math.sqrt(square))
    return axpy(dt, axpy(central, r, gravity(r, environment)), v)


@kernel
def coast(r: Vector, v: Vector, dt: float, environment: Record) -> tuple[Vector, Vector]:
    """Propagate position and velocity over a coast.

    Args:
        r: position, m.
        v: velocity, m/s.
        dt: length, s; may be negative.
        environment: record of dtype ENVIRONMENT.
    """
    if environment.j2 == 0.0 or not abs(dt) > 0.0:
        return kepler(r, v, dt, environment.mu)
    steps = int(min(_MOST_STEPS, math.ceil(abs(dt) / STEP)))
    h = dt / steps
    v = kicked(r, v, 0.5 * h, environment)
    for i in range(steps):
        r, v = kepler(r, v, h, environment.mu)
        v = kicked(r, v, h if i + 1 < steps else 0.5 * h, environment)
    return r, v
