# SPDX-License-Identifier: Apache-2.0
"""Arcs of a stage whose engines give less.

The plant flies them after a failure, guidance plans with them once it has found it.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, Record
from ares_models.jit import kernel
from ares_models.kernels.thrust_curve import flow_area


@kernel
def area_left(arc: Record, into: float) -> float:
    """Seconds of full mass flow that a burn of fixed length has left ``into`` s after its begin."""
    return flow_area(arc, arc.duration) - flow_area(arc, into)


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
        lasts: a burn of fixed length goes on until it has burnt what it should have, but for
            that of a solid motor, which ends with its table.
    """
    thrust, flow = ratios
    for i in range(k, arcs.shape[0]):
        arc = arcs[i]
        if arc.stage != arcs[k].stage:
            break
        if arc.kind != BURN:
            continue
        if lasts and math.isfinite(arc.duration) and arc.tabled == 0:
            left = area_left(arc, into if i == k else 0.0)
            arc.duration += left * (1.0 / flow - 1.0)
        arc.thrust *= thrust
        arc.mass_flow *= flow
        arc.exhaust_velocity *= thrust / flow
