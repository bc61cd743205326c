"""The flight cut into segments of smooth thrust, for given cut-off and jettison times.

The sequence is the plant's: arcs in flight order, a burn that is fixed ends by the clock or
when its propellant is gone, the last burn ends at the cut-off time; thrust-time curves at
start and cut-off are linear between knots, so that within a segment thrust and mass flow are
linear in time. A segment knows which unknown time moves its ends.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, SEQUENCE, Record
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
    next_knot,
    tail_end_time,
)
from ares_models.kernels.thrust_curve import curve_slope, curve_value

MAX_SEGMENTS = 64

#: What a heating jettison does: wait for the limit with the interior condition, wait for it
#: without (no jump), drop at the ignition of its stage, or drop at a given time.
HEATING_OPTIMAL = 0
HEATING_PASSIVE = 1
HEATING_IGNORED = 2
HEATING_TIMED = 3

#: First columns of the unknowns: lambda_v, lambda_r, cut-off time, then per heating
#: jettison its time and its pi.
COLUMN_CUTOFF = 6
COLUMN_JETTISON = 7

SEGMENT = np.dtype(
    [
        ("start", np.float64),  # s, mission elapsed time
        ("end", np.float64),
        ("thrust", np.float64),  # N at the start, and its slope, N/s
        ("thrust_slope", np.float64),
        ("flow", np.float64),  # kg/s at the start, and its slope, kg/s2
        ("flow_slope", np.float64),
        ("mass", np.float64),  # kg at the start, after drops
        ("start_column", np.int64),  # unknown that moves the start; -1: none
        ("end_column", np.int64),
        ("mass_by_start", np.float64),  # d mass / d start time, kg/s
        ("thrust_by_start", np.float64),
        ("flow_by_start", np.float64),
        ("end_heating", np.int64),  # which heating unknown ends it (0, 1, ...); -1: none
        ("arc", np.int64),
        ("after_cutoff", np.int64),  # 1: tail-off after the cut-off command
    ],
    align=True,
)


@kernel
def heating_count(start: Record, jettisons: NDArray[Any], heating: int) -> int:
    """Number of jettisons whose time is unknown: heating ones not done yet.

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
def begin_mass(start: Record, arcs: NDArray[Any]) -> float:
    """Mass at the start: the navigation state's, or the stack's if that is not positive."""
    if start.mass > 0.0:
        return start.mass
    return arcs[start.arc].stack_mass


@kernel
def propellant_used(
    start: Record, mass: float, arcs: NDArray[Any], jettisons: NDArray[Any]
) -> float:
    """Propellant that the present stage has burnt so far, kg: what its stack has lost."""
    full = loaded_mass(arcs[start.arc].stage, arcs, jettisons, start.jettisoned)
    return max(0.0, full - mass)


@kernel
def last_tail(start: Record, arcs: NDArray[Any]) -> tuple[int, float]:
    """Burn whose tail-off may still run in the coast after it, and its cut-off time, s.

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
    """The times that make a timetable.

    Attributes:
        heating: HEATING_*.
        jettisons: s, per heating jettison not done at the start, in the order of the file.
        cutoff: cut-off command, s.
    """

    heating: int
    jettisons: NDArray[np.float64]
    cutoff: float


@kernel
def begin_sequence(
    start: Record, arcs: NDArray[Any], jettisons: NDArray[Any], sequence: Record
) -> None:
    """Where the flight stands at the start.

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
    """Which of the unknown jettisons ``j`` is: 0, 1, ..."""
    index = 0
    for i in range(j):
        if awaits_heating(jettisons, start.jettisoned, i):
            index += 1
    return index


@kernel
def due_time(
    start: Record, jettisons: NDArray[Any], j: int, times: Times, sequence: Record
) -> float:
    """When jettison ``j`` is due, s; inf: gone, or not decided."""
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
def out_of_time(sequence: Record, arcs: NDArray[Any]) -> bool:
    """Whether the present arc ends now by the clock."""
    end = sequence.arc_start_time + arcs[sequence.arc].duration
    return end <= sequence.time + SAME_TIME


@kernel
def burnt_out(sequence: Record, arcs: NDArray[Any]) -> bool:
    """Whether the present burn has used up its stage's propellant."""
    arc = arcs[sequence.arc]
    left = arc.propellant - sequence.propellant_used
    return arc.kind == BURN and left <= SAME_BURNOUT * arc.mass_flow


@kernel
def pass_instant(
    start: Record, arcs: NDArray[Any], jettisons: NDArray[Any], times: Times, sequence: Record
) -> None:
    """Carry out everything that falls on the present instant but the last cut-off.

    Args:
        start: record NAVIGATION.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        times: unknown ones.
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
        if out_of_time(sequence, arcs):
            end_thrust(sequence, arcs)
            enter_arc(sequence, sequence.arc + 1, arcs, jettisons)
            changed = True
        elif burnt_out(sequence, arcs):
            following = min(arc_after_burnout(sequence.arc, arcs), last)
            enter_arc(sequence, following, arcs, jettisons)
            changed = True


@kernel
def write_thrust(sequence: Record, arcs: NDArray[Any], segment: Record) -> None:
    """Thrust and mass flow just after the present instant, with their slopes."""
    segment.thrust = 0.0
    segment.thrust_slope = 0.0
    segment.flow = 0.0
    segment.flow_slope = 0.0
    arc = arcs[sequence.arc]
    if arc.kind == BURN and sequence.inserted == 0:
        fraction = 1.0
        slope = 0.0
        if arc.start_knots > 0:
            into = sequence.time - sequence.arc_start_time + SAME_TIME
            fraction = curve_value(arc.start_time, arc.start_fraction, arc.start_knots, into)
            slope = curve_slope(arc.start_time, arc.start_fraction, arc.start_knots, into)
        segment.thrust += fraction * arc.thrust
        segment.thrust_slope += slope * arc.thrust
        segment.flow += fraction * arc.mass_flow
        segment.flow_slope += slope * arc.mass_flow
    if sequence.tail_arc >= 0:
        tail = arcs[sequence.tail_arc]
        into = sequence.time - sequence.tail_start_time + SAME_TIME
        fraction = curve_value(tail.tail_time, tail.tail_fraction, tail.tail_knots, into)
        slope = curve_slope(tail.tail_time, tail.tail_fraction, tail.tail_knots, into)
        segment.thrust += fraction * tail.thrust
        segment.thrust_slope += slope * tail.thrust
        segment.flow += fraction * tail.mass_flow
        segment.flow_slope += slope * tail.mass_flow


@kernel
def write_end(
    start: Record,
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    times: Times,
    sequence: Record,
    segment: Record,
) -> None:
    """When a segment ends, and which unknown moves its end.

    Args:
        start: record NAVIGATION.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        times: unknown ones.
        sequence: record SEQUENCE, at its begin.
        segment: record SEGMENT with its thrust. Changed.
    """
    segment.end = next_knot(sequence, arcs, math.inf)
    segment.end_column = -1
    segment.end_heating = -1
    if sequence.inserted == 1:
        segment.end_column = COLUMN_CUTOFF
        return
    arc = arcs[sequence.arc]
    if sequence.arc < arcs.shape[0] - 1:
        segment.end = min(segment.end, sequence.arc_start_time + arc.duration)
        if arc.kind == BURN and segment.flow > 0.0 and segment.flow_slope == 0.0:
            burnout = sequence.time + (arc.propellant - sequence.propellant_used) / segment.flow
            if burnout < segment.end - SAME_BURNOUT:
                segment.end = burnout
    for j in range(jettisons.shape[0]):
        due = due_time(start, jettisons, j, times, sequence)
        if due < segment.end:
            segment.end = due
            segment.end_column = -1
            segment.end_heating = -1
            if jettisons[j].criterion == HEATING_LIMIT and times.heating <= HEATING_PASSIVE:
                segment.end_heating = heating_index(start, jettisons, j)
                segment.end_column = COLUMN_JETTISON + 2 * segment.end_heating
    if sequence.arc == arcs.shape[0] - 1 and times.cutoff < segment.end:
        segment.end = times.cutoff
        segment.end_column = COLUMN_CUTOFF
        segment.end_heating = -1


@kernel
def begin_segment(
    sequence: Record, segments: NDArray[Any], count: int, tail_mass_rate: float
) -> None:
    """What a segment, its thrust known, has at its begin, and how that moves with an unknown.

    Args:
        sequence: record SEQUENCE.
        segments: dtype SEGMENT. The one at ``count`` is changed.
        count: number of the segments before.
        tail_mass_rate: d mass / d cut-off time in the tail-off, kg/s.
    """
    segment = segments[count]
    column = segments[count - 1].end_column if count > 0 else -1
    segment.start = sequence.time
    segment.mass = sequence.mass
    segment.start_column = column
    segment.arc = sequence.arc
    segment.after_cutoff = sequence.inserted
    segment.mass_by_start = 0.0
    segment.thrust_by_start = 0.0
    segment.flow_by_start = 0.0
    if sequence.inserted == 1:
        # the tail moves with the cut-off; only the mass that it finds differs
        segment.mass_by_start = tail_mass_rate
    elif column >= 0:
        segment.mass_by_start = -segment.flow
        segment.thrust_by_start = segment.thrust_slope
        segment.flow_by_start = segment.flow_slope


@kernel
def fill_timetable(
    start: Record,
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    times: Times,
    segments: NDArray[Any],
    room: NDArray[Any],
) -> int:
    """Fill ``segments``; arguments and result as of :func:`build_timetable`.

    Args:
        start: record NAVIGATION.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        times: unknown ones.
        segments: dtype SEGMENT. Changed.
        room: shape (1,), dtype SEQUENCE, to count in.
    """
    sequence = room[0]
    begin_sequence(start, arcs, jettisons, sequence)
    tail_mass_rate = 0.0
    for count in range(MAX_SEGMENTS + 1):
        pass_instant(start, arcs, jettisons, times, sequence)
        due = sequence.arc == arcs.shape[0] - 1 and times.cutoff <= sequence.time + SAME_TIME
        if due and sequence.inserted == 0:
            if count == 0 or segments[count - 1].end_column != COLUMN_CUTOFF:
                return 0
            before = segments[count - 1]
            length = before.end - before.start
            tail_mass_rate = -(before.flow + before.flow_slope * length)
            sequence.inserted = 1
            end_thrust(sequence, arcs)
        if sequence.inserted == 1 and sequence.tail_arc < 0:
            return count
        if count == MAX_SEGMENTS:
            return 0
        segment = segments[count]
        write_thrust(sequence, arcs, segment)
        write_end(start, arcs, jettisons, times, sequence, segment)
        if not segment.end < math.inf:
            return 0
        begin_segment(sequence, segments, count, tail_mass_rate)
        length = segment.end - sequence.time
        burnt = (segment.flow + 0.5 * segment.flow_slope * length) * length
        sequence.mass -= burnt
        sequence.propellant_used += burnt
        sequence.time = segment.end
    return 0


@allocating
def build_timetable(
    start: Record,
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    heating: int,
    heating_times: NDArray[np.float64],
    cutoff: float,
    segments: NDArray[Any],
) -> int:
    """Fill ``segments`` from the start to the end of the tail-off.

    Args:
        start: record NAVIGATION: time, mass (0: that of the stack), arc, arc_start_time,
            jettisoned.
        arcs: dtype ARC. The last one is the burn that ends at ``cutoff``.
        jettisons: dtype JETTISON.
        heating: HEATING_*.
        heating_times: s, per heating jettison not done yet, in the order of the file.
        cutoff: cut-off command, s.
        segments: dtype SEGMENT, shape (MAX_SEGMENTS,), written.

    Returns:
        number of segments; 0 if there are too many or a burn begins after ``cutoff``.
    """
    # a record does not keep its array alive: who allocates it lends it to another
    room = np.zeros(1, SEQUENCE)
    times = Times(heating, heating_times, cutoff)
    return fill_timetable(start, arcs, jettisons, times, segments, room)


@kernel
def segment_mass(segment: Record, t: float) -> float:
    """Mass in a segment at time ``t``, kg."""
    s = t - segment.start
    return segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)


@kernel
def segment_thrust(segment: Record, t: float) -> float:
    """Thrust in a segment at time ``t``, N."""
    return segment.thrust + (t - segment.start) * segment.thrust_slope
