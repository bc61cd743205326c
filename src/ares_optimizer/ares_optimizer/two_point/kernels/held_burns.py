# SPDX-License-Identifier: Apache-2.0
"""Optimise burns in held attitude: one free thrust direction w from ignition to cut-off.

Within such a burn the Hamiltonian has lambda_v . w in place of |lambda_v|. w is a control
parameter with |w| = 1, so the stationarity condition makes it parallel to I, the integral of
lambda_v T/m over the burn. That gives three unknowns and the equations w = I/|I| per burn.

Source: Bryson and Ho, *Applied Optimal Control*, section 2.8 for control parameters.
"""

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, dot, load, norm, scale


@kernel
def direction_column(held: int, work: Record) -> int:
    """Return the first column, and row, of the direction of held burn ``held``."""
    return work.first_held + 3 * (held - 1)


@kernel
def along_thrust(segment: Record, p: Vector, work: Record) -> tuple[float, Vector]:
    """Return the primer along the thrust, and the thrust direction, of a segment.

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
    """Return the derivative of lambda_v . w by column ``c`` through the direction w."""
    if segment.held == 0:
        return 0.0
    k = c - direction_column(segment.held, work)
    return p[k] if 0 <= k < 3 else 0.0


@kernel
def load_aims(count: int, unknowns: NDArray[np.float64], work: Record) -> None:
    """Copy the directions of ``count`` held burns into ``work`` and clear their integrals."""
    for k in range(count):
        column = direction_column(k + 1, work)
        for i in range(3):
            work.aims[k].direction[i] = unknowns[column + i]
            work.aims[k].primer_impulse[i] = 0.0


@kernel
def clear_impulse_tangents(count: int, work: Record) -> None:
    """Clear the tangents of the integrals of ``count`` held burns."""
    for k in range(count):
        for c in range(work.columns_wanted):
            for i in range(3):
                work.aims[k].primer_impulse_by[c, i] = 0.0


@kernel
def store_primer_thrust(p: Vector, thrust: float, work: Record) -> None:
    """Write lambda_v T/m at a stage, and its tangents, into ``work``.

    Args:
        p: primer at the stage; its tangents are in ``work.moved``.
        thrust: T/m, m/s2; its tangents are in ``work.thrust``.
        work: record WORK.
    """
    for i in range(3):
        work.primer_thrust[i] = thrust * p[i]
    for c in range(work.columns):
        for i in range(3):
            work.primer_thrust_by[c, i] = thrust * work.moved[c, 3 + i] + work.thrust[c] * p[i]


@kernel
def add_primer_impulse(aim: Record, weight: float, h: float, work: Record) -> None:
    """Add the contribution of a stage to the integral of lambda_v T/m."""
    for i in range(3):
        aim.primer_impulse[i] += h * weight * work.primer_thrust[i]
    for c in range(work.columns):
        longer = work.stretch[c]
        for i in range(3):
            by = h * work.primer_thrust_by[c, i] + longer * work.primer_thrust[i]
            aim.primer_impulse_by[c, i] += weight * by


@kernel
def aim_rows(count: int, work: Record) -> None:
    """Write residuals and Jacobian rows of ``count`` held directions after a flight."""
    for k in range(count):
        aim = work.aims[k]
        row = direction_column(k + 1, work)
        primer_impulse = load(aim.primer_impulse)
        size = norm(primer_impulse)
        # a burn of no length has no optimal direction
        inverse = 1.0 / size if size > 0.0 else 0.0
        u = scale(inverse, primer_impulse)
        for i in range(3):
            work.residual[row + i] = aim.direction[i] - u[i]
        for c in range(work.columns_wanted):
            by = load(aim.primer_impulse_by[c])
            along = dot(u, by)
            for i in range(3):
                same = 1.0 if c == row + i else 0.0
                work.jacobian[row + i, c] = same - inverse * (by[i] - along * u[i])
