"""What the cut-off point must be, given where the prediction puts it."""

import math

from ares_models.arrays import TARGET_KEPLERIAN, TARGET_RADIUS_SPEED_ANGLE_INCLINATION, Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import Vector, add, axpy, cross, dot, norm, scale, sub, unit

POLE = (0.0, 0.0, 1.0)


@kernel
def named_plane(target: Record) -> Vector:
    """Unit normal of the plane of the target's inclination and ascending node."""
    si = math.sin(target.inclination)
    return (
        si * math.sin(target.ascending_node),
        -si * math.cos(target.ascending_node),
        math.cos(target.inclination),
    )


@kernel
def plane_normal(target: Record, r: Vector, h: Vector) -> tuple[Vector, bool]:
    """Normal of the target plane, along the angular momentum.

    With the node free the plane is the one of exact inclination through ``r``, on the
    branch (northbound or southbound) of the motion; holding the plane of the present
    angular momentum instead makes the iteration diverge.

    Args:
        target: record TARGET.
        r: predicted cut-off position, m.
        h: angular momentum there, of any size; chooses the branch.

    Returns:
        unit normal, and whether a plane of that inclination passes through ``r``; if
        not, the normal is that of the nearest inclination that does.
    """
    if target.kind != TARGET_RADIUS_SPEED_ANGLE_INCLINATION:
        return named_plane(target), True
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
def desired_state(
    target: Record, mu: float, radial: Vector, normal: Vector
) -> tuple[Vector, Vector, Vector]:
    """Desired cut-off state on the ray ``radial`` of the target plane.

    Args:
        target: record TARGET.
        mu: m3/s2.
        radial: unit vector in the plane.
        normal: unit normal of the plane.

    Returns:
        position m, velocity m/s, downrange unit vector.
    """
    downrange = cross(normal, radial)
    if target.kind == TARGET_KEPLERIAN:
        node = (math.cos(target.ascending_node), math.sin(target.ascending_node), 0.0)
        latitude_argument = math.atan2(dot(cross(node, radial), normal), dot(node, radial))
        anomaly = latitude_argument - target.argument_of_perigee
        e = target.eccentricity
        parameter = target.semi_major_axis * (1.0 - e * e)
        # beyond the asymptote of a hyperbola there is no orbit
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
def target_speed(target: Record, mu: float, radius: float) -> float:
    """Speed to reach: the target's own, or that of its energy at ``radius``, m/s."""
    if target.kind == TARGET_KEPLERIAN:
        return math.sqrt(max(0.0, mu * (2.0 / radius - 1.0 / target.semi_major_axis)))
    return target.speed


@kernel
def project_to_plane(r: Vector, normal: Vector) -> Vector:
    """Unit vector of the part of ``r`` that lies in the plane."""
    return unit(sub(r, scale(dot(r, normal), normal)))
