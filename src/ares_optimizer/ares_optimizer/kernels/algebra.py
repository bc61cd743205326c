# SPDX-License-Identifier: Apache-2.0
"""Solve dense linear algebra of a dozen unknowns, without calls into LAPACK."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.jit import allocating, kernel

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]

_TINY = 1e-13


@allocating
def full_qr(a: Array, q: Array, r: Array) -> float:
    """Factor ``a`` transposed by Householder QR, with the full Q.

    Args:
        a: shape (m, n), m <= n.
        q: shape (n, n), written: first m columns span the rows of ``a``, the others their
            null space.
        r: shape (m, m), written: upper triangle, a^T = Q [R; 0].

    Returns:
        smallest diagonal of R over the largest; 1 when there are no rows.
    """
    m, n = a.shape
    work = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            work[i, j] = a[j, i]
        for j in range(n):
            q[i, j] = 1.0 if i == j else 0.0
    v = np.empty(n)
    for k in range(m):
        size = 0.0
        for i in range(k, n):
            size += work[i, k] * work[i, k]
        size = math.sqrt(size)
        if size == 0.0:
            continue
        alpha = -size if work[k, k] > 0.0 else size
        square = 0.0
        for i in range(k, n):
            v[i] = work[i, k]
            if i == k:
                v[i] -= alpha
            square += v[i] * v[i]
        if square == 0.0:
            continue
        for j in range(k, m):
            s = 0.0
            for i in range(k, n):
                s += v[i] * work[i, j]
            s *= 2.0 / square
            for i in range(k, n):
                work[i, j] -= s * v[i]
        for i in range(n):
            s = 0.0
            for j in range(k, n):
                s += q[i, j] * v[j]
            s *= 2.0 / square
            for j in range(k, n):
                q[i, j] -= s * v[j]
    least = math.inf
    most = 0.0
    for k in range(m):
        for j in range(m):
            r[k, j] = work[k, j] if j >= k else 0.0
        least = min(least, abs(work[k, k]))
        most = max(most, abs(work[k, k]))
    if m == 0:
        return 1.0
    return least / most if most > 0.0 else 0.0


@kernel
def solve_lower_transposed(r: Array, b: Array, x: Array) -> None:
    """Solve R^T x = b; a vanishing pivot gives a zero component."""
    m = r.shape[0]
    floor = 0.0
    for i in range(m):
        floor = max(floor, abs(r[i, i]))
    floor *= _TINY
    for i in range(m):
        s = b[i]
        for j in range(i):
            s -= r[j, i] * x[j]
        x[i] = s / r[i, i] if abs(r[i, i]) > floor else 0.0


@kernel
def solve_upper(r: Array, b: Array, x: Array) -> None:
    """Solve R x = b; a vanishing pivot gives a zero component."""
    m = r.shape[0]
    floor = 0.0
    for i in range(m):
        floor = max(floor, abs(r[i, i]))
    floor *= _TINY
    for i in range(m - 1, -1, -1):
        s = b[i]
        for j in range(i + 1, m):
            s -= r[i, j] * x[j]
        x[i] = s / r[i, i] if abs(r[i, i]) > floor else 0.0


@kernel
def solve_symmetric(a: Array, b: Array, x: Array, size: int) -> None:
    """Solve with the leading part of a positive (semi-)definite matrix, by Cholesky.

    Args:
        a: shape (>= size, >= size); lower triangle is overwritten by the factor.
        b: right-hand side.
        x: written.
        size: leading part in use.
    """
    trace = 0.0
    for i in range(size):
        trace += a[i, i]
    floor = _TINY * trace
    for j in range(size):
        d = a[j, j]
        for k in range(j):
            d -= a[j, k] * a[j, k]
        d = math.sqrt(max(d, floor))
        a[j, j] = d
        for i in range(j + 1, size):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            a[i, j] = s / d
    for i in range(size):
        s = b[i]
        for k in range(i):
            s -= a[i, k] * x[k]
        x[i] = s / a[i, i]
    for i in range(size - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, size):
            s -= a[k, i] * x[k]
        x[i] = s / a[i, i]


@allocating
def dual_multipliers(m: Array, q: Array, x: Array) -> int:
    """Find x >= 0 with m x + q >= 0 and x . (m x + q) = 0.

    The dual of a small quadratic program, by an active set method after Lawson and Hanson, *Solving
    Least Squares Problems*, chapter 23.

    Args:
        m: shape (k, k), symmetric positive semi-definite.
        q: shape (k,).
        x: shape (k,), written.

    Returns:
        0; 1 without convergence, as the constraints contradict each other.
    """
    k = q.size
    active = np.zeros(k, np.bool_)
    part = np.empty((k, k))
    right = np.empty(k)
    trial = np.empty(k)
    index = np.empty(k, np.int64)
    x[:] = 0.0
    scale = 0.0
    for i in range(k):
        scale = max(scale, m[i, i])
    for _ in range(6 * k + 6):
        worst = _most_violated(m, q, x, active, scale)
        if worst < 0:
            return 0
        active[worst] = True
        while True:
            size = 0
            for i in range(k):
                if active[i]:
                    index[size] = i
                    size += 1
            if size == 0:
                break
            for a in range(size):
                right[a] = -q[index[a]]
                for b in range(size):
                    part[a, b] = m[index[a], index[b]]
            solve_symmetric(part, right, trial, size)
            if _step_to_trial(trial, index[:size], x, active):
                break
    return 1


@kernel
def _most_violated(m: Array, q: Array, x: Array, active: Flags, scale: float) -> int:
    """Return the inactive row with the most negative m x + q; -1 when all hold."""
    worst = -1
    least = -1e-12
    for i in range(q.size):
        if active[i] or m[i, i] <= 1e-14 * scale:
            continue
        s = q[i]
        for j in range(q.size):
            s += m[i, j] * x[j]
        if s < least:
            least = s
            worst = i
    return worst


@kernel
def _step_to_trial(trial: Array, index: Index, x: Array, active: Flags) -> bool:
    """Move x towards the trial while x stays >= 0; return true for a full step.

    Components that reach zero leave the active set.
    """
    step = 1.0
    out = -1
    for a in range(index.size):
        if trial[a] <= 0.0:
            i = index[a]
            ratio = x[i] / (x[i] - trial[a]) if x[i] > trial[a] else 0.0
            if ratio < step or out < 0:
                step = min(step, ratio)
                out = i
    for a in range(index.size):
        i = index[a]
        x[i] += step * (trial[a] - x[i])
    if out < 0:
        return True
    x[out] = 0.0
    active[out] = False
    for a in range(index.size):
        i = index[a]
        if x[i] <= 0.0:
            x[i] = 0.0
            active[i] = False
    return False


@allocating
def least_step(rows: Array, values: Array, damping: float, step: Array) -> None:
    """Compute the shortest step with rows @ step = -values, damped (Levenberg-Marquardt).

    Args:
        rows: shape (k, n).
        values: shape (k,).
        damping: added to the diagonal of rows rows^T, relative to its mean.
        step: shape (n,), written.
    """
    k, n = rows.shape
    x = np.empty(k)
    row_multipliers(rows, values, damping, x)
    for j in range(n):
        s = 0.0
        for a in range(k):
            s -= rows[a, j] * x[a]
        step[j] = s


@allocating
def row_multipliers(rows: Array, values: Array, damping: float, x: Array) -> None:
    """Solve (rows rows^T + damping) x = values.

    Args: as :func:`least_step`; ``x`` of shape (k,) is written.
    """
    k, n = rows.shape
    normal = np.empty((k, k))
    trace = 0.0
    for a in range(k):
        for b in range(a + 1):
            s = 0.0
            for j in range(n):
                s += rows[a, j] * rows[b, j]
            normal[a, b] = s
            normal[b, a] = s
        trace += normal[a, a]
    for a in range(k):
        normal[a, a] += damping * trace / k
    solve_symmetric(normal, values, x, k)
