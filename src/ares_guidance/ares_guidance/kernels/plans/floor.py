# SPDX-License-Identifier: Apache-2.0
"""Lowest altitude of an optimized trajectory: at its samples and all along its coasts."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.coast import STEP, coast
from ares_models.kernels.environment import altitude
from ares_models.kernels.vectors import Vector, load

#: Largest number of steps in a coast: a hundred days.
MOST_STEPS = 600_000
#: Reductions of the bracket of a lowest point by a third each: from 15 s to 0.1 ms.
CUTS = 30


@kernel
def lowest_between(r: Vector, v: Vector, span: float, environment: Record) -> float:
    """Find the lowest altitude, m, in a part of a coast with a single minimum.

    Args:
        r: position at its start, m.
        v: velocity at its start, m/s.
        span: its length, s.
        environment: record of dtype ENVIRONMENT.
    """
    low, high = 0.0, span
    for _ in range(CUTS):
        first = low + (high - low) / 3.0
        second = high - (high - low) / 3.0
        here, _ = coast(r, v, first, environment)
        there, _ = coast(r, v, second, environment)
        if altitude(here, environment) < altitude(there, environment):
            high = second
        else:
            low = first
    r, _ = coast(r, v, 0.5 * (low + high), environment)
    return altitude(r, environment)


@kernel
def lowest_of_coast(r: Vector, v: Vector, length: float, environment: Record) -> float:
    """Find the lowest altitude of a coast, m.

    Args:
        r: position at its start, m.
        v: velocity at its start, m/s.
        length: of the coast, s.
        environment: record of dtype ENVIRONMENT.
    """
    lowest = altitude(r, environment)
    steps = int(min(float(MOST_STEPS), math.ceil(max(length, 0.0) / STEP)))
    if not steps > 0:
        return lowest
    h = length / steps
    before_r, before_v = r, v
    falling = False
    last = lowest
    for _ in range(steps):
        next_r, next_v = coast(r, v, h, environment)
        here = altitude(next_r, environment)
        if falling and here >= last:
            # the minimum is in this step or the previous one
            lowest = min(lowest, lowest_between(before_r, before_v, 2.0 * h, environment))
        falling = here < last
        lowest = min(lowest, here)
        before_r, before_v = r, v
        r, v, last = next_r, next_v, here
    return lowest


@kernel
def lowest_altitude(
    begin: float,
    end: float,
    coasts: bool,
    time: NDArray[Any],
    position: NDArray[Any],
    velocity: NDArray[Any],
    environment: NDArray[Any],
) -> float:
    """Find the lowest altitude of an arc, m; inf if it has no sample.

    Args:
        begin: start of the arc, s.
        end: end of the arc, s.
        coasts: it is a coast, and is propagated from its first sample on.
        time: of the samples, s, increasing, shape (n,).
        position: of the samples, m, shape (n, 3).
        velocity: of the samples, m/s, shape (n, 3).
        environment: shape (1,), dtype ENVIRONMENT.
    """
    lowest = math.inf
    coasting = coasts
    for k in range(time.shape[0]):
        if begin <= time[k] <= end:
            lowest = min(lowest, altitude(load(position[k]), environment[0]))
            if coasting:
                r, v = load(position[k]), load(velocity[k])
                lowest = min(lowest, lowest_of_coast(r, v, end - time[k], environment[0]))
                coasting = False
    return lowest
