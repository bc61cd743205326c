# SPDX-License-Identifier: Apache-2.0
"""Make the globe: tracks in longitude, latitude and height, and the land below."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ares_models.mission import Mission
from ares_studies.flight_page.charts import ARC_ROLES, ROLES, lies_over
from ares_studies.flight_page.data import DrawnFlight, Phase
from ares_studies.flight_page.geometry import ground_track
from ares_studies.flight_page.land import land_on
from ares_studies.pages.parts import Role, Shape
from ares_vehicle_sim.falls import Fall


@dataclass(frozen=True)
class Way:
    """Hold an interval of a flight with one colour.

    Attributes:
        name: for the legend.
        role: sets the colour; None: a coast, in a muted colour.
        first, last: its states.
    """

    name: str
    role: Role | None
    first: int
    last: int


@dataclass(frozen=True)
class GlobeFlight:
    """Hold a flight on the globe.

    Attributes:
        name: for the legend.
        role: sets the colour of its marks.
        time_s, latitude_deg, longitude_deg, height: of its states; height in radii of the globe.
        ways: its coloured intervals.
        impact_time_s, impact_latitude_deg, impact_longitude_deg: of its impact points.
        faint: one of many: a thin line, and a dot at its end.
        over: dashed, above the other flights.
    """

    name: str
    role: Role
    time_s: tuple[float, ...]
    latitude_deg: tuple[float, ...]
    longitude_deg: tuple[float, ...]
    height: tuple[float, ...]
    ways: tuple[Way, ...] = ()
    impact_time_s: tuple[float, ...] = ()
    impact_latitude_deg: tuple[float, ...] = ()
    impact_longitude_deg: tuple[float, ...] = ()
    faint: bool = False
    over: bool = False


@dataclass(frozen=True)
class Globe:
    """Hold the contents of the globe.

    Attributes:
        flights: on it.
        land: rings of alternating longitude and latitude, deg; empty unless the body is the Earth.
        ends: label of the last mark of each flight.
        nearest: largest initial zoom; 1: the whole globe.
        areas: outlines of areas, as `land`.
        areas_role: sets their colour.
        falls: ways of what was dropped to where it comes down.
    """

    flights: tuple[GlobeFlight, ...]
    land: tuple[tuple[float, ...], ...]
    ends: tuple[str, ...]
    nearest: float = 1.0
    areas: tuple[tuple[float, ...], ...] = ()
    areas_role: Role = "thesis"
    falls: tuple[GlobeFlight, ...] = ()

    def key(self, kinds: Iterable[tuple[str, Role]]) -> list[tuple[str, Role, int, Shape]]:
        """Return labels, colours, numbers and shapes of the kinds of flights on it.

        Args:
            kinds: name and colour of each.
        """
        found: list[tuple[str, Role, int, Shape]] = []
        for name, role in kinds:
            flights = [flight for flight in self.flights if flight.role == role]
            if flights:
                found.append((name, role, len(flights), "line" if flights[0].ways else "cloud"))
        return found


#: Points of a track beside others.
_POINTS = 60


def way_beside_others(
    mission: Mission,
    time_s: NDArray[np.float64],
    position: NDArray[np.float64],
    name: str,
    role: Role,
    *,
    faint: bool,
) -> GlobeFlight:
    """Make one of several flights on a globe from its states, thinned.

    Args:
        mission: that was flown.
        time_s: mission elapsed time, shape (n,), s.
        position: inertial, shape (n, 3), m.
        name: for who points at it.
        role: decides the colour.
        faint: one of many.
    """
    kept = np.unique(np.linspace(0, len(time_s) - 1, _POINTS).astype(int))
    time_s, position = time_s[kept], position[kept]
    track = ground_track(time_s, position, mission.earth())
    radius = mission.environment.earth.equatorial_radius_m
    return GlobeFlight(
        name=name,
        role=role,
        time_s=rounded(time_s, 1),
        latitude_deg=rounded(track.latitude_deg, 3),
        longitude_deg=rounded(track.longitude_deg, 3),
        height=rounded(np.linalg.norm(position, axis=1) / radius - 1.0, 5),
        ways=(Way(name, role, 0, len(kept) - 1),),
        faint=faint,
    )


def spot(name: str, role: Role, latitude_deg: float, longitude_deg: float) -> GlobeFlight:
    """Make a place on the ground, of which there are many."""
    return GlobeFlight(
        name=name,
        role=role,
        time_s=(0.0,),
        latitude_deg=(round(latitude_deg, 2),),
        longitude_deg=(round(longitude_deg, 2),),
        height=(0.0,),
        faint=True,
    )


def ring(outline: Iterable[tuple[float, float]]) -> tuple[float, ...]:
    """Make an outline for the globe from latitudes and longitudes, deg."""
    return tuple(round(angle, 3) for place in outline for angle in reversed(place))


def make_globe(
    flights: Sequence[DrawnFlight],
    names: Sequence[str],
    ends: Sequence[str],
    falls: Sequence[Sequence[Fall]] = (),
) -> Globe:
    """Make the globe of some flights.

    Args:
        flights: one, or several overlaid.
        names: of the flights.
        ends: label of the end of each.
        falls: of what each has dropped.
    """
    radius = flights[0].mission.environment.earth.equatorial_radius_m
    return Globe(
        flights=tuple(
            _flight(flight, name, ROLES[k], len(flights) > 1)
            for k, (flight, name) in enumerate(zip(flights, names, strict=True))
        ),
        land=land_on(radius),
        ends=tuple(ends),
        falls=tuple(
            _fall(flight.mission, fall, ROLES[k])
            for k, (flight, dropped) in enumerate(zip(flights, falls, strict=False))
            for fall in dropped
            if fall.impact is not None
        ),
    )


def _fall(mission: Mission, fall: Fall, role: Role) -> GlobeFlight:
    """Make the way of a piece to the ground, drawn as a coast is."""
    way = way_beside_others(mission, fall.track_time_s, fall.track, fall.name, role, faint=True)
    return replace(way, ways=tuple(replace(part, role=None) for part in way.ways))


def _flight(flight: DrawnFlight, name: str, role: Role, together: bool) -> GlobeFlight:
    states = flight.states
    radius = flight.mission.environment.earth.equatorial_radius_m
    falls = np.isfinite(flight.impact.latitude_deg)
    return GlobeFlight(
        name=name,
        role=role,
        time_s=rounded(states.time_s, 2),
        latitude_deg=rounded(states.track.latitude_deg, 3),
        longitude_deg=rounded(states.track.longitude_deg, 3),
        height=rounded(states.altitude_m / radius, 5),
        ways=_ways(flight.phases, role if together else None),
        impact_time_s=rounded(flight.impact_time_s[falls], 2),
        impact_latitude_deg=rounded(flight.impact.latitude_deg[falls], 3),
        impact_longitude_deg=rounded(flight.impact.longitude_deg[falls], 3),
        over=together and lies_over(flight),
    )


def _ways(phases: Sequence[Phase], role: Role | None) -> tuple[Way, ...]:
    """Make the coloured intervals: in the flight's colour, or in turn; a coast has none."""
    ways: list[Way] = []
    burns = 0
    for phase in phases:
        colour = None
        if phase.burns:
            colour = role or ARC_ROLES[burns % len(ARC_ROLES)]
            burns += 1
        # extend the line to the begin of the next one
        last = phase.last if phase is phases[-1] else phase.last + 1
        ways.append(Way(phase.name, colour, phase.first, last))
    return tuple(ways)


def rounded(values: NDArray[np.float64], digits: int) -> tuple[float, ...]:
    """Round numbers for the page."""
    return tuple((np.round(values, digits) + 0.0).tolist())
