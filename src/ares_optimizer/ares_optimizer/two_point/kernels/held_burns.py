# SPDX-License-Identifier: Apache-2.0
"""Burns in held attitude: one thrust direction w from ignition to cut-off, free to choose.

Within such a burn the Hamiltonian has lambda_v . w in place of |lambda_v|. As w is a parameter,
its adjoint rises by (T/m) lambda_v over the burn and is 0 at both ends but for the length of w,
which is 1: w lies along the integral of lambda_v T/m. That gives three unknowns a burn and the
three equations w = I/|I|, which say the length and the sense of w as well.

Source: Bryson and Ho, *Applied Optimal Control*, section 2.8 for control parameters.
"""

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, dot, load, norm, scale


@kernel
def direction_column(held: int, work: Record) -> int:
    """First column of the direction of held burn number ``held``, and its first row."""
    return work.first_held + 3 * (held - 1)


@kernel
def along_thrust(segment: Record, p: Vector, work: Record) -> tuple[float, Vector]:
    """Primer along the thrust, and the thrust direction, of a segment.

    Args:
        segment: record SEGMENT.
        p: primer.
        work: record WORK with the directions of held burns.
    """
    if segment.held == 0:
        size = norm(p)
        return size, scale(1.0 / size, p)
    w = load(work.aims[segment.held - 1].direction)
    return dot(w, p), w


@kernel
def along_by_direction(c: int, segment: Record, p: Vector, work: Record) -> float:
    """How the primer along the thrust changes as column ``c`` turns a held direction."""
    if segment.held == 0:
        return 0.0
    k = c - direction_column(segment.held, work)
    return p[k] if 0 <= k < 3 else 0.0


@kernel
def load_aims(count: int, unknowns: NDArray[np.float64], work: Record) -> None:
    """Directions of ``count`` held burns into ``work``; nothing pulls on them yet."""
    for k in range(count):
        column = direction_column(k + 1, work)
        for i in range(3):
            work.aims[k].direction[i] = unknowns[column + i]
            work.aims[k].pull[i] = 0.0


@kernel
def clear_pull_tangents(count: int, work: Record) -> None:
    """Nothing pulls yet, whatever the unknowns are."""
    for k in range(count):
        for c in range(work.columns_wanted):
            for i in range(3):
                work.aims[k].pull_by[c, i] = 0.0


@kernel
def note_pull_rate(p: Vector, thrust: float, work: Record) -> None:
    """lambda_v T/m at a stage, and its tangents, into ``work``.

    Args:
        p: primer there; its tangents stand in ``work.moved``.
        thrust: T/m, m/s2; its tangents stand in ``work.thrust``.
        work: record WORK.
    """
    for i in range(3):
        work.pull_rate[i] = thrust * p[i]
    for c in range(work.columns):
        for i in range(3):
            work.pull_rate_by[c, i] = thrust * work.moved[c, 3 + i] + work.thrust[c] * p[i]


@kernel
def add_pull(aim: Record, weight: float, h: float, work: Record) -> None:
    """Add a stage's part to the pull on a direction."""
    for i in range(3):
        aim.pull[i] += h * weight * work.pull_rate[i]
    for c in range(work.columns):
        longer = work.stretch[c]
        for i in range(3):
            by = h * work.pull_rate_by[c, i] + longer * work.pull_rate[i]
            aim.pull_by[c, i] += weight * by


@kernel
def aim_rows(count: int, work: Record) -> None:
    """Residuals and Jacobian rows of ``count`` held directions, the flight just flown."""
    for k in range(count):
        aim = work.aims[k]
        row = direction_column(k + 1, work)
        pull = load(aim.pull)
        size = norm(pull)
        # a burn that comes to no thrust has no direction
        inverse = 1.0 / size if size > 0.0 else 0.0
        u = scale(inverse, pull)
        for i in range(3):
            work.residual[row + i] = aim.direction[i] - u[i]
        for c in range(work.columns_wanted):
            by = load(aim.pull_by[c])
            along = dot(u, by)
            for i in range(3):
                same = 1.0 if c == row + i else 0.0
                work.jacobian[row + i, c] = same - inverse * (by[i] - along * u[i])
