"""When the propellant does not reach the target: the highest energy that it does reach."""

import math

from ares_models.arrays import TARGET_ELEMENTS, TARGET_KEPLERIAN, Record
from ares_models.jit import kernel

#: m/s of surplus or lack that is left alone.
SETTLED = 0.5
_ROUNDEST = 1e-6  # eccentricity that a lowered orbit keeps, so that it has a perigee
ROUNDS = 6


@kernel
def lacking_speed(state: Record) -> float:
    """Velocity, m/s, that the plan needs beyond its propellant; negative: has to spare."""
    for i in range(state.segment_count):
        segment = state.segments[i]
        burn = state.solution.time_to_go - segment.start
        if i == state.segment_count - 1 or burn <= segment.duration:
            if segment.acceleration > 0.0:
                return segment.acceleration * (burn - segment.capacity)
            left = segment.tau - min(segment.capacity, 0.999 * segment.tau)
            return segment.exhaust_velocity * math.log(left / (segment.tau - burn))
    return 0.0


@kernel
def _lower_orbit(target: Record, mu: float, by: float) -> float:
    """As :func:`lower_target`, for a target by elements: whatever it names goes along."""
    perigee = target.perigee_radius
    speed = math.sqrt(target.c3 + 2.0 * mu / perigee)
    lowered = max(speed - by, math.sqrt(mu / perigee))
    target.c3 = lowered * lowered - 2.0 * mu / perigee
    target.eccentricity = max(_ROUNDEST, 1.0 + perigee * target.c3 / mu)
    target.semi_major_axis = -mu / target.c3
    target.apogee_radius = 2.0 * target.semi_major_axis - perigee
    return speed - lowered


@kernel
def lower_target(target: Record, mu: float, by: float) -> float:
    """Take speed off a target, m/s: radius and angle stay, or the perigee of an orbit does.

    Returns:
        what was taken off; less than asked where an orbit would sink below its perigee.
    """
    if target.kind == TARGET_ELEMENTS:
        return _lower_orbit(target, mu, by)
    if target.kind != TARGET_KEPLERIAN:
        target.speed -= by
        return by
    a = target.semi_major_axis
    perigee = a * (1.0 - target.eccentricity)
    speed = math.sqrt(mu * (2.0 / perigee - 1.0 / a))
    slowest = math.sqrt(mu / perigee)
    lowered = max(speed - by, slowest)
    target.semi_major_axis = 1.0 / (2.0 / perigee - lowered * lowered / mu)
    target.eccentricity = max(0.0, 1.0 - perigee / target.semi_major_axis)
    return speed - lowered
