# SPDX-License-Identifier: Apache-2.0
"""Compute Radau IIA points, differentiation and integration matrices."""

from functools import cache

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray

Array = NDArray[np.float64]


@cache
def radau(degree: int) -> tuple[Array, Array, Array]:
    """Return points, differentiation matrix and integration matrix on [0, 1].

    Args:
        degree: number of points d; the last one is 1.

    Returns:
        points, shape (d + 1,), 0 before the Radau points; derivatives at the d Radau points of
        the polynomials that are 1 at one point, shape (d, d + 1); integrals from 0 to each Radau
        point, shape (d, d), of which the last row is the quadrature weights.
    """
    # roots of P_d - P_{d-1}; 1 is one of them
    roots = (Legendre.basis(degree) - Legendre.basis(degree - 1)).roots()
    points = np.concatenate(([0.0], np.sort((np.real(roots) + 1.0) / 2.0)))
    points[-1] = 1.0
    count = degree + 1
    derivative = np.zeros((degree, count))
    for j in range(count):
        others = np.delete(points, j)
        polynomial = np.poly1d(others, r=True) / np.prod(points[j] - others)
        derivative[:, j] = polynomial.deriv()(points[1:])
    integral = np.linalg.inv(derivative[:, 1:]).astype(np.float64)
    return points.astype(np.float64), derivative, integral
