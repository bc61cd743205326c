# SPDX-License-Identifier: Apache-2.0
"""Divide the flight into segments of smooth thrust, for given cut-off and jettison times.

The sequence is that of the plant. Arcs follow in flight order; a burn of fixed length ends by the
clock or at depletion, the last burn at the cut-off time, any other free arc at an unknown time.
Thrust-time curves at start and cut-off are linear between knots, so thrust and mass flow are linear
in time within a segment; in a burn throttled to constant acceleration both are proportional to the
mass. Each segment has the derivatives of its ends, mass and thrust by the unknown times.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    BURN,
    HEATING_LIMIT,
    MAX_ARCS,
    MAX_JETTISONS,
    SEQUENCE,
    TIME_AFTER_IGNITION,
    Record,
)
from ares_models.jit import allocating, kernel
from ares_models.kernels.sequence import (
    SAME_BURNOUT,
    SAME_TIME,
    aboard,
    arc_after_burnout,
    awaits_heating,
    drop_time,
    end_thrust,
    enter_arc,
    last_ignition,
    loaded_mass,
    tail_end_time,
)
from ares_optimizer.kernels.segments import (
    begin_segment,
    end_with,
    held_number,
    write_burnout,
    write_knots,
    write_throttle_end,
    write_thrust,
)

MAX_SEGMENTS = 256

#: Time of a heating jettison: at the limit with the interior condition, at the limit without it
#: (no jump of the costates), at the ignition of its stage, or at a given time.
HEATING_OPTIMAL = 0
HEATING_PASSIVE = 1
HEATING_IGNORED = 2
HEATING_TIMED = 3

#: First columns of the unknowns: lambda_v, lambda_r, cut-off time, time and pi of each heating
#: jettison, end of each free arc but the last, direction of each burn in held attitude.
COLUMN_CUTOFF = 6
COLUMN_JETTISON = 7

#: Most free arcs before the last.
MAX_FREE = 8
#: Most burns in held attitude.
MAX_HELD = 4
MAX_UNKNOWNS = COLUMN_JETTISON + 2 * MAX_JETTISONS + MAX_FREE + 3 * MAX_HELD
#: Most columns from COLUMN_CUTOFF on, the size of derivatives by the unknown times.
MAX_MOVES = MAX_UNKNOWNS - COLUMN_CUTOFF

SEGMENT = np.dtype(
    [
        ("start", np.float64),  # s, mission elapsed time
        ("end", np.float64),
        ("thrust", np.float64),  # N at the start, and its slope, N/s
        ("thrust_slope", np.float64),
        ("flow", np.float64),  # kg/s at the start, and its slope, kg/s2
        ("flow_slope", np.float64),
        ("fading", np.float64),  # 1/s: thrust, flow and mass fall as exp(-fading t); 0: they do not
        ("mass", np.float64),  # kg at the start, after drops
        ("end_heating", np.int64),  # heating unknown (0, 1, ...) at its end; -1: none
        ("end_arc", np.int64),  # free arc, not the last, that ends with it; -1: none
        ("arc", np.int64),
        ("held", np.int64),  # number, from 1 on, of the held burn; 0: none thrusts
        ("after_cutoff", np.int64),  # 1: tail-off after the cut-off command
        # derivatives by the unknown times
        ("moves", np.int64),  # 0: all of them are 0
        ("start_by", np.float64, (MAX_MOVES,)),
        ("end_by", np.float64, (MAX_MOVES,)),
        ("mass_by", np.float64, (MAX_MOVES,)),
        ("thrust_by", np.float64, (MAX_MOVES,)),
        ("flow_by", np.float64, (MAX_MOVES,)),
    ],
    align=True,
)

#: Begin of an arc, and propellant of its stage burnt before.
ARC_BEGIN = np.dtype(
    [
        ("time", np.float64),  # s
        ("used", np.float64),  # kg, propellant burnt before the arc
        ("mass", np.float64),  # kg
        ("time_by", np.float64, (MAX_MOVES,)),
        ("used_by", np.float64, (MAX_MOVES,)),
        ("used_end", np.float64),  # kg, propellant burnt up to the end of the arc
        ("used_end_by", np.float64, (MAX_MOVES,)),
    ],
    align=True,
)

#: State of the construction of a timetable.
LAYOUT = np.dtype(
    [
        ("sequence", SEQUENCE),
        ("moves", np.int64),  # number of derivatives in use
        ("now_by", np.float64, (MAX_MOVES,)),
        ("mass_by", np.float64, (MAX_MOVES,)),
        ("used_by", np.float64, (MAX_MOVES,)),
        ("arc_start_by", np.float64, (MAX_MOVES,)),
        ("tail_start_by", np.float64, (MAX_MOVES,)),
        ("ignition_by", np.float64, (MAX_MOVES,)),
        ("begins", ARC_BEGIN, (MAX_ARCS,)),
    ],
    align=True,
)


@kernel
def segment_mass(segment: Record, t: float) -> float:
    """Return the mass in a segment at time ``t``, kg."""
    s = t - segment.start
    if segment.fading > 0.0:
        return segment.mass * math.exp(-segment.fading * s)
    return segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)


@kernel
def segment_thrust(segment: Record, t: float) -> float:
    """Return the thrust in a segment at time ``t``, N."""
    s = t - segment.start
    if segment.fading > 0.0:
        return segment.thrust * math.exp(-segment.fading * s)
    return segment.thrust + s * segment.thrust_slope


@kernel
def segment_flow(segment: Record, t: float) -> float:
    """Return the mass flow in a segment at time ``t``, kg/s."""
    s = t - segment.start
    if segment.fading > 0.0:
        return segment.flow * math.exp(-segment.fading * s)
    return segment.flow + s * segment.flow_slope


@kernel
def heating_count(start: Record, jettisons: NDArray[Any], heating: int) -> int:
    """Return the number of heating jettisons to come whose time is unknown.

    Args:
        start: record NAVIGATION.
        jettisons: dtype JETTISON.
        heating: HEATING_*; only HEATING_OPTIMAL and HEATING_PASSIVE leave times unknown.
    """
    if heating > HEATING_PASSIVE:
        return 0
    count = 0
    for j in range(jettisons.shape[0]):
        if awaits_heating(jettisons, start.jettisoned, j):
            count += 1
    return count


@kernel
def ends_by_plan(k: int, arcs: NDArray[Any]) -> bool:
    """Return true if the end of arc ``k`` is an unknown other than the cut-off."""
    return k < arcs.shape[0] - 1 and arcs[k].duration == math.inf


@kernel
def free_count(start: Record, arcs: NDArray[Any]) -> int:
    """Return the number of free arcs before the last from the current arc on."""
    count = 0
    for k in range(start.arc, arcs.shape[0]):
        if ends_by_plan(k, arcs):
            count += 1
    return count


@kernel
def free_index(start: Record, arcs: NDArray[Any], k: int) -> int:
    """Return the index of arc ``k`` among the free arcs from the current arc on."""
    index = 0
    for i in range(start.arc, k):
        if ends_by_plan(i, arcs):
            index += 1
    return index


@kernel
def held_count(start: Record, arcs: NDArray[Any]) -> int:
    """Return the number of burns in held attitude from the current arc on."""
    count = 0
    for k in range(start.arc, arcs.shape[0]):
        count += arcs[k].held
    return count


@kernel
def begin_mass(start: Record, arcs: NDArray[Any]) -> float:
    """Return the mass at the start, kg: of the navigation state if positive, else the stack's."""
    if start.mass > 0.0:
        return start.mass
    return arcs[start.arc].stack_mass


@kernel
def propellant_used(
    start: Record, mass: float, arcs: NDArray[Any], jettisons: NDArray[Any]
) -> float:
    """Return the propellant of the current stage burnt before the start, kg.

    It is the loaded mass of the stack minus the mass.
    """
    full = loaded_mass(arcs[start.arc].stage, arcs, jettisons, start.jettisoned)
    return max(0.0, full - mass)


@kernel
def last_tail(start: Record, arcs: NDArray[Any]) -> tuple[int, float]:
    """Return the burn whose tail-off may run at the start, and its cut-off time, s.

    Returns:
        index of the arc, -1 if there is none, and the time.
    """
    end = start.arc_start_time
    for k in range(start.arc, 0, -1):
        if arcs[k].begins_stage == 1:
            break
        if arcs[k - 1].kind == BURN:
            return (k - 1 if arcs[k - 1].tail_knots > 0 else -1), end
        end -= arcs[k - 1].duration
    return -1, end


class Times(NamedTuple):
    """Hold the unknown times of a timetable.

    Attributes:
        heating: HEATING_*.
        jettisons: times of the heating jettisons to come, s, in the order of the file.
        ends: ends of the free arcs before the last, s, in flight order.
        cutoff: cut-off command, s.
    """

    heating: int
    jettisons: NDArray[np.float64]
    ends: NDArray[np.float64]
    cutoff: float


@kernel
def begin_sequence(
    start: Record, arcs: NDArray[Any], jettisons: NDArray[Any], sequence: Record
) -> None:
    """Set the sequence to the state at the start.

    Args:
        start: record NAVIGATION.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        sequence: record SEQUENCE. Changed.
    """
    sequence.time = start.time
    sequence.mass = begin_mass(start, arcs)
    sequence.jettisoned = start.jettisoned
    sequence.arc = start.arc
    sequence.arc_start_time = start.arc_start_time
    sequence.propellant_used = propellant_used(start, sequence.mass, arcs, jettisons)
    sequence.ignited_stage, sequence.ignition_time = last_ignition(
        start.arc, start.arc_start_time, arcs
    )
    sequence.tail_arc, sequence.tail_start_time = last_tail(start, arcs)
    sequence.inserted = 0


@kernel
def heating_index(start: Record, jettisons: NDArray[Any], j: int) -> int:
    """Return the index of jettison ``j`` among those with unknown times."""
    index = 0
    for i in range(j):
        if awaits_heating(jettisons, start.jettisoned, i):
            index += 1
    return index


@kernel
def due_time(
    start: Record, jettisons: NDArray[Any], j: int, times: Times, sequence: Record
) -> float:
    """Return the time, s, at which jettison ``j`` is due; inf: gone, or not determined."""
    if not aboard(sequence.jettisoned, j):
        return math.inf
    heating_time = sequence.time
    if jettisons[j].criterion == HEATING_LIMIT and times.heating != HEATING_IGNORED:
        heating_time = times.jettisons[heating_index(start, jettisons, j)]
    return drop_time(
        jettisons[j],
        sequence.ignited_stage,
        sequence.ignition_time,
        sequence.time,
        heating_time,
    )


@kernel
def arc_end(start: Record, arcs: NDArray[Any], times: Times, sequence: Record) -> float:
    """Return the end of the current arc, not the last, by the clock or by unknown, s."""
    k = sequence.arc
    if ends_by_plan(k, arcs):
        return times.ends[free_index(start, arcs, k)]
    return sequence.arc_start_time + arcs[k].duration


@kernel
def is_depleted(sequence: Record, arcs: NDArray[Any]) -> bool:
    """Return true if the current burn, of fixed length, has depleted its stage."""
    arc = arcs[sequence.arc]
    left = arc.propellant - sequence.propellant_used
    fixed = arc.kind == BURN and not ends_by_plan(sequence.arc, arcs)
    return fixed and left <= SAME_BURNOUT * arc.mass_flow


@kernel
def execute_events(
    start: Record, arcs: NDArray[Any], jettisons: NDArray[Any], times: Times, sequence: Record
) -> None:
    """Execute all events at the current instant, except the last cut-off.

    Args:
        start: record NAVIGATION.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        times: unknown times.
        sequence: record SEQUENCE. Changed.
    """
    now = sequence.time + SAME_TIME
    last = arcs.shape[0] - 1
    changed = True
    while changed:
        changed = False
        for j in range(jettisons.shape[0]):
            if sequence.inserted == 0 and due_time(start, jettisons, j, times, sequence) <= now:
                sequence.jettisoned |= 1 << j
                sequence.mass -= jettisons[j].mass
        if sequence.tail_arc >= 0 and tail_end_time(sequence, arcs) <= now:
            sequence.tail_arc = -1
        if sequence.arc == last:
            continue
        if arc_end(start, arcs, times, sequence) <= now:
            end_thrust(sequence, arcs)
            enter_arc(sequence, sequence.arc + 1, arcs, jettisons)
            changed = True
        elif is_depleted(sequence, arcs):
            following = min(arc_after_burnout(sequence.arc, arcs), last)
            enter_arc(sequence, following, arcs, jettisons)
            changed = True


@kernel
def store_begin(layout: Record, k: int) -> None:
    """Store the begin of arc ``k``, at the current instant."""
    begin = layout.begins[k]
    begin.time = layout.sequence.arc_start_time
    begin.used = layout.sequence.propellant_used
    begin.mass = layout.sequence.mass
    for c in range(layout.moves):
        layout.arc_start_by[c] = layout.now_by[c]
        begin.time_by[c] = layout.now_by[c]
        begin.used_by[c] = layout.used_by[c]


@kernel
def execute_events_with_derivatives(
    start: Record, arcs: NDArray[Any], jettisons: NDArray[Any], times: Times, layout: Record
) -> None:
    """Execute :func:`execute_events` and update the derivatives of all begins."""
    sequence = layout.sequence
    arc = sequence.arc
    tail = sequence.tail_arc
    ignited = sequence.ignited_stage
    execute_events(start, arcs, jettisons, times, sequence)
    for k in range(arc + 1, sequence.arc + 1):
        if arcs[k].begins_stage == 1:
            # the mass of the new stack does not depend on the unknowns
            for c in range(layout.moves):
                layout.mass_by[c] = 0.0
                layout.used_by[c] = 0.0
        store_begin(layout, k)
    if sequence.ignited_stage != ignited:
        for c in range(layout.moves):
            layout.ignition_by[c] = layout.now_by[c]
    if sequence.tail_arc != tail:
        for c in range(layout.moves):
            layout.tail_start_by[c] = layout.now_by[c]


@kernel
def end_by_unknown(segment: Record, at: float, moves: int, column: int) -> None:
    """End a segment at an unknown time, or at a given one if ``column`` is -1."""
    segment.end = at
    segment.end_heating = -1
    segment.end_arc = -1
    for c in range(moves):
        segment.end_by[c] = 0.0
    if column >= 0:
        segment.end_by[column - COLUMN_CUTOFF] = 1.0


@kernel
def write_arc_end(
    start: Record,
    arcs: NDArray[Any],
    drops: int,
    times: Times,
    layout: Record,
    segment: Record,
) -> None:
    """End a segment with its arc, not the last one, or at depletion of its stage.

    Args:
        start: record NAVIGATION.
        arcs: dtype ARC.
        drops: number of unknown jettison times.
        times: unknown times.
        layout: record LAYOUT.
        segment: record SEGMENT with its thrust. Changed.
    """
    sequence = layout.sequence
    moves = layout.moves
    k = sequence.arc
    arc = arcs[k]
    at = arc_end(start, arcs, times, sequence)
    if ends_by_plan(k, arcs):
        if at <= segment.end:
            column = COLUMN_JETTISON + 2 * drops + free_index(start, arcs, k)
            end_by_unknown(segment, at, moves, column)
            segment.end_arc = k
        return
    if at <= segment.end:
        end_with(segment, at, moves, layout.arc_start_by[:])
    if arc.kind == BURN:
        write_burnout(arc, layout, segment)


@kernel
def write_end(
    start: Record,
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    times: Times,
    layout: Record,
    segment: Record,
) -> None:
    """Write the end of a segment and its derivatives by the unknown times.

    Args:
        start: record NAVIGATION.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        times: unknown times.
        layout: record LAYOUT, at the begin of the segment.
        segment: record SEGMENT with its thrust. Changed.
    """
    sequence = layout.sequence
    moves = layout.moves
    end_by_unknown(segment, math.inf, moves, -1)
    write_knots(arcs, layout, segment)
    if sequence.inserted == 1:
        return
    drops = heating_count(start, jettisons, times.heating)
    if arcs[sequence.arc].kind == BURN:
        write_throttle_end(arcs[sequence.arc], layout, segment)
    last = sequence.arc == arcs.shape[0] - 1
    if not last:
        write_arc_end(start, arcs, drops, times, layout, segment)
    for j in range(jettisons.shape[0]):
        due = due_time(start, jettisons, j, times, sequence)
        if due >= segment.end:
            continue
        if jettisons[j].criterion == TIME_AFTER_IGNITION:
            end_with(segment, due, moves, layout.ignition_by[:])
        elif jettisons[j].criterion == HEATING_LIMIT and times.heating <= HEATING_PASSIVE:
            index = heating_index(start, jettisons, j)
            end_by_unknown(segment, due, moves, COLUMN_JETTISON + 2 * index)
            segment.end_heating = index
        else:
            end_by_unknown(segment, due, moves, -1)
    if last and times.cutoff < segment.end:
        end_by_unknown(segment, times.cutoff, moves, COLUMN_CUTOFF)


@kernel
def advance_over_segment(segment: Record, layout: Record) -> None:
    """Advance the construction to the end of a segment."""
    sequence = layout.sequence
    begin = layout.begins[sequence.arc]
    length = segment.end - sequence.time
    burnt = segment.mass - segment_mass(segment, segment.end)
    flow = segment_flow(segment, segment.end)
    part = -math.expm1(-segment.fading * length)
    sequence.mass -= burnt
    sequence.propellant_used += burnt
    sequence.time = segment.end
    begin.used_end = sequence.propellant_used
    for c in range(layout.moves):
        longer = segment.end_by[c] - segment.start_by[c]
        more = flow * longer + part * layout.mass_by[c]
        if segment.fading == 0.0:
            more += segment.flow_by[c] * length
        layout.mass_by[c] -= more
        layout.used_by[c] += more
        layout.now_by[c] = segment.end_by[c]
        begin.used_end_by[c] = layout.used_by[c]


@kernel
def fill_timetable(
    start: Record,
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    times: Times,
    segments: NDArray[Any],
    layout: Record,
) -> int:
    """Fill ``segments`` from the start to the end of the tail-off.

    Args:
        start: record NAVIGATION: time, mass (0: that of the stack), arc, arc_start_time,
            jettisoned.
        arcs: dtype ARC. The last one is the burn that ends at ``times.cutoff``.
        jettisons: dtype JETTISON.
        times: unknown times.
        segments: dtype SEGMENT, shape (MAX_SEGMENTS,), written.
        layout: record LAYOUT, written; on return it has the begins of all arcs.

    Returns:
        number of segments; 0 if there are too many, an arc ends before it begins, or a burn
        begins after the cut-off.
    """
    sequence = layout.sequence
    begin_sequence(start, arcs, jettisons, sequence)
    layout.moves = 1 + 2 * heating_count(start, jettisons, times.heating)
    layout.moves += free_count(start, arcs) + 3 * held_count(start, arcs)
    for c in range(layout.moves):
        layout.now_by[c] = 0.0
        layout.mass_by[c] = 0.0
        layout.used_by[c] = 0.0
        layout.arc_start_by[c] = 0.0
        layout.tail_start_by[c] = 0.0
        layout.ignition_by[c] = 0.0
    store_begin(layout, sequence.arc)
    for count in range(MAX_SEGMENTS + 1):
        execute_events_with_derivatives(start, arcs, jettisons, times, layout)
        due = sequence.arc == arcs.shape[0] - 1 and times.cutoff <= sequence.time + SAME_TIME
        if due and sequence.inserted == 0:
            if count == 0 or segments[count - 1].arc != sequence.arc:
                return 0
            sequence.inserted = 1
            end_thrust(sequence, arcs)
            for c in range(layout.moves):
                layout.tail_start_by[c] = layout.now_by[c]
        if sequence.inserted == 1 and sequence.tail_arc < 0:
            return count
        if count == MAX_SEGMENTS:
            return 0
        segment = segments[count]
        write_thrust(sequence, arcs, segment)
        segment.held = held_number(start, arcs, sequence)
        write_end(start, arcs, jettisons, times, layout, segment)
        if not segment.end < math.inf or segment.end < sequence.time:
            return 0
        begin_segment(layout, arcs, segment)
        advance_over_segment(segment, layout)
    return 0


@allocating
def build_timetable(
    start: Record,
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    times: Times,
    segments: NDArray[Any],
) -> int:
    """Fill ``segments`` as :func:`fill_timetable` does, with a layout of its own."""
    # a record does not keep its array alive: the array must live in this caller
    layout = np.zeros(1, LAYOUT)
    return fill_timetable(start, arcs, jettisons, times, segments, layout[0])
