# SPDX-License-Identifier: Apache-2.0
"""Burns throttled to an acceleration limit: T = min(T_full, max(m a_max, least T_full)).

As the mass decreases a burn passes three regimes: full thrust; constant acceleration, with mass
proportional to exp(-a t / v_e); least thrust. An engine is (exhaust velocity m/s, mass flow at full
thrust kg/s).
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
    """Return the throttle setting at a mass, kg, as a fraction of full thrust."""
    return min(1.0, max(mass * arc.max_acceleration / arc.thrust, arc.min_throttle))


@kernel
def throttle_regime(arc: Record, engine: tuple[float, float], mass: float) -> tuple[int, float]:
    """Return the throttle regime of a burn and the time to its end.

    Args:
        arc: record ARC, with the limits.
        engine: as measured.
        mass: now, kg.

    Returns:
        FULL, LIMITED or LEAST, and s to its end; inf: it lasts until depletion.
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
    """Return the mass, kg, after ``span`` s in one throttle regime.

    Args:
        arc: record ARC.
        engine: as in :func:`throttle_regime`.
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
    """Compute the time in which a burn consumes ``propellant``, s.

    Args:
        arc: record ARC.
        engine: as in :func:`throttle_regime`.
        mass: now, kg.
        propellant: kg.
    """
    exhaust_velocity, flow = engine
    end = mass - propellant
    t = 0.0
    for _ in range(3):
        kind, span = throttle_regime(arc, engine, mass)
        after = mass_after(arc, engine, kind, mass, span)
        if not after > end:
            if kind == LIMITED:
                return t + exhaust_velocity / arc.max_acceleration * math.log(mass / end)
            rate = flow * arc.min_throttle if kind == LEAST else flow
            return t + (mass - end) / rate
        t += span
        mass = after
    return t
