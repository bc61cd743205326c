# SPDX-License-Identifier: Apache-2.0
"""What burns, what drops and what is left: the rules of a flight's sequence.

The plant flies by them, guidance plans by them, the optimizer counts by them. Bit j of
``jettisoned`` is set when jettison j is done. ``sequence`` is a record with the fields of
``arrays.SEQUENCE``.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, MISSION_TIME, Record
from ares_models.jit import kernel
from ares_models.kernels.thrust_curve import start_knot_after, tail_knot_after, tail_length

#: s; events closer than this fall on the same instant.
SAME_TIME = 1e-9
#: s; a burn as long as its propellant ends by the clock.
SAME_BURNOUT = 1e-6


@kernel
def plans_arcs(arcs: NDArray[Any]) -> bool:
    """Whether guidance decides the end of more than the last arc."""
    free = 0
    for k in range(arcs.shape[0] - 1):
        if math.isinf(arcs[k].duration):
            free += 1
    return free > 0


@kernel
def aboard(jettisoned: int, j: int) -> bool:
    """Whether jettison ``j`` is still to come."""
    return (jettisoned >> j) & 1 == 0


@kernel
def awaits_heating(jettisons: NDArray[Any], jettisoned: int, j: int) -> bool:
    """Whether jettison ``j`` is still to come and waits for the heating."""
    return jettisons[j].criterion == HEATING_LIMIT and aboard(jettisoned, j)


@kernel
def mass_at_staging(arc: Record, jettisons: NDArray[Any], jettisoned: int) -> float:
    """Mass with which ``arc`` begins its stage, kg: what should have gone before is carried."""
    mass = arc.stack_mass
    for j in range(jettisons.shape[0]):
        if aboard(jettisoned, j) and jettisons[j].stage < arc.stage:
            mass += jettisons[j].mass
    return mass


@kernel
def loaded_mass(stage: int, arcs: NDArray[Any], jettisons: NDArray[Any], jettisoned: int) -> float:
    """Mass of the stack with ``stage`` full and all gone that is, kg."""
    mass = 0.0
    for k in range(arcs.shape[0]):
        if arcs[k].stage == stage:
            mass = mass_at_staging(arcs[k], jettisons, jettisoned)
            break
    for j in range(jettisons.shape[0]):
        if not aboard(jettisoned, j) and jettisons[j].stage >= stage:
            mass -= jettisons[j].mass
    return mass


@kernel
def empty_mass(arc: Record, arcs: NDArray[Any], jettisons: NDArray[Any], jettisoned: int) -> float:
    """Mass of the stack when the stage of ``arc`` has burnt its propellant, kg."""
    return loaded_mass(arc.stage, arcs, jettisons, jettisoned) - arc.propellant


@kernel
def arc_after_burnout(k: int, arcs: NDArray[Any]) -> int:
    """Arc that follows when the stage of arc ``k`` is empty; the number of arcs: none does."""
    following = k + 1
    while (
        following < arcs.shape[0]
        and arcs[following].kind == BURN
        and arcs[following].stage == arcs[k].stage
    ):
        following += 1
    return following


@kernel
def last_ignition(k: int, arc_start_time: float, arcs: NDArray[Any]) -> tuple[int, float]:
    """Stage that was lit last when arc ``k`` began at ``arc_start_time``, and when, s.

    Returns:
        the stage, one less than that of the arc if it is not lit yet, and the time.
    """
    stage = arcs[k].stage
    ignited = stage - 1
    ignition_time = arc_start_time
    begin = arc_start_time
    for i in range(k, -1, -1):
        if arcs[i].stage != stage:
            break
        if i < k:
            begin -= arcs[i].duration
        if arcs[i].kind == BURN:
            ignited = stage
            ignition_time = begin
    return ignited, ignition_time


@kernel
def drop_time(
    jettison: Record, ignited: int, ignition_time: float, now: float, heating_time: float
) -> float:
    """When a jettison that is still to come is due, s; inf: not decided.

    Args:
        jettison: record JETTISON.
        ignited: stage that was lit last, and when:
        ignition_time: s.
        now: s; when it is overdue.
        heating_time: s; when the heating allows it, if it waits for that.
    """
    if ignited < jettison.stage:
        return math.inf
    if jettison.criterion == HEATING_LIMIT:
        return heating_time
    if jettison.criterion == MISSION_TIME:
        return jettison.value
    if ignited > jettison.stage:
        return now
    return ignition_time + jettison.value


@kernel
def enter_arc(sequence: Record, k: int, arcs: NDArray[Any], jettisons: NDArray[Any]) -> None:
    """Make arc ``k`` the present one: separation and ignition as it says."""
    arc = arcs[k]
    sequence.arc = k
    sequence.arc_start_time = sequence.time
    if arc.begins_stage == 1 and k > 0:
        sequence.tail_arc = -1
        sequence.propellant_used = 0.0
        sequence.mass = mass_at_staging(arc, jettisons, sequence.jettisoned)
    if arc.kind == BURN and sequence.ignited_stage < arc.stage:
        sequence.ignited_stage = arc.stage
        sequence.ignition_time = sequence.time


@kernel
def end_thrust(sequence: Record, arcs: NDArray[Any]) -> None:
    """Cut-off command to the present arc: its tail-off begins."""
    if arcs[sequence.arc].tail_knots > 0:
        sequence.tail_arc = sequence.arc
        sequence.tail_start_time = sequence.time


@kernel
def tail_end_time(sequence: Record, arcs: NDArray[Any]) -> float:
    """Time at which the running tail-off is over."""
    return sequence.tail_start_time + tail_length(arcs[sequence.tail_arc])


@kernel
def next_knot(sequence: Record, arcs: NDArray[Any], limit: float) -> float:
    """Next knot of a running thrust curve; ``limit`` if there is none before it."""
    now = sequence.time + SAME_TIME
    at = limit
    if sequence.tail_arc >= 0:
        begin = sequence.tail_start_time
        at = min(at, begin + tail_knot_after(arcs[sequence.tail_arc], now - begin))
    arc = arcs[sequence.arc]
    if sequence.inserted == 0 and arc.kind == BURN:
        begin = sequence.arc_start_time
        at = min(at, begin + start_knot_after(arc, now - begin))
    return at
