"""Arcs of a stage whose engines give less.

The plant flies them after a failure, guidance plans with them once it has found it.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, Record
from ares_models.jit import kernel
from ares_models.kernels.thrust_curve import curve_area


@kernel
def area_left(arc: Record, into: float) -> float:
    """Seconds of full thrust that a burn of fixed length has left ``into`` s after its begin."""
    if arc.start_knots == 0:
        return arc.duration - into
    whole = curve_area(arc.start_time, arc.start_fraction, arc.start_knots, arc.duration)
    return whole - curve_area(arc.start_time, arc.start_fraction, arc.start_knots, into)


@kernel
def weaken_stage(
    arcs: NDArray[Any], k: int, into: float, ratios: tuple[float, float], lasts: bool
) -> None:
    """The engines of a stage give less from now on, in every burn that it has left.

    Args:
        arcs: dtype ARC. Changed.
        k: the present one.
        into: s since its begin.
        ratios: thrust and mass flow after over before.
        lasts: a burn of fixed length goes on until it has burnt what it should have.
    """
    thrust, flow = ratios
    for i in range(k, arcs.shape[0]):
        arc = arcs[i]
        if arc.stage != arcs[k].stage:
            break
        if arc.kind != BURN:
            continue
        if lasts and math.isfinite(arc.duration):
            left = area_left(arc, into if i == k else 0.0)
            arc.duration += left * (1.0 / flow - 1.0)
        arc.thrust *= thrust
        arc.mass_flow *= flow
        arc.exhaust_velocity *= thrust / flow
