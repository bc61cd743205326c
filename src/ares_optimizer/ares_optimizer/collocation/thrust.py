# SPDX-License-Identifier: Apache-2.0
"""Compute thrust acceleration and mass along a phase, with derivatives."""

import math

from ares_models.arrays import Record
from ares_models.jit import kernel


@kernel
def acceleration_terms(
    phase: Record, s: float, mass: float
) -> tuple[float, float, float, float, float, float]:
    """Return the thrust acceleration, and its derivatives by time and initial mass.

    Args:
        phase: record PHASE.
        s: time into the phase.
        mass: at the begin of the phase.

    Returns:
        a, a_s, a_m, a_ss, a_sm, a_mm.
    """
    if phase.fading > 0.0:
        return phase.acceleration, 0.0, 0.0, 0.0, 0.0, 0.0
    left = mass - s * (phase.flow + 0.5 * s * phase.flow_slope)
    flow = phase.flow + s * phase.flow_slope
    a = (phase.thrust + s * phase.thrust_slope) / left
    by_s = (phase.thrust_slope + a * flow) / left
    by_m = -a / left
    by_ss = (2.0 * by_s * flow + a * phase.flow_slope) / left
    by_sm = -(by_s - by_m * flow) / left
    return a, by_s, by_m, by_ss, by_sm, -2.0 * by_m / left


@kernel
def mass_at_end(phase: Record, length: float, mass: float) -> tuple[float, float, float]:
    """Return the mass at the end of a phase, and its derivatives by length and mass.

    The end is before drops; ``mass`` is that at the begin.
    """
    if phase.fading > 0.0:
        part = math.exp(-phase.fading * length)
        return mass * part, -phase.fading * mass * part, part
    flow = phase.flow + 0.5 * length * phase.flow_slope
    return mass - length * flow, -(phase.flow + length * phase.flow_slope), 1.0
