# SPDX-License-Identifier: Apache-2.0
"""Compute gravity, heating and orbital elements in NumPy."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    ALTITUDE_SPHERICAL,
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


def heating(r: Array, v: Array, arrays: MissionArrays) -> Array:
    """Return the free molecular heating 0.5 rho V_rel^3, W/m2 (Eqs. 2.2 to 2.5, 2.12, 2.15).

    Args:
        r: m, shape (..., 3).
        v: m/s, shape (..., 3).
        arrays: the mission.
    """
    environment = arrays.environment[0]
    height = np.linalg.norm(r, axis=-1) - surface_radius(r, environment)
    table = arrays.atmosphere
    row = table[np.maximum(np.searchsorted(table[:, 0], height, side="right") - 1, 0)].T
    x = height - row[0]
    cubic = np.where(x > 0.0, row[3] + row[4] * x, 0.0)
    log_density = row[1] + (row[2] + cubic * x) * x
    rate = float(environment["rotation_rate"])
    relative = np.stack((v[..., 0] + rate * r[..., 1], v[..., 1] - rate * r[..., 0], v[..., 2]), -1)
    density = float(environment["density_factor"]) * np.exp(np.minimum(log_density, _DENSEST))
    square = np.sum(relative * relative, axis=-1)
    heat: Array = 0.5 * density * square * np.sqrt(square)
    return heat


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
