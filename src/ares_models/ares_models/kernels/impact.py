# SPDX-License-Identifier: Apache-2.0
"""Instantaneous impact point: the place of impact if the thrust ended now.

A Kepler arc without air, down to altitude zero, on a rotating body. Newton's method in the
eccentric anomaly, bracketed on the descending branch, so that it always ends. Source: Bate,
Mueller, White, *Fundamentals of Astrodynamics* (1971), sections 6.2 and 6.4 (the ballistic missile
problem, rotation included).
"""

import math

from ares_models.arrays import AREA_CIRCLE, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import altitude, altitude_gradient
from ares_models.kernels.vectors import (
    Vector,
    add,
    angle_between,
    axpy,
    cross,
    dot,
    load,
    norm,
    scale,
    sub,
    unit,
)

_MAX_ITERATIONS = 60
#: Tolerance of the eccentric anomaly, rad; some micrometres on the ground.
_TOLERANCE = 1e-13
#: Eccentricity below which the perigee is undefined.
_ROUND = 1e-11


@kernel
def fall(r: Vector, v: Vector, environment: Record) -> tuple[float, Vector]:
    """Propagate a state without thrust to the ground: time and inertial position.

    Args:
        r: position, m.
        v: inertial velocity, m/s.
        environment: record ENVIRONMENT.

    Returns:
        s and m; nan if there is no impact: the perigee is above the ground, or it escapes. For a
        vehicle that descends and is on or below the ground the time is 0.
    """
    mu = environment.mu
    nowhere = (math.nan, math.nan, math.nan)
    radius = norm(r)
    alpha = 2.0 / radius - dot(v, v) / mu
    momentum = cross(r, v)
    if not (alpha > 0.0 and norm(momentum) > 0.0):
        return math.nan, nowhere
    a = 1.0 / alpha
    to_perigee = sub(scale(1.0 / mu, cross(v, momentum)), scale(1.0 / radius, r))
    e = norm(to_perigee)
    if not e > _ROUND:
        return math.nan, nowhere
    ahead = scale(a, unit(to_perigee))
    aside = scale(norm(momentum) * math.sqrt(a / mu), unit(cross(momentum, to_perigee)))
    now = math.atan2(dot(r, v) / math.sqrt(mu * a), 1.0 - radius * alpha)
    if now < 0.0:
        now += 2.0 * math.pi
    # the descending branch lies between apogee and perigee
    low = max(now, math.pi)
    high = 2.0 * math.pi
    if not altitude(scale(1.0 - e, ahead), environment) < 0.0:
        return math.nan, nowhere
    at = low
    point = axpy(math.cos(at) - e, ahead, scale(math.sin(at), aside))
    if altitude(point, environment) > 0.0:
        at = 0.5 * (low + high)
        for _ in range(_MAX_ITERATIONS):
            c, s = math.cos(at), math.sin(at)
            point = axpy(c - e, ahead, scale(s, aside))
            height = altitude(point, environment)
            if height > 0.0:
                low = at
            else:
                high = at
            along = axpy(-s, ahead, scale(c, aside))
            step = -height / dot(altitude_gradient(point, environment), along)
            if abs(step) < _TOLERANCE or high - low < _TOLERANCE:
                break
            at += step
            if not low < at < high:
                at = 0.5 * (low + high)
    mean = at - e * math.sin(at) - (now - e * math.sin(now))
    return max(0.0, mean * a * math.sqrt(a / mu)), point


@kernel
def ground_direction(r: Vector, time: float, environment: Record) -> Vector:
    """Convert an inertial position to a unit vector from the centre in body-fixed axes.

    Args:
        r: position, m.
        time: mission elapsed time, s.
        environment: record ENVIRONMENT.
    """
    angle = environment.zero_longitude + environment.rotation_rate * time
    c, s = math.cos(angle), math.sin(angle)
    return unit((c * r[0] + s * r[1], c * r[1] - s * r[0], r[2]))


@kernel
def impact_direction(r: Vector, v: Vector, time: float, environment: Record) -> Vector:
    """Compute the impact point as a unit vector in body-fixed axes; nan if there is none.

    Args: as in :func:`fall`, at mission elapsed time ``time``, s.
    """
    span, down = fall(r, v, environment)
    return ground_direction(down, time + span, environment)


@kernel
def impact_jacobian(
    r: Vector, v: Vector, time: float, environment: Record
) -> tuple[Vector, Vector, Vector]:
    """Differentiate the impact point by the velocity: Jacobian of :func:`impact_direction`.

    Central differences: the impact point has more digits than they lose.

    Args: as in :func:`impact_direction`.

    Returns:
        its derivatives by the three components of the velocity, rad per m/s.
    """
    h = 0.05
    x = sub(
        impact_direction(r, add(v, (h, 0.0, 0.0)), time, environment),
        impact_direction(r, sub(v, (h, 0.0, 0.0)), time, environment),
    )
    y = sub(
        impact_direction(r, add(v, (0.0, h, 0.0)), time, environment),
        impact_direction(r, sub(v, (0.0, h, 0.0)), time, environment),
    )
    z = sub(
        impact_direction(r, add(v, (0.0, 0.0, h)), time, environment),
        impact_direction(r, sub(v, (0.0, 0.0, h)), time, environment),
    )
    half = 0.5 / h
    return scale(half, x), scale(half, y), scale(half, z)


@kernel
def _from_edge(place: Vector, one: Vector, other: Vector) -> float:
    """Return the angle between a place and an edge, rad, the great circle between two corners."""
    normal = unit(cross(one, other))
    if dot(cross(normal, one), place) > 0.0 and dot(cross(other, normal), place) > 0.0:
        return abs(math.asin(min(1.0, max(-1.0, dot(normal, place)))))
    nearest = min(norm(sub(place, one)), norm(sub(place, other)))
    return 2.0 * math.asin(min(1.0, 0.5 * nearest))


@kernel
def outside_area(place: Vector, area: Record) -> float:
    """Return the angular distance of a place from an area's edge, rad; negative inside.

    Args:
        place: unit vector in body-fixed axes.
        area: record AREA.
    """
    centre = load(area.centre)
    from_centre = 2.0 * math.asin(min(1.0, 0.5 * norm(sub(place, centre))))
    if area.kind == AREA_CIRCLE:
        return from_centre - area.radius
    nearest = math.inf
    turned = 0.0
    for k in range(area.count):
        one = load(area.vertices[k])
        other = load(area.vertices[k + 1 if k + 1 < area.count else 0])
        nearest = min(nearest, _from_edge(place, one, other))
        # angle of the edge as seen from the place: their sum is the winding number
        turned += math.atan2(
            dot(place, cross(one, other)),
            dot(one, other) - dot(one, place) * dot(other, place),
        )
    inside = abs(turned) > math.pi and dot(place, centre) > 0.0
    return -nearest if inside else nearest


@kernel
def outside_areas(place: Vector, environment: Record) -> tuple[float, int]:
    """Find the nearest area of a mission and the distance of a place from it.

    Args:
        place: unit vector in body-fixed axes; nan: no impact.
        environment: record ENVIRONMENT.

    Returns:
        distance over the ground, m, negative inside, inf without an impact or an area; and index
        of the area, -1 if there is none.
    """
    nearest = math.inf
    index = -1
    if math.isnan(place[0]):
        return nearest, index
    for k in range(environment.area_count):
        area = environment.areas[k]
        # lower bound on the distance by the area's enclosing circle
        bound = angle_between(place, load(area.centre)) - area.radius
        if environment.equatorial_radius * bound > nearest:
            continue
        away = environment.equatorial_radius * outside_area(place, area)
        if away < nearest:
            nearest = away
            index = k
    return nearest, index
