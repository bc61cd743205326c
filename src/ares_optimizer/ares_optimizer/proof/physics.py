# SPDX-License-Identifier: Apache-2.0
"""Compute gravity, forces of the air, heating and orbital elements in NumPy."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    ALTITUDE_SPHERICAL,
    COAST,
    MissionArrays,
    Record,
)

Array = NDArray[np.float64]
#: Upper bound of the log of density, whose exponential is finite.
_DENSEST = 300.0


def gravity(r: Array, environment: Record) -> Array:
    """Return the gravitational acceleration, m/s2: Eq. 2.13, with J2 if the mission has it."""
    square = float(r @ r)
    g = -float(environment["mu"]) / square**1.5 * r
    j2 = float(environment["j2"])
    if j2 != 0.0:
        z2 = 5.0 * r[2] ** 2 / square
        factor = 1.5 * j2 * float(environment["equatorial_radius"]) ** 2 / square
        g = g * (1.0 + factor * np.array([1.0 - z2, 1.0 - z2, 3.0 - z2]))
    return g


def surface_radius(r: Array, environment: Record) -> Array:
    """Return the distance of the ground below a position from the Earth's centre, m (Eq. 2.15).

    Args:
        r: m, shape (..., 3).
        environment: record ENVIRONMENT.
    """
    equatorial = float(environment["equatorial_radius"])
    if environment["altitude_model"] == ALTITUDE_SPHERICAL:
        return np.full(r.shape[:-1], equatorial)
    polar = float(environment["polar_radius"])
    cos_square = 1.0 - r[..., 2] ** 2 / np.sum(r * r, axis=-1)
    return polar / np.sqrt(1.0 + ((polar / equatorial) ** 2 - 1.0) * cos_square)


def _table_at(height: Array, table: Array, column: int) -> Array:
    """Return a cubic of the atmosphere's table at altitudes, m, from a column on: 1 or 5."""
    row = table[np.maximum(np.searchsorted(table[:, 0], height, side="right") - 1, 0)].T
    x = height - row[0]
    c0, c1, c2, c3 = row[column : column + 4]
    cubic = np.where(x > 0.0, c2 + c3 * x, 0.0)
    value: Array = c0 + (c1 + cubic * x) * x
    return np.minimum(value, _DENSEST)


def _air_speed(r: Array, v: Array, environment: Record) -> Array:
    """Return the velocity in the air, which turns with the body, less wind, m/s, (..., 3)."""
    rate = float(environment["rotation_rate"])
    turning = np.stack((-rate * r[..., 1], rate * r[..., 0], np.zeros(r.shape[:-1])), -1)
    return np.asarray(v - turning - _wind(r, environment))


def _wind(r: Array, environment: Record) -> Array:
    """Return the wind over the ground, m/s, shape (..., 3): the table without gusts."""
    wind = environment["wind"]
    knots = int(wind["knots"])
    if not knots:
        return np.zeros(r.shape)
    places = wind["altitude"][:knots]
    height = np.clip(_height(r, environment), places[0], places[-1])
    k = np.clip(np.searchsorted(places, height, side="right") - 1, 0, knots - 1)
    powers = (height - places[k])[..., None] ** np.arange(4)
    to_east, to_north = (np.sum(cubic[k] * powers, axis=-1) for cubic in wind["cubic"])
    normal = vertical(r, environment)
    east = np.cross([0.0, 0.0, 1.0], normal)
    east /= np.maximum(np.linalg.norm(east, axis=-1, keepdims=True), 1e-300)
    north = np.cross(normal, east)
    return np.asarray(to_east[..., None] * east + to_north[..., None] * north)


def _height(r: Array, environment: Record) -> Array:
    """Return the altitude, m, shape (...)."""
    height: Array = np.linalg.norm(r, axis=-1) - surface_radius(r, environment)
    return height


def _density(height: Array, arrays: MissionArrays) -> Array:
    """Return the density at altitudes, m, in kg/m3."""
    factor = float(arrays.environment[0]["density_factor"])
    density: Array = factor * np.exp(_table_at(height, arrays.atmosphere, 1))
    return density


def heating(r: Array, v: Array, arrays: MissionArrays) -> Array:
    """Return the free molecular heating 0.5 rho V^3 in the air, W/m2 (Eqs. 2.2 to 2.5, 2.12).

    Args:
        r: m, shape (..., 3).
        v: m/s, shape (..., 3).
        arrays: the mission.
    """
    return dynamic_pressure(r, v, arrays) * np.linalg.norm(
        _air_speed(r, v, arrays.environment[0]), axis=-1
    )


def dynamic_pressure(r: Array, v: Array, arrays: MissionArrays) -> Array:
    """Return 0.5 rho V_rel^2, Pa; arguments as in :func:`heating`."""
    environment = arrays.environment[0]
    relative = _air_speed(r, v, environment)
    density = _density(_height(r, environment), arrays)
    pressure: Array = 0.5 * density * np.sum(relative * relative, axis=-1)
    return pressure


def q_alpha(r: Array, v: Array, direction: Array, arrays: MissionArrays) -> Array:
    """Return the dynamic pressure times the sine of the angle of attack, Pa.

    Args:
        r: m, shape (..., 3).
        v: m/s, shape (..., 3).
        direction: of the thrust, unit vectors, shape (..., 3).
        arrays: the mission.
    """
    relative = _air_speed(r, v, arrays.environment[0])
    speed = np.maximum(np.linalg.norm(relative, axis=-1), 1e-9)
    across = np.linalg.norm(np.cross(direction, relative), axis=-1) / speed
    value: Array = dynamic_pressure(r, v, arrays) * across
    return value


def vertical(r: Array, environment: Record) -> Array:
    """Return the direction upwards, normal to the ground below; along the radius on a sphere."""
    normal = r.copy()
    if environment["altitude_model"] != ALTITUDE_SPHERICAL:
        normal[..., 2] *= (environment["equatorial_radius"] / environment["polar_radius"]) ** 2
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


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
    environment = arrays.environment[0]
    height = _height(r, environment)
    density = float(_density(height, arrays))
    pressure = math.exp(float(_table_at(height, arrays.atmosphere, 5)))
    force = max(0.0, thrust - pressure * float(arc["exit_area"])) * direction
    knots = int(arc["drag_knots"])
    if not knots:
        return force
    relative = _air_speed(r, v, environment)
    speed = float(np.linalg.norm(relative))
    mach = speed / math.sqrt(1.4 * pressure / density) if density > 0.0 else math.inf
    push = 0.5 * density * speed * speed * float(arc["drag_area"])
    along = _coefficient(mach, arc, "drag")
    if speed == 0.0:
        return force
    stream = relative / speed
    if arc["kind"] == COAST:
        return np.asarray(force - push * along * stream)
    across = _coefficient(mach, arc, "across")
    cosine = float(direction @ stream)
    if arc["body_axes"]:
        # axial force against the body, normal force to the side from which the air comes
        turned = along * direction + across * (stream - cosine * direction)
    else:
        # drag with the air, lift to the side to which the body points
        turned = along * stream - across * (direction - cosine * stream)
    return np.asarray(force - push * turned)


def _coefficient(mach: float, arc: Record, name: str) -> float:
    """Return a coefficient of a table over the Mach number, constant beyond both ends."""
    knots = int(arc[f"{name}_knots"])
    if not knots:
        return 0.0
    places = arc[f"{name}_mach"][:knots]
    k = min(max(int(np.searchsorted(places, mach, side="right")) - 1, 0), len(places) - 1)
    x = min(max(mach, places[0]), places[-1]) - places[k]
    return float(np.polynomial.polynomial.polyval(x, arc[f"{name}_cubic"][k]))


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
