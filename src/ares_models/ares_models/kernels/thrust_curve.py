# SPDX-License-Identifier: Apache-2.0
"""Thrust-time curves: fraction of full thrust, linear between knots, constant beyond them.

A curve is ``times`` and ``fractions`` of a record ARC with the number of knots. At a jump, two
knots at one time, the later value holds.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.jit import kernel


@kernel
def curve_value(times: NDArray[Any], fractions: NDArray[Any], knots: int, t: float) -> float:
    """Return the thrust fraction at ``t``, s."""
    if t < times[0]:
        return fractions[0]
    for i in range(1, knots):
        if t < times[i]:
            w = (t - times[i - 1]) / (times[i] - times[i - 1])
            return fractions[i - 1] + w * (fractions[i] - fractions[i - 1])
    return fractions[knots - 1]


@kernel
def curve_slope(times: NDArray[Any], fractions: NDArray[Any], knots: int, t: float) -> float:
    """Return the slope of the thrust fraction just after ``t``, 1/s."""
    if t < times[0]:
        return 0.0
    for i in range(1, knots):
        if t < times[i]:
            return (fractions[i] - fractions[i - 1]) / (times[i] - times[i - 1])
    return 0.0


@kernel
def curve_area(times: NDArray[Any], fractions: NDArray[Any], knots: int, t: float) -> float:
    """Integrate the thrust fraction from 0 to ``t``, s."""
    area = 0.0
    at = 0.0
    level = fractions[0]
    for i in range(knots):
        if times[i] <= at:
            level = fractions[i]
            continue
        length = min(t, times[i]) - at
        value = level + (fractions[i] - level) * length / (times[i] - at)
        area += 0.5 * (level + value) * length
        if t <= times[i]:
            return area
        at = times[i]
        level = fractions[i]
    return area + level * max(0.0, t - at)


@kernel
def start_value(arc: Record, t: float) -> float:
    """Return the thrust fraction of a burn ``t`` s after its ignition command."""
    if arc.start_knots == 0:
        return 1.0
    return curve_value(arc.start_time, arc.start_fraction, arc.start_knots, t)


@kernel
def flow_value(arc: Record, t: float) -> float:
    """Return the mass flow fraction of a burn ``t`` s after its ignition command."""
    if arc.start_knots == 0:
        return 1.0
    return curve_value(arc.start_time, arc.start_flow, arc.start_knots, t)


@kernel
def start_area(arc: Record, t: float) -> float:
    """Integrate the thrust fraction to ``t`` s after the ignition command, s of full thrust."""
    if arc.start_knots == 0:
        return t
    return curve_area(arc.start_time, arc.start_fraction, arc.start_knots, t)


@kernel
def flow_area(arc: Record, t: float) -> float:
    """Integrate the mass flow fraction to ``t`` s after the ignition command, s of full flow."""
    if arc.start_knots == 0:
        return t
    return curve_area(arc.start_time, arc.start_flow, arc.start_knots, t)


@kernel
def tail_value(arc: Record, t: float) -> float:
    """Return the thrust fraction of a burn ``t`` s after its cut-off command."""
    return curve_value(arc.tail_time, arc.tail_fraction, arc.tail_knots, t)


@kernel
def start_length(arc: Record) -> float:
    """Return the length of the start curve from the ignition command, s."""
    return arc.start_time[arc.start_knots - 1] if arc.start_knots > 0 else 0.0


@kernel
def tail_length(arc: Record) -> float:
    """Return the length of the tail-off from the cut-off command, s."""
    return arc.tail_time[arc.tail_knots - 1] if arc.tail_knots > 0 else 0.0


@kernel
def start_knot_after(arc: Record, t: float) -> float:
    """Return the next knot of the start after ``t``, s from the ignition command, or inf."""
    for i in range(arc.start_knots):
        if t < arc.start_time[i]:
            return arc.start_time[i]
    return math.inf


@kernel
def tail_knot_after(arc: Record, t: float) -> float:
    """Return the next knot of the tail-off after ``t``, s from the cut-off command, or inf."""
    for i in range(arc.tail_knots):
        if t < arc.tail_time[i]:
            return arc.tail_time[i]
    return math.inf
