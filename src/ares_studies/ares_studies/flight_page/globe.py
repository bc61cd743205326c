# SPDX-License-Identifier: Apache-2.0
"""The globe: ways over the Earth, in places and heights, and the land below."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_studies.flight_page.charts import ROLES
from ares_studies.flight_page.data import Flight, Phase
from ares_studies.flight_page.land import land_on
from ares_studies.pages.parts import Role


@dataclass(frozen=True)
class Way:
    """A stretch of a flight that has one colour.

    Attributes:
        name: for the legend.
        role: decides the colour; None: a coast, in the colour of quiet things.
        first, last: its states.
    """

    name: str
    role: Role | None
    first: int
    last: int


@dataclass(frozen=True)
class GlobeFlight:
    """A flight on the globe.

    Attributes:
        name: for the legend.
        role: decides the colour of its marks.
        time_s, latitude_deg, longitude_deg, height: of its states; height in radii of the globe.
        ways: its stretches.
        impact_time_s, impact_latitude_deg, impact_longitude_deg: of its impact points.
        faint: one of many: a thin way, and no more than a dot at its end.
    """

    name: str
    role: Role
    time_s: tuple[float, ...]
    latitude_deg: tuple[float, ...]
    longitude_deg: tuple[float, ...]
    height: tuple[float, ...]
    ways: tuple[Way, ...]
    impact_time_s: tuple[float, ...]
    impact_latitude_deg: tuple[float, ...]
    impact_longitude_deg: tuple[float, ...]
    faint: bool = False


@dataclass(frozen=True)
class Globe:
    """What the globe shows.

    Attributes:
        flights: on it.
        land: rings of longitude, latitude in turn, deg; none on a body that is not the Earth.
        ends: what the last mark of each flight is called.
        nearest: how near it is seen at first, at most; 1: whole.
    """

    flights: tuple[GlobeFlight, ...]
    land: tuple[tuple[float, ...], ...]
    ends: tuple[str, ...]
    nearest: float = 1.0


def make_globe(flights: Sequence[Flight], names: Sequence[str], ends: Sequence[str]) -> Globe:
    """The globe of some flights.

    Args:
        flights: one, or several over each other.
        names: of the flights.
        ends: what the end of each is called.
    """
    radius = flights[0].mission.environment.earth.equatorial_radius_m
    return Globe(
        flights=tuple(
            _flight(flight, name, ROLES[k], len(flights) > 1)
            for k, (flight, name) in enumerate(zip(flights, names, strict=True))
        ),
        land=land_on(radius),
        ends=tuple(ends),
    )


def _flight(flight: Flight, name: str, role: Role, together: bool) -> GlobeFlight:
    states = flight.states
    radius = flight.mission.environment.earth.equatorial_radius_m
    return GlobeFlight(
        name=name,
        role=role,
        time_s=rounded(states.time_s, 2),
        latitude_deg=rounded(states.track.latitude_deg, 3),
        longitude_deg=rounded(states.track.longitude_deg, 3),
        height=rounded(states.altitude_m / radius, 5),
        ways=_ways(flight.phases, role if together else None),
        **_impact(flight),
    )


def _impact(flight: Flight) -> dict[str, Any]:
    falls = np.isfinite(flight.impact.latitude_deg)
    return {
        "impact_time_s": rounded(flight.impact_time_s[falls], 2),
        "impact_latitude_deg": rounded(flight.impact.latitude_deg[falls], 3),
        "impact_longitude_deg": rounded(flight.impact.longitude_deg[falls], 3),
    }


def _ways(phases: Sequence[Phase], role: Role | None) -> tuple[Way, ...]:
    """Stretches with their colours: of the flight, or in turn; a coast has none."""
    ways: list[Way] = []
    burns = 0
    for phase in phases:
        colour = None
        if phase.burns:
            colour = role or ROLES[burns % len(ROLES)]
            burns += 1
        # the line goes on to where the next one begins
        last = phase.last if phase is phases[-1] else phase.last + 1
        ways.append(Way(phase.name, colour, phase.first, last))
    return tuple(ways)


def rounded(values: NDArray[np.float64], digits: int) -> tuple[float, ...]:
    """Numbers for the page."""
    return tuple((np.round(values, digits) + 0.0).tolist())
