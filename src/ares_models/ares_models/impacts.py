# SPDX-License-Identifier: Apache-2.0
"""Impact of a flight: latitude, longitude and the protected area that it lies in."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import ALTITUDE_SPHERICAL, AREA_CIRCLE, Record
from ares_models.earth import Earth
from ares_models.kernels.impact import fall, ground_direction, outside_areas

if TYPE_CHECKING:
    from ares_models.mission import Mission

Array = NDArray[np.float64]
#: Corners of an area for a chart, latitude and longitude in deg; closed by the first corner.
Outline = tuple[tuple[float, float], ...]
#: Number of points of a circle, and of each edge of a polygon, for a chart.
_ROUND, _EDGE = 72, 12


@dataclass(frozen=True)
class Impact:
    """Hold the impact of a vehicle, or of a piece of it, without thrust.

    Attributes:
        time_s: mission elapsed time.
        latitude_deg: geodetic.
        longitude_deg: positive to the east, -180 to 180.
        area: name of the area that contains it; None: outside all areas.
        outside_m: distance to the nearest area over the ground; negative inside; inf: no area.
    """

    time_s: float
    latitude_deg: float
    longitude_deg: float
    area: str | None
    outside_m: float

    @property
    def place(self) -> str:
        """Return latitude and longitude as a text such as "28.50 N 80.60 W"."""
        return place_words(self.latitude_deg, self.longitude_deg)


def place_words(latitude_deg: float, longitude_deg: float) -> str:
    """Return latitude and longitude as a text such as "28.50 N 80.60 W"."""
    north = "S" if latitude_deg < 0.0 else "N"
    east = "W" if longitude_deg < 0.0 else "E"
    return f"{abs(latitude_deg):.2f} {north} {abs(longitude_deg):.2f} {east}"


def find_impact(
    position: Sequence[float],
    velocity: Sequence[float],
    time_s: float,
    environment: Record,
    areas: Sequence[str] = (),
) -> Impact | None:
    """Find the impact of a state without air drag; None if it has none.

    Args:
        position: inertial, m, shape (3,).
        velocity: inertial, m/s, shape (3,).
        time_s: mission elapsed time.
        environment: record ENVIRONMENT.
        areas: names of the areas.
    """
    r = (float(position[0]), float(position[1]), float(position[2]))
    v = (float(velocity[0]), float(velocity[1]), float(velocity[2]))
    # numba accepts a record only as an element of an array
    record = np.asarray(environment).reshape(1)[0]
    span, down = fall(r, v, record)
    if not math.isfinite(span):
        return None
    return impact_at(time_s + span, ground_direction(down, time_s + span, record), record, areas)


def impact_at(
    time_s: float, place: tuple[float, float, float], record: Record, areas: Sequence[str]
) -> Impact:
    """Describe an impact.

    Args:
        time_s: mission elapsed time.
        place: unit vector from the centre in body-fixed axes.
        record: record ENVIRONMENT, element of an array.
        areas: names of the areas.
    """
    outside_m, nearest = outside_areas(place, record)
    latitude_deg, longitude_deg = _place(place, record)
    return Impact(
        time_s,
        latitude_deg,
        longitude_deg,
        areas[nearest] if outside_m < 0.0 and areas else None,
        float(outside_m),
    )


def outlines(mission: "Mission") -> dict[str, Outline]:
    """Return the outlines of a mission's areas for a chart, by name."""
    record = mission.environment_array()[0]
    found = {}
    for name, area in zip(mission.area_names, record["areas"], strict=False):
        if area["kind"] == AREA_CIRCLE:
            points = _circle(area["centre"], float(area["radius"]))
        else:
            points = _polygon(area["vertices"][: area["count"]])
        found[name] = tuple(_place(point, record) for point in points)
    return found


def _place(direction: Iterable[float], record: Record) -> tuple[float, float]:
    """Return geodetic latitude and longitude of a direction from the centre, deg."""
    x, y, z = (float(component) for component in direction)
    latitude = math.atan2(z, math.hypot(x, y))
    if record["altitude_model"] != ALTITUDE_SPHERICAL:
        earth = Earth(float(record["equatorial_radius"]), float(record["polar_radius"]), 0.0)
        latitude = earth.geodetic_latitude(latitude)
    return math.degrees(latitude), math.degrees(math.atan2(y, x))


def _circle(centre: Array, radius: float) -> list[Array]:
    first = np.cross(centre, np.eye(3)[int(np.argmin(np.abs(centre)))])
    first /= np.linalg.norm(first)
    second = np.cross(centre, first)
    return [
        math.cos(radius) * centre
        + math.sin(radius) * (math.cos(angle) * first + math.sin(angle) * second)
        for angle in np.linspace(0.0, 2.0 * math.pi, _ROUND + 1)
    ]


def _polygon(corners: Array) -> list[Array]:
    following = np.roll(corners, -1, axis=0)
    shares = np.linspace(0.0, 1.0, _EDGE, endpoint=False)
    points = [
        one + share * (other - one)
        for one, other in zip(corners, following, strict=True)
        for share in shares
    ]
    return [*points, corners[0]]
