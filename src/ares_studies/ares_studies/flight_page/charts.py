# SPDX-License-Identifier: Apache-2.0
"""Define the charts of a flight page: content and unit of each."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ares_studies.flight_page import lines
from ares_studies.flight_page.data import OPTIMUM, DrawnFlight, span_of
from ares_studies.flight_page.land import coasts, land_on
from ares_studies.flight_page.lines import LevelLine, Line
from ares_studies.pages.parts import (
    Axis,
    Chapter,
    Figure,
    Guide,
    Role,
    Series,
    Shape,
    item,
    line,
    numbered,
)

Array = NDArray[np.float64]

#: Colours of overlaid flights, and of the lines of one flight.
ROLES: tuple[Role, ...] = ("here", "thesis", "other", "otis", "third")
#: Colours of the arcs of one flight, in turn.
ARC_ROLES: tuple[Role, ...] = (*ROLES, "fourth", "fifth", "sixth")
#: Style of the first, second and third line of each of several overlaid flights.
_SHAPES: tuple[Shape, ...] = ("line", "dashes", "dots")
#: The same of an optimum, which the flight beside it would hide.
_SHAPES_OVER: tuple[Shape, ...] = ("over", "dots", "dots")
#: Margin above and below a level line, in units of its last decimal.
_LEVEL_ROOM = 5.0


@dataclass(frozen=True)
class Chart:
    """Define a chart.

    Attributes:
        title: its subject.
        see: hint for the reader.
        unit: of y.
        lines: of a flight; empty without data.
        levels: horizontal lines.
        name: of y; "": the title, in small letters.
        log: y is logarithmic.
        x: name and unit of x; None: mission elapsed time.
        least: least range of the y axis, in its unit.
        in_air: over the part of the flight in the air.
        is_map: longitude and latitude, with coasts, at full width.
    """

    title: str
    see: str
    unit: str
    lines: Callable[[DrawnFlight], Sequence[Line]]
    levels: Callable[[DrawnFlight], Sequence[LevelLine]] = lambda _flight: ()
    name: str = ""
    log: bool = False
    x: Axis | None = None
    least: float = 0.0
    in_air: bool = False
    is_map: bool = False

    @property
    def axis(self) -> Axis:
        """Return name and unit of y."""
        return Axis(self.name or self.title[0].lower() + self.title[1:], self.unit, log=self.log)


#: What the air does to a vehicle that climbs through it, a line each.
AIR: tuple[Chart, ...] = (
    Chart(
        "Dynamic pressure",
        "Half the density times the square of the speed against the air.",
        "kPa",
        lines.in_air(("", "dynamic_pressure_pa", 1e-3, 4)),
        lines.air_limits("dynamic_pressure_pa", "kPa"),
        in_air=True,
    ),
    Chart(
        "Mach number",
        "Speed against the air over the speed of sound.",
        "",
        lines.in_air(("", "mach", 1.0, 4)),
        name="Mach number",
        in_air=True,
    ),
    Chart(
        "Angle of attack",
        "From the velocity against the air to the thrust.",
        "deg",
        lines.in_air(("", "angle_of_attack_deg", 1.0, 4)),
        in_air=True,
    ),
    Chart(
        "Q alpha",
        "Dynamic pressure times the sine of the angle of attack: what bends the vehicle.",
        "kPa rad",
        lines.in_air(("", "q_alpha_pa_rad", 1e-3, 5)),
        lines.air_limits("q_alpha_pa_rad", "kPa rad"),
        in_air=True,
    ),
)

CHAPTERS: tuple[tuple[str, str, tuple[Chart, ...]], ...] = (
    (
        "Trajectory",
        "The trajectory: of a flight the truth, as the simulator published it.",
        (
            Chart("Altitude", "Above the ground.", "km", lines.state("altitude_m", 1e-3)),
            Chart(
                "Speed",
                "Inertial, and against the air that turns with the ground.",
                "m/s",
                lines.speeds,
            ),
            Chart(
                "Flight-path angle",
                "Of the inertial velocity above the local horizontal.",
                "deg",
                lines.state("flight_path_angle_deg", digits=4),
            ),
            Chart(
                "Ground range",
                "Distance along the ground track.",
                "km",
                lines.state("range_m", 1e-3, 2),
            ),
            Chart(
                "Altitude over ground range",
                "The shape of the flight.",
                "km",
                lines.over_range,
                name="altitude",
                x=Axis("ground range", "km"),
            ),
            Chart(
                "Ground track",
                "The places below, and the land around them.",
                "deg",
                lines.ground_track,
                name="latitude",
                x=Axis("longitude", "deg"),
                is_map=True,
            ),
        ),
    ),
    (
        "Vehicle",
        "Where the thrust points, what it does, and what the air does.",
        (
            Chart(
                "Pitch of the thrust",
                "Above the local horizontal, as in a programme.",
                "deg",
                lines.state("pitch_deg", digits=4),
                name="pitch",
            ),
            Chart(
                "Yaw of the thrust",
                "Azimuth of the thrust minus that of the inertial velocity; positive to the right.",
                "deg",
                lines.state("yaw_deg", digits=5),
                name="yaw",
            ),
            Chart("Mass", "Of the vehicle.", "t", lines.state("mass_kg", 1e-3)),
            Chart(
                "Propellant",
                "Left in the running stage, by the masses of the mission.",
                "t",
                lines.propellant,
            ),
            Chart("Thrust", "Of all engines.", "kN", lines.state("thrust_n", 1e-3, 2)),
            Chart(
                "Acceleration",
                "As sensed on board, along the thrust.",
                "m/s2",
                lines.state("acceleration_m_s2", digits=4),
            ),
            Chart(
                "Heating",
                "Free molecular heating rate.",
                "W/m2",
                lines.heating,
                lines.heating_limit,
                name="heating rate",
                log=True,
            ),
        ),
    ),
    (
        "In the air",
        "From the pad until the air is thin, with what the air does to the vehicle there.",
        (
            *AIR,
            Chart(
                "Loads",
                "Acceleration by thrust and air, along the thrust and across it.",
                "m/s2",
                lines.in_air(
                    ("axial", "acceleration_m_s2", 1.0, 4),
                    ("lateral", "lateral_acceleration_m_s2", 1.0, 4),
                ),
                name="acceleration",
                in_air=True,
            ),
        ),
    ),
    (
        "Orbit",
        "The orbit on which the vehicle would go on without thrust.",
        (
            Chart(
                "Perigee",
                "Above the equatorial radius; below zero the orbit meets the ground.",
                "km",
                lines.state("perigee_m", 1e-3, 2),
                name="perigee altitude",
            ),
            Chart(
                "Apogee",
                "Above the equatorial radius; an escape has none.",
                "km",
                lines.state("apogee_m", 1e-3, 2),
                name="apogee altitude",
            ),
            Chart(
                "Inclination",
                "Of the osculating orbit.",
                "deg",
                lines.state("inclination_deg", digits=7),
            ),
            Chart(
                "Eccentricity",
                "Of the osculating orbit.",
                "",
                lines.state("eccentricity", digits=6),
            ),
        ),
    ),
    (
        "Optimality",
        "What makes it the optimum, from the costates along the trajectory.",
        (
            Chart(
                "Primer vector, size",
                "Costate of the velocity, 1 at the start; thrust is worth most where it is large.",
                "",
                lines.optimality(("", "primer", 8)),
                name="primer",
            ),
            Chart(
                "Primer vector, direction",
                "Its parts ahead, up and right at the vehicle: where the best thrust points.",
                "",
                lines.optimality(
                    ("ahead", "primer_ahead", 5),
                    ("up", "primer_up", 5),
                    ("right", "primer_right", 5),
                ),
                name="part of the primer",
            ),
            Chart(
                "Switching function",
                "Final mass that a kg of propellant burnt here is worth beyond its price: above "
                "zero a burn pays, below zero a coast would; free coasts begin and end at zero. "
                "Burns of given length have none.",
                "kg/kg",
                lines.optimality(("", "switching", 9)),
                lines.zero,
            ),
            Chart(
                "Hamiltonian",
                "With mass costate and price of propellant: constant along each arc, zero where "
                "the length of the arc is free.",
                "m/s2",
                lines.optimality(("", "hamiltonian_m_s2", 9)),
                name="Hamiltonian",
                least=0.01,
            ),
        ),
    ),
    (
        "Guidance",
        "What guidance said of its own solution, a point per cycle.",
        (
            Chart(
                "Time to go",
                "From each cycle to its predicted cut-off.",
                "s",
                lines.guidance("time_to_go_s", 3),
            ),
            Chart(
                "Iterations",
                "Of the predictor-corrector, per cycle.",
                "per cycle",
                lines.guidance("iterations", 0, step=True),
            ),
            Chart(
                "Predicted cut-off",
                "When the main engine will be cut off.",
                "s",
                lines.guidance("cutoff_s", 4, step=True),
            ),
            Chart(
                "Predicted jettison",
                "When the next part will be dropped, as long as one is left.",
                "s",
                lines.guidance("jettison_s", 4, step=True),
            ),
        ),
    ),
    (
        "Navigation",
        "Navigation minus truth.",
        (
            Chart(
                "Position error",
                "Distance of the navigated from the true position.",
                "m",
                lines.navigation("position_m", 1.0, 4),
            ),
            Chart(
                "Velocity error",
                "Size of the difference of navigated and true velocity.",
                "m/s",
                lines.navigation("velocity_m_s", 1.0, 6),
            ),
        ),
    ),
)


def make_chapters(
    flights: Sequence[DrawnFlight],
    names: Sequence[str],
    instants: Sequence[Guide],
    in_air: Sequence[Guide] = (),
) -> tuple[Chapter, ...]:
    """Make the charts of some flights, numbered; leave out those without data.

    Args:
        flights: one, or several overlaid.
        names: of the flights, for legends.
        instants: to mark in each chart over the whole flight.
        in_air: to mark in each chart over its part in the air.
    """
    first, last = span_of(flights)
    times = _time(first, last), instants
    left = max((flight.air.until_s for flight in flights if flight.air), default=last)
    air_times = _time(first, left), [mark for mark in in_air if mark.at <= left]
    chapters: list[Chapter] = []
    for title, text, charts in CHAPTERS:
        items = []
        for chart in charts:
            series = _series(chart, flights, names)
            if not series:
                continue
            axis = _with_room(chart.axis, series, chart.least)
            time, marked = air_times if chart.in_air else times
            levels = _levels(chart, flights)
            if chart.in_air and levels:
                axis = _with_levels(axis, series, levels)
            figure = Figure(time, axis, series, tuple(marked), levels)
            if chart.x is not None:
                figure = replace(figure, x=chart.x, instants=())
            if chart.is_map:
                figure = _with_land(figure, flights[0])
            items.append(item(chart.title, figure, chart.see, wide=chart.is_map))
        if items:
            chapters.append(Chapter(len(chapters) + 1, title, text, tuple(items)))
    return numbered(chapters)


def _time(first: float, last: float) -> Axis:
    room = 0.01 * (last - first)
    return Axis("mission elapsed time", "s", span=(first - room, last + room))


def lies_over(flight: DrawnFlight) -> bool:
    """Return whether a flight is drawn over those beside it: the optimum that they follow."""
    return flight.law == OPTIMUM


def _series(
    chart: Chart, flights: Sequence[DrawnFlight], names: Sequence[str]
) -> tuple[Series, ...]:
    """Make the lines of a chart: one flight, a colour per line; several, a colour per flight."""
    found = []
    lines = [chart.lines(flight) for flight in flights]
    shared = sum(map(bool, lines)) > 1
    shapes = [_SHAPES_OVER if shared and lies_over(flight) else _SHAPES for flight in flights]
    for k in range(len(flights)):
        for i, one in enumerate(lines[k]):
            together = len(flights) > 1
            name = one.name or chart.axis.title
            if together:
                name = f"{names[k]}, {one.name}" if one.name else names[k]
            shape: Shape = shapes[k][i] if together else "line"
            drawn = line(
                name,
                ROLES[k] if together else ROLES[2 * i],
                one.x,
                one.y,
                one.digits,
                "step" if one.step and shape == "line" else shape,
                log=chart.axis.log,
                t=one.t,
            )
            found.append(drawn)
    return tuple(found)


#: Margin beside a ground track, deg; land beyond, in widths, since a map fills its frame.
_BESIDE_DEG = 1.0
_LAND_BEYOND = 6.0


def _with_land(figure: Figure, flight: DrawnFlight) -> Figure:
    """Fit a map to its tracks and add the coasts around them."""
    x, y = ([v for one in figure.series for v in getattr(one, k) if v is not None] for k in "xy")
    spans = [
        (min(values) - _BESIDE_DEG, max(values) + _BESIDE_DEG) if values else None
        for values in (x, y)
    ]
    middle = 0.5 * (min(y) + max(y)) if y else 0.0
    land: tuple[Series, ...] = ()
    rings = land_on(flight.mission.environment.earth.equatorial_radius_m)
    if rings and x:
        width = _LAND_BEYOND * max(max(x) - min(x), max(y) - min(y), 2.0 * _BESIDE_DEG)
        box = (min(x) - width, max(x) + width, min(y) - width, max(y) + width)
        land = (coasts(rings, box),)
    return replace(
        figure,
        x=replace(figure.x, span=spans[0]),
        y=replace(figure.y, span=spans[1]),
        series=(*figure.series, *land),
        stretch=1.0 / max(math.cos(math.radians(middle)), 0.1),
    )


def _levels(chart: Chart, flights: Sequence[DrawnFlight]) -> tuple[Guide, ...]:
    """Return the horizontal lines that all flights share; of one flight, with what it spares."""
    first, *others = (chart.levels(flight) for flight in flights)
    known = [{(level.at, level.text) for level in levels} for levels in others]
    return tuple(
        Guide(level.at, level.text + ("" if others else level.spare))
        for level in first
        if all((level.at, level.text) in levels for levels in known)
    )


def _with_levels(axis: Axis, series: Sequence[Series], levels: Sequence[Guide]) -> Axis:
    """Widen an axis so that horizontal lines and their words show."""
    values = [y for one in series for y in one.y if y is not None]
    values += [level.at for level in levels]
    low, high = min(values), max(values)
    return replace(axis, span=(low - 0.03 * (high - low), high + 0.12 * (high - low)))


def _with_room(axis: Axis, series: Sequence[Series], at_least: float) -> Axis:
    """Widen an axis so that the noise of a level line does not fill it."""
    values = [y for one in series for y in one.y if y is not None]
    if axis.log or not values:
        return axis
    low, high = min(values), max(values)
    least = max(1e-5 * max(abs(low), abs(high), 1e-3), at_least / (2.0 * _LEVEL_ROOM))
    if high - low >= least:
        return axis
    middle = 0.5 * (low + high)
    return replace(axis, span=(middle - _LEVEL_ROOM * least, middle + _LEVEL_ROOM * least))
