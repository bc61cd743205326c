# SPDX-License-Identifier: Apache-2.0
"""Footprints of a campaign: where pieces come down, with ellipses of dispersion."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.impacts import place_words
from ares_models.mission import Mission
from ares_studies.montecarlo.table import FALLEN
from ares_vehicle_sim.draws import piece_slugs

Array = NDArray[np.float64]

#: Share of the flights in an ellipse, where the places are normal in two components; and the
#: distance of its edge in standard deviations: the chi-square distribution of two degrees of
#: freedom is an exponential one.
SHARE = 0.99
REACH = math.sqrt(-2.0 * math.log(1.0 - SHARE))
#: Points of an outline.
_ROUND = 72


@dataclass(frozen=True)
class Footprint:
    """Hold where a piece comes down in the flights of a campaign.

    Attributes:
        name: of the piece.
        slug: the same in columns' names.
        flights: in which it comes down.
        latitude_deg, longitude_deg: mean, geodetic.
        major_km, minor_km: semi-axes of the ellipse that holds SHARE of a normal distribution with
            the covariance found; nan: fewer than three flights.
        azimuth_deg: of the major axis, from north to east, 0 to 180.
        east_m, north_m: radii of curvature there, by which angles are distances.
    """

    name: str
    slug: str
    flights: int
    latitude_deg: float
    longitude_deg: float
    major_km: float
    minor_km: float
    azimuth_deg: float
    east_m: float
    north_m: float

    @property
    def place(self) -> str:
        """Return the mean as a text such as "28.50 N 80.60 W"."""
        return place_words(self.latitude_deg, self.longitude_deg)

    @property
    def words(self) -> str:
        """Describe mean and ellipse."""
        flights = f"{self.flights:,} {'flights' if self.flights > 1 else 'flight'}"
        told = f"{self.name}: down at {self.place}, mean of {flights}"
        if math.isnan(self.major_km):
            return told
        return (
            f"{told}; {100 * SHARE:g} % ellipse: semi-major axis {self.major_km:,.1f} km, "
            f"semi-minor axis {self.minor_km:,.1f} km, azimuth of the major axis "
            f"{self.azimuth_deg:.0f} deg from north"
        )

    def ellipse(self) -> Array:
        """Return points of the ellipse, east and north of the mean, km, shape (n, 2); closed."""
        angle = np.linspace(0.0, 2.0 * math.pi, _ROUND + 1)
        along, across = self.major_km * np.cos(angle), self.minor_km * np.sin(angle)
        c, s = math.cos(math.radians(self.azimuth_deg)), math.sin(math.radians(self.azimuth_deg))
        return np.stack((along * s + across * c, along * c - across * s), axis=1)

    def outline(self) -> list[tuple[float, float]]:
        """Return latitude and longitude of points of the ellipse, deg; empty without one."""
        if math.isnan(self.major_km):
            return []
        mean = _directions(np.array([self.latitude_deg]), np.array([self.longitude_deg]))[0]
        level = 1e3 * self.ellipse() / (self.east_m, self.north_m)
        away = np.hypot(*level.T)[:, None]
        along = level @ _axes(mean) / np.maximum(away, 1e-12)
        x, y, z = (np.cos(away) * mean + np.sin(away) * along).T
        found = np.degrees([np.arctan2(z, np.hypot(x, y)), np.arctan2(y, x)])
        return [(latitude, longitude) for latitude, longitude in found.T.tolist()]

    def beside(self, latitude_deg: Array, longitude_deg: Array) -> Array:
        """Return places as distances east and north of the mean, km, shape (n, 2)."""
        mean = _directions(np.array([self.latitude_deg]), np.array([self.longitude_deg]))[0]
        level = _directions(latitude_deg, longitude_deg) @ _axes(mean).T
        return 1e-3 * level * (self.east_m, self.north_m)


class Footprints:
    """Accumulate where the pieces of a mission come down, chunk by chunk."""

    def __init__(self, mission: Mission) -> None:
        """Start without flights."""
        self._pieces = dict(zip(piece_slugs(mission), mission.pieces, strict=True))
        earth = mission.earth()
        self._equatorial = self._polar = earth.equatorial_radius
        if mission.environment.altitude == "ellipsoid":
            self._polar = earth.polar_radius
        # number, sums of directions less the first one, and of their products
        self._origins: dict[str, Array] = {}
        self._counts = dict.fromkeys(self._pieces, 0)
        self._sums = {slug: np.zeros(3) for slug in self._pieces}
        self._squares = {slug: np.zeros((3, 3)) for slug in self._pieces}

    def add(self, table: Any) -> None:
        """Add flights, a pyarrow.Table; one without places adds nothing."""
        for slug in self._pieces:
            places = _places(table, slug)
            if places is None or not len(places[0]):
                continue
            directions = _directions(*places)
            off = directions - self._origins.setdefault(slug, directions[0])
            self._counts[slug] += len(off)
            self._sums[slug] += off.sum(axis=0)
            self._squares[slug] += off.T @ off

    def found(self) -> tuple[Footprint, ...]:
        """Return the footprint of each piece that comes down."""
        return tuple(
            self._footprint(slug, piece.name, self._counts[slug])
            for slug, piece in self._pieces.items()
            if self._counts[slug]
        )

    def _footprint(self, slug: str, name: str, count: int) -> Footprint:
        off = self._sums[slug] / count
        mean = self._origins[slug] + off
        mean /= np.linalg.norm(mean)
        flattened = 1.0 - (self._polar / self._equatorial) ** 2
        bent = 1.0 - flattened * mean[2] ** 2
        east_m = self._equatorial / math.sqrt(bent)
        north_m = east_m * (1.0 - flattened) / bent
        major = minor = azimuth = math.nan
        if count > 2:
            spread = (self._squares[slug] - count * np.outer(off, off)) / (count - 1)
            level = _axes(mean) * np.array([[east_m], [north_m]])
            values, vectors = np.linalg.eigh(level @ spread @ level.T)
            minor, major = (1e-3 * REACH * np.sqrt(np.maximum(values, 0.0))).tolist()
            azimuth = math.degrees(math.atan2(vectors[0, 1], vectors[1, 1])) % 180.0
        return Footprint(
            name,
            slug,
            count,
            math.degrees(math.asin(mean[2])),
            math.degrees(math.atan2(mean[1], mean[0])),
            major,
            minor,
            azimuth,
            east_m,
            north_m,
        )


def _places(table: Any, slug: str) -> tuple[Array, Array] | None:
    """Return the latitudes and longitudes at which a piece comes down, deg; None: no column."""
    names = [f"{FALLEN}{slug}_{name}_deg" for name in ("latitude", "longitude")]
    if not set(names) <= set(table.schema.names):
        return None
    latitude, longitude = (table[name].to_numpy() for name in names)
    down = np.isfinite(latitude)
    return latitude[down], longitude[down]


def _directions(latitude_deg: Array, longitude_deg: Array) -> Array:
    """Return unit vectors normal to the ground at places, shape (n, 3)."""
    latitude, longitude = np.radians(latitude_deg), np.radians(longitude_deg)
    across = np.cos(latitude)
    parts = (across * np.cos(longitude), across * np.sin(longitude), np.sin(latitude))
    return np.stack(parts, axis=1)


def _axes(mean: Array) -> Array:
    """Return the directions east and north at a place, shape (2, 3)."""
    away = math.hypot(mean[0], mean[1])
    east = np.array([-mean[1], mean[0], 0.0]) / away if away > 0.0 else np.array([0.0, 1.0, 0.0])
    return np.array([east, np.cross(mean, east)])
