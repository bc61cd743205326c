# SPDX-License-Identifier: Apache-2.0
"""Compute thrust acceleration and mass along a phase, with derivatives."""

import math

from ares_models.arrays import Record
from ares_models.jit import kernel


@kernel
def burnt_terms(phase: Record, fraction: float, length: float) -> tuple[float, float, float]:
    """Return the mass burnt since the begin of a phase, and its derivatives by the length.

    Args:
        phase: record PHASE; it does not fade.
        fraction: of the phase that has passed.
        length: of the phase.
    """
    # a phase of which the end is known has its thrust and flow from there
    part = fraction * (fraction - 2.0) if phase.from_end == 1 else fraction * fraction
    curved = phase.flow_slope * part
    burnt = length * (phase.flow * fraction + 0.5 * curved * length)
    return burnt, phase.flow * fraction + curved * length, curved


@kernel
def acceleration_terms(
    phase: Record, fraction: float, length: float, mass: float
) -> tuple[float, float, float, float, float, float]:
    """Return the thrust acceleration, and its derivatives by length and initial mass.

    Args:
        phase: record PHASE.
        fraction: of the phase that has passed.
        length: of the phase.
        mass: at the begin of the phase.

    Returns:
        a, a_l, a_m, a_ll, a_lm, a_mm.
    """
    if phase.fading > 0.0:
        return phase.acceleration, 0.0, 0.0, 0.0, 0.0, 0.0
    burnt, burnt_l, burnt_ll = burnt_terms(phase, fraction, length)
    left = mass - burnt
    thrust_l = phase.thrust_slope * (fraction - phase.from_end)
    a = (phase.thrust + length * thrust_l) / left
    by_l = (thrust_l + a * burnt_l) / left
    by_m = -a / left
    by_ll = (2.0 * by_l * burnt_l + a * burnt_ll) / left
    by_lm = -(by_l - by_m * burnt_l) / left
    return a, by_l, by_m, by_ll, by_lm, -2.0 * by_m / left


@kernel
def mass_after(
    phase: Record, fraction: float, length: float, mass: float
) -> tuple[float, float, float]:
    """Return the mass in a phase, and its derivatives by length and initial mass.

    Args: as in :func:`acceleration_terms`. At fraction 1 it is the mass before drops.
    """
    if phase.fading > 0.0:
        fading = phase.fading * fraction
        part = math.exp(-fading * length)
        return mass * part, -fading * mass * part, part
    burnt, by_length, _ = burnt_terms(phase, fraction, length)
    return mass - burnt, -by_length, 1.0
