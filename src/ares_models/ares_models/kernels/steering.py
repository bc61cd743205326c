# SPDX-License-Identifier: Apache-2.0
"""An answer of guidance: what it must be to be flown, where it goes out and comes in; copies."""

import math

from ares_models.arrays import MAX_ARCS, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import is_finite, load, norm, store

#: How far the length of a direction may be from 1.
UNIT_TOLERANCE = 1e-6


@kernel
def is_sound(steering: Record, jettisons: int) -> bool:
    """Whether an answer can be flown: finite, a unit vector, a jettison that there is.

    Args:
        steering: record STEERING.
        jettisons: how many the mission has.
    """
    direction = load(steering.direction)
    for k in range(MAX_ARCS):
        if math.isinf(steering.arc_end_times[k]):
            return False
    return (
        is_finite(direction)
        and abs(norm(direction) - 1.0) <= UNIT_TOLERANCE
        and is_finite(load(steering.direction_rate))
        and math.isfinite(steering.reference_time)
        and not math.isinf(steering.cutoff_time)
        and not math.isinf(steering.jettison_time)
        and -1 <= steering.jettison < jettisons
    )


@kernel
def copy_decision(source: Record, destination: Record) -> None:
    """Copy a record STEERING over another, but for the ends of the free arcs."""
    destination.reference_time = source.reference_time
    store(destination.direction, load(source.direction))
    store(destination.direction_rate, load(source.direction_rate))
    destination.cutoff_time = source.cutoff_time
    destination.jettison = source.jettison
    destination.jettison_time = source.jettison_time


@kernel
def copy_steering(source: Record, destination: Record) -> None:
    """Copy a record STEERING over another."""
    copy_decision(source, destination)
    for k in range(MAX_ARCS):
        destination.arc_end_times[k] = source.arc_end_times[k]
