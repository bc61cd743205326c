# SPDX-License-Identifier: Apache-2.0
"""Fly the steering of the closed form in inverse-square gravity."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import allocating, kernel
from ares_optimizer.two_point.arrays import Gravity
from ares_optimizer.two_point.kernels.closed_form import closed_form_segment, correct_gravity
from ares_optimizer.two_point.kernels.shooting import part_of, step_count

Array = NDArray[np.float64]


@kernel
def _put_rates(piece: Record, mu: float, t: float, steered: Array, y: Array, rates: Array) -> None:
    """Compute the rates of position and velocity with thrust along the closed form's primer.

    Args:
        piece: record SEGMENT.
        mu: m3/s2.
        t: time from the start of the piece, s.
        steered: shape (12,), state of the closed form at the start of the piece.
        y: shape (6,).
        rates: shape (6,), written.
    """
    square = steered[0] * steered[0] + steered[1] * steered[1] + steered[2] * steered[2]
    omega = math.sqrt(mu / (square * math.sqrt(square)))
    a = (piece.thrust + piece.thrust_slope * t) / (
        piece.mass - t * (piece.flow + 0.5 * t * piece.flow_slope)
    )
    cos = math.cos(omega * t)
    sin = math.sin(omega * t) / omega
    p0 = steered[6] * cos + steered[9] * sin
    p1 = steered[7] * cos + steered[10] * sin
    p2 = steered[8] * cos + steered[11] * sin
    a /= math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
    square = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
    g = mu / (square * math.sqrt(square))
    rates[0] = y[3]
    rates[1] = y[4]
    rates[2] = y[5]
    rates[3] = a * p0 - g * y[0]
    rates[4] = a * p1 - g * y[1]
    rates[5] = a * p2 - g * y[2]


@allocating
def _fly_steered(piece: Record, mu: float, substep: float, steered: Array, exact: Array) -> None:
    """Integrate ``exact``, shape (6,), over a piece by Runge-Kutta 4."""
    h = piece.end - piece.start
    count = max(1, int(math.ceil(h / substep - 1e-9)))
    step = h / count
    y = np.empty(6)
    slope = np.zeros(6)
    total = np.empty(6)
    for k in range(count):
        for i in range(6):
            total[i] = 0.0
            slope[i] = 0.0
        for stage in range(4):
            part = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            weight = 1.0 / 6.0 if stage in (0, 3) else 1.0 / 3.0
            for i in range(6):
                y[i] = exact[i] + part * step * slope[i]
            _put_rates(piece, mu, (k + part) * step, steered, y, slope)
            for i in range(6):
                total[i] += weight * slope[i]
        for i in range(6):
            exact[i] += step * total[i]


@allocating
def exact_beside(
    segment: Record, arcs: int, gravity: Gravity, options: Record, exact: Array, work: Record
) -> None:
    """Fly one segment in closed form, and its steering in inverse-square gravity.

    The exact flight is integrated by Runge-Kutta 4 with thrust along the primer of the closed form
    at each instant.

    Args:
        segment: record SEGMENT.
        arcs: number of closed-form arcs.
        gravity: the field of the closed form.
        options: record OPTIONS of the closed form; ``step`` is the longest Runge-Kutta step, s.
        exact: shape (6,), changed: r, V of the exact flight.
        work: record WORK without tangents; its ``state``, that of the closed form, is changed.
    """
    state = work.state
    piece = work.segments[work.segments.shape[0] - 1]
    before = np.empty(12)
    steered = np.empty(12)
    for arc in range(arcs):
        part_of(segment, arc, arcs, piece)
        h = piece.end - piece.start
        for i in range(12):
            before[i] = state[i]
        if options.corrected == 1:
            square = state[0] * state[0] + state[1] * state[1] + state[2] * state[2]
            omega = math.sqrt(gravity.mu / (square * math.sqrt(square)))
            correct_gravity(gravity.mu, omega, h, work)
        for i in range(12):
            steered[i] = state[i]
            state[i] = before[i]
        closed_form_segment(piece, step_count(piece, h), gravity, options, work)
        _fly_steered(piece, gravity.mu, options.step, steered, exact)
