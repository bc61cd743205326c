"""The flight cut into segments of smooth thrust, for given cut-off and jettison times.

The sequence is the plant's: arcs in flight order, a burn that is fixed ends by the clock or
when its propellant is gone, the last burn ends at the cut-off time; thrust-time curves at
start and cut-off are linear between knots, so that within a segment thrust and mass flow are
linear in time. A segment knows which unknown time moves its ends.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, MISSION_TIME, Record
from ares_models.jit import kernel

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

_SAME_TIME = 1e-9
_SAME_BURNOUT = 1e-6


@kernel
def _curve_value(times: NDArray[Any], fractions: NDArray[Any], knots: int, t: float) -> float:
    """Thrust fraction at ``t``, constant beyond the ends; a jump takes its later value."""
    if t < times[0]:
        return fractions[0]
    for i in range(1, knots):
        if t < times[i]:
            w = (t - times[i - 1]) / (times[i] - times[i - 1])
            return fractions[i - 1] + w * (fractions[i] - fractions[i - 1])
    return fractions[knots - 1]


@kernel
def _curve_slope(times: NDArray[Any], fractions: NDArray[Any], knots: int, t: float) -> float:
    """Slope of the thrust fraction just after ``t``, 1/s."""
    if t < times[0]:
        return 0.0
    for i in range(1, knots):
        if t < times[i]:
            return (fractions[i] - fractions[i - 1]) / (times[i] - times[i - 1])
    return 0.0


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
        if jettisons[j].criterion == HEATING_LIMIT and (start.jettisoned >> j) & 1 == 0:
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
    stage = arcs[start.arc].stage
    full = 0.0
    for k in range(arcs.shape[0]):
        if arcs[k].stage == stage:
            full = arcs[k].stack_mass
            break
    for j in range(jettisons.shape[0]):
        gone = (start.jettisoned >> j) & 1
        if gone == 0 and jettisons[j].stage < stage:
            full += jettisons[j].mass
        elif gone == 1 and jettisons[j].stage >= stage:
            full -= jettisons[j].mass
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


@kernel
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
    now = start.time
    mass = begin_mass(start, arcs)
    dropped = start.jettisoned
    k = start.arc
    arc_start = start.arc_start_time
    used = propellant_used(start, mass, arcs, jettisons)
    last = arcs.shape[0] - 1

    # which stages have ignited, and when the latest did
    ignited = arcs[k].stage - 1
    ignition = arc_start
    back = arc_start
    for i in range(k, -1, -1):
        if arcs[i].stage != arcs[k].stage:
            break
        if i < k:
            back -= arcs[i].duration
        if arcs[i].kind == BURN:
            ignited = arcs[k].stage
            ignition = back

    column = -1
    tail, tail_start = last_tail(start, arcs)
    inserted = False
    tail_mass_rate = 0.0
    count = 0
    for _ in range(16 * MAX_SEGMENTS):
        # everything that falls on this instant
        changed = True
        while changed:
            changed = False
            arc = arcs[k]
            unknown = 0
            for j in range(jettisons.shape[0]):
                is_heating = jettisons[j].criterion == HEATING_LIMIT
                if (start.jettisoned >> j) & 1 == 1:
                    continue
                index = unknown
                if is_heating:
                    unknown += 1
                if (dropped >> j) & 1 == 1 or ignited < jettisons[j].stage or inserted:
                    continue
                if is_heating:
                    due = now if heating == HEATING_IGNORED else heating_times[index]
                elif jettisons[j].criterion == MISSION_TIME:
                    due = jettisons[j].value
                elif ignited > jettisons[j].stage:
                    due = now
                else:
                    due = ignition + jettisons[j].value
                if due <= now + _SAME_TIME:
                    dropped |= 1 << j
                    mass -= jettisons[j].mass
            if tail >= 0:
                knots = arcs[tail].tail_knots
                if tail_start + arcs[tail].tail_time[knots - 1] <= now + _SAME_TIME:
                    tail = -1
            if inserted:
                if tail < 0:
                    return count
                break
            if k == last:
                if cutoff <= now + _SAME_TIME:
                    if count == 0 or segments[count - 1].end_column != COLUMN_CUTOFF:
                        return 0
                    inserted = True
                    column = COLUMN_CUTOFF
                    if arc.tail_knots > 0:
                        tail = k
                        tail_start = now
                    before = segments[count - 1]
                    length = before.end - before.start
                    tail_mass_rate = -(before.flow + before.flow_slope * length)
                    changed = True
                continue
            ends = arc_start + arc.duration <= now + _SAME_TIME
            spent = False
            if arc.kind == BURN and not ends:
                spent = arc.propellant - used <= _SAME_BURNOUT * arc.mass_flow
            if ends or spent:
                following = k + 1
                if spent:
                    while following < last and (
                        arcs[following].kind == BURN and arcs[following].stage == arc.stage
                    ):
                        following += 1
                elif arc.tail_knots > 0:
                    tail = k
                    tail_start = now
                k = following
                arc_start = now
                if arcs[k].begins_stage == 1:
                    tail = -1
                    used = 0.0
                    mass = arcs[k].stack_mass
                    for j in range(jettisons.shape[0]):
                        if (dropped >> j) & 1 == 0 and jettisons[j].stage < arcs[k].stage:
                            mass += jettisons[j].mass
                if arcs[k].kind == BURN and ignited < arcs[k].stage:
                    ignited = arcs[k].stage
                    ignition = now
                changed = True

        # thrust just after this instant
        arc = arcs[k]
        thrust = 0.0
        thrust_slope = 0.0
        flow = 0.0
        flow_slope = 0.0
        end = math.inf
        end_column = -1
        end_heating = -1
        if arc.kind == BURN and not inserted:
            fraction = 1.0
            slope = 0.0
            if arc.start_knots > 0:
                into = now - arc_start + _SAME_TIME
                fraction = _curve_value(arc.start_time, arc.start_fraction, arc.start_knots, into)
                slope = _curve_slope(arc.start_time, arc.start_fraction, arc.start_knots, into)
                for i in range(arc.start_knots):
                    knot = arc_start + arc.start_time[i]
                    if now + _SAME_TIME < knot < end:
                        end = knot
            thrust += fraction * arc.thrust
            thrust_slope += slope * arc.thrust
            flow += fraction * arc.mass_flow
            flow_slope += slope * arc.mass_flow
        if tail >= 0:
            other = arcs[tail]
            into = now - tail_start + _SAME_TIME
            fraction = _curve_value(other.tail_time, other.tail_fraction, other.tail_knots, into)
            slope = _curve_slope(other.tail_time, other.tail_fraction, other.tail_knots, into)
            for i in range(other.tail_knots):
                knot = tail_start + other.tail_time[i]
                if now + _SAME_TIME < knot < end:
                    end = knot
            thrust += fraction * other.thrust
            thrust_slope += slope * other.thrust
            flow += fraction * other.mass_flow
            flow_slope += slope * other.mass_flow
        if inserted:
            end_column = COLUMN_CUTOFF
        else:
            if k < last:
                by_clock = arc_start + arc.duration
                if by_clock < end:
                    end = by_clock
                if arc.kind == BURN and flow > 0.0 and flow_slope == 0.0:
                    burnout = now + (arc.propellant - used) / flow
                    if burnout < end - _SAME_BURNOUT:
                        end = burnout
            unknown = 0
            for j in range(jettisons.shape[0]):
                if (start.jettisoned >> j) & 1 == 1:
                    continue
                is_heating = jettisons[j].criterion == HEATING_LIMIT
                index = unknown
                if is_heating:
                    unknown += 1
                if (dropped >> j) & 1 == 1 or ignited < jettisons[j].stage:
                    continue
                if is_heating:
                    due = heating_times[index]
                elif jettisons[j].criterion == MISSION_TIME:
                    due = jettisons[j].value
                else:
                    due = ignition + jettisons[j].value
                if due < end:
                    end = due
                    end_column = -1
                    end_heating = -1
                    if is_heating and heating <= HEATING_PASSIVE:
                        end_heating = index
                        end_column = COLUMN_JETTISON + 2 * index
            if k == last and cutoff < end:
                end = cutoff
                end_column = COLUMN_CUTOFF
                end_heating = -1
        if count == MAX_SEGMENTS or not end < math.inf:
            return 0
        segment = segments[count]
        count += 1
        segment.start = now
        segment.end = end
        segment.thrust = thrust
        segment.thrust_slope = thrust_slope
        segment.flow = flow
        segment.flow_slope = flow_slope
        segment.mass = mass
        segment.start_column = column
        segment.end_column = end_column
        segment.end_heating = end_heating
        segment.arc = k
        segment.after_cutoff = 1 if inserted else 0
        segment.mass_by_start = 0.0
        segment.thrust_by_start = 0.0
        segment.flow_by_start = 0.0
        if inserted:
            # the tail moves with the cut-off; only the mass that it finds differs
            segment.mass_by_start = tail_mass_rate
        elif column >= 0:
            segment.mass_by_start = -flow
            segment.thrust_by_start = thrust_slope
            segment.flow_by_start = flow_slope
        length = end - now
        burnt = (flow + 0.5 * flow_slope * length) * length
        mass -= burnt
        used += burnt
        now = end
        column = end_column
    return 0


@kernel
def segment_mass(segment: Record, t: float) -> float:
    """Mass in a segment at time ``t``, kg."""
    s = t - segment.start
    return segment.mass - s * (segment.flow + 0.5 * s * segment.flow_slope)


@kernel
def segment_thrust(segment: Record, t: float) -> float:
    """Thrust in a segment at time ``t``, N."""
    return segment.thrust + (t - segment.start) * segment.thrust_slope
