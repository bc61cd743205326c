# SPDX-License-Identifier: Apache-2.0
"""Write begin, thrust and end of a segment, with derivatives by the unknown times."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, Record
from ares_models.jit import kernel
from ares_models.kernels.sequence import SAME_BURNOUT, SAME_TIME
from ares_models.kernels.thrust_curve import (
    curve_slope,
    curve_value,
    start_knot_after,
    tail_knot_after,
)

#: Relative tolerance of masses at the limits of throttling.
SAME_MASS = 1e-12


@kernel
def throttle(arc: Record, mass: float) -> tuple[float, float]:
    """Return the throttle of a burn at a mass, kg, and the rate at which it falls, 1/s."""
    if not arc.max_acceleration < math.inf:
        return 1.0, 0.0
    limit = arc.thrust / arc.max_acceleration
    # at a limit, take the side after it
    mass *= 1.0 - SAME_MASS
    if mass > limit:
        return 1.0, 0.0
    if mass > arc.min_throttle * limit:
        return mass / limit, arc.max_acceleration / arc.exhaust_velocity
    return arc.min_throttle, 0.0


@kernel
def write_throttle_end(arc: Record, layout: Record, segment: Record) -> None:
    """End a segment where throttling in proportion to the mass begins or ends.

    Args:
        arc: arc of the segment.
        layout: record LAYOUT.
        segment: record SEGMENT with its thrust. Changed.
    """
    if not arc.max_acceleration < math.inf:
        return
    sequence = layout.sequence
    limit = arc.thrust / arc.max_acceleration
    if segment.fading > 0.0:
        limit *= arc.min_throttle
        if limit <= 0.0:
            return
        at = sequence.time + math.log(sequence.mass / limit) / segment.fading
        rate = sequence.mass * segment.fading
    elif sequence.mass > limit:
        at = sequence.time + (sequence.mass - limit) / segment.flow
        rate = segment.flow
    else:
        return
    if at < segment.end:
        end_with(segment, at, layout.moves, layout.now_by[:])
        for c in range(layout.moves):
            segment.end_by[c] += layout.mass_by[c] / rate


@kernel
def write_burnout(arc: Record, layout: Record, segment: Record) -> None:
    """End a segment at the depletion of its stage, unless it ends before.

    Args:
        arc: arc of the segment, a burn of fixed length.
        layout: record LAYOUT.
        segment: record SEGMENT with its thrust. Changed.
    """
    sequence = layout.sequence
    left = arc.propellant - sequence.propellant_used
    if segment.fading > 0.0:
        part = left / sequence.mass
        if not part < 1.0:
            return
        length = -math.log1p(-part) / segment.fading
        rate = segment.fading * (sequence.mass - left)
    elif segment.flow > 0.0 and segment.flow_slope == 0.0:
        length = left / segment.flow
        part = 0.0
        rate = segment.flow
    else:
        return
    at = sequence.time + length
    if at < segment.end - SAME_BURNOUT:
        end_with(segment, at, layout.moves, layout.now_by[:])
        for c in range(layout.moves):
            segment.end_by[c] -= (layout.used_by[c] + part * layout.mass_by[c]) / rate


@kernel
def write_thrust(sequence: Record, arcs: NDArray[Any], segment: Record) -> None:
    """Write thrust and mass flow just after the current instant, with their slopes."""
    segment.thrust = 0.0
    segment.thrust_slope = 0.0
    segment.flow = 0.0
    segment.flow_slope = 0.0
    segment.fading = 0.0
    arc = arcs[sequence.arc]
    if arc.kind == BURN and sequence.inserted == 0:
        fraction, segment.fading = throttle(arc, sequence.mass)
        flow = fraction
        if arc.start_knots > 0:
            into = sequence.time - sequence.arc_start_time + SAME_TIME
            times, knots = arc.start_time, arc.start_knots
            fraction = curve_value(times, arc.start_fraction, knots, into)
            flow = curve_value(times, arc.start_flow, knots, into)
            slope = curve_slope(times, arc.start_fraction, knots, into)
            segment.thrust_slope += slope * arc.thrust
            segment.flow_slope += curve_slope(times, arc.start_flow, knots, into) * arc.mass_flow
        segment.thrust += fraction * arc.thrust
        segment.flow += flow * arc.mass_flow
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
def end_with(segment: Record, at: float, moves: int, source: NDArray[np.float64]) -> None:
    """End a segment at ``at``, s, with the derivatives ``source``."""
    segment.end = at
    segment.end_heating = -1
    segment.end_arc = -1
    for c in range(moves):
        segment.end_by[c] = source[c]


@kernel
def write_knots(arcs: NDArray[Any], layout: Record, segment: Record) -> None:
    """End a segment at the next knot of a running thrust curve, if there is one."""
    sequence = layout.sequence
    moves = layout.moves
    now = sequence.time + SAME_TIME
    if sequence.tail_arc >= 0:
        begin = sequence.tail_start_time
        at = begin + tail_knot_after(arcs[sequence.tail_arc], now - begin)
        if at < segment.end:
            end_with(segment, at, moves, layout.tail_start_by[:])
    arc = arcs[sequence.arc]
    if sequence.inserted == 0 and arc.kind == BURN:
        begin = sequence.arc_start_time
        at = begin + start_knot_after(arc, now - begin)
        if at < segment.end:
            end_with(segment, at, moves, layout.arc_start_by[:])


@kernel
def held_number(start: Record, arcs: NDArray[Any], sequence: Record) -> int:
    """Return the number of the held burn that thrusts: 1, 2, ...; 0: none.

    Args:
        start: record NAVIGATION.
        arcs: dtype ARC.
        sequence: record SEQUENCE.
    """
    k = sequence.arc if sequence.inserted == 0 else -1
    if sequence.tail_arc >= 0:
        k = sequence.tail_arc
    if k < start.arc or arcs[k].held == 0:
        return 0
    number = 0
    for i in range(start.arc, k + 1):
        number += arcs[i].held
    return number


@kernel
def begin_segment(layout: Record, arcs: NDArray[Any], segment: Record) -> None:
    """Write the begin of a segment and its derivatives by the unknown times.

    Args:
        layout: record LAYOUT.
        arcs: dtype ARC.
        segment: record SEGMENT with thrust and end. Changed.
    """
    sequence = layout.sequence
    segment.start = sequence.time
    segment.mass = sequence.mass
    segment.arc = sequence.arc
    segment.after_cutoff = sequence.inserted
    segment.moves = 0
    tail_thrust = 0.0
    tail_flow = 0.0
    if sequence.tail_arc >= 0:
        tail = arcs[sequence.tail_arc]
        into = sequence.time - sequence.tail_start_time + SAME_TIME
        slope = curve_slope(tail.tail_time, tail.tail_fraction, tail.tail_knots, into)
        tail_thrust = slope * tail.thrust
        tail_flow = slope * tail.mass_flow
    for c in range(layout.moves):
        segment.start_by[c] = layout.now_by[c]
        segment.mass_by[c] = layout.mass_by[c]
        # by the slopes of the running thrust curves
        into_arc = layout.now_by[c] - layout.arc_start_by[c]
        into_tail = layout.now_by[c] - layout.tail_start_by[c]
        segment.thrust_by[c] = (
            segment.thrust_slope - tail_thrust
        ) * into_arc + tail_thrust * into_tail
        segment.flow_by[c] = (segment.flow_slope - tail_flow) * into_arc + tail_flow * into_tail
        if segment.start_by[c] != 0.0 or segment.end_by[c] != 0.0 or segment.mass_by[c] != 0.0:
            segment.moves = 1
