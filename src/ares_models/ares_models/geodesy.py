# SPDX-License-Identifier: Apache-2.0
"""Places on the rotating Earth: Earth-fixed positions, geodetic coordinates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_models.earth import Earth
from ares_models.frames import earth_fixed_from_inertial
from ares_models.kernels import states

Array = NDArray[np.float64]

#: Tolerance of the latitude, rad: a hundredth of a micrometre on the ground.
_LATITUDE = 1e-15
#: Largest number of iterations; three suffice near the Earth.
_MOST = 30


@dataclass(frozen=True)
class Places:
    """Hold geodetic places over an ellipsoid, each shape (n,).

    Attributes:
        latitude_deg: geodetic.
        longitude_deg: east of zero, -180 to 180.
        height_m: above the ellipsoid, along its normal.
    """

    latitude_deg: Array
    longitude_deg: Array
    height_m: Array


def earth_fixed(time: Array, position: Array, earth: Earth) -> Array:
    """Convert inertial positions to Earth-fixed ones, shape (n, 3), m.

    By default the inertial x axis points to longitude zero at mission time 0, as in the thesis.

    Args:
        time: mission elapsed time, shape (n,), s.
        position: inertial, shape (n, 3), m.
        earth: its rotation.
    """
    rate, at_zero = earth.rotation_rate, earth.angle_at_zero
    turned = [
        earth_fixed_from_inertial(t, rate, at_zero) @ r for t, r in zip(time, position, strict=True)
    ]
    return np.array(turned).reshape(-1, 3)


def geodetic(time: Array, position: Array, earth: Earth) -> Places:
    """Convert inertial positions to geodetic places on the mission's own ellipsoid.

    Iterates Bowring's equation for the parametric latitude to convergence: a single step, as in
    most libraries, is off by tens of metres at the height of geostationary satellites.

    Args: as in :func:`earth_fixed`.
    """
    x, y, z = earth_fixed(time, position, earth).T
    a, b = earth.equatorial_radius, earth.polar_radius
    across = np.hypot(x, y)
    parametric = np.arctan2(a * z, b * across)
    for _ in range(_MOST):
        latitude = np.arctan2(
            z + (a * a - b * b) / b * np.sin(parametric) ** 3,
            across - (a * a - b * b) / a * np.cos(parametric) ** 3,
        )
        before = parametric
        parametric = np.arctan2(b * np.sin(latitude), a * np.cos(latitude))
        if np.all(np.abs(parametric - before) < _LATITUDE):
            break
    # along the normal: no division by a small number at a pole or at the equator
    foot = a * np.cos(parametric), b * np.sin(parametric)
    height = (across - foot[0]) * np.cos(latitude) + (z - foot[1]) * np.sin(latitude)
    return Places(np.degrees(latitude), np.degrees(np.arctan2(y, x)), height)


def earth_fixed_place(
    latitude_deg: float, longitude_deg: float, height_m: float, earth: Earth
) -> Array:
    """Convert a geodetic place to an Earth-fixed position, shape (3,), m."""
    latitude, longitude = np.radians(latitude_deg), np.radians(longitude_deg)
    a, b = earth.equatorial_radius, earth.polar_radius
    parametric = np.arctan2(b * np.sin(latitude), a * np.cos(latitude))
    across = a * np.cos(parametric) + height_m * np.cos(latitude)
    along = b * np.sin(parametric) + height_m * np.sin(latitude)
    return np.array([across * np.cos(longitude), across * np.sin(longitude), along])


def velocity_over_ground(
    latitude_deg: float,
    longitude_deg: float,
    speed_m_s: float,
    elevation_deg: float,
    azimuth_deg: float,
) -> Array:
    """Return the Earth-fixed velocity over the ground at a geodetic place, shape (3,), m/s.

    Args:
        latitude_deg: geodetic.
        longitude_deg: east of zero.
        speed_m_s: relative to the rotating Earth.
        elevation_deg: above the tangent plane of the ellipsoid.
        azimuth_deg: from north towards east.
    """
    latitude, longitude = np.radians(latitude_deg), np.radians(longitude_deg)
    elevation, azimuth = np.radians(elevation_deg), np.radians(azimuth_deg)
    east, north, up = np.array(states.east_north_up(float(latitude), float(longitude)))
    across = np.cos(azimuth) * north + np.sin(azimuth) * east
    velocity: Array = speed_m_s * (np.cos(elevation) * across + np.sin(elevation) * up)
    return velocity


def inertial_state(
    time: float, position: Array, velocity: Array, earth: Earth
) -> tuple[Array, Array]:
    """Return the inertial position (m) and velocity (m/s) of an Earth-fixed state, each (3,).

    V = V_rel + omega x r, the inverse of Eq. 2.4.

    Args:
        time: mission elapsed time, s.
        position: Earth-fixed, m, shape (3,).
        velocity: relative to the rotating Earth, Earth-fixed components, m/s, shape (3,).
        earth: its rotation.
    """
    rate = earth.rotation_rate
    back = earth_fixed_from_inertial(time, rate, earth.angle_at_zero).T
    r = back @ position
    return r, back @ velocity + np.cross([0.0, 0.0, rate], r)
