# SPDX-License-Identifier: Apache-2.0
"""Burns throttled to a thrust acceleration: T = min(T_full, max(m a_max, least T_full)).

As the mass falls there are three stretches: full thrust, constant acceleration, under which the
mass fades as exp(-a t / v_e), and least thrust. An engine is (exhaust velocity m/s, mass flow at
full thrust kg/s).
"""

import math

from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.sequence import SAME_TIME

FULL = 0
LIMITED = 1
LEAST = 2


@kernel
def throttle(arc: Record, mass: float) -> float:
    """Fraction of full thrust at a mass, kg."""
    return min(1.0, max(mass * arc.max_acceleration / arc.thrust, arc.min_throttle))


@kernel
def stretch(arc: Record, engine: tuple[float, float], mass: float) -> tuple[int, float]:
    """Which stretch a burn is in, and when it ends.

    Args:
        arc: record ARC, with the limits.
        engine: as it burns.
        mass: now, kg.

    Returns:
        FULL, LIMITED or LEAST, and s to its end; inf: the propellant ends it.
    """
    limit = arc.max_acceleration
    if math.isinf(limit):
        return FULL, math.inf
    exhaust_velocity, flow = engine
    upper = exhaust_velocity * flow / limit
    left = (mass - upper) / flow
    if left > SAME_TIME:
        return FULL, left
    lower = arc.min_throttle * upper
    if lower <= 0.0:
        return LIMITED, math.inf
    left = exhaust_velocity / limit * math.log(mass / lower)
    if left > SAME_TIME:
        return LIMITED, left
    return LEAST, math.inf


@kernel
def mass_after(
    arc: Record, engine: tuple[float, float], kind: int, mass: float, span: float
) -> float:
    """Mass, kg, after ``span`` s of one stretch.

    Args:
        arc: as of :func:`stretch`; so the next.
        engine: as it burns.
        kind: FULL, LIMITED or LEAST.
        mass: before, kg.
        span: s.
    """
    exhaust_velocity, flow = engine
    if kind == LIMITED:
        return mass * math.exp(-arc.max_acceleration * span / exhaust_velocity)
    if kind == LEAST:
        flow *= arc.min_throttle
    return mass - flow * span


@kernel
def time_to_burn(arc: Record, engine: tuple[float, float], mass: float, propellant: float) -> float:
    """Time in which a burn takes so much propellant, s.

    Args:
        arc: as of :func:`stretch`; so the next two.
        engine: as it burns.
        mass: now, kg.
        propellant: kg.
    """
    exhaust_velocity, flow = engine
    end = mass - propellant
    t = 0.0
    for _ in range(3):
        kind, span = stretch(arc, engine, mass)
        after = mass_after(arc, engine, kind, mass, span)
        if not after > end:
            if kind == LIMITED:
                return t + exhaust_velocity / arc.max_acceleration * math.log(mass / end)
            rate = flow * arc.min_throttle if kind == LEAST else flow
            return t + (mass - end) / rate
        t += span
        mass = after
    return t
