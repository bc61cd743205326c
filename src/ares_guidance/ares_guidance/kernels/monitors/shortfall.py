# SPDX-License-Identifier: Apache-2.0
"""Lowered targets where the propellant falls short: the highest energy within reach.

If that is not a safe orbit and one is within reach, the aim is the lowest safe orbit.
"""

import math

from ares_models.arrays import (
    NAMES_INCLINATION,
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.targets import names, plane_is_named

#: Surplus or lack of delta-V that is ignored, m/s.
SETTLED = 0.5
_ROUNDEST = 1e-6  # eccentricity that a lowered orbit keeps, so that it has a perigee
ROUNDS = 6
#: Speed taken off a target that no search converges to after a failure, as a fraction of the
#: velocity-to-go: in one cycle and in total.
STEP_DOWN = 0.12
MOST_DOWN = 0.7


@kernel
def lacking_speed(state: Record) -> float:
    """Return the delta-V that the plan needs beyond its propellant, m/s; negative: surplus."""
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
    """Take speed off the perigee of a target by elements and update all its elements."""
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
    """Take ``by`` m/s off a target at fixed radius and angle, or off an orbit at its perigee.

    Returns:
        speed taken off, m/s; less than ``by`` if the orbit becomes a circle at its perigee.
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


@kernel
def has_safe_orbit(target: Record) -> bool:
    """Return whether a safe orbit in the target's plane is defined."""
    if target.kind == TARGET_ELEMENTS and not names(target, NAMES_INCLINATION):
        return False
    return target.safe_radius > 0.0


@kernel
def aim_at_safe_orbit(target: Record, mu: float) -> None:
    """Set a target to the lowest safe orbit: a circle in the same plane."""
    if plane_is_named(target):
        target.kind = TARGET_RADIUS_SPEED_ANGLE_PLANE
    else:
        target.kind = TARGET_RADIUS_SPEED_ANGLE_INCLINATION
    target.radius = target.safe_radius
    target.speed = math.sqrt(mu / target.radius)
    target.flight_path_angle = 0.0
