# SPDX-License-Identifier: Apache-2.0
"""Transformations between axes as 3x3 matrices (Eqs. 2.6 and 2.7).

A matrix ``T_b_from_a`` converts the components of a vector in axes a to those in axes b; its
columns are the unit vectors of a in components of b (Eq. 2.6). It is orthonormal, so its inverse is
the transpose (Eq. 2.7).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ares_models.kernels import states

Matrix = NDArray[np.float64]


def transformation(axes: Sequence[ArrayLike]) -> Matrix:
    """Build the transformation with three unit vectors as columns, Eq. 2.6.

    Args:
        axes: the unit vectors of the old axes, in components of the new ones; each (3,).

    Returns:
        Shape (3, 3), T_new_from_old.
    """
    return np.column_stack([np.asarray(axis, dtype=np.float64) for axis in axes])


def inverse(matrix: Matrix) -> Matrix:
    """Return the inverse of a transformation: its transpose, Eq. 2.7."""
    return matrix.T.copy()


def inertial_from_east_north_up(latitude: float, right_ascension: float) -> Matrix:
    """Build the transformation from east, north, up axes at a place to inertial axes.

    Args:
        latitude: geocentric, rad.
        right_ascension: from the inertial x axis, rad.

    Returns:
        Shape (3, 3).
    """
    return transformation(states.east_north_up(float(latitude), float(right_ascension)))


def earth_fixed_from_inertial(
    time: float, rotation_rate: float, angle_at_zero: float = 0.0
) -> Matrix:
    """Build the transformation from inertial axes to Earth-fixed axes, rotating about z.

    The thesis' inertial x axis passes through zero longitude at mission time 0
    (section 2.4), which is ``angle_at_zero`` = 0.

    Args:
        time: mission elapsed time, s.
        rotation_rate: rad/s.
        angle_at_zero: right ascension of zero longitude at time 0, rad.

    Returns:
        Shape (3, 3).
    """
    angle = angle_at_zero + rotation_rate * time
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
