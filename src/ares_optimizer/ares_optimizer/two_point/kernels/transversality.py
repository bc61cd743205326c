# SPDX-License-Identifier: Apache-2.0
"""Reduce the transversality conditions of any target, from the gradients of its rows.

The costate at cut-off must be a linear combination of the gradients of the rows. With G the
gradients, N an orthonormal basis of their null space and nu the multipliers, the condition
N^T lambda = 0 has the derivative N^T (d lambda - dG^T nu), exact at the root.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import load, norm
from ares_optimizer.kernels.terminal import terminal_rows

Array = NDArray[np.float64]

_DIFFERENCE = 3e-6  # of radius and speed, for second derivatives
_NEARLY_SPANNED = 0.3  # least remainder of a unit vector that counts as a new direction


@kernel
def _scale_state(work: Record) -> None:
    """Scale the costate at the end of thrust by radius and speed."""
    frame = work.terminal_frame
    state = work.state
    radius = norm(load(state))
    speed = norm(load(state[3:]))
    for k in range(3):
        frame.size[k] = radius
        frame.size[3 + k] = speed
        # lambda_r is the negative rate of the primer
        frame.costate[k] = -state[9 + k] * radius / speed
        frame.costate[3 + k] = state[6 + k]


@kernel
def _project_out(vector: Array, axis: Array) -> float:
    """Subtract the component along a unit vector; return that component."""
    along = 0.0
    for k in range(6):
        along += vector[k] * axis[k]
    for k in range(6):
        vector[k] -= along * axis[k]
    return along


@kernel
def _normalise(vector: Array) -> float:
    """Normalise a vector; return the length that it had."""
    square = 0.0
    for k in range(6):
        square += vector[k] * vector[k]
    size = math.sqrt(square)
    if size > 0.0:
        for k in range(6):
            vector[k] /= size
    return size


@kernel
def _span(rows: int, work: Record) -> None:
    """Compute an orthonormal basis of the scaled gradients, and the multipliers."""
    frame = work.terminal_frame
    for i in range(rows):
        for k in range(6):
            frame.span[i, k] = work.terminal_gradient[i, k] * frame.size[k]
        for j in range(i):
            frame.factor[i, j] = _project_out(frame.span[i], frame.span[j])
        frame.factor[i, i] = _normalise(frame.span[i])
    for j in range(rows - 1, -1, -1):
        total = 0.0
        for k in range(6):
            total += frame.span[j, k] * frame.costate[k]
        for i in range(j + 1, rows):
            total -= frame.factor[i, j] * frame.multipliers[i]
        frame.multipliers[j] = total / frame.factor[j, j] if frame.factor[j, j] > 0.0 else 0.0


@kernel
def _try_direction(f: int, rows: int, work: Record) -> float:
    """Orthonormalise ``free[f]`` against span and earlier rows; return its remainder."""
    frame = work.terminal_frame
    left = 1.0
    for _ in range(2):
        for j in range(rows):
            _project_out(frame.free[f], frame.span[j])
        for j in range(f):
            _project_out(frame.free[f], frame.free[j])
        left *= _normalise(frame.free[f])
    return left


@kernel
def _complete(rows: int, work: Record) -> None:
    """Complete the span by an orthonormal basis of its complement.

    The basis of the last call is turned as little as possible, so residuals change smoothly.
    """
    frame = work.terminal_frame
    for f in range(6 - rows):
        if _try_direction(f, rows, work) > _NEARLY_SPANNED:
            continue
        best = 0
        most = -1.0
        for axis in range(7):
            # the seventh pass sets the best axis
            chosen = best if axis == 6 else axis
            for k in range(6):
                frame.free[f, k] = 1.0 if k == chosen else 0.0
            left = _try_direction(f, rows, work)
            if left > most:
                most = left
                best = chosen


@kernel
def _second_derivatives(target: Record, mu: float, rows: int, work: Record) -> None:
    """Compute second derivatives of multipliers . rows by differences of exact gradients."""
    frame = work.terminal_frame
    state = work.state
    for k in range(6):
        middle = state[k]
        step = _DIFFERENCE * frame.size[k]
        state[k] = middle + step
        terminal_rows(target, mu, load(state), load(state[3:]), frame.values[:], frame.ahead[:])
        state[k] = middle - step
        terminal_rows(target, mu, load(state), load(state[3:]), frame.values[:], frame.behind[:])
        state[k] = middle
        for n in range(6):
            total = 0.0
            for i in range(rows):
                total += frame.multipliers[i] * (frame.ahead[i, n] - frame.behind[i, n])
            frame.hessian[n, k] = total / (2.0 * step)


@kernel
def transversality_rows(target: Record, mu: float, rows: int, work: Record) -> None:
    """Write residuals and Jacobian rows of the reduced transversality conditions.

    Args:
        target: record TARGET.
        mu: m3/s2.
        rows: number of rows of the target, whose gradients are in ``work.terminal_gradient``;
            the rows written follow these, without unit.
        work: record WORK with the end of the thrust in ``state`` and ``tangent``.
    """
    frame = work.terminal_frame
    tangent = work.tangent
    _scale_state(work)
    _span(rows, work)
    _complete(rows, work)
    if work.columns > 0:
        _second_derivatives(target, mu, rows, work)
    speed = frame.size[3]
    for f in range(6 - rows):
        row = 1 + rows + f
        total = 0.0
        for n in range(6):
            total += frame.free[f, n] * frame.costate[n]
        work.residual[row] = total
        for c in range(work.columns):
            total = 0.0
            for n in range(6):
                moved = -tangent[c, 9 + n] if n < 3 else tangent[c, 3 + n]
                moved /= speed
                for k in range(6):
                    moved -= frame.hessian[n, k] * tangent[c, k]
                total += frame.free[f, n] * frame.size[n] * moved
            work.jacobian[row, c] = total
