"""The burn still to come, cut into segments of constant thrust and exhaust velocity.

A segment ends where the mission's arc ends or where something is dropped: a jettison
is the boundary of a "virtual stage" (Brand, Brown, Higgins 1974 for the multi-stage form).
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import MAX_SEGMENTS
from ares_guidance.kernels.engines import present_engine
from ares_models.arrays import BURN, HEATING_LIMIT, MISSION_TIME, Record
from ares_models.jit import kernel

#: L, J, S, Q, P, H.
Integrals = tuple[float, float, float, float, float, float]


@kernel
def stage_floor_mass(
    stage: int, arcs: NDArray[Any], jettisons: NDArray[Any], dropped: int
) -> float:
    """Mass of the stack when ``stage`` has burnt its propellant, kg.

    Args:
        stage: index of the stage.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        dropped: bit k set: jettison k is gone.
    """
    mass = 0.0
    for k in range(arcs.shape[0]):
        if arcs[k].stage == stage:
            mass = arcs[k].stack_mass - arcs[k].propellant
            break
    for j in range(jettisons.shape[0]):
        gone = (dropped >> j) & 1
        if gone == 0 and jettisons[j].stage < stage:
            mass += jettisons[j].mass
        elif gone == 1 and jettisons[j].stage >= stage:
            mass -= jettisons[j].mass
    return mass


@kernel
def plan_segments(nav: Record, arcs: NDArray[Any], jettisons: NDArray[Any], state: Record) -> None:
    """Fill ``state.segments`` from the present arc to the free burn.

    Heating jettisons stand at ``state.jettison_time``, the others where the mission puts
    them. Thrust transients enter as the time that an equal impulse at full thrust takes.

    Args:
        nav: record NAVIGATION.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        state: record GUIDANCE_STATE.
    """
    now = nav.time
    mass = nav.mass
    dropped = nav.jettisoned
    cursor = now
    count = 0
    stage_ignited = arcs[nav.arc].stage - 1
    ignition_time = nav.arc_start_time
    if arcs[nav.arc].kind == BURN:
        stage_ignited += 1
    for k in range(nav.arc):
        if arcs[k].stage == arcs[nav.arc].stage:
            if arcs[k].kind == BURN:
                stage_ignited = arcs[k].stage
            if stage_ignited == arcs[k].stage:
                ignition_time -= arcs[k].duration
    present = arcs[nav.arc].stage
    for k in range(nav.arc, arcs.shape[0]):
        arc = arcs[k]
        exhaust_velocity, mass_flow = present_engine(arc, present, state)
        begin = nav.arc_start_time if k == nav.arc else cursor
        if k > nav.arc and arc.begins_stage == 1:
            mass = arc.stack_mass
            for j in range(jettisons.shape[0]):
                if (dropped >> j) & 1 == 0 and jettisons[j].stage < arc.stage:
                    mass += jettisons[j].mass
        if arc.kind != BURN:
            cursor = max(cursor, begin + arc.duration)
            continue
        if arc.stage > stage_ignited:
            stage_ignited = arc.stage
            ignition_time = begin
        thrust_begin = max(cursor, begin + arc.start_loss)
        end = begin + arc.duration + arc.tail_gain
        cursor = thrust_begin
        unforeseen = k == nav.arc and arc.duration == 0.0
        if unforeseen or (mass_flow > arc.mass_flow and math.isfinite(end)):
            floor = stage_floor_mass(arc.stage, arcs, jettisons, dropped)
            empty = cursor + (mass - floor) / mass_flow
            end = empty if unforeseen else min(end, empty)
        while True:
            # the next drop within this burn
            drop = -1
            drop_time = end
            for j in range(jettisons.shape[0]):
                if (dropped >> j) & 1 == 1 or jettisons[j].stage > arc.stage:
                    continue
                if jettisons[j].criterion == HEATING_LIMIT:
                    time = state.jettison_time[j]
                elif jettisons[j].criterion == MISSION_TIME:
                    time = jettisons[j].value
                else:
                    time = ignition_time + jettisons[j].value
                if time < drop_time:
                    drop_time = time
                    drop = j
            segment_end = max(cursor, drop_time)
            if segment_end > cursor and count < MAX_SEGMENTS:
                segment = state.segments[count]
                segment.start = cursor - now
                segment.duration = segment_end - cursor
                segment.exhaust_velocity = exhaust_velocity
                segment.tau = mass / mass_flow
                segment.arc = k
                count += 1
                if math.isfinite(segment_end):
                    segment.capacity = segment.duration
                    ratio = segment.duration / segment.tau
                    segment.gain = -exhaust_velocity * math.log1p(-ratio)
                    mass -= mass_flow * (segment_end - cursor)
                else:
                    floor = stage_floor_mass(arc.stage, arcs, jettisons, dropped)
                    segment.capacity = (mass - floor) / mass_flow
                    segment.gain = math.inf
            cursor = segment_end
            if drop < 0:
                break
            mass -= jettisons[drop].mass
            dropped |= 1 << drop
        # the tail runs on while the next arc begins at the cut-off command
        cursor = end - arc.tail_gain if math.isfinite(end) else end
    state.segment_count = count


@kernel
def thrust_integrals(state: Record, until: float, cutoff: float) -> Integrals:
    """Thrust integrals over the planned segments, cut off early, from now to ``until``.

    With a the thrust acceleration and s the time from now:
    L = int a, J = int a s, H = int a s^2 (single integrals),
    S = int int a, Q = int int a s, P = int int a s^2 (double integrals, to ``until``).
    Closed form per segment, after Brand, Brown, Higgins (NTRS 19740004402).

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
        tb = min(until, cutoff) - segment.start
        ve = segment.exhaust_velocity
        tau = segment.tau
        t1 = segment.start
        if tb < segment.duration:
            li = -ve * math.log1p(-tb / tau)
        else:
            tb = segment.duration
            li = segment.gain
        ji = tau * li - ve * tb
        si = tb * li - ji
        half = 0.5 * ve * tb * tb
        qi = si * (tau + t1) - half
        pi = qi * (tau + t1) - half * (tb / 3.0 + t1)
        s_sum += si + l_sum * tb
        q_sum += qi + j_sum * tb
        p_sum += pi + h_sum * tb
        l_sum += li
        j_sum += ji + li * t1
        clock = t1 + tb
        h_sum = j_sum * clock - q_sum
    gap = until - clock
    if gap > 0.0:
        s_sum += l_sum * gap
        q_sum += j_sum * gap
        p_sum += h_sum * gap
    return l_sum, j_sum, s_sum, q_sum, p_sum, h_sum


@kernel
def burn_time_to_go(state: Record, delta_v: float) -> tuple[float, int]:
    """Time at which the planned burn has given ``delta_v``.

    Args:
        state: record GUIDANCE_STATE with planned segments.
        delta_v: m/s.

    Returns:
        time from now in s, and index of the segment in which it falls.
    """
    left = delta_v
    last = state.segment_count - 1
    for i in range(state.segment_count):
        segment = state.segments[i]
        if i < last and segment.gain < left:
            left -= segment.gain
            continue
        tb = -segment.tau * math.expm1(-max(left, 0.0) / segment.exhaust_velocity)
        return segment.start + tb, i
    return 0.0, last


@kernel
def note_tail_off(arc: Record, state: Record) -> None:
    """What follows the cut-off command: an impulse, and a drift until the thrust is gone.

    The target holds at the end of the thrust; until then the vehicle moves on.
    """
    state.tail_gain = arc.tail_gain
    state.tail_drift = 0.0
    if arc.tail_knots > 0:
        state.tail_drift = arc.tail_time[arc.tail_knots - 1] - arc.tail_gain
