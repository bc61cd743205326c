# SPDX-License-Identifier: Apache-2.0
"""Compute gravity, forces of the air, heating and orbital elements, apart from the solvers."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    ALTITUDE_SPHERICAL,
    COAST,
    MissionArrays,
    Record,
)
from ares_models.jit import kernel

Array = NDArray[np.float64]
#: Position, velocity or direction in a kernel.
Triple = tuple[float, float, float]
#: Upper bound of the log of density, whose exponential is finite.
_DENSEST = 300.0
#: Columns of the cubics of log density and log pressure in the table of the atmosphere.
_DENSITY = 1
_PRESSURE = 5
#: Square of the sound speed times density over pressure.
_HEAT_RATIO = 1.4


@kernel
def _triple(a: Array) -> Triple:
    return (a[0], a[1], a[2])


@kernel
def _dot(a: Triple, b: Triple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _cross(a: Triple, b: Triple) -> Triple:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def _scaled(a: float, x: Triple) -> Triple:
    return (a * x[0], a * x[1], a * x[2])


@kernel
def _sum(a: float, x: Triple, b: float, y: Triple) -> Triple:
    """Return a x + b y."""
    return (a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2])


@kernel
def _gravity(r: Triple, environment: Record) -> Triple:
    square = _dot(r, r)
    k = -environment.mu / (square * math.sqrt(square))
    z2 = 5.0 * r[2] * r[2] / square
    factor = 1.5 * environment.j2 * environment.equatorial_radius**2 / square
    across = k * (1.0 + factor * (1.0 - z2))
    return (across * r[0], across * r[1], k * (1.0 + factor * (3.0 - z2)) * r[2])


@kernel
def _surface_radius(r: Triple, environment: Record) -> float:
    if environment.altitude_model == ALTITUDE_SPHERICAL:
        return float(environment.equatorial_radius)
    polar = environment.polar_radius
    cos_square = 1.0 - r[2] * r[2] / _dot(r, r)
    flat = (polar / environment.equatorial_radius) ** 2 - 1.0
    return float(polar / math.sqrt(1.0 + flat * cos_square))


@kernel
def _height(r: Triple, environment: Record) -> float:
    return math.sqrt(_dot(r, r)) - _surface_radius(r, environment)


@kernel
def _knot(x: float, places: Array, count: int) -> int:
    """Return the last of some knots at or below a place; the first if there is none."""
    k = 0
    while k + 1 < count and places[k + 1] <= x:
        k += 1
    return k


@kernel
def _cubic(x: float, places: Array, cubics: Array, count: int) -> float:
    """Return a function of cubics between knots, constant beyond both ends."""
    x = min(max(x, places[0]), places[count - 1])
    k = _knot(x, places, count)
    c, x = cubics[k], x - places[k]
    return float(c[0] + (c[1] + (c[2] + c[3] * x) * x) * x)


@kernel
def _table_at(height: float, table: Array, column: int) -> float:
    """Return a cubic of the atmosphere's table at an altitude, m, from a column on."""
    row = table[_knot(height, table[:, 0], table.shape[0])]
    x = height - row[0]
    # straight below the table
    bend = row[column + 2] + row[column + 3] * x if x > 0.0 else 0.0
    return min(row[column] + (row[column + 1] + bend * x) * x, _DENSEST)


@kernel
def _vertical(r: Triple, environment: Record) -> Triple:
    stretch = 1.0
    if environment.altitude_model != ALTITUDE_SPHERICAL:
        stretch = (environment.equatorial_radius / environment.polar_radius) ** 2
    normal = (r[0], r[1], stretch * r[2])
    return _scaled(1.0 / math.sqrt(_dot(normal, normal)), normal)


@kernel
def _wind(r: Triple, environment: Record) -> Triple:
    """Return the wind over the ground, m/s: the table without gusts."""
    wind = environment.wind
    if wind.knots == 0:
        return (0.0, 0.0, 0.0)
    height = _height(r, environment)
    to_east = _cubic(height, wind.altitude, wind.cubic[0], wind.knots)
    to_north = _cubic(height, wind.altitude, wind.cubic[1], wind.knots)
    normal = _vertical(r, environment)
    east = (-normal[1], normal[0], 0.0)
    east = _scaled(1.0 / max(math.hypot(east[0], east[1]), 1e-300), east)
    return _sum(to_east, east, to_north, _cross(normal, east))


@kernel
def _air_velocity(r: Triple, v: Triple, environment: Record) -> Triple:
    """Return the velocity in the air, which turns with the body, less wind, m/s."""
    rate = environment.rotation_rate
    relative = (v[0] + rate * r[1], v[1] - rate * r[0], v[2])
    return _sum(1.0, relative, -1.0, _wind(r, environment))


@kernel
def _density(r: Triple, environment: Record, atmosphere: Array) -> float:
    logarithm = _table_at(_height(r, environment), atmosphere, _DENSITY)
    return float(environment.density_factor * math.exp(logarithm))


@kernel
def _coefficient(mach: float, places: Array, cubics: Array, count: int) -> float:
    return _cubic(mach, places, cubics, count) if count > 0 else 0.0


@kernel
def _air_force(
    r: Triple,
    v: Triple,
    thrust: float,
    direction: Triple,
    arc: Record,
    environment: Record,
    atmosphere: Array,
) -> Triple:
    if arc.drag_knots == 0 and arc.exit_area == 0.0:
        return _scaled(thrust, direction)
    density = _density(r, environment, atmosphere)
    pressure = math.exp(_table_at(_height(r, environment), atmosphere, _PRESSURE))
    force = _scaled(max(0.0, thrust - pressure * arc.exit_area), direction)
    relative = _air_velocity(r, v, environment)
    speed = math.sqrt(_dot(relative, relative))
    if arc.drag_knots == 0 or speed == 0.0:
        return force
    mach = speed / math.sqrt(_HEAT_RATIO * pressure / density) if density > 0.0 else math.inf
    push = 0.5 * density * speed * speed * arc.drag_area
    along = _coefficient(mach, arc.drag_mach, arc.drag_cubic, arc.drag_knots)
    stream = _scaled(1.0 / speed, relative)
    if arc.kind == COAST:
        return _sum(1.0, force, -push * along, stream)
    across = _coefficient(mach, arc.across_mach, arc.across_cubic, arc.across_knots)
    cosine = _dot(direction, stream)
    if arc.body_axes:
        # axial force against the body, normal force to the side from which the air comes
        turned = _sum(along - across * cosine, direction, across, stream)
    else:
        # drag with the air, lift to the side to which the body points
        turned = _sum(along + across * cosine, stream, -across, direction)
    return _sum(1.0, force, -push, turned)


@kernel
def _fill_pressures(
    r: Array, v: Array, environment: Record, atmosphere: Array, pressure: Array, speed: Array
) -> None:
    """Write 0.5 rho V^2, Pa, and V, m/s, in the air, of n states, shape (n, 3)."""
    for i in range(r.shape[0]):
        place = _triple(r[i])
        relative = _air_velocity(place, _triple(v[i]), environment)
        square = _dot(relative, relative)
        pressure[i] = 0.5 * _density(place, environment, atmosphere) * square
        speed[i] = math.sqrt(square)


@kernel
def _fill_sines(r: Array, v: Array, direction: Array, environment: Record, sine: Array) -> None:
    """Write the sines of the angle of attack of n states."""
    for i in range(r.shape[0]):
        relative = _air_velocity(_triple(r[i]), _triple(v[i]), environment)
        across = _cross(_triple(direction[i]), relative)
        speed = math.sqrt(_dot(relative, relative))
        sine[i] = math.sqrt(_dot(across, across)) / max(speed, 1e-9)


@kernel
def _fill_acceleration(
    y: Array,
    thrust: float,
    direction: Array,
    arc: Record,
    environment: Record,
    atmosphere: Array,
    out: Array,
) -> None:
    """Write the acceleration by gravity, thrust and air, m/s2; as in :func:`acceleration`."""
    r, v = (y[0], y[1], y[2]), (y[3], y[4], y[5])
    along = _triple(direction)
    if arc.vertical:
        along = _vertical(r, environment)
    force = _air_force(r, v, thrust, along, arc, environment, atmosphere)
    a = _sum(1.0, _gravity(r, environment), 1.0 / y[6], force)
    for c in range(3):
        out[c] = a[c]


def gravity(r: Array, environment: Record) -> Array:
    """Return the gravitational acceleration, m/s2: Eq. 2.13, with J2 if the mission has it."""
    return np.array(_gravity(_triple(r), environment))


def surface_radius(r: Array, environment: Record) -> Array:
    """Return the distance of the ground below a position from the Earth's centre, m (Eq. 2.15).

    Args:
        r: m, shape (..., 3).
        environment: record ENVIRONMENT.
    """
    radii = [_surface_radius(_triple(place), environment) for place in r.reshape(-1, 3)]
    return np.array(radii).reshape(r.shape[:-1])


def _pressures(r: Array, v: Array, arrays: MissionArrays) -> tuple[Array, Array]:
    """Return dynamic pressure, Pa, and speed in the air, m/s, shape (...)."""
    places = r.reshape(-1, 3)
    pressure, speed = np.empty(len(places)), np.empty(len(places))
    environment, atmosphere = arrays.environment[0], arrays.atmosphere
    _fill_pressures(places, v.reshape(-1, 3), environment, atmosphere, pressure, speed)
    return pressure.reshape(r.shape[:-1]), speed.reshape(r.shape[:-1])


def heating(r: Array, v: Array, arrays: MissionArrays) -> Array:
    """Return the free molecular heating 0.5 rho V^3 in the air, W/m2 (Eqs. 2.2 to 2.5, 2.12).

    Args:
        r: m, shape (..., 3).
        v: m/s, shape (..., 3).
        arrays: the mission.
    """
    pressure, speed = _pressures(r, v, arrays)
    return pressure * speed


def dynamic_pressure(r: Array, v: Array, arrays: MissionArrays) -> Array:
    """Return 0.5 rho V_rel^2, Pa; arguments as in :func:`heating`."""
    return _pressures(r, v, arrays)[0]


def q_alpha(r: Array, v: Array, direction: Array, arrays: MissionArrays) -> Array:
    """Return the dynamic pressure times the sine of the angle of attack, Pa.

    Args:
        r: m, shape (..., 3).
        v: m/s, shape (..., 3).
        direction: of the thrust, unit vectors, shape (..., 3).
        arrays: the mission.
    """
    places = r.reshape(-1, 3)
    sine = np.empty(len(places))
    axes, environment = direction.reshape(-1, 3), arrays.environment[0]
    _fill_sines(places, v.reshape(-1, 3), axes, environment, sine)
    return dynamic_pressure(r, v, arrays) * sine.reshape(r.shape[:-1])


def acceleration(
    y: Array, thrust: float, direction: Array, arc: Record, arrays: MissionArrays
) -> Array:
    """Return the acceleration by gravity, thrust and air, m/s2, shape (3,).

    Args:
        y: position m, velocity m/s, mass kg, shape (7,).
        thrust: in vacuum, N.
        direction: of the thrust, unit vector, shape (3,); a vertical rise has its own.
        arc: record ARC.
        arrays: the mission.
    """
    out = np.empty(3)
    environment, atmosphere = arrays.environment[0], arrays.atmosphere
    _fill_acceleration(y, thrust, direction, arc, environment, atmosphere, out)
    return out


def air_force(
    r: Array, v: Array, thrust: float, direction: Array, arc: Record, arrays: MissionArrays
) -> Array:
    """Return the thrust less ambient pressure, and the force of the air, N, shape (3,).

    Args:
        r: m, shape (3,).
        v: m/s, shape (3,).
        thrust: in vacuum, N.
        direction: of the thrust, unit vector, shape (3,).
        arc: record ARC.
        arrays: the mission.
    """
    environment, atmosphere = arrays.environment[0], arrays.atmosphere
    place, velocity, along = _triple(r), _triple(v), _triple(direction)
    return np.array(_air_force(place, velocity, thrust, along, arc, environment, atmosphere))


def elements(r: Array, v: Array, mu: float) -> dict[str, float]:
    """Return the elements of a state by the fields of TARGET: SI, angles in deg.

    Returns:
        radius, speed, flight_path_angle, inclination, ascending_node,
        semi_major_axis, eccentricity, argument_of_perigee, perigee_radius,
        apogee_radius (inf: escape), c3, true_anomaly.
    """
    radius = float(np.linalg.norm(r))
    speed = float(np.linalg.norm(v))
    h = np.cross(r, v)
    unit = h / np.linalg.norm(h)
    node = np.array([-h[1], h[0], 0.0])
    size = float(np.linalg.norm(node))
    node = node / size if size > 0.0 else np.array([1.0, 0.0, 0.0])
    e = np.cross(v, h) / mu - r / radius
    eccentricity = float(np.linalg.norm(e))
    parameter = float(h @ h) / mu
    return {
        "radius": radius,
        "speed": speed,
        "flight_path_angle": math.degrees(math.asin(float(r @ v) / (radius * speed))),
        "inclination": math.degrees(math.atan2(math.hypot(h[0], h[1]), h[2])),
        "ascending_node": math.degrees(math.atan2(node[1], node[0])) % 360.0,
        "semi_major_axis": 1.0 / (2.0 / radius - speed**2 / mu),
        "eccentricity": eccentricity,
        "argument_of_perigee": math.degrees(
            math.atan2(float(np.cross(node, e) @ unit), float(node @ e))
        )
        % 360.0,
        "perigee_radius": parameter / (1.0 + eccentricity),
        "apogee_radius": parameter / (1.0 - eccentricity) if eccentricity < 1.0 else math.inf,
        "c3": speed**2 - 2.0 * mu / radius,
        "true_anomaly": math.degrees(math.atan2(float(np.cross(e, r) @ unit), float(e @ r))),
    }
