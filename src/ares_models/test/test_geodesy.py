# SPDX-License-Identifier: Apache-2.0
"""Geodetic places, against PROJ."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pyproj import Transformer

from ares_models.earth import Earth
from ares_models.geodesy import earth_fixed, earth_fixed_place, geodetic
from ares_models.mission import load_mission

EARTHS = {
    "wgs84": Earth(6378137.0, 6356752.314245, 7.292115e-5),
    "sphere": Earth(6378137.0, 6378137.0, 7.292115e-5),
    # as flat as a mission may have it
    "flat": Earth(6.4e6, 3.2e6, 1e-4),
    "ares_v": replace(load_mission("ares_v").earth(), angle_at_zero=0.0),
}


def proj(earth: Earth) -> Transformer:
    """Earth-fixed positions to longitude, latitude in deg and height in m."""
    figure = f"+a={earth.equatorial_radius} +b={earth.polar_radius} +no_defs"
    return Transformer.from_crs(f"+proj=geocent {figure}", f"+proj=longlat {figure}")


def spread(radius: float) -> np.ndarray:
    """Positions in all directions."""
    direction = np.random.default_rng(3).normal(size=(200, 3))
    return direction / np.linalg.norm(direction, axis=1, keepdims=True) * radius


# PROJ takes one step: from 500 km on it is off by more than a centimetre itself
@pytest.mark.parametrize("name", ["wgs84", "sphere", "ares_v"])
@pytest.mark.parametrize(
    ("height", "tolerance"), [(-1e3, 0.01), (0.0, 0.01), (1e5, 0.01), (5e5, 0.01), (3.6e7, 1.0)]
)
def test_places_are_those_of_proj(name, height, tolerance):
    earth = EARTHS[name]
    position = spread(earth.equatorial_radius + height)
    place = geodetic(np.zeros(200), position, earth)
    longitude, latitude, high = proj(earth).transform(*position.T)
    metres = np.pi / 180.0 * (earth.equatorial_radius + height)
    assert np.abs(place.latitude_deg - latitude).max() * metres < tolerance
    assert np.abs(place.longitude_deg - longitude).max() * metres < tolerance
    assert np.abs(place.height_m - high).max() < tolerance


@pytest.mark.parametrize("earth", EARTHS.values(), ids=EARTHS)
@pytest.mark.parametrize("height", [-1e3, 0.0, 1e5, 5e5, 3.6e7, 4e8])
def test_places_lead_back_to_where_they_are_of(earth, height):
    position = spread(earth.equatorial_radius + height)
    place = geodetic(np.zeros(200), position, earth)
    columns = place.latitude_deg, place.longitude_deg, place.height_m
    back = [earth_fixed_place(*row, earth) for row in zip(*columns, strict=True)]
    assert np.abs(np.array(back) - position).max() < 1e-14 * np.abs(position).max() + 1e-6


def test_the_earth_turns_below():
    earth = EARTHS["wgs84"]
    time = np.array([0.0, 100.0, 5e4])
    position = np.tile([earth.equatorial_radius + 1e5, 0.0, 0.0], (3, 1))
    place = geodetic(time, position, earth)
    turned = np.degrees(earth.rotation_rate * time)
    assert place.longitude_deg == pytest.approx((-turned + 180.0) % 360.0 - 180.0)
    # as pages place a flight
    for row, t in enumerate(time):
        _, longitude = earth.latitude_longitude(position[row], t)
        assert place.longitude_deg[row] == pytest.approx(np.degrees(longitude))
    fixed = earth_fixed(time, position, earth)
    assert np.linalg.norm(fixed, axis=1) == pytest.approx(earth.equatorial_radius + 1e5)


def test_longitude_zero_is_where_the_mission_says():
    time = np.array([0.0, 100.0, 5e4])
    position = spread(7e6)[:3]
    turned = replace(EARTHS["wgs84"], angle_at_zero=math.radians(50.0))
    here, there = (geodetic(time, position, earth) for earth in (turned, EARTHS["wgs84"]))
    less = (there.longitude_deg - here.longitude_deg) % 360.0
    assert less == pytest.approx(50.0)
    assert here.latitude_deg == pytest.approx(there.latitude_deg)
    _, longitude = turned.latitude_longitude(position[1], 100.0)
    assert here.longitude_deg[1] == pytest.approx(math.degrees(longitude))


@pytest.mark.parametrize("earth", EARTHS.values(), ids=EARTHS)
def test_the_poles_have_a_place(earth):
    position = np.array([[0.0, 0.0, 7e6], [0.0, 0.0, -7e6]])
    place = geodetic(np.zeros(2), position, earth)
    assert place.latitude_deg == pytest.approx([90.0, -90.0])
    assert place.height_m == pytest.approx([7e6 - earth.polar_radius] * 2)


@pytest.mark.parametrize("earth", EARTHS.values(), ids=EARTHS)
def test_a_place_on_the_ground_has_no_height(earth):
    point = earth_fixed_place(28.5, -80.6, 0.0, earth)
    place = geodetic(np.zeros(1), point[None], earth)
    assert place.height_m[0] == pytest.approx(0.0, abs=1e-8)
    assert place.latitude_deg[0] == pytest.approx(28.5)
    assert place.longitude_deg[0] == pytest.approx(-80.6)
