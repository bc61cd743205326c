"""What an answer of guidance must be to be flown; asked where it goes out and where it comes in."""

import math

from ares_models.arrays import MAX_ARCS, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import is_finite, load, norm

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
