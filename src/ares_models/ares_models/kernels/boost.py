# SPDX-License-Identifier: Apache-2.0
"""Compute the thrust direction by the boost programme of a mission file, and its end.

``environment`` is a record of dtype ``arrays.ENVIRONMENT``; its ``boost`` holds the programme.
"""

import math

from ares_models.arrays import OVER_ALTITUDE, OVER_TIME, Record
from ares_models.jit import kernel
from ares_models.kernels.aerodynamics import local_vertical
from ares_models.kernels.environment import AT_REST, altitude, relative_velocity
from ares_models.kernels.states import east_north_up
from ares_models.kernels.vectors import Vector, add, dot, load, norm, scale, unit

#: Share of the largest heating of a programme below which its peak is past: what waits drops then.
PAST_PEAK = 0.9


@kernel
def measure(over: int, t: float, r: Vector, v: Vector, environment: Record) -> float:
    """Return the time, s, the altitude, m, or the speed in the air, m/s, of a state.

    Args:
        over: OVER_*.
        t: s.
        r: position, m.
        v: velocity, m/s.
        environment: record ENVIRONMENT.
    """
    if over == OVER_TIME:
        return t
    if over == OVER_ALTITUDE:
        return altitude(r, environment)
    return norm(relative_velocity(r, v, environment))


@kernel
def is_over(t: float, r: Vector, v: Vector, arc: int, environment: Record) -> bool:
    """Return whether the programme is over, or there is none.

    Args:
        t, r, v, environment: as in :func:`measure`.
        arc: index into the mission's arcs.
    """
    boost = environment.boost
    if boost.knots == 0 or arc > boost.last_arc:
        return True
    return bool(measure(boost.end_over, t, r, v, environment) >= boost.end)


@kernel
def horizon(r: Vector, environment: Record) -> tuple[Vector, Vector, Vector]:
    """Return the unit vectors east, north and up at a position, m."""
    up = local_vertical(r, environment)
    return east_north_up(math.asin(min(max(up[2], -1.0), 1.0)), math.atan2(up[1], up[0]))


@kernel
def boost_direction(t: float, r: Vector, v: Vector, environment: Record) -> Vector:
    """Return the thrust direction of the programme, a unit vector.

    Args: as in :func:`measure`.
    """
    boost = environment.boost
    east, north, up = horizon(r, environment)
    if boost.fixed == 1:
        east, north, up = load(boost.axes[0]), load(boost.axes[1]), load(boost.axes[2])
    at = measure(boost.over, t, r, v, environment)
    last = boost.knots - 1
    k = 0
    while k < last and boost.at[k + 1] <= at:
        k += 1
    pitch, azimuth = boost.pitch[k], boost.azimuth[k]
    if k < last and at > boost.at[k]:
        part = (at - boost.at[k]) / (boost.at[k + 1] - boost.at[k])
        pitch += part * (boost.pitch[k + 1] - pitch)
        azimuth += part * (boost.azimuth[k + 1] - azimuth)
    if boost.follows == 1 and at >= boost.at[last]:
        w = relative_velocity(r, v, environment)
        if dot(w, w) > AT_REST and dot(w, up) <= math.sin(pitch) * norm(w):
            return unit(w)
    level = add(scale(math.sin(azimuth), east), scale(math.cos(azimuth), north))
    return add(scale(math.sin(pitch), up), scale(math.cos(pitch), level))
