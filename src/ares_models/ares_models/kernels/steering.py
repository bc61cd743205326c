# SPDX-License-Identifier: Apache-2.0
"""Steering commands: check of their validity, copies."""

import math

from ares_models.arrays import MAX_ARCS, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, axpy, is_finite, load, norm, store, unit

#: Largest deviation of a direction's length from 1.
UNIT_TOLERANCE = 1e-6


@kernel
def is_sound(steering: Record, jettisons: int) -> bool:
    """Return whether a command can be flown: finite, a unit vector, an existing jettison.

    Args:
        steering: record STEERING.
        jettisons: number of the mission's jettisons.
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
def steered_direction(steering: Record, t: float) -> Vector:
    """Return the thrust direction of a command at a time, unit vector.

    Args:
        steering: record STEERING.
        t: mission elapsed time, s.
    """
    late = t - steering.reference_time
    return unit(axpy(late, load(steering.direction_rate), load(steering.direction)))


@kernel
def copy_decision(source: Record, destination: Record) -> None:
    """Copy a record STEERING to another, except the ends of the free arcs."""
    destination.reference_time = source.reference_time
    store(destination.direction, load(source.direction))
    store(destination.direction_rate, load(source.direction_rate))
    destination.cutoff_time = source.cutoff_time
    destination.jettison = source.jettison
    destination.jettison_time = source.jettison_time


@kernel
def copy_steering(source: Record, destination: Record) -> None:
    """Copy a record STEERING to another."""
    copy_decision(source, destination)
    for k in range(MAX_ARCS):
        destination.arc_end_times[k] = source.arc_end_times[k]
