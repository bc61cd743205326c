# SPDX-License-Identifier: Apache-2.0
"""Arcs of a stage with weakened engines.

The plant uses them after a failure, guidance after its detection.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, Record
from ares_models.jit import kernel
from ares_models.kernels.thrust_curve import flow_area


@kernel
def area_left(arc: Record, into: float) -> float:
    """Return the s of full mass flow that a burn of fixed length has left after ``into`` s."""
    return flow_area(arc, arc.duration) - flow_area(arc, into)


@kernel
def weaken_stage(
    arcs: NDArray[Any], k: int, into: float, ratios: tuple[float, float], lasts: bool
) -> None:
    """Weaken the engines of a stage in all its remaining burns.

    Args:
        arcs: dtype ARC. Changed.
        k: index of the present arc.
        into: time since its start, s.
        ratios: thrust and mass flow, after over before.
        lasts: a burn of fixed length lasts until it has burnt its planned propellant; not that
            of a solid motor, which ends with its table.
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
