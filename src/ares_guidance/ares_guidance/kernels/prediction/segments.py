# SPDX-License-Identifier: Apache-2.0
"""The remaining burn as segments of constant thrust or constant acceleration.

A segment ends with the mission's arc, at a drop (a jettison bounds a "virtual stage"; Brand,
Brown, Higgins 1974 for the multi-stage form), and where a throttled engine reaches its
acceleration limit or its least thrust (Jaggers 1977: constant acceleration).
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import MAX_SEGMENTS, Onboard
from ares_guidance.kernels.monitors.engines import present_engine
from ares_models.arrays import BURN, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.sequence import (
    aboard,
    drop_time,
    empty_mass,
    last_ignition,
    mass_at_staging,
)
from ares_models.kernels.throttle import LEAST, LIMITED, mass_after, throttle_regime, time_to_burn
from ares_models.kernels.thrust_curve import curve_area, flow_area, start_length, tail_length

#: Number of constant-thrust segments that replace the rest of a solid motor's table.
TABLE_PIECES = 4
#: Least mass flow of a motor, as a fraction of full flow.
LEAST_FLOW = 1e-6
#: Length of a last burn that the target does not need, s.
SHORTEST_BURN = 0.05

#: Thrust integrals L, J, S, Q, P, H, see :func:`thrust_integrals`.
Integrals = tuple[float, float, float, float, float, float]


@kernel
def next_drop(
    mission: MissionRecords, state: Record, dropped: int, lit: tuple[int, float], now: float
) -> tuple[int, float]:
    """Return the next jettison and its time, s; -1 and inf if there is none.

    Args:
        mission: as guidance believes it.
        state: record GUIDANCE_STATE; its solution holds the times of the heating jettisons.
        dropped: bit j set: jettison j is gone.
        lit: stage ignited last, and its ignition time, s.
        now: time at which an overdue jettison drops, s.
    """
    first = -1
    at = math.inf
    for j in range(mission.jettisons.shape[0]):
        if not aboard(dropped, j):
            continue
        jettison = mission.jettisons[j]
        due = drop_time(jettison, lit[0], lit[1], now, state.solution.jettison_time[j])
        if due < at:
            first = j
            at = due
    return first, at


@kernel
def add_segment(
    onboard: Onboard, begin: float, end: float, mass: float, engine: tuple[float, float]
) -> Record:
    """Append a constant-thrust segment to the plan; if it is full, overwrite the last one.

    Args:
        onboard: state of guidance. Its segments are changed.
        begin: mission elapsed time, s.
        end: mission elapsed time, s; inf for the free burn.
        mass: at its start, kg.
        engine: exhaust velocity m/s and mass flow kg/s.

    Returns:
        the segment, record SEGMENT.
    """
    state = onboard.state
    count = min(state.segment_count, MAX_SEGMENTS - 1)
    exhaust_velocity, mass_flow = engine
    segment = state.segments[count]
    segment.start = begin - onboard.navigation.time
    segment.duration = end - begin
    segment.exhaust_velocity = exhaust_velocity
    segment.tau = mass / mass_flow
    segment.capacity = segment.duration
    segment.acceleration = 0.0
    segment.held_at = math.nan
    segment.gain = math.inf
    if math.isfinite(end):
        segment.gain = -exhaust_velocity * math.log1p(-segment.duration / segment.tau)
    state.segment_count = count + 1
    return segment


@kernel
def plan_regimes(
    onboard: Onboard,
    arc: Record,
    engine: tuple[float, float],
    span: tuple[float, float],
    mass: float,
    empty: float,
) -> float:
    """Append the segments of a burn between two drops: one, or up to three if throttled.

    Args:
        onboard: state of guidance. Its segments are changed.
        arc: record ARC.
        engine: exhaust velocity m/s and mass flow at full thrust kg/s.
        span: start and end, s; the end inf for the free burn.
        mass: at the start, kg.
        empty: mass at depletion of the stage, kg.

    Returns:
        mass at the end, kg; for the free burn the mass at the start of its last segment.
    """
    begin, last = span
    exhaust_velocity, flow = engine
    limit = arc.max_acceleration
    for _ in range(3):
        kind, length = throttle_regime(arc, engine, mass)
        end = min(last, begin + length)
        rate = flow * arc.min_throttle if kind == LEAST else flow
        segment = add_segment(onboard, begin, end, mass, (exhaust_velocity, rate))
        left = (mass - empty) / rate
        if kind == LIMITED:
            segment.acceleration = limit
            segment.tau = exhaust_velocity / limit
            segment.gain = limit * segment.duration
            left = segment.tau * math.log(mass / empty)
        if math.isinf(last):
            segment.capacity = min(segment.duration, left)
        if math.isinf(end):
            return mass
        mass = mass_after(arc, engine, kind, mass, end - begin)
        begin = end
        if not begin < last:
            break
    return mass


@kernel
def mean_engine(
    arc: Record, engine: tuple[float, float], begin: float, end: float
) -> tuple[float, float]:
    """Average exhaust velocity m/s and mass flow kg/s of a solid motor over a part of its table.

    Args:
        arc: record ARC.
        engine: of the whole table: exhaust velocity m/s, mass flow at full thrust kg/s.
        begin: s since the ignition command.
        end: s since the ignition command, more than ``begin``.
    """
    flow = flow_area(arc, end) - flow_area(arc, begin)
    times, fractions, knots = arc.start_time, arc.start_fraction, arc.start_knots
    thrust = curve_area(times, fractions, knots, end) - curve_area(times, fractions, knots, begin)
    # avoid a division by almost zero
    least = LEAST_FLOW * (end - begin)
    if flow < least or thrust < least:
        return engine[0], least * engine[1] / (end - begin)
    return engine[0] * thrust / flow, engine[1] * flow / (end - begin)


@kernel
def plan_burn(
    mission: MissionRecords,
    onboard: Onboard,
    k: int,
    span: tuple[float, float, float],
    stack: tuple[float, int],
    lit: tuple[int, float],
) -> tuple[float, int]:
    """Append the segments of one burn, split at each drop.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Its segments are changed.
        k: the arc.
        span: ignition command, start and end of the thrust, s; the end inf for the free burn.
        stack: mass at the start, kg, and bits of the dropped jettisons.
        lit: stage ignited last, and its ignition time, s.

    Returns:
        mass at the end, kg, and bits of the jettisons dropped by then.
    """
    nav = onboard.navigation
    state = onboard.state
    arc = mission.arcs[k]
    engine = present_engine(arc, mission.arcs[nav.arc].stage, state)
    first = state.segment_count
    ignition, cursor, end = span
    piece = (end - cursor) / TABLE_PIECES if arc.tabled == 1 else math.inf
    mass, dropped = stack
    while True:
        drop, drop_at = next_drop(mission, state, dropped, lit, cursor)
        if not drop_at < end:
            drop, drop_at = -1, end
        segment_end = max(cursor, drop_at)
        while segment_end > cursor:
            empty = empty_mass(arc, mission.arcs, mission.jettisons, dropped)
            part = engine
            part_end = segment_end
            if arc.tabled == 1:
                if segment_end - cursor > 1.5 * piece:
                    part_end = cursor + piece
                part = mean_engine(arc, engine, cursor - ignition, part_end - ignition)
            mass = plan_regimes(onboard, arc, part, (cursor, part_end), mass, empty)
            cursor = part_end
        if drop < 0:
            break
        mass -= mission.jettisons[drop].mass
        dropped |= 1 << drop
    for i in range(first, state.segment_count):
        state.segments[i].arc = k
        if arc.held == 1:
            state.segments[i].held_at = ignition - nav.time
    return mass, dropped


@kernel
def plan_segments(mission: MissionRecords, onboard: Onboard) -> None:
    """Fill ``state.segments`` from the present arc to the free burn.

    Heating jettisons take their times from the solution, the others from the mission. A thrust
    transient is replaced by full thrust for the time of an equal impulse.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Its segments are changed.
    """
    nav = onboard.navigation
    state = onboard.state
    arcs = mission.arcs
    mass = nav.mass
    dropped = nav.jettisoned
    cursor = nav.time
    lit = last_ignition(nav.arc, nav.arc_start_time, arcs)
    state.segment_count = 0
    for k in range(nav.arc, arcs.shape[0]):
        arc = arcs[k]
        begin = nav.arc_start_time if k == nav.arc else cursor
        if k > nav.arc and arc.begins_stage == 1:
            mass = mass_at_staging(arc, mission.jettisons, dropped)
        if arc.kind != BURN:
            cursor = max(cursor, begin + arc.duration)
            continue
        if arc.stage > lit[0]:
            lit = arc.stage, begin
        end = begin + arc.duration + arc.tail_gain
        if arc.tabled == 1:
            end = begin + start_length(arc)
            if k == arcs.shape[0] - 1:
                end = max(end, cursor + SHORTEST_BURN)
        else:
            cursor = max(cursor, begin + arc.start_loss)
        ve, mass_flow = present_engine(arc, arcs[nav.arc].stage, state)
        unforeseen = k == nav.arc and arc.duration == 0.0
        if unforeseen or (mass_flow > arc.mass_flow and math.isfinite(end)):
            left = mass - empty_mass(arc, arcs, mission.jettisons, dropped)
            empty = cursor + left / mass_flow
            if math.isfinite(arc.max_acceleration):
                empty = cursor + time_to_burn(arc, (ve, mass_flow), mass, left)
            end = empty if unforeseen else min(end, empty)
        mass, dropped = plan_burn(mission, onboard, k, (begin, cursor, end), (mass, dropped), lit)
        # the next arc begins at the cut-off command, during the tail-off
        cursor = end - arc.tail_gain if math.isfinite(end) else end


@kernel
def segment_integrals(segment: Record, tb: float) -> Integrals:
    """Compute the thrust integrals of one segment over its first ``tb`` s, up to that time.

    Args:
        segment: record SEGMENT.
        tb: s.

    Returns:
        (L, J, S, Q, P, H) as in :func:`thrust_integrals`, but J relative to the segment's start;
        H only for a segment with held direction, else 0.
    """
    t1 = segment.start
    if segment.acceleration > 0.0:
        a = segment.acceleration
        li = a * tb
        si = ji = 0.5 * li * tb
        local = si * tb / 3.0
        qi = local + si * t1
        pi = 0.5 * local * tb + t1 * (2.0 * local + t1 * si)
    else:
        ve = segment.exhaust_velocity
        tau = segment.tau
        li = segment.gain
        if tb < segment.duration:
            li = -ve * math.log1p(-tb / tau)
        ji = tau * li - ve * tb
        si = tb * li - ji
        half = 0.5 * ve * tb * tb
        qi = si * (tau + t1) - half
        pi = qi * (tau + t1) - half * (tb / 3.0 + t1)
    at = segment.held_at
    if math.isnan(at):
        return li, ji, si, qi, pi, 0.0
    return li, li * (at - t1), si, si * at, si * at * at, li * at * at


@kernel
def thrust_integrals(state: Record, until: float, cutoff: float) -> Integrals:
    """Compute the thrust integrals over the planned segments up to a cut-off.

    With a the thrust acceleration and s the time from now:
    L = int a, J = int a s, H = int a s^2 (single integrals),
    S = int int a, Q = int int a s, P = int int a s^2 (double integrals, to ``until``).
    Closed form per segment, after Brand, Brown, Higgins (NTRS 19740004402). In a segment with
    held direction s is the time that the direction is taken from.

    Args:
        state: record GUIDANCE_STATE with planned segments.
        until: s from now.
        cutoff: end of all thrust, s from now.

    Returns:
        (L, J, S, Q, P, H) in m/s, m, m, m s, m s^2, m s.
    """
    l_sum = 0.0
    j_sum = 0.0
    s_sum = 0.0
    q_sum = 0.0
    p_sum = 0.0
    h_sum = 0.0
    clock = 0.0
    held = False
    for i in range(state.segment_count):
        segment = state.segments[i]
        if segment.start >= min(until, cutoff):
            break
        gap = segment.start - clock
        if gap > 0.0:
            s_sum += l_sum * gap
            q_sum += j_sum * gap
            p_sum += h_sum * gap
            clock = segment.start
        tb = min(min(until, cutoff) - segment.start, segment.duration)
        t1 = segment.start
        li, ji, si, qi, pi, hi = segment_integrals(segment, tb)
        s_sum += si + l_sum * tb
        q_sum += qi + j_sum * tb
        p_sum += pi + h_sum * tb
        l_sum += li
        j_sum += ji + li * t1
        clock = t1 + tb
        if not math.isnan(segment.held_at):
            held = True
            h_sum += hi
        elif held:
            h_sum += (ji + li * t1) * clock - qi
        else:
            h_sum = j_sum * clock - q_sum
    gap = until - clock
    if gap > 0.0:
        s_sum += l_sum * gap
        q_sum += j_sum * gap
        p_sum += h_sum * gap
    return l_sum, j_sum, s_sum, q_sum, p_sum, h_sum


@kernel
def time_to_gain(segment: Record, delta_v: float) -> float:
    """Return the time, s, in which a segment of unlimited length gives ``delta_v``, m/s."""
    if segment.acceleration > 0.0:
        return delta_v / segment.acceleration
    return -segment.tau * math.expm1(-delta_v / segment.exhaust_velocity)


@kernel
def gain_within(segment: Record, t: float) -> float:
    """Return the delta-V, m/s, of the first ``t`` s of a segment."""
    if segment.acceleration > 0.0:
        return segment.acceleration * t
    return -segment.exhaust_velocity * math.log1p(-t / segment.tau)


@kernel
def acceleration_at(segment: Record, t: float) -> float:
    """Return the thrust acceleration, m/s2, ``t`` s after the start of a segment."""
    if segment.acceleration > 0.0:
        return segment.acceleration
    return segment.exhaust_velocity / (segment.tau - t)


@kernel
def direction_time(segment: Record, t: float) -> float:
    """Return the time, s from now, that gives the thrust direction of a segment at ``t``."""
    return t if math.isnan(segment.held_at) else segment.held_at


@kernel
def burn_time_to_go(state: Record, delta_v: float) -> tuple[float, int]:
    """Find the time at which the planned burn has given ``delta_v``.

    Args:
        state: record GUIDANCE_STATE with planned segments.
        delta_v: m/s.

    Returns:
        time from now, s, and index of its segment.
    """
    left = delta_v
    last = state.segment_count - 1
    for i in range(state.segment_count):
        segment = state.segments[i]
        if i < last and segment.gain < left:
            left -= segment.gain
            continue
        tb = time_to_gain(segment, max(left, 0.0))
        return segment.start + tb, i
    return 0.0, last


@kernel
def least_time_to_go(arcs: NDArray[Any], nav: Record, state: Record) -> float:
    """Return the least time to go, s, at which the last arc has reached its shortest length.

    The arcs before it are flown in full. A burn of fixed length ends by the clock.

    Args:
        arcs: dtype ARC.
        nav: record NAVIGATION.
        state: record GUIDANCE_STATE; before the last arc its segments must be planned.
    """
    last = arcs.shape[0] - 1
    arc = arcs[last]
    shortest = arc.shortest if arc.shortest < arc.longest else 0.0
    if nav.arc == last:
        return nav.arc_start_time + shortest - nav.time + arc.tail_gain
    for i in range(state.segment_count):
        if state.segments[i].arc == last:
            lost = 0.0 if arc.tabled == 1 else arc.start_loss
            begin = state.segments[i].start - lost
            return begin + max(shortest, lost, SHORTEST_BURN) + arc.tail_gain
    return 0.0


@kernel
def note_tail_off(arc: Record, state: Record) -> None:
    """Write the effect of the tail-off: its impulse in s of full thrust, and the drift after it.

    The target is to be met at the end of the tail-off.
    """
    state.solution.tail_gain = arc.tail_gain
    state.solution.tail_drift = 0.0
    if arc.tail_knots > 0:
        state.solution.tail_drift = tail_length(arc) - arc.tail_gain
