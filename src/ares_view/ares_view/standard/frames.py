# SPDX-License-Identifier: Apache-2.0
"""Compute the frames of a flight and their transforms. No ROS."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ares_models.frames import Matrix, inertial_from_east_north_up, transformation

Array = NDArray[np.float64]
Quaternion = tuple[float, float, float, float]

#: Earth-centred, turns with the Earth; x through longitude zero, z through the north pole: the
#: root, which all flights share, as REP 105 has it.
EARTH = "earth"


@dataclass(frozen=True)
class Frames:
    """Name the frames of one flight.

    Attributes:
        prefix: of all frames except that of the Earth; ends with a slash, or is empty.
    """

    prefix: str = ""

    @property
    def eci(self) -> str:
        """Return the inertial frame: Earth-centred, fixed at the mission's epoch."""
        return f"{self.prefix}ares_eci"

    @property
    def start(self) -> str:
        """Return the launch frame: east, north, up on the ellipsoid below the first state."""
        return f"{self.prefix}ares_start"

    @property
    def vehicle(self) -> str:
        """Return the vehicle frame: x along the thrust, y left, z closest to up."""
        return f"{self.prefix}ares_vehicle"


#: Sine of the angle between thrust and orbit normal below which the normal defines no axis.
_ALONG = 1e-6


def vehicle_axes(position: ArrayLike, velocity: ArrayLike, direction: ArrayLike) -> Matrix:
    """Compute the rotation from vehicle axes to inertial axes.

    x is the thrust direction; y the component of the orbit normal r x v orthogonal to it, to the
    left of a pilot facing forward with the local vertical above; z = x cross y. Roll is not
    simulated.

    Args:
        position: inertial, m, shape (3,).
        velocity: inertial, m/s, shape (3,).
        direction: of the thrust, unit vector, shape (3,).

    Returns:
        Shape (3, 3), T_inertial_from_vehicle. If the thrust is along the normal, y is derived from
        the vertical instead.
    """
    r = np.asarray(position, dtype=np.float64)
    ahead = np.asarray(direction, dtype=np.float64)
    ahead = ahead / np.linalg.norm(ahead)
    normal = np.cross(r, np.asarray(velocity, dtype=np.float64))
    left = normal - (normal @ ahead) * ahead
    if not np.linalg.norm(left) > _ALONG * np.linalg.norm(normal):
        left = r - (r @ ahead) * ahead
    left = left / np.linalg.norm(left)
    return transformation([ahead, left, np.cross(ahead, left)])


def start_axes(latitude_deg: float, longitude_deg: float) -> Matrix:
    """Compute the rotation from east, north, up at a geodetic place to Earth-fixed axes, (3, 3)."""
    return inertial_from_east_north_up(math.radians(latitude_deg), math.radians(longitude_deg))


def quaternion(matrix: Matrix) -> Quaternion:
    """Convert a rotation matrix to a unit quaternion x, y, z, w with w >= 0.

    Args:
        matrix: orthonormal, shape (3, 3), T_parent_from_child.
    """
    m = matrix.tolist()
    # divide by the largest of the four components, for accuracy
    squares = [
        1.0 + m[0][0] - m[1][1] - m[2][2],
        1.0 - m[0][0] + m[1][1] - m[2][2],
        1.0 - m[0][0] - m[1][1] + m[2][2],
        1.0 + m[0][0] + m[1][1] + m[2][2],
    ]
    rows = (
        (squares[0], m[0][1] + m[1][0], m[0][2] + m[2][0], m[2][1] - m[1][2]),
        (m[0][1] + m[1][0], squares[1], m[1][2] + m[2][1], m[0][2] - m[2][0]),
        (m[0][2] + m[2][0], m[1][2] + m[2][1], squares[2], m[1][0] - m[0][1]),
        (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], squares[3]),
    )
    row = rows[squares.index(max(squares))]
    length = math.copysign(math.hypot(*row), row[3])
    x, y, z, w = (component / length for component in row)
    return x, y, z, w


def turn_rate(before: Array, after: Array, seconds: float) -> Array:
    """Compute the angular velocity that turns one direction into another, shape (3,), rad/s.

    Args:
        before: unit vector, shape (3,).
        after: unit vector, shape (3,).
        seconds: time between them, s; zero if there is no direction before.
    """
    axis = np.cross(before, after)
    sine = float(np.linalg.norm(axis))
    if not (seconds > 0.0 and sine > 0.0):
        return np.zeros(3)
    return axis * (math.atan2(sine, float(before @ after)) / (sine * seconds))
