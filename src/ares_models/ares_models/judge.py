# SPDX-License-Identifier: Apache-2.0
"""The judge of a flight's end: outcome, errors against the target, lack of speed.

Flights, campaigns, abort maps and the proof of an optimum all use it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models import arrays as layout
from ares_models.arrays import Record
from ares_models.kernels.judging import JUDGED, judge_state
from ares_models.tolerances import SPEED_M_S

Vector = Sequence[float] | NDArray[np.float64]

JUDGEMENT = np.dtype(JUDGED, align=True)


class End(StrEnum):
    """Name the outcomes of a flight, the best first."""

    #: all elements that the target names, within their tolerances
    TARGET = "target"
    #: the target's plane, radius and angle (or perigee) at less speed, with a safe perigee; or, if
    #: the target's own perigee is below the safe limit, a perigee no lower than the target's
    LOWERED = "lowered"
    #: another orbit with a perigee above the safe limit
    SAFE_ORBIT = "safe_orbit"
    #: an orbit that does not last, or the ground
    SUBORBITAL = "suborbital"

    @property
    def rank(self) -> int:
        """Return the rank of the outcome, 0 for the best."""
        return list(End).index(self)


class JudgedQuantity(NamedTuple):
    """Describe a quantity that a target may constrain.

    Attributes:
        name: of its field in TARGET and, with _error and _allowed, in JUDGED.
        bit: NAMES_*.
        unit: m, m/s, deg, 1 or m2/s2.
    """

    name: str
    bit: int
    unit: str

    @property
    def key(self) -> str:
        """Return the name with the unit as suffix."""
        return self.name + self.suffix

    @property
    def suffix(self) -> str:
        """Return the unit as the suffix of a name."""
        return _SUFFIXES[self.unit]

    @property
    def label(self) -> str:
        """Return the name in words."""
        return _LABELS.get(self.name) or self.name.replace("_", " ")

    def in_words(self, value: float) -> str:
        """Format a value in the figure's unit, with three figures and the unit."""
        return f"{value:,.3g}" + (f" {self.unit}" if self.unit != "1" else "")

    def in_unit(self, value: float) -> float:
        """Convert a value from SI and rad to the figure's unit."""
        return math.degrees(value) if self.unit == "deg" else float(value)


_LABELS = {
    "flight_path_angle": "flight-path angle",
    "semi_major_axis": "semi-major axis",
    "c3": "C3",
}
_SUFFIXES = {"m": "_m", "m/s": "_m_s", "deg": "_deg", "1": "", "m2/s2": "_m2_s2"}
FIGURES = (
    JudgedQuantity("radius", layout.NAMES_RADIUS, "m"),
    JudgedQuantity("speed", layout.NAMES_SPEED, "m/s"),
    JudgedQuantity("flight_path_angle", layout.NAMES_FLIGHT_PATH_ANGLE, "deg"),
    JudgedQuantity("inclination", layout.NAMES_INCLINATION, "deg"),
    JudgedQuantity("ascending_node", layout.NAMES_ASCENDING_NODE, "deg"),
    JudgedQuantity("argument_of_perigee", layout.NAMES_ARGUMENT_OF_PERIGEE, "deg"),
    JudgedQuantity("perigee_radius", layout.NAMES_PERIGEE, "m"),
    JudgedQuantity("apogee_radius", layout.NAMES_APOGEE, "m"),
    JudgedQuantity("semi_major_axis", layout.NAMES_SEMI_MAJOR_AXIS, "m"),
    JudgedQuantity("eccentricity", layout.NAMES_ECCENTRICITY, "1"),
    JudgedQuantity("c3", layout.NAMES_C3, "m2/s2"),
    JudgedQuantity("true_anomaly", layout.NAMES_TRUE_ANOMALY, "deg"),
)


@dataclass(frozen=True)
class Judgement:
    """Hold the judgement of a flight's end.

    Attributes:
        end: outcome.
        names: NAMES_* of the figures that the target constrains.
        errors: flown minus target of these figures, by :attr:`Figure.key`.
        allowed: tolerance of each.
        lacking_m_s: speed deficit of the energy, at the target's lowest point; negative: surplus.
        perigee_altitude_m: above the equatorial radius.
        apogee_altitude_m: above the equatorial radius; inf for an escape.
    """

    end: End
    names: int
    errors: dict[str, float]
    allowed: dict[str, float]
    lacking_m_s: float
    perigee_altitude_m: float
    apogee_altitude_m: float

    def error_of(self, name: str) -> tuple[float, float]:
        """Return error and tolerance of a figure by its :attr:`Figure.name`."""
        key = next(figure.key for figure in FIGURES if figure.name == name)
        return self.errors[key], self.allowed[key]

    def missed(self) -> list[JudgedQuantity]:
        """Return the figures whose error is beyond its tolerance."""
        return [
            figure
            for figure in FIGURES
            if figure.key in self.errors
            and not abs(self.errors[figure.key]) <= self.allowed[figure.key]
        ]

    def misses(self) -> list[str]:
        """Return one text for each error beyond its tolerance."""
        return [
            f"{figure.label} off by {figure.in_words(self.errors[figure.key])}, "
            f"allowed {figure.in_words(self.allowed[figure.key])}"
            for figure in self.missed()
        ]

    def reached(self) -> str:
        """Return the outcome in a few words."""
        if not math.isfinite(self.perigee_altitude_m):
            return "no orbit"
        perigee = f"perigee {self.perigee_altitude_m / 1e3:,.1f} km"
        if self.end is End.LOWERED and self.lacking_m_s > SPEED_M_S:
            return f"target lowered by {self.lacking_m_s:,.1f} m/s"
        if self.end is End.SUBORBITAL and self.lacking_m_s > SPEED_M_S:
            return f"suborbital, {perigee}, {self.lacking_m_s:,.1f} m/s short"
        missed = self.missed()
        if self.end is End.LOWERED and len(missed) == 1:
            return f"all of the target but its {missed[0].label}, {perigee}"
        return f"{_WORDS[self.end]}, {perigee}"


_WORDS = {
    End.TARGET: "on the target",
    End.LOWERED: "another orbit",
    End.SAFE_ORBIT: "safe orbit",
    End.SUBORBITAL: "suborbital",
}


def judge(
    position: Vector,
    velocity: Vector,
    target: Record,
    mu: float,
    ground_m: float,
    *,
    grounded: bool = False,
) -> Judgement:
    """Judge the state at the end of a flight.

    Args:
        position: m, shape (3,).
        velocity: m/s, shape (3,).
        target: record TARGET.
        mu: m3/s2.
        ground_m: equatorial radius.
        grounded: the flight went below the ground or its floor.
    """
    r, v = ((float(x), float(y), float(z)) for x, y, z in (position, velocity))
    row = np.zeros(1, JUDGEMENT)[0]
    judge_state(r, v, target, float(mu), float(ground_m), grounded, row)
    figures = [figure for figure in FIGURES if int(row["judged"]) & figure.bit]
    return Judgement(
        list(End)[row["end"]],
        int(row["judged"]),
        {f.key: f.in_unit(row[f"{f.name}_error"]) for f in figures},
        {f.key: f.in_unit(row[f"{f.name}_allowed"]) for f in figures},
        float(row["lacking_speed"]),
        float(row["perigee_radius"]) - ground_m,
        float(row["apogee_radius"]) - ground_m,
    )


def left_on(jettisoned: int, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the jettisons that were not dropped.

    Args:
        jettisoned: bit k: jettison k is done.
        names: of the mission's jettisons.
    """
    return tuple(name for k, name in enumerate(names) if not jettisoned >> k & 1)
