# SPDX-License-Identifier: Apache-2.0
"""Solver of small dense linear systems without LAPACK."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.jit import kernel

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@kernel
def factor(n: int, a: Array, pivots: Index) -> bool:
    """Factor ``a`` in place to LU with row exchanges; return False if it is singular."""
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        pivots[k] = best
        if not abs(a[best, k]) > 0.0:
            return False
        if best != k:
            for j in range(n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, n):
            a[i, k] *= inverse
            x = a[i, k]
            if x != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= x * a[k, j]
    return math.isfinite(a[n - 1, n - 1])


@kernel
def back_substitute(n: int, a: Array, pivots: Index, b: Array) -> None:
    """Solve with the factors of :func:`factor`; ``b`` is replaced by the solution."""
    for k in range(n):
        i = pivots[k]
        if i != k:
            b[k], b[i] = b[i], b[k]
    for i in range(n):
        total = b[i]
        for j in range(i):
            total -= a[i, j] * b[j]
        b[i] = total
    for i in range(n - 1, -1, -1):
        total = b[i]
        for j in range(i + 1, n):
            total -= a[i, j] * b[j]
        b[i] = total / a[i, i]
