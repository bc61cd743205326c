# SPDX-License-Identifier: Apache-2.0
"""Frames of a flight: which there are, and how one lies in another. No ROS."""

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
    """Names of the frames of one flight.

    Attributes:
        prefix: of all but that of the Earth; ends with a slash, or is empty.
    """

    prefix: str = ""

    @property
    def eci(self) -> str:
        """Earth-centred, inertial, fixed at the mission's epoch."""
        return f"{self.prefix}ares_eci"

    @property
    def start(self) -> str:
        """East, north, up on the ellipsoid below the first state; fixed to the Earth."""
        return f"{self.prefix}ares_start"

    @property
    def vehicle(self) -> str:
        """In the vehicle: x along the thrust, y to the left, z up, as far as the thrust lets it."""
        return f"{self.prefix}ares_vehicle"


#: Sine of the angle between thrust and orbit normal below which that normal says nothing.
_ALONG = 1e-6


def vehicle_axes(position: ArrayLike, velocity: ArrayLike, direction: ArrayLike) -> Matrix:
    """Axes of the vehicle to inertial axes.

    x is the thrust direction; y the part of the orbit normal r x v that is normal to it, to the
    left of who flies with the local vertical above; z = x cross y. Roll is not simulated.

    Args:
        position: inertial, m, shape (3,).
        velocity: inertial, m/s, shape (3,).
        direction: of the thrust, unit vector, shape (3,).

    Returns:
        Shape (3, 3), T_inertial_from_vehicle. Thrust along the normal takes the vertical for it.
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
    """East, north, up at a geodetic place to Earth-fixed axes, shape (3, 3)."""
    return inertial_from_east_north_up(math.radians(latitude_deg), math.radians(longitude_deg))


def quaternion(matrix: Matrix) -> Quaternion:
    """The rotation of a matrix as x, y, z, w, of unit length; w is not negative.

    Args:
        matrix: orthonormal, shape (3, 3), T_parent_from_child.
    """
    m = matrix.tolist()
    # the largest of the four is found first, so that nothing is divided by a small number
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
    """Angular velocity that takes one direction into another, shape (3,), rad/s.

    Args:
        before: unit vector, shape (3,).
        after: unit vector, shape (3,).
        seconds: between them; zero if there is none before.
    """
    axis = np.cross(before, after)
    sine = float(np.linalg.norm(axis))
    if not (seconds > 0.0 and sine > 0.0):
        return np.zeros(3)
    return axis * (math.atan2(sine, float(before @ after)) / (sine * seconds))
