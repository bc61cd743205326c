# SPDX-License-Identifier: Apache-2.0
"""Gravity, altitude, density, relative velocity and heating (thesis chapter 2).

``environment`` is a record of dtype ``arrays.ENVIRONMENT``; ``atmosphere`` is the table of
``arrays.MissionArrays``: rows (altitude m, c0, c1, c2, c3, p0, p1, p2, p3), log density and log
pressure cubics in the height above the row's altitude. The last row has values and slopes only:
the table continues linearly in both logarithms above it, and below the first row.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import ALTITUDE_SPHERICAL, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, dot, norm, scale

#: Square of a speed in the air below which a vehicle is at rest, m2/s2.
AT_REST = 1e-12


@kernel
def gravity(r: Vector, environment: Record) -> Vector:
    """Compute the gravitational acceleration, m/s2: Eq. 2.13, plus J2 about z if it is not 0.

    Args:
        r: position, m, shape (3,) tuple.
        environment: record of dtype ENVIRONMENT.
    """
    square = dot(r, r)
    k = -environment.mu / (square * math.sqrt(square))
    j2 = environment.j2
    if j2 == 0.0:
        return scale(k, r)
    radius = environment.equatorial_radius
    q = 1.5 * j2 * radius * radius / square
    s = 5.0 * r[2] * r[2] / square
    across = k * (1.0 + q * (1.0 - s))
    along = k * (1.0 + q * (3.0 - s))
    return (across * r[0], across * r[1], along * r[2])


@kernel
def altitude(r: Vector, environment: Record) -> float:
    """Compute the altitude, m: Eq. 2.15 above the ellipsoid, or r - R_equatorial if so chosen.

    Eq. 2.15 is printed with a misplaced bracket; correct is
    h = r - (1 - eps) R_eq / sqrt(1 + ((1 - eps)^2 - 1)(1 - sin^2 lat)) with the geocentric
    latitude, where (1 - eps) R_eq is the polar radius.
    """
    square = dot(r, r)
    radius = math.sqrt(square)
    equatorial: float = environment.equatorial_radius
    if environment.altitude_model == ALTITUDE_SPHERICAL:
        return radius - equatorial
    polar: float = environment.polar_radius
    k = 1.0 - polar * polar / (equatorial * equatorial)
    cos_square = (r[0] * r[0] + r[1] * r[1]) / square
    return radius - polar / math.sqrt(1.0 - k * cos_square)


@kernel
def altitude_gradient(r: Vector, environment: Record) -> Vector:
    """Compute the gradient of :func:`altitude` by position, no unit."""
    square = dot(r, r)
    up = scale(1.0 / math.sqrt(square), r)
    if environment.altitude_model == ALTITUDE_SPHERICAL:
        return up
    ratio = environment.polar_radius / environment.equatorial_radius
    k = 1.0 - ratio * ratio
    cos_square = (r[0] * r[0] + r[1] * r[1]) / square
    base = 1.0 - k * cos_square
    # d(surface radius)/d(cos^2 lat), times the gradient of cos^2 lat
    s = environment.polar_radius * 0.5 * k / (base * math.sqrt(base))
    a = 2.0 * s * r[2] / square
    b = a * r[2] / square
    return (up[0] - b * r[0], up[1] - b * r[1], up[2] - b * r[2] + a)


@kernel
def row_below(h: float, atmosphere: NDArray[np.float64]) -> int:
    """Return the last row of the table at or below an altitude, m; the first if there is none."""
    low = 0
    high = atmosphere.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if h >= atmosphere[middle, 0]:
            low = middle
        else:
            high = middle
    return low


@kernel
def cubic_above(
    h: float, atmosphere: NDArray[np.float64], row: int, column: int
) -> tuple[float, float]:
    """Return the cubic of a row from a column on, and its slope; linear below the first row."""
    x = h - atmosphere[row, 0]
    c0 = atmosphere[row, column]
    c1 = atmosphere[row, column + 1]
    if x < 0.0:
        return c0 + c1 * x, c1
    c2 = atmosphere[row, column + 2]
    c3 = atmosphere[row, column + 3]
    return c0 + x * (c1 + x * (c2 + x * c3)), c1 + x * (2.0 * c2 + x * 3.0 * c3)


@kernel
def log_density(h: float, atmosphere: NDArray[np.float64]) -> tuple[float, float]:
    """Compute the logarithm of density in kg/m3, and its derivative by altitude, 1/m.

    Args:
        h: altitude, m. Beyond both ends of the table the logarithm is linear.
        atmosphere: see the module text; without the density factor.
    """
    return cubic_above(h, atmosphere, row_below(h, atmosphere), 1)


@kernel
def density(r: Vector, environment: Record, atmosphere: NDArray[np.float64]) -> float:
    """Compute the density at a position, kg/m3, with the mission's density factor."""
    factor: float = environment.density_factor
    value, _ = log_density(altitude(r, environment), atmosphere)
    return factor * math.exp(value)


@kernel
def relative_velocity(r: Vector, v: Vector, environment: Record) -> Vector:
    """Compute the velocity relative to the rotating air, m/s: V - omega x r, Eq. 2.4."""
    rate = environment.rotation_rate
    return (v[0] + rate * r[1], v[1] - rate * r[0], v[2])


@kernel
def heating_rate(
    r: Vector, v: Vector, environment: Record, atmosphere: NDArray[np.float64]
) -> float:
    """Compute the free molecular heating 0.5 rho V_rel^3, W/m2: Eqs. 2.2 and 2.3 in SI.

    Eq. 2.2 has c q V_rel in BTU/ft2/s with c = 0.00128593, BTU per ft lbf.
    """
    speed = norm(relative_velocity(r, v, environment))
    return 0.5 * density(r, environment, atmosphere) * speed * speed * speed


@kernel
def log_heating_gradient(
    r: Vector, v: Vector, environment: Record, atmosphere: NDArray[np.float64]
) -> tuple[float, Vector, Vector]:
    """Compute the logarithm of :func:`heating_rate` and its gradients.

    Returns:
        log of the rate in W/m2, gradient by position (1/m), gradient by velocity (s/m).
    """
    relative = relative_velocity(r, v, environment)
    square = max(dot(relative, relative), AT_REST)
    value, slope = log_density(altitude(r, environment), atmosphere)
    up = altitude_gradient(r, environment)
    k = 3.0 / square
    rate = environment.rotation_rate
    by_velocity = scale(k, relative)
    by_position = (
        slope * up[0] - rate * by_velocity[1],
        slope * up[1] + rate * by_velocity[0],
        slope * up[2],
    )
    log_rate = value + math.log(0.5 * environment.density_factor * square * math.sqrt(square))
    return log_rate, by_position, by_velocity


@kernel
def log_heating(
    r: Vector,
    v: Vector,
    environment: Record,
    atmosphere: NDArray[np.float64],
    acceleration: Vector,
) -> tuple[float, float]:
    """Compute the logarithm of :func:`heating_rate` and its time derivative along the motion.

    Args:
        r: position, m.
        v: velocity, m/s.
        environment: record of dtype ENVIRONMENT.
        atmosphere: see the module text.
        acceleration: total acceleration, gravity included, m/s2.

    Returns:
        log of the rate in W/m2, and its derivative in time, 1/s.
    """
    log_rate, by_position, by_velocity = log_heating_gradient(r, v, environment, atmosphere)
    return log_rate, dot(by_position, v) + dot(by_velocity, acceleration)
