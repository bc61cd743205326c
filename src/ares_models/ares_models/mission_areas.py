# SPDX-License-Identifier: Apache-2.0
"""Protected areas of a mission: checks, and conversion to the kernels' arrays."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ares_models import arrays as layout
from ares_models.mission_keys import fail
from ares_models.mission_parts import AreaPart

if TYPE_CHECKING:
    from ares_models.mission import Mission

Array = NDArray[np.float64]

#: Largest angle from an area's centre to its edge, deg; the inside of a larger one is ambiguous.
MOST_ACROSS_DEG = 80.0
#: Least angle between neighbouring corners, deg.
LEAST_EDGE_DEG = 0.01


def write_areas(mission: "Mission", record: NDArray[np.void]) -> None:
    """Write the areas of a mission with a section ``abort`` into its environment.

    Args:
        mission: with the areas.
        record: shape (1,), dtype ENVIRONMENT. Changed.
    """
    assert mission.abort is not None
    record["area_count"] = len(mission.abort.avoid)
    for area, row in zip(mission.abort.avoid, record["areas"][0], strict=False):
        if area.vertices_deg is None:
            row["kind"] = layout.AREA_CIRCLE
            row["centre"] = _direction(mission, area.latitude_deg, area.longitude_deg)
            row["radius"] = _angle(mission, area)
            continue
        corners = np.array([_direction(mission, *corner) for corner in area.vertices_deg])
        row["kind"] = layout.AREA_POLYGON
        row["count"] = len(corners)
        row["vertices"][: len(corners)] = corners
        row["centre"] = _middle(corners)
        row["radius"] = np.arccos(np.clip(corners @ row["centre"], -1.0, 1.0)).max()


def check_areas(mission: "Mission") -> None:
    """Report areas with equal names, without a known longitude zero, or without a clear inside."""
    if mission.abort is None or not mission.abort.avoid:
        return
    if mission.zero_longitude_deg is None:
        key = ("environment", "earth", "zero_longitude_deg")
        fail(key, None, "a number, because abort.avoid names places")
    names = mission.area_names
    for k, area in enumerate(mission.abort.avoid):
        path = ("abort", "avoid", k)
        if area.name in names[:k]:
            at = names.index(area.name)
            fail((*path, "name"), area.name, f"a name other than that of abort.avoid[{at}]")
        if area.vertices_deg is not None:
            _check_polygon(mission, area.vertices_deg, (*path, "vertices_deg"))
        elif math.degrees(_angle(mission, area)) > MOST_ACROSS_DEG:
            most = math.radians(MOST_ACROSS_DEG) * _radius(mission)
            fail((*path, "radius_m"), area.radius_m, f"at most {most:,.0f} m on this body")


def _check_polygon(
    mission: "Mission", vertices: tuple[tuple[float, float], ...], path: tuple[str | int, ...]
) -> None:
    corners = np.array([_direction(mission, *corner) for corner in vertices])
    following = np.roll(corners, -1, axis=0)
    for k, (one, other) in enumerate(zip(corners, following, strict=True)):
        if _between(one, other) < math.radians(LEAST_EDGE_DEG):
            second = (k + 1) % len(vertices)
            apart = f"a corner at least {LEAST_EDGE_DEG:g} deg from the one before it"
            fail((*path, second), vertices[second], f"{apart}; the polygon closes by itself")
    middle = _middle(corners)
    away = corners @ middle
    if not away.min() > math.cos(math.radians(MOST_ACROSS_DEG)):
        fail(path, vertices, f"corners within {MOST_ACROSS_DEG:g} deg of their middle")
    # gnomonic projection to the tangent plane at the middle: great circles become straight lines
    flat = (corners / away[:, None]) @ _plane(middle).T
    crossing = _crossing(flat)
    if crossing is not None:
        one, other = crossing
        expected = f"a corner whose edge does not cross that of corner {one}"
        fail((*path, other), vertices[other], expected)


def _crossing(flat: Array) -> tuple[int, int] | None:
    """Find two crossing edges of a flat polygon, by their first corners; None if there are none.

    Args:
        flat: corners in order, shape (n, 2).
    """
    n = len(flat)

    def side(a: Array, b: Array, c: Array) -> float:
        return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    for i in range(n):
        a, b = flat[i], flat[(i + 1) % n]
        for k in range(i + 2, n):
            if (k + 1) % n == i:
                continue
            c, d = flat[k], flat[(k + 1) % n]
            if side(a, b, c) * side(a, b, d) <= 0.0 and side(c, d, a) * side(c, d, b) <= 0.0:
                return i, k
    return None


def _direction(mission: "Mission", latitude_deg: Any, longitude_deg: Any) -> Array:
    """Return the unit vector from the centre to a place on the ground, in body-fixed axes."""
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    if mission.environment.altitude == "ellipsoid":
        latitude = mission.earth().geocentric_latitude(latitude)
    across = math.cos(latitude)
    return np.array(
        [across * math.cos(longitude), across * math.sin(longitude), math.sin(latitude)]
    )


def _radius(mission: "Mission") -> float:
    return mission.environment.earth.equatorial_radius_m


def _angle(mission: "Mission", area: AreaPart) -> float:
    """Return the radius of a circle, rad."""
    assert area.radius_m is not None
    return area.radius_m / _radius(mission)


def _middle(corners: Array) -> Array:
    mean = corners.mean(axis=0)
    length = float(np.linalg.norm(mean))
    # corners all around the globe have no middle: any direction fails the check
    middle: Array = mean / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    return middle


def _between(one: Array, other: Array) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(one, other))), float(one @ other))


def _plane(normal: Array) -> Array:
    """Return two unit vectors normal to ``normal`` and to each other, shape (2, 3)."""
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first)])
