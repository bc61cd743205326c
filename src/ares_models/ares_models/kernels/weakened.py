# SPDX-License-Identifier: Apache-2.0
"""Arcs of a stage with weakened engines.

The plant uses them after a failure, guidance after its detection. Boosters beside the engines burn
on as before.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, Record
from ares_models.jit import kernel
from ares_models.kernels.sequence import arc_after_burnout
from ares_models.kernels.thrust_curve import flow_area, start_length


@kernel
def area_left(arc: Record, into: float) -> float:
    """Return the s of full mass flow that a burn of fixed length has left after ``into`` s."""
    return flow_area(arc, arc.duration) - flow_area(arc, into)


@kernel
def weaken_core(arc: Record, ratios: tuple[float, float]) -> None:
    """Weaken the engines of an arc in which boosters burn beside them.

    Args:
        arc: record ARC. Changed.
        ratios: thrust and mass flow of these engines, after over before; 0: shut down.
    """
    full, full_flow = arc.thrust, arc.mass_flow
    lost, lost_flow = (1.0 - ratios[0]) * arc.core_thrust, (1.0 - ratios[1]) * arc.core_flow
    arc.thrust = full - lost
    arc.mass_flow = full_flow - lost_flow
    arc.exhaust_velocity = arc.thrust / arc.mass_flow
    length = start_length(arc)
    arc.start_loss = length - (full * (length - arc.start_loss) - lost * length) / arc.thrust
    for i in range(arc.start_knots):
        force = full * arc.start_fraction[i] - lost
        flow = full_flow * arc.start_flow[i] - lost_flow
        arc.start_fraction[i] = max(0.0, force) / arc.thrust
        arc.start_flow[i] = max(0.0, flow) / arc.mass_flow
    arc.core_thrust *= ratios[0]
    arc.core_flow *= ratios[1]


@kernel
def shut_down_core(arcs: NDArray[Any], k: int) -> None:
    """Shut down the engines of a stage in all its remaining burns; its boosters burn on.

    Args:
        arcs: dtype ARC. Changed.
        k: index of the present arc, in which boosters burn.
    """
    for i in range(k, arcs.shape[0]):
        arc = arcs[i]
        if arc.stage != arcs[k].stage:
            break
        if arc.core_thrust > 0.0:
            weaken_core(arc, (0.0, 0.0))
        elif arc.kind == BURN:
            arc.duration = 0.0


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
            of a solid motor, which ends with its table. What the engines leave while boosters burn
            beside them is burnt after the boosters.
    """
    thrust, flow = ratios
    unburnt = 0.0
    for i in range(k, arcs.shape[0]):
        arc = arcs[i]
        if arc.stage != arcs[k].stage:
            break
        if arc.kind != BURN:
            continue
        if arc.core_thrust > 0.0:
            unburnt += (1.0 - flow) * arc.core_flow * (arc.duration - (into if i == k else 0.0))
            weaken_core(arc, ratios)
            continue
        if lasts and math.isfinite(arc.duration) and arc.tabled == 0:
            left = area_left(arc, into if i == k else 0.0)
            arc.duration += left * (1.0 / flow - 1.0)
            if i + 1 == arc_after_burnout(k, arcs):
                arc.duration += unburnt / (flow * arc.mass_flow)
        arc.thrust *= thrust
        arc.mass_flow *= flow
        arc.exhaust_velocity *= thrust / flow
