# SPDX-License-Identifier: Apache-2.0
"""Compute ground track, thrust angles and instantaneous impact points."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.earth import Earth
from ares_models.kernels.environment import vertical_stretch
from ares_models.kernels.impact import fall

Array = NDArray[np.float64]

#: Pitch beyond which the thrust points up and its azimuth means nothing, deg.
_UPRIGHT_DEG = 89.0


@dataclass(frozen=True)
class GroundTrack:
    """Hold points on the ground, shape (n,), deg: geocentric latitude, longitude east of zero."""

    latitude_deg: Array
    longitude_deg: Array


def local_axes(position: Array, velocity: Array, environment: Record) -> tuple[Array, Array, Array]:
    """Compute axes at the vehicle: up, ahead along the horizontal velocity, right of it.

    Up is normal to the ellipsoid, as for the angles of a `programme`; along the radius where
    altitudes are above a sphere.

    Args:
        position: inertial, shape (n, 3), m.
        velocity: inertial, shape (n, 3), m/s.
        environment: record of dtype ENVIRONMENT.

    Returns:
        Unit vectors, shape (n, 3) each; zero ahead and right if the velocity is vertical.
    """
    up = position * (1.0, 1.0, vertical_stretch(environment))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    right = np.cross(velocity, up)
    size = np.linalg.norm(right, axis=1, keepdims=True)
    right = right / np.where(size > 0.0, size, 1.0)
    return up, np.cross(up, right), right


def thrust_angles(
    position: Array, velocity: Array, direction: Array, environment: Record
) -> tuple[Array, Array, Array]:
    """Compute pitch, yaw and azimuth of the thrust.

    Pitch is the angle of the thrust above the horizon, see :func:`local_axes`. Yaw is the azimuth
    of the thrust minus that of the inertial velocity: the angle between their horizontal
    components, positive to the right of the velocity as seen from above. Thrust in the vertical
    plane of the velocity has no yaw.

    Args:
        position: inertial, shape (n, 3), m.
        velocity: inertial, shape (n, 3), m/s.
        direction: of the thrust, shape (n, 3), unit vectors.
        environment: record of dtype ENVIRONMENT.

    Returns:
        Pitch, yaw, and azimuth from north to east in 0..360, shape (n,) each, deg; yaw is 0 if
        thrust or velocity is vertical.
    """
    up, along, right = local_axes(position, velocity, environment)
    sine = np.sum(direction * up, axis=1)
    across = np.sum(direction * right, axis=1)
    ahead = np.sum(direction * along, axis=1)
    east = np.cross((0.0, 0.0, 1.0), up)
    to_east = np.sum(direction * east, axis=1)
    to_north = np.sum(direction * np.cross(up, east), axis=1)
    return (
        np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))),
        np.degrees(np.arctan2(across, ahead)),
        np.degrees(np.arctan2(to_east, to_north)) % 360.0,
    )


def attitude(truth: Mapping[str, Array], environment: Record) -> tuple[Array, Array, Array]:
    """Compute pitch, yaw and azimuth of the thrust along a flight, as they are drawn.

    Args:
        truth: columns of VehicleState.
        environment: record of dtype ENVIRONMENT.

    Returns:
        As :func:`thrust_angles`; nan without thrust, and yaw and azimuth of a thrust that points
        up.
    """
    pitch, yaw, azimuth = thrust_angles(
        truth["position"], truth["velocity"], truth["thrust_direction"], environment
    )
    for angle in (pitch, yaw, azimuth):
        angle[truth["thrust"] <= 0.0] = math.nan
    # azimuth of what points up is noise
    for angle in (yaw, azimuth):
        angle[pitch > _UPRIGHT_DEG] = math.nan
    return pitch, yaw, azimuth


def ground_track(time: Array, position: Array, earth: Earth) -> GroundTrack:
    """Compute the ground track on the rotating Earth.

    Unless the mission defines it, the inertial x axis points to longitude zero at mission time 0,
    as in the thesis.

    Args:
        time: mission elapsed time, shape (n,), s.
        position: inertial, shape (n, 3), m.
        earth: rotation model.
    """
    places = [earth.latitude_longitude(r, t) for t, r in zip(time, position, strict=True)]
    degrees = np.degrees(np.array(places).reshape(-1, 2))
    return GroundTrack(degrees[:, 0], degrees[:, 1])


def ground_range(track: GroundTrack, radius: float) -> Array:
    """Compute the length of a track on a sphere up to each point, shape (n,), m.

    Args:
        track: n points.
        radius: of the sphere, m.
    """
    latitude, longitude = np.radians(track.latitude_deg), np.radians(track.longitude_deg)
    steps = np.sin(0.5 * np.diff(latitude)) ** 2
    steps += np.cos(latitude[:-1]) * np.cos(latitude[1:]) * np.sin(0.5 * np.diff(longitude)) ** 2
    return radius * np.concatenate(([0.0], np.cumsum(2.0 * np.arcsin(np.sqrt(steps)))))


def impact_time(position: Array, velocity: Array, environment: Record) -> float:
    """Compute the time to impact if the thrust ended now, s.

    The fall is a Kepler arc without drag; the ground is at the mission's altitude zero.

    Args:
        position: inertial, shape (3,), m.
        velocity: inertial, shape (3,), m/s.
        environment: record of dtype ENVIRONMENT.

    Returns:
        nan without an impact: the perigee is above the ground, or the vehicle escapes.
    """
    span, _ = fall(tuple(position.tolist()), tuple(velocity.tolist()), environment)
    return float(span)


def impact_track(
    time: Array, position: Array, velocity: Array, environment: Record, earth: Earth
) -> GroundTrack:
    """Compute instantaneous impact points, for the thrust ending at each state.

    Args:
        time: mission elapsed time, shape (n,), s.
        position: inertial, shape (n, 3), m.
        velocity: inertial, shape (n, 3), m/s.
        environment: record of dtype ENVIRONMENT.
        earth: rotation during the fall.

    Returns:
        n points; nan without an impact.
    """
    places = []
    for t, r, v in zip(time, position, velocity, strict=True):
        span, down = fall(tuple(r.tolist()), tuple(v.tolist()), environment)
        if math.isnan(span):
            places.append((math.nan, math.nan))
            continue
        places.append(earth.latitude_longitude(down, float(t) + span))
    degrees = np.degrees(np.array(places).reshape(-1, 2))
    return GroundTrack(degrees[:, 0], degrees[:, 1])
