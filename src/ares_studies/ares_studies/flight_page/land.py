# SPDX-License-Identifier: Apache-2.0
"""Provide the land: coastlines for the globe and for maps."""

import json
from collections.abc import Iterable, Sequence
from importlib.resources import files
from typing import Any

from ares_studies.pages.parts import Series

LAND = "land.json"
#: Radius of the Earth, m, and relative difference within which a body is the Earth.
_EARTH_RADIUS_M = 6378e3
_LIKE_THE_EARTH = 0.01

#: Bounds: west, east, south, north, deg.
Box = tuple[float, float, float, float]


def read_land() -> tuple[tuple[float, ...], ...]:
    """Read the rings of land: alternating longitude and latitude, deg."""
    data: dict[str, Any] = json.loads(files(__package__).joinpath(LAND).read_text("utf-8"))
    return tuple(tuple(ring) for ring in data["rings"])


def land_on(radius_m: float) -> tuple[tuple[float, ...], ...]:
    """Return the land on a body of a radius, m; empty unless it is the Earth."""
    return read_land() if abs(radius_m / _EARTH_RADIUS_M - 1.0) < _LIKE_THE_EARTH else ()


def coasts(rings: Iterable[Sequence[float]], box: Box) -> Series:
    """Make a map's series of coasts, broken between them, at 180 deg and outside the box.

    Args:
        rings: alternating longitude and latitude, deg.
        box: clips them; longitudes may exceed 180.
    """
    west, east, south, north = box
    x: list[float | None] = []
    y: list[float | None] = []
    for ring in rings:
        for turn in (-360.0, 0.0, 360.0):
            before = None
            for longitude, latitude in zip(ring[::2], ring[1::2], strict=True):
                shown = west <= longitude + turn <= east and south <= latitude <= north
                if shown and before is not None and abs(longitude - before) <= 180.0:
                    x.append(round(longitude + turn, 2))
                    y.append(round(latitude, 2))
                elif shown:
                    x += [None, round(longitude + turn, 2)]
                    y += [None, round(latitude, 2)]
                before = longitude if shown else None
    return Series("land", "quiet", "line", tuple(x), tuple(y))
