# SPDX-License-Identifier: Apache-2.0
"""Where a vehicle would fall if its thrust ended now: the instantaneous impact point.

A Kepler arc without air, down to where the mission's altitude is zero, on a body that turns below.
Source: Bate, Mueller, White, *Fundamentals of Astrodynamics* (1971), sections 6.2 and 6.4 (the
ballistic missile problem, rotation included). Found by Newton's
method in the eccentric anomaly, held inside the branch that descends, so it always ends.
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
#: rad of the eccentric anomaly; some micrometres on the ground.
_TOLERANCE = 1e-13
#: Eccentricity below which an orbit has no perigee to tell.
_ROUND = 1e-11


@kernel
def fall(r: Vector, v: Vector, environment: Record) -> tuple[float, Vector]:
    """Time until the ground, and the inertial position there.

    Args:
        r: position, m.
        v: inertial velocity, m/s.
        environment: record ENVIRONMENT.

    Returns:
        s and m; nan where it never falls: its perigee lies above the ground, or it escapes.
        A vehicle that descends and is on the ground already falls in no time.
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
    # it descends from the apogee to the perigee
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
    """Unit vector from the centre to an inertial position, in axes that turn with the body.

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
    """The impact point as a unit vector in axes that turn with the body; nan: there is none.

    Args: as :func:`fall`, at mission elapsed time ``time``, s.
    """
    span, down = fall(r, v, environment)
    return ground_direction(down, time + span, environment)


@kernel
def impact_moves(
    r: Vector, v: Vector, time: float, environment: Record
) -> tuple[Vector, Vector, Vector]:
    """How the impact point moves with the velocity: derivative of :func:`impact_direction`.

    Central differences: the impact point is found to more digits than they lose.

    Args: as :func:`impact_direction`.

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
    """Angle between a place and an edge, rad: a great circle from one corner to another."""
    normal = unit(cross(one, other))
    if dot(cross(normal, one), place) > 0.0 and dot(cross(other, normal), place) > 0.0:
        return abs(math.asin(min(1.0, max(-1.0, dot(normal, place)))))
    nearest = min(norm(sub(place, one)), norm(sub(place, other)))
    return 2.0 * math.asin(min(1.0, 0.5 * nearest))


@kernel
def outside_area(place: Vector, area: Record) -> float:
    """How far a place is from an area, rad; less than 0: it is inside, so far from its edge.

    Args:
        place: unit vector in axes that turn with the body.
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
        # by how much the edge goes round the place
        turned += math.atan2(
            dot(place, cross(one, other)),
            dot(one, other) - dot(one, place) * dot(other, place),
        )
    inside = abs(turned) > math.pi and dot(place, centre) > 0.0
    return -nearest if inside else nearest


@kernel
def outside_areas(place: Vector, environment: Record) -> tuple[float, int]:
    """How far a place is from the areas of a mission.

    Args:
        place: as of :func:`outside_area`; nan: nothing falls.
        environment: record ENVIRONMENT.

    Returns:
        m over the ground from the area that is nearest, less than 0 inside; inf where nothing
        falls or there is no area. And which area; -1: none.
    """
    nearest = math.inf
    index = -1
    if math.isnan(place[0]):
        return nearest, index
    for k in range(environment.area_count):
        area = environment.areas[k]
        # no nearer than its farthest corner lets it be
        bound = angle_between(place, load(area.centre)) - area.radius
        if environment.equatorial_radius * bound > nearest:
            continue
        away = environment.equatorial_radius * outside_area(place, area)
        if away < nearest:
            nearest = away
            index = k
    return nearest, index
