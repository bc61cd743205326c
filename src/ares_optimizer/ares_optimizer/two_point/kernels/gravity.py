# SPDX-License-Identifier: Apache-2.0
"""Compute gravity and its first two derivatives: sphere, J2, or linear.

The J2 term, with k = 1.5 J2 mu R^2 (Eq. 2.13 with J2), s = r . r and z along the pole, is

    g = -k [(s^-5/2 - 5 z^2 s^-7/2) r + 2 z s^-5/2 e_z].
"""

import math

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, axpy, dot, scale
from ares_optimizer.two_point.arrays import INVERSE_SQUARE, LINEAR, Gravity

POLE = (0.0, 0.0, 1.0)


@kernel
def field_of(environment: Record) -> Gravity:
    """Return the inverse-square gravity of a mission, with its J2 term."""
    radius = environment.equatorial_radius
    oblateness = 1.5 * environment.j2 * environment.mu * radius * radius
    return Gravity(environment.mu, 0.0, INVERSE_SQUARE, oblateness)


@kernel
def _first_changes(r: Vector, p: Vector) -> tuple[float, float]:
    """Differentiate s^-5/2 - 5 z^2 s^-7/2 and z s^-5/2 along ``p``."""
    square = dot(r, r)
    along = dot(r, p)
    z = r[2]
    b = 1.0 / (square * square * square * math.sqrt(square))
    c = b / square
    first = -5.0 * b * along - 10.0 * z * p[2] * b + 35.0 * z * z * c * along
    second = p[2] * b * square - 5.0 * z * b * along
    return first, second


@kernel
def oblate_terms(r: Vector, oblateness: float, p: Vector) -> tuple[Vector, Vector]:
    """Return the J2 acceleration, m/s2, and its gradient times ``p``."""
    square = dot(r, r)
    z = r[2]
    b = 1.0 / (square * square * square * math.sqrt(square))
    level = b * square - 5.0 * z * z * b
    first, second = _first_changes(r, p)
    g = axpy(2.0 * z * b * square, POLE, scale(level, r))
    gradient_p = axpy(2.0 * second, POLE, axpy(first, r, scale(level, p)))
    return scale(-oblateness, g), scale(-oblateness, gradient_p)


@kernel
def oblate_curvature(r: Vector, oblateness: float, p: Vector, a: Vector) -> Vector:
    """Differentiate the gradient of the J2 acceleration along ``a``; multiply by ``p``."""
    square = dot(r, r)
    z = r[2]
    rp = dot(r, p)
    ra = dot(r, a)
    pa = dot(p, a)
    b = 1.0 / (square * square * square * math.sqrt(square))
    c = b / square
    d = c / square
    first = (
        35.0 * c * ra * rp
        - 5.0 * b * pa
        - 10.0 * a[2] * p[2] * b
        + 70.0 * z * c * (p[2] * ra + a[2] * rp)
        - 315.0 * z * z * d * ra * rp
        + 35.0 * z * z * c * pa
    )
    second = -5.0 * b * (p[2] * ra + a[2] * rp + z * pa) + 35.0 * z * c * ra * rp
    first_p, _ = _first_changes(r, p)
    first_a, _ = _first_changes(r, a)
    change = axpy(first_a, p, axpy(first_p, a, axpy(first, r, scale(2.0 * second, POLE))))
    return scale(-oblateness, change)


@kernel
def gravity_terms(r: Vector, gravity: Gravity, p: Vector) -> tuple[Vector, Vector]:
    """Return gravity g, m/s2, and its gradient times ``p``."""
    if gravity.model == LINEAR:
        return scale(-gravity.omega_square, r), scale(-gravity.omega_square, p)
    square = dot(r, r)
    k = gravity.mu / (square * math.sqrt(square))
    g = scale(-k, r)
    gradient_p = axpy(3.0 * k * dot(r, p) / square, r, scale(-k, p))
    if gravity.oblateness != 0.0:
        more, more_gradient_p = oblate_terms(r, gravity.oblateness, p)
        g = axpy(1.0, more, g)
        gradient_p = axpy(1.0, more_gradient_p, gradient_p)
    return g, gradient_p
