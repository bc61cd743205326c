# SPDX-License-Identifier: Apache-2.0
"""Write the terminal conditions of the two-point problem: target and transversality."""

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import TARGET_ELEMENTS, TARGET_KEPLERIAN, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import (
    Vector,
    add,
    axpy,
    cross,
    dot,
    norm,
    scale,
    sub,
)
from ares_optimizer.kernels.terminal import SCALE, terminal_rows
from ares_optimizer.two_point.kernels.transversality import transversality_rows


@kernel
def _row(
    out: NDArray[np.float64],
    tangent: NDArray[np.float64],
    columns: int,
    by_r: Vector,
    by_v: Vector,
    by_p: Vector,
    by_q: Vector,
) -> None:
    """Write a row of the Jacobian from the gradients by the state."""
    for c in range(columns):
        out[c] = (
            by_r[0] * tangent[c, 0]
            + by_r[1] * tangent[c, 1]
            + by_r[2] * tangent[c, 2]
            + by_v[0] * tangent[c, 3]
            + by_v[1] * tangent[c, 4]
            + by_v[2] * tangent[c, 5]
            + by_p[0] * tangent[c, 6]
            + by_p[1] * tangent[c, 7]
            + by_p[2] * tangent[c, 8]
            + by_q[0] * tangent[c, 9]
            + by_q[1] * tangent[c, 10]
            + by_q[2] * tangent[c, 11]
        )


@kernel
def _turn(place: tuple[Vector, Vector], primer: tuple[Vector, Vector]) -> Vector:
    """Return C = r x lambda_r + V x lambda_v from (r, V) and (lambda_v, -lambda_r)."""
    r, v = place
    p, q = primer
    return sub(cross(v, p), cross(r, q))


@kernel
def _row_along_orbit(
    target: Record,
    mu: float,
    place: tuple[Vector, Vector],
    primer: tuple[Vector, Vector],
    row: int,
    work: Record,
) -> None:
    """Write the row of a Keplerian target: lambda_r . V + lambda_v . g = 0."""
    r, v = place
    p, q = primer
    radius = norm(r)
    k = mu / (radius * radius * radius)
    e = scale(1.0 / radius, r)
    size = target.semi_major_axis * target.semi_major_axis / mu
    ep = dot(e, p)
    work.residual[row] = size * (-dot(q, v) - k * radius * ep)
    _row(
        work.jacobian[row],
        work.tangent,
        work.columns,
        scale(size * k, axpy(3.0 * ep, e, scale(-1.0, p))),
        scale(-size, q),
        scale(-size * k, r),
        scale(-size, v),
    )


@kernel
def _downrange_row(
    target: Record,
    place: tuple[Vector, Vector],
    primer: tuple[Vector, Vector],
    row: int,
    work: Record,
) -> None:
    """Write the row of free downrange: h . C = 0."""
    r, v = place
    p, q = primer
    h = cross(r, v)
    turn = _turn(place, primer)
    size = 1.0 / (target.radius * target.speed * target.speed)
    work.residual[row] = size * dot(turn, h)
    by_r = sub(cross(v, turn), cross(q, h))
    by_v = add(cross(turn, r), cross(p, h))
    _row(
        work.jacobian[row],
        work.tangent,
        work.columns,
        scale(size, by_r),
        scale(size, by_v),
        scale(size, cross(h, v)),
        scale(-size, cross(h, r)),
    )


@kernel
def end_rows(target: Record, mu: float, work: Record) -> None:
    """Write residuals and Jacobian rows 1 to 6: terminal set and reduced transversality.

    A motion that the terminal set leaves free must not change the cost: lambda . dx = 0. For a
    rotation of the whole state about an axis e this is e . C = 0 with
    C = r x lambda_r + V x lambda_v. Free downrange: e along h; free node: e along the pole. On a
    Keplerian target the free motion is along the orbit: lambda_r . V + lambda_v . g = 0. For a
    target by elements the free motions follow from the gradients of its rows.

    Args:
        target: record TARGET.
        mu: m3/s2.
        work: record WORK with the end of the thrust in ``state`` and ``tangent``; rows of
            ``residual`` and ``jacobian`` are written, without unit.
    """
    state = work.state
    tangent = work.tangent
    columns = work.columns
    r = (state[0], state[1], state[2])
    v = (state[3], state[4], state[5])
    p = (state[6], state[7], state[8])
    q = (state[9], state[10], state[11])
    residual = work.residual
    jacobian = work.jacobian
    rows = terminal_rows(target, mu, r, v, work.terminal[:], work.terminal_gradient[:])
    for i in range(rows):
        residual[1 + i] = work.terminal[i] / SCALE
        for c in range(columns):
            total = 0.0
            for n in range(6):
                total += work.terminal_gradient[i, n] * tangent[c, n]
            jacobian[1 + i, c] = total / SCALE
    row = 1 + rows
    if target.kind == TARGET_ELEMENTS:
        transversality_rows(target, mu, rows, work)
        return
    if rows == 4:
        pole = (0.0, 0.0, 1.0)
        size = 1.0 / target.speed
        residual[row] = size * _turn((r, v), (p, q))[2]
        _row(
            jacobian[row],
            tangent,
            columns,
            scale(-size, cross(q, pole)),
            scale(size, cross(p, pole)),
            scale(size, cross(pole, v)),
            scale(-size, cross(pole, r)),
        )
        row += 1
    if target.kind == TARGET_KEPLERIAN:
        _row_along_orbit(target, mu, (r, v), (p, q), row, work)
    else:
        _downrange_row(target, (r, v), (p, q), row, work)
