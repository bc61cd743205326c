# SPDX-License-Identifier: Apache-2.0
"""Target plane and desired cut-off state for a predicted position."""

import math

from ares_models.arrays import (
    NAMES_APOGEE,
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_ASCENDING_NODE,
    NAMES_C3,
    NAMES_ECCENTRICITY,
    NAMES_INCLINATION,
    NAMES_PERIGEE,
    NAMES_SEMI_MAJOR_AXIS,
    NAMES_TRUE_ANOMALY,
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, add, axpy, cross, dot, norm, scale, sub, unit

POLE = (0.0, 0.0, 1.0)


@kernel
def names(target: Record, elements: int) -> bool:
    """Return whether a target of kind TARGET_ELEMENTS constrains all of these NAMES_*."""
    return target.named & elements == elements


@kernel
def plane_is_named(target: Record) -> bool:
    """Return whether a target constrains inclination and ascending node."""
    if target.kind == TARGET_ELEMENTS:
        return names(target, NAMES_INCLINATION | NAMES_ASCENDING_NODE)
    return target.kind != TARGET_RADIUS_SPEED_ANGLE_INCLINATION


@kernel
def two_planes(target: Record) -> bool:
    """Return whether two target planes, north- and southbound, pass through a point."""
    if target.kind == TARGET_ELEMENTS:
        return names(target, NAMES_INCLINATION) and not names(target, NAMES_ASCENDING_NODE)
    return target.kind == TARGET_RADIUS_SPEED_ANGLE_INCLINATION


@kernel
def size_and_shape(target: Record, mu: float) -> tuple[float, float]:
    """Return C3 (m2/s2) and perigee radius (m) of a target with two elements of size and shape."""
    apogee = target.apogee_radius
    e = target.eccentricity
    perigee = target.perigee_radius
    c3 = target.c3
    if names(target, NAMES_SEMI_MAJOR_AXIS):
        c3 = -mu / target.semi_major_axis
    elif not names(target, NAMES_C3):
        if names(target, NAMES_PERIGEE | NAMES_APOGEE):
            return -2.0 * mu / (perigee + apogee), perigee
        if names(target, NAMES_PERIGEE):
            return mu * (e - 1.0) / perigee, perigee
        return -mu * (1.0 + e) / apogee, apogee * (1.0 - e) / (1.0 + e)
    if names(target, NAMES_APOGEE):
        perigee = -2.0 * mu / c3 - apogee
    elif names(target, NAMES_ECCENTRICITY):
        perigee = mu * (e - 1.0) / c3
    return c3, perigee


@kernel
def named_plane(target: Record) -> Vector:
    """Return the unit normal of the plane of the target's inclination and ascending node."""
    si = math.sin(target.inclination)
    return (
        si * math.sin(target.ascending_node),
        -si * math.cos(target.ascending_node),
        math.cos(target.inclination),
    )


@kernel
def plane_normal(target: Record, r: Vector, h: Vector) -> tuple[Vector, bool]:
    """Compute the normal of the target plane, along the angular momentum.

    With a free node it is the plane of exact inclination through ``r``, on the branch (northbound
    or southbound) of the motion; with the plane of the present angular momentum instead the
    iteration would diverge. With a free inclination it is the plane through ``r`` and the node,
    with both free the plane of the motion.

    Args:
        target: record TARGET.
        r: predicted cut-off position, m.
        h: angular momentum there, of any size; chooses the branch.

    Returns:
        unit normal, and whether a plane of that inclination passes through ``r``; if
        not, the normal is that of the nearest inclination that does.
    """
    if plane_is_named(target):
        return named_plane(target), True
    if not two_planes(target):
        normal = h
        if names(target, NAMES_ASCENDING_NODE):
            node = (math.cos(target.ascending_node), math.sin(target.ascending_node), 0.0)
            normal = cross(node, unit(r))
            normal = scale(dot(normal, h), normal)
            if norm(normal) < 1e-12 * norm(h):
                normal = h
        return unit(normal), True
    radial = unit(r)
    north = axpy(-radial[2], radial, POLE)
    cos_latitude = norm(north)
    if cos_latitude < 1e-12:
        return unit(h), True
    north = scale(1.0 / cos_latitude, north)
    west = cross(radial, north)
    along_north = math.cos(target.inclination) / cos_latitude
    reachable = abs(along_north) <= 1.0
    along_north = min(1.0, max(-1.0, along_north))
    along_west = math.sqrt(1.0 - along_north * along_north)
    if dot(h, west) < 0.0:
        along_west = -along_west
    return add(scale(along_north, north), scale(along_west, west)), reachable


@kernel
def _anomaly_from(node: Vector, argument: float, radial: Vector, normal: Vector) -> float:
    """Return the true anomaly of a direction, rad, for an argument of perigee from a node."""
    latitude_argument = math.atan2(dot(cross(node, radial), normal), dot(node, radial))
    return latitude_argument - argument


@kernel
def _aimed_anomaly(target: Record, radial: Vector, normal: Vector) -> float:
    """Return the true anomaly of the aim on a target by elements, rad."""
    if names(target, NAMES_TRUE_ANOMALY) or not names(target, NAMES_ARGUMENT_OF_PERIGEE):
        return target.true_anomaly
    node = unit((-normal[1], normal[0], 0.0))
    if names(target, NAMES_ASCENDING_NODE):
        node = (math.cos(target.ascending_node), math.sin(target.ascending_node), 0.0)
    return _anomaly_from(node, target.argument_of_perigee, radial, normal)


@kernel
def desired_state(
    target: Record, mu: float, radial: Vector, normal: Vector
) -> tuple[Vector, Vector, Vector]:
    """Compute the desired cut-off state on the ray ``radial`` of the target plane.

    Args:
        target: record TARGET.
        mu: m3/s2.
        radial: unit vector in the plane.
        normal: unit normal of the plane.

    Returns:
        position m, velocity m/s, downrange unit vector.
    """
    downrange = cross(normal, radial)
    if target.kind == TARGET_KEPLERIAN or target.kind == TARGET_ELEMENTS:
        e = target.eccentricity
        if target.kind == TARGET_ELEMENTS:
            anomaly = _aimed_anomaly(target, radial, normal)
            parameter = target.perigee_radius * (1.0 + e)
        else:
            node = (math.cos(target.ascending_node), math.sin(target.ascending_node), 0.0)
            anomaly = _anomaly_from(node, target.argument_of_perigee, radial, normal)
            parameter = target.semi_major_axis * (1.0 - e * e)
        # bounded, as there is no orbit beyond the asymptote of a hyperbola
        radius = parameter / max(1e-3, 1.0 + e * math.cos(anomaly))
        root = math.sqrt(mu / parameter)
        vertical = root * e * math.sin(anomaly)
        horizontal = root * (1.0 + e * math.cos(anomaly))
    else:
        radius = target.radius
        vertical = target.speed * math.sin(target.flight_path_angle)
        horizontal = target.speed * math.cos(target.flight_path_angle)
    velocity = add(scale(vertical, radial), scale(horizontal, downrange))
    return scale(radius, radial), velocity, downrange


@kernel
def leaves_place_free(target: Record) -> bool:
    """Return whether a target may be met anywhere on its orbit, not only at its aim."""
    named = names(target, NAMES_TRUE_ANOMALY) or names(target, NAMES_ARGUMENT_OF_PERIGEE)
    return target.kind == TARGET_ELEMENTS and not named


@kernel
def aim_at_radius(target: Record, radius: float) -> None:
    """Move the aim on a target by elements to a radius, or to the nearest apsis.

    Args:
        target: record TARGET. Its true anomaly is changed, but keeps its sign.
        radius: m.
    """
    e = target.eccentricity
    if not e > 0.0:
        return
    cosine = (target.perigee_radius * (1.0 + e) / radius - 1.0) / e
    anomaly = math.acos(min(1.0, max(-1.0, cosine)))
    target.true_anomaly = math.copysign(anomaly, math.sin(target.true_anomaly))


@kernel
def target_speed(target: Record, mu: float, radius: float) -> float:
    """Return the target speed, m/s: fixed, or of the orbit's energy at ``radius``, m."""
    if target.kind == TARGET_KEPLERIAN:
        return math.sqrt(max(0.0, mu * (2.0 / radius - 1.0 / target.semi_major_axis)))
    if target.kind == TARGET_ELEMENTS:
        return math.sqrt(max(0.0, target.c3 + 2.0 * mu / radius))
    return target.speed


@kernel
def project_to_plane(r: Vector, normal: Vector) -> Vector:
    """Project ``r`` into a plane and return the unit vector."""
    return unit(sub(r, scale(dot(r, normal), normal)))


@kernel
def perigee_radius(target: Record, mu: float) -> float:
    """Return the perigee radius of a target's orbit, m."""
    if target.kind == TARGET_ELEMENTS:
        return target.perigee_radius
    if target.kind == TARGET_KEPLERIAN:
        return target.semi_major_axis * (1.0 - target.eccentricity)
    energy = 0.5 * target.speed**2 - mu / target.radius
    momentum = target.radius * target.speed * math.cos(target.flight_path_angle)
    parameter = momentum * momentum / mu
    eccentricity = math.sqrt(max(0.0, 1.0 + 2.0 * energy * parameter / mu))
    return parameter / (1.0 + eccentricity)
