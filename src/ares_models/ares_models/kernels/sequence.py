# SPDX-License-Identifier: Apache-2.0
"""Rules of a flight's sequence: burns, drops and remaining masses.

Plant, guidance and optimizer share them. Bit j of ``jettisoned`` is set when jettison j is done.
``sequence`` is a record with the fields of ``arrays.SEQUENCE``.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, MISSION_TIME, Record
from ares_models.jit import kernel
from ares_models.kernels.thrust_curve import start_knot_after, tail_knot_after, tail_length

#: Tolerance of simultaneous events, s.
SAME_TIME = 1e-9
#: Tolerance of simultaneous cut-off by the clock and depletion, s: the clock has priority.
SAME_BURNOUT = 1e-6


@kernel
def plans_arcs(arcs: NDArray[Any]) -> bool:
    """Return whether arcs before the last are free."""
    free = 0
    for k in range(arcs.shape[0] - 1):
        if math.isinf(arcs[k].duration):
            free += 1
    return free > 0


@kernel
def aboard(jettisoned: int, j: int) -> bool:
    """Return whether jettison ``j`` is still aboard."""
    return (jettisoned >> j) & 1 == 0


@kernel
def awaits_heating(jettisons: NDArray[Any], jettisoned: int, j: int) -> bool:
    """Return whether jettison ``j`` is aboard and waits for the heating."""
    return jettisons[j].criterion == HEATING_LIMIT and aboard(jettisoned, j)


@kernel
def mass_at_staging(arc: Record, jettisons: NDArray[Any], jettisoned: int) -> float:
    """Return the mass at the start of the stage of ``arc``, kg, with all overdue jettisons."""
    mass = arc.stack_mass
    for j in range(jettisons.shape[0]):
        if aboard(jettisoned, j) and jettisons[j].stage < arc.stage:
            mass += jettisons[j].mass
    return mass


@kernel
def loaded_mass(stage: int, arcs: NDArray[Any], jettisons: NDArray[Any], jettisoned: int) -> float:
    """Return the mass of the stack with ``stage`` full and the dropped jettisons gone, kg."""
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
    """Return the mass of the stack at depletion of the stage of ``arc``, kg."""
    return loaded_mass(arc.stage, arcs, jettisons, jettisoned) - arc.propellant


@kernel
def arc_after_burnout(k: int, arcs: NDArray[Any]) -> int:
    """Return the arc after depletion of the stage of arc ``k``; the number of arcs if none."""
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
    """Find the stage ignited last when arc ``k`` began at ``arc_start_time``, s.

    Returns:
        the stage, one less than that of the arc if that is not ignited yet, and the time, s.
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
    """Return the time of a jettison that is aboard, s; inf if it is not determined.

    Args:
        jettison: record JETTISON.
        ignited: stage ignited last.
        ignition_time: of that stage, s.
        now: s; returned for an overdue jettison.
        heating_time: time for a heating jettison, s.
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
    """Begin arc ``k``, with staging and ignition if due."""
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
    """Command the cut-off of the present arc and begin its tail-off."""
    if arcs[sequence.arc].tail_knots > 0:
        sequence.tail_arc = sequence.arc
        sequence.tail_start_time = sequence.time


@kernel
def tail_end_time(sequence: Record, arcs: NDArray[Any]) -> float:
    """Return the end of the present tail-off, s."""
    return sequence.tail_start_time + tail_length(arcs[sequence.tail_arc])


@kernel
def next_knot(sequence: Record, arcs: NDArray[Any], limit: float) -> float:
    """Return the next knot of the present thrust curves, s, at most ``limit``."""
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
