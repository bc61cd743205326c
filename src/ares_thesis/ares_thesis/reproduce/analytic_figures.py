# SPDX-License-Identifier: Apache-2.0
"""Draw the figures of the analytic solutions: 5.3, 5.4 and 6.1 to 6.6."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ares_studies.pages.parts import (
    Axis,
    Figure,
    Role,
    Series,
    Shape,
    about,
    line,
    marks,
)
from ares_thesis.analytic.flight import PlanarFlight
from ares_thesis.reproduce import printed
from ares_thesis.reproduce.analytic_tables import PlanarAscent, analytic_ascent, optimum_ascent
from ares_thesis.reproduce.figures import TIME, angle_marks, instants
from ares_thesis.reproduce.sources import Sources


def _fitted(column: str, title: str, s: Sources) -> Figure:
    """Draw figures 5.3 and 5.4: an angle of the optimum and the polynomials of chapter 5."""
    flight = s.planar_optimum
    worst = [getattr(piece, column).worst for piece in s.fits]
    return Figure(
        TIME,
        Axis(title, ""),
        (
            line("optimum", "other", flight.time_s, getattr(flight, column), 6, "band"),
            _fit(s, column, 3, 1.0, "polynomials of degree 2, 1 and 2, fitted"),
            *(_sine_marks() if column == "sin_gamma" else ()),
        ),
        instants(s, s.optimum),
        finding=f"The fits are off by at most {about(worst[0])}, {about(worst[1])} and "
        f"{about(worst[2])}.",
    )


def _fit(s: Sources, column: str, pieces: int, scale: float, name: str) -> Series:
    """Draw the first fitted polynomials, with gaps between them."""
    x: list[float] = []
    y: list[float] = []
    for piece in s.fits[:pieces]:
        times = np.linspace(piece.start_s, piece.end_s, 100)
        values = scale * getattr(piece, column).at(times - piece.start_s)
        x += [*times.tolist(), piece.end_s]
        y += [*values.tolist(), math.nan]
    return line(name, "here", x[:-1], y[:-1], 6)


def _sine_marks() -> tuple[Series, ...]:
    angles = angle_marks()
    sines = tuple(math.sin(math.radians(y)) for y in angles.y if y is not None)
    return (replace(angles, y=sines),)


@dataclass(frozen=True)
class Planar:
    """Draw radius or speed in the orbital plane."""

    column: str
    axis: Axis
    key: str

    def draw(self, name: str, role: Role, flight: PlanarFlight, shape: Shape = "line") -> Series:
        """Make a line of the column."""
        return line(name, role, flight.time_s, getattr(flight, self.column) / 1e3, 4, shape)


RADIUS = Planar("radius", Axis("radius", "km"), "radius_km")
SPEED = Planar("speed", Axis("inertial speed", "km/s"), "speed_km_s")


def _curves(
    quantity: Planar, s: Sources, piece: Callable[[PlanarAscent], PlanarFlight]
) -> list[Series]:
    return [
        quantity.draw("optimum", "other", piece(optimum_ascent(s)), "band"),
        quantity.draw(
            "analytic, as printed", "third", piece(analytic_ascent(s, s.analytic_printed)), "dashes"
        ),
        quantity.draw("analytic, improved", "here", piece(analytic_ascent(s, s.analytic_improved))),
    ]


def _off(quantity: Planar, s: Sources, piece: Callable[[PlanarAscent], PlanarFlight]) -> str:
    """Describe the largest distance of the two solutions from the optimum at equal times."""
    true = piece(optimum_ascent(s))
    apart = []
    for found in (s.analytic_printed, s.analytic_improved):
        flight = piece(analytic_ascent(s, found))
        times = np.arange(math.ceil(true.time_s[0]), min(true.time_s[-1], flight.time_s[-1]))
        values = [np.interp(times, f.time_s, getattr(f, quantity.column)) for f in (true, flight)]
        apart.append(float(np.max(np.abs(values[0] - values[1]))))
    unit = "m" if quantity is RADIUS else "m/s"
    return (
        f"Greatest distance to the optimum at the same time: {about(apart[0])} {unit} as printed, "
        f"{about(apart[1])} {unit} improved."
    )


def _part_one(quantity: Planar, s: Sources) -> Figure:
    """Draw figures 6.1 and 6.2."""

    def piece(ascent: PlanarAscent) -> PlanarFlight:
        return ascent.flight.between(float(ascent.flight.time_s[0]), ascent.jettison_s)

    series = _curves(quantity, s, piece)
    if quantity is SPEED:
        series.append(
            replace(
                _fit(s, "speed", 2, 1e-3, "quadratic and line fitted to the optimum"),
                role="thesis",
                shape="dots",
            )
        )
    return Figure(
        TIME,
        quantity.axis,
        tuple(series),
        instants(s, s.optimum)[:2],
        finding=_off(quantity, s, piece),
    )


def _printed_ends(quantity: Planar, *which: str) -> Series:
    """Mark the cut-off as printed in Table 6.5."""
    table = printed.values("table-6.5")
    return marks(
        "thesis, printed",
        "thesis",
        [
            (table[key]["cutoff_s"], table[key][quantity.key], f"Table 6.5: {key}, cut-off")
            for key in which
        ],
    )


def _part_two(quantity: Planar, s: Sources) -> Figure:
    """Draw figures 6.3 and 6.4."""

    def piece(ascent: PlanarAscent) -> PlanarFlight:
        return ascent.flight.between(ascent.jettison_s, ascent.cutoff_s)

    return Figure(
        TIME,
        quantity.axis,
        (*_curves(quantity, s, piece), _printed_ends(quantity, "analytic")),
        instants(s, s.optimum)[1:],
        finding=_off(quantity, s, piece),
    )


def _both(quantity: Planar, s: Sources) -> Figure:
    """Draw figures 6.5 and 6.6."""

    def whole(ascent: PlanarAscent) -> PlanarFlight:
        return ascent.flight

    return Figure(
        TIME,
        quantity.axis,
        (*_curves(quantity, s, whole), _printed_ends(quantity, "optimum", "analytic")),
        instants(s, s.optimum)[:2],
        finding=_off(quantity, s, whole),
    )


FIGURES: dict[str, Callable[[Sources], Figure]] = {
    "figure-5.3": partial(_fitted, "sin_gamma", "sine of the flight-path angle"),
    "figure-5.4": partial(_fitted, "cos_alpha", "cosine of the steering angle"),
    "figure-6.1": partial(_part_one, SPEED),
    "figure-6.2": partial(_part_one, RADIUS),
    "figure-6.3": partial(_part_two, RADIUS),
    "figure-6.4": partial(_part_two, SPEED),
    "figure-6.5": partial(_both, RADIUS),
    "figure-6.6": partial(_both, SPEED),
}
