# SPDX-License-Identifier: Apache-2.0
"""Gravity, altitude, density, wind, velocity in the air and heating (thesis chapter 2).

``environment`` is a record of dtype ``arrays.ENVIRONMENT``; ``atmosphere`` is the table of
``arrays.MissionArrays``: rows (altitude m, c0, c1, c2, c3, p0, p1, p2, p3), log density and log
pressure cubics in the height above the row's altitude. The last row has values and slopes only:
the table continues linearly in both logarithms above it, and below the first row.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import ALTITUDE_SPHERICAL, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, add, axpy, dot, norm, scale, sub

#: Square of a speed in the air below which a vehicle is at rest, m2/s2.
AT_REST = 1e-12
#: Least distance from the axis at which east has a direction, m.
OFF_AXIS = 1e-3


class Wind(NamedTuple):
    """Hold the wind at a position, and its gradient.

    Attributes:
        velocity: over the ground, m/s.
        by_x, by_y, by_z: changes of it with each coordinate, 1/s.
    """

    velocity: Vector
    by_x: Vector
    by_y: Vector
    by_z: Vector


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
def table_at(
    x: float, places: NDArray[np.float64], cubics: NDArray[np.float64], knots: int
) -> tuple[float, float]:
    """Return the value of a table of cubics, constant beyond both ends, and its derivative.

    Args:
        x: where.
        places: shape (n,), of the knots, increasing.
        cubics: shape (n, 4), c0..c3 in the distance above each knot.
        knots: number of knots, 1 to n.
    """
    last = knots - 1
    if x <= places[0]:
        return cubics[0, 0], 0.0
    if x >= places[last]:
        return cubics[last, 0], 0.0
    k, above = 0, last
    while above - k > 1:
        middle = (k + above) // 2
        if x >= places[middle]:
            k = middle
        else:
            above = middle
    y = x - places[k]
    c1, c2, c3 = cubics[k, 1], cubics[k, 2], cubics[k, 3]
    value: float = cubics[k, 0] + y * (c1 + y * (c2 + y * c3))
    return value, c1 + y * (2.0 * c2 + y * 3.0 * c3)


@kernel
def is_calm(environment: Record) -> bool:
    """Return whether there is neither wind nor gust."""
    flag: bool = environment.wind.knots == 0 and environment.wind.gust_length == 0.0
    return flag


@kernel
def wind_component(h: float, wind: Record, component: int) -> tuple[float, float]:
    """Return the wind to the east (0) or north (1) at an altitude, m/s, and its slope, 1/s.

    The gust is 0.5 A (1 + cos(2 pi x / L)), with the distance x from its middle.
    """
    value, slope = 0.0, 0.0
    if wind.knots > 0:
        value, slope = table_at(h, wind.altitude, wind.cubic[component], wind.knots)
    x = h - wind.gust_altitude
    if abs(x) < 0.5 * wind.gust_length:
        rate = 2.0 * math.pi / wind.gust_length
        half = 0.5 * wind.gust[component]
        value += half * (1.0 + math.cos(rate * x))
        slope -= half * rate * math.sin(rate * x)
    return value, slope


@kernel
def vertical_stretch(environment: Record) -> float:
    """Return the factor on z by which a position becomes a normal to the ellipsoid; 1: sphere."""
    if environment.altitude_model == ALTITUDE_SPHERICAL:
        return 1.0
    ratio = environment.equatorial_radius / environment.polar_radius
    return float(ratio * ratio)


@kernel
def wind_at(r: Vector, environment: Record) -> Wind:
    """Compute the wind at a position with its gradient.

    North is level, at right angles to the normal of the ellipsoid below; on the axis there is no
    wind.
    """
    nothing = (0.0, 0.0, 0.0)
    if is_calm(environment):
        return Wind(nothing, nothing, nothing, nothing)
    outwards = math.sqrt(r[0] * r[0] + r[1] * r[1])
    if outwards < OFF_AXIS:
        return Wind(nothing, nothing, nothing, nothing)
    h = altitude(r, environment)
    to_east, east_slope = wind_component(h, environment.wind, 0)
    to_north, north_slope = wind_component(h, environment.wind, 1)
    stretch = vertical_stretch(environment)
    high = stretch * r[2]
    size = math.sqrt(outwards * outwards + high * high)
    sine, cosine = high / size, outwards / size
    away = (r[0] / outwards, r[1] / outwards, 0.0)
    east = (-away[1], away[0], 0.0)
    north = (-sine * away[0], -sine * away[1], cosine)
    normal = (cosine * away[0], cosine * away[1], sine)
    velocity = add(scale(to_east, east), scale(to_north, north))
    # by altitude, by longitude and by the latitude of the normal
    by_h = add(scale(east_slope, east), scale(north_slope, north))
    by_longitude = sub(scale(-to_east, away), scale(to_north * sine, east))
    by_latitude = scale(-to_north, normal)
    up = altitude_gradient(r, environment)
    turn = scale(1.0 / outwards, east)
    rise = (
        -high * away[0] / (size * size),
        -high * away[1] / (size * size),
        stretch * outwards / (size * size),
    )
    by_x = axpy(up[0], by_h, axpy(turn[0], by_longitude, scale(rise[0], by_latitude)))
    by_y = axpy(up[1], by_h, axpy(turn[1], by_longitude, scale(rise[1], by_latitude)))
    by_z = axpy(up[2], by_h, scale(rise[2], by_latitude))
    return Wind(velocity, by_x, by_y, by_z)


@kernel
def relative_velocity(r: Vector, v: Vector, environment: Record) -> Vector:
    """Compute the velocity relative to the rotating body, m/s: V - omega x r, Eq. 2.4."""
    rate = environment.rotation_rate
    return (v[0] + rate * r[1], v[1] - rate * r[0], v[2])


@kernel
def air_velocity(r: Vector, v: Vector, environment: Record) -> Vector:
    """Compute the velocity relative to the air, m/s: the air turns with the body, plus wind."""
    relative = relative_velocity(r, v, environment)
    if is_calm(environment):
        return relative
    return sub(relative, wind_at(r, environment).velocity)


@kernel
def pulled_back(r: Vector, y: Vector, environment: Record) -> Vector:
    """Return a gradient by position from that by the velocity in the air, ``y``."""
    rate = environment.rotation_rate
    by_r = (-rate * y[1], rate * y[0], 0.0)
    if is_calm(environment):
        return by_r
    wind = wind_at(r, environment)
    return sub(by_r, (dot(wind.by_x, y), dot(wind.by_y, y), dot(wind.by_z, y)))


@kernel
def heating_rate(
    r: Vector, v: Vector, environment: Record, atmosphere: NDArray[np.float64]
) -> float:
    """Compute the free molecular heating 0.5 rho V_rel^3, W/m2: Eqs. 2.2 and 2.3 in SI.

    Eq. 2.2 has c q V_rel in BTU/ft2/s with c = 0.00128593, BTU per ft lbf.
    """
    speed = norm(air_velocity(r, v, environment))
    return 0.5 * density(r, environment, atmosphere) * speed * speed * speed


@kernel
def log_heating_gradient(
    r: Vector, v: Vector, environment: Record, atmosphere: NDArray[np.float64]
) -> tuple[float, Vector, Vector]:
    """Compute the logarithm of :func:`heating_rate` and its gradients.

    Returns:
        log of the rate in W/m2, gradient by position (1/m), gradient by velocity (s/m).
    """
    relative = air_velocity(r, v, environment)
    square = max(dot(relative, relative), AT_REST)
    value, slope = log_density(altitude(r, environment), atmosphere)
    up = altitude_gradient(r, environment)
    k = 3.0 / square
    by_velocity = scale(k, relative)
    by_position = axpy(slope, up, pulled_back(r, by_velocity, environment))
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
