# SPDX-License-Identifier: Apache-2.0
"""Build cubic splines as tables for the kernels.

SciPy has these splines, but its import takes longer than all other imports of a flight.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def monotone_slopes(x: Array, y: Array) -> Array:
    """Compute the slopes of the monotone cubic of Fritsch and Butland (1984).

    Args:
        x: increasing, shape (n,), n at least 3.
        y: shape (..., n).
    """
    width = np.diff(x)
    chord = np.diff(y) / width
    before, after = chord[..., :-1], chord[..., 1:]
    # weighted harmonic mean, the nearer chord with the larger weight; 0 at a turning point
    one, other = 2.0 * width[1:] + width[:-1], width[1:] + 2.0 * width[:-1]
    same = before * after > 0.0
    reciprocal = np.divide(one, before, out=np.zeros_like(before), where=same)
    reciprocal += np.divide(other, after, out=np.zeros_like(before), where=same)
    slope = np.zeros_like(y)
    np.divide(one + other, reciprocal, out=slope[..., 1:-1], where=same)
    for end, near, far in ((0, 0, 1), (-1, -1, -2)):
        first, second = chord[..., near], chord[..., far]
        # slope of the parabola through three points, limited to the sign of the data
        both = width[near] + width[far]
        steep = np.asarray(((width[near] + both) * first - width[near] * second) / both)
        steep[steep * first <= 0.0] = 0.0
        overshoots = (first * second < 0.0) & (np.abs(steep) > 3.0 * np.abs(first))
        slope[..., end] = np.where(overshoots, 3.0 * first, steep)
    return slope


def spline_slopes(x: Array, y: Array) -> Array:
    """Compute the slopes of the not-a-knot cubic spline (de Boor, ch. IV).

    Args:
        x: increasing, shape (n,), n at least 4.
        y: shape (n,).
    """
    width = np.diff(x)
    chord = np.diff(y) / width
    matrix = np.zeros((x.size, x.size))
    right = np.zeros(x.size)
    for k in range(1, x.size - 1):
        before, after = width[k - 1], width[k]
        matrix[k, k - 1 : k + 2] = after, 2.0 * (before + after), before
        right[k] = 3.0 * (after * chord[k - 1] + before * chord[k])
    for row, near, far in ((0, 0, 1), (-1, -1, -2)):
        both = width[near] + width[far]
        matrix[row, near], matrix[row, far] = width[far], both
        right[row] = (width[near] + 2.0 * both) * width[far] * chord[near]
        right[row] = (right[row] + width[near] ** 2 * chord[far]) / both
    return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)


def hermite_table(x: ArrayLike, y: ArrayLike, slope: ArrayLike) -> Array:
    """Build the table of cubics through nodes with given slopes, for one or several profiles.

    Args:
        x: increasing, shape (n,).
        y: shape (..., n).
        slope: shape (..., n).

    Returns:
        Shape (..., n, 5): x, then c0..c3 of the cubic in the distance from it; the last row has
        value and slope only.
    """
    place = np.asarray(x, dtype=np.float64)
    value = np.asarray(y, dtype=np.float64)
    s = np.asarray(slope, dtype=np.float64)
    table = np.zeros((*value.shape, 5))
    table[..., 0] = place
    table[..., 1] = value
    table[..., 2] = s
    width = np.diff(place)
    chord = np.diff(value) / width
    start, end = s[..., :-1], s[..., 1:]
    table[..., :-1, 3] = (3.0 * chord - 2.0 * start - end) / width
    table[..., :-1, 4] = (start + end - 2.0 * chord) / width**2
    return table
