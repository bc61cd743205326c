# SPDX-License-Identifier: Apache-2.0
"""Conversion between state vectors and angles of a flight (Eqs. 2.14 and 2.18)."""

import math

from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, add, cross, dot, norm, scale


@kernel
def east_north_up(latitude: float, right_ascension: float) -> tuple[Vector, Vector, Vector]:
    """Return the unit vectors east, north and up in the inertial frame.

    Args:
        latitude: geocentric, rad.
        right_ascension: from the inertial x axis, rad.
    """
    sin_lat = math.sin(latitude)
    cos_lat = math.cos(latitude)
    sin_ra = math.sin(right_ascension)
    cos_ra = math.cos(right_ascension)
    east = (-sin_ra, cos_ra, 0.0)
    north = (-sin_lat * cos_ra, -sin_lat * sin_ra, cos_lat)
    up = (cos_lat * cos_ra, cos_lat * sin_ra, sin_lat)
    return east, north, up


@kernel
def state_from_angles(
    radius: float,
    latitude: float,
    right_ascension: float,
    speed: float,
    flight_path_angle: float,
    azimuth: float,
) -> tuple[Vector, Vector]:
    """Compute inertial position and velocity, Eqs. 2.14 and 2.18.

    The directions of Eq. 2.18 are printed without normalisation; here they are unit vectors:
    V = V0 [(north cos(az) + east sin(az)) cos(gamma) + up sin(gamma)].

    Args:
        radius: m.
        latitude: geocentric, rad.
        right_ascension: from the inertial x axis, rad.
        speed: inertial, m/s.
        flight_path_angle: of the inertial velocity above the local horizontal, rad.
        azimuth: of the inertial velocity, from north towards east, rad.

    Returns:
        Position (m) and velocity (m/s).
    """
    east, north, up = east_north_up(latitude, right_ascension)
    across = speed * math.cos(flight_path_angle)
    v = add(
        add(scale(across * math.cos(azimuth), north), scale(across * math.sin(azimuth), east)),
        scale(speed * math.sin(flight_path_angle), up),
    )
    return scale(radius, up), v


@kernel
def angles_from_state(r: Vector, v: Vector) -> tuple[float, float, float, float, float, float]:
    """Compute radius, latitude, right ascension, speed, flight-path angle and azimuth.

    The inverse of :func:`state_from_angles`; same order and units. Over a pole the
    right ascension is that of atan2(0, 0), zero.
    """
    latitude = math.atan2(r[2], math.hypot(r[0], r[1]))
    right_ascension = math.atan2(r[1], r[0])
    east, north, up = east_north_up(latitude, right_ascension)
    v_east = dot(v, east)
    v_north = dot(v, north)
    flight_path_angle = math.atan2(dot(v, up), math.hypot(v_east, v_north))
    azimuth = math.atan2(v_east, v_north)
    return norm(r), latitude, right_ascension, norm(v), flight_path_angle, azimuth


@kernel
def insertion_quantities(r: Vector, v: Vector) -> tuple[float, float, float, float, float]:
    """Compute radius, speed, flight-path angle, inclination and ascending node of a state.

    Args:
        r: position, m.
        v: velocity, m/s.

    Returns:
        radius m, speed m/s, flight-path angle rad, inclination rad (0..pi), ascending node
        rad (0..2 pi, from the x axis; 0 for an equatorial plane).
    """
    h = cross(r, v)
    across = math.hypot(h[0], h[1])
    node = 0.0
    if across > 0.0:
        node = math.atan2(h[0], -h[1]) % (2.0 * math.pi)
    return (
        norm(r),
        norm(v),
        math.atan2(dot(r, v), norm(h)),
        math.atan2(across, h[2]),
        node,
    )
