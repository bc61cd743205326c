# SPDX-License-Identifier: Apache-2.0
"""Make the lines of charts from the columns of a flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_studies.flight_page.data import AirLimit, DrawnFlight

Array = NDArray[np.float64]

#: Share of a limit that optima are free to pass it by.
_REACHED = 1e-3


@dataclass(frozen=True)
class Line:
    """Hold a line of a chart: its name if the chart has several, points, decimals.

    `t` holds the times of the points if x is not time.
    """

    name: str
    x: Array
    y: Array
    digits: int
    step: bool = False
    t: Array | None = None


@dataclass(frozen=True)
class LevelLine:
    """Hold a horizontal line: its height, its name, and how far one flight stays from it."""

    at: float
    text: str
    spare: str = ""


def state(
    name: str, scale: float = 1.0, digits: int = 3
) -> Callable[[DrawnFlight], Sequence[Line]]:
    """Make one line: a column of the states."""

    def lines(flight: DrawnFlight) -> Sequence[Line]:
        y = getattr(flight.states, name) * scale
        return [Line("", flight.states.time_s, y, digits)]

    return lines


def speeds(flight: DrawnFlight) -> Sequence[Line]:
    """Make the lines of the inertial speed and that against the air."""
    states = flight.states
    return [
        Line("inertial", states.time_s, states.speed_m_s, 2),
        Line("against the air", states.time_s, states.relative_speed_m_s, 2),
    ]


def over_range(flight: DrawnFlight) -> Sequence[Line]:
    """Make the line of altitude over ground range."""
    states = flight.states
    return [Line("", states.range_m / 1e3, states.altitude_m / 1e3, 3, t=states.time_s)]


def ground_track(flight: DrawnFlight) -> Sequence[Line]:
    """Make the track; unwrap the longitude beyond 180 deg."""
    track = flight.states.track
    longitude = np.unwrap(track.longitude_deg, period=360.0)
    return [Line("", longitude, track.latitude_deg, 4, t=flight.states.time_s)]


def propellant(flight: DrawnFlight) -> Sequence[Line]:
    """Make the line of the propellant left; none if it is never known."""
    if not np.any(np.isfinite(flight.propellant_kg)):
        return []
    return [Line("", flight.states.time_s, flight.propellant_kg / 1e3, 3)]


def optimality(*columns: tuple[str, str, int]) -> Callable[[DrawnFlight], Sequence[Line]]:
    """Make lines of an optimum's conditions: name, column, decimals; none for a flown flight."""

    def lines(flight: DrawnFlight) -> Sequence[Line]:
        proof = flight.optimality
        if proof is None:
            return []
        known = [(name, getattr(proof, column), digits) for name, column, digits in columns]
        return [
            Line(name, proof.time_s, y, digits)
            for name, y, digits in known
            if np.any(np.isfinite(y))
        ]

    return lines


def zero(flight: DrawnFlight) -> Sequence[LevelLine]:
    """Make a line at zero, of an optimum."""
    return () if flight.optimality is None else (LevelLine(0.0, ""),)


def heating(flight: DrawnFlight) -> Sequence[Line]:
    """Make the line of the heating, beyond the air."""
    time, heating = flight.states.time_s, flight.states.heating_w_m2
    # in the air molecules do not come one by one
    counts = heating > 0.0 if flight.air is None else time > flight.air.until_s
    return [Line("", time, np.where(counts, heating, np.nan), 4)]


def heating_limit(flight: DrawnFlight) -> Sequence[LevelLine]:
    """Make the line of the heating limit, if there is one."""
    limit = flight.heating_limit_w_m2
    return () if limit is None else (LevelLine(limit, f"limit, {limit:,.0f} W/m2"),)


def in_air(*columns: tuple[str, str, float, int]) -> Callable[[DrawnFlight], Sequence[Line]]:
    """Make lines of the part in the air: name, column of the states, scale and decimals of each."""

    def lines(flight: DrawnFlight) -> Sequence[Line]:
        if flight.air is None:
            return []
        time = flight.states.time_s
        rows = time <= flight.air.until_s
        return [
            Line(name, time[rows], scale * getattr(flight.states, column)[rows], digits)
            for name, column, scale, digits in columns
        ]

    return lines


def air_limits(column: str, unit: str) -> Callable[[DrawnFlight], Sequence[LevelLine]]:
    """Make lines of the limits of a column of the states, in thousands of its unit."""

    def spare(limit: AirLimit) -> str:
        left = limit.limit - limit.most
        if abs(left) < _REACHED * limit.limit:
            return ", reached"
        return f", {1e-3 * abs(left):,.2f} " + ("to spare" if left > 0.0 else "beyond it")

    def levels(flight: DrawnFlight) -> Sequence[LevelLine]:
        return [
            LevelLine(1e-3 * limit.limit, f"limit, {1e-3 * limit.limit:,g} {unit}", spare(limit))
            for limit in (flight.air.limits if flight.air else ())
            if limit.column == column
        ]

    return levels


def guidance(
    name: str, digits: int, *, step: bool = False
) -> Callable[[DrawnFlight], Sequence[Line]]:
    """Make one line: a column of the guidance status; none if it is never known."""

    def lines(flight: DrawnFlight) -> Sequence[Line]:
        if flight.guidance is None:
            return []
        y = getattr(flight.guidance, name)
        if not np.any(np.isfinite(y)):
            return []
        return [Line("", flight.guidance.time_s, y, digits, step)]

    return lines


def navigation(name: str, scale: float, digits: int) -> Callable[[DrawnFlight], Sequence[Line]]:
    """Make one line: a column of the navigation errors."""

    def lines(flight: DrawnFlight) -> Sequence[Line]:
        if flight.navigation is None:
            return []
        return [
            Line("", flight.navigation.time_s, getattr(flight.navigation, name) * scale, digits)
        ]

    return lines
