# SPDX-License-Identifier: Apache-2.0
"""Draw the figures of the thesis, each by a function of the sources."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ares_optimizer.solution import Solution
from ares_studies.pages.parts import (
    Axis,
    Figure,
    Guide,
    Role,
    Series,
    Shape,
    about,
    line,
    marks,
)
from ares_thesis.history import FlightHistory
from ares_thesis.reproduce import printed
from ares_thesis.reproduce.sources import Sources

TIME = Axis("mission elapsed time", "s")

Marks = Callable[[Sources], tuple[Series, ...]]


@dataclass(frozen=True)
class Quantity:
    """Define a quantity of a flight for figures.

    Attributes:
        column: of the profile.
        axis: name and unit.
        fine: unit of the column, for small differences.
        scale: from the unit of the column to that of the axis.
        digits: decimals that are kept.
    """

    column: str
    axis: Axis
    fine: str
    scale: float = 1e-3
    digits: int = 3

    def draw(self, name: str, role: Role, profile: FlightHistory, shape: Shape = "line") -> Series:
        """Make a line of the column."""
        values = self.scale * getattr(profile, self.column)
        return line(name, role, profile.time_s, values, self.digits, shape, log=self.axis.log)


ALTITUDE = Quantity("altitude_m", Axis("altitude", "km"), "m")
RADIUS = Quantity("radius_m", Axis("radius", "km"), "m")
SPEED = Quantity("speed_m_s", Axis("inertial speed", "km/s"), "m/s", digits=4)
MASS = Quantity("mass_kg", Axis("mass", "t"), "kg")
THRUST = Quantity("thrust_n", Axis("thrust", "MN", span=(0.0, 18.5)), "N", 1e-6, 4)
ANGLE = Quantity("flight_path_angle_deg", Axis("flight-path angle", "deg"), "deg", 1.0, 4)
PITCH = Quantity("pitch_deg", Axis("pitch of the thrust", "deg"), "deg", 1.0, 4)
HEATING = Quantity(
    "heating_w_m2",
    Axis("free molecular heating", "kW/m²", log=True, span=(0.2, 8000.0)),
    "W/m²",
    digits=5,
)


def instants(s: Sources, solution: Solution) -> tuple[Guide, ...]:
    """Return staging, jettison and cut-off of a solution."""
    return (
        Guide(s.staging_s, "staging"),
        Guide(round(solution.t_plf_s, 3), "jettison"),
        Guide(round(solution.t_meco_s, 3), "cut-off"),
    )


def _end_marks(value: Callable[[Sources], float], words: str) -> Marks:
    """Mark the printed cut-off times of thesis and OTIS, at a common value."""

    def points(s: Sources) -> tuple[Series, ...]:
        table = printed.values("table-4.1")
        at = value(s)
        return tuple(
            marks(who, role, [(table[key]["cutoff_s"], at, f"{who}: {words}")])
            for who, role, key in _PROGRAMS
        )

    return points


_PROGRAMS: tuple[tuple[str, Role, str], ...] = (
    ("thesis, printed", "thesis", "thesis"),
    ("OTIS, printed", "otis", "otis"),
)


def _altitude_marks(s: Sources) -> tuple[Series, ...]:
    # the target is printed as a radius; take the ground below our cut-off
    ground = s.optimum_profile.radius_m[-1] - s.optimum_profile.altitude_m[-1]
    target = printed.values("table-2.1")["target"]["radius_m"]
    return _end_marks(lambda _: (target - ground) / 1e3, "cut-off, at the target radius")(s)


def _speed_marks(s: Sources) -> tuple[Series, ...]:
    target = printed.values("table-2.1")["target"]["speed_m_s"]
    return _end_marks(lambda _: target / 1e3, "cut-off, at the target speed")(s)


def _mass_marks(_: Sources) -> tuple[Series, ...]:
    table = printed.values("table-4.1")
    vehicle = printed.values("table-2.2")
    thesis, otis = _PROGRAMS
    both = (
        (vehicle["start_s"], vehicle["start_mass_kg"] / 1e3, "Table 2.2: mass at the start"),
        (vehicle["staging_s"], vehicle["upper_mass_kg"] / 1e3, "Table 2.2: mass after staging"),
    )
    return tuple(
        marks(
            who,
            role,
            [
                *(both if key == "thesis" else ()),
                (
                    table[key]["cutoff_s"],
                    table[key]["final_mass_kg"] / 1e3,
                    f"Table 4.1: {table[key]['final_mass_kg']:,} kg",
                ),
            ],
        )
        for who, role, key in (thesis, otis)
    )


def _thrust_marks(_: Sources) -> tuple[Series, ...]:
    vehicle = printed.values("table-2.2")
    return (
        marks(
            "thesis, printed",
            "thesis",
            [
                (vehicle["start_s"], vehicle["core_thrust_n"] / 1e6, "Table 2.2: core"),
                (vehicle["staging_s"], vehicle["upper_thrust_n"] / 1e6, "Table 2.2: upper stage"),
            ],
        ),
    )


def angle_marks() -> Series:
    """Mark the printed flight-path angles of the thesis' optimum."""
    table = printed.values("table-2.1")
    vehicle = printed.values("table-2.2")
    staging = printed.values("table-6.1")["optimum"]["gamma_staging_deg"]
    end = printed.values("table-4.1")["thesis"]["cutoff_s"]
    return marks(
        "thesis, printed",
        "thesis",
        [
            (vehicle["start_s"], table["initial"]["flight_path_angle_deg"], "Table 2.1: start"),
            (vehicle["staging_s"], staging, "Table 6.1: optimum at staging"),
            (end, table["target"]["flight_path_angle_deg"], "Table 2.1: target"),
        ],
    )


def _angle_marks(_: Sources) -> tuple[Series, ...]:
    target = printed.values("table-2.1")["target"]["flight_path_angle_deg"]
    who, role, key = _PROGRAMS[1]
    end = printed.values("table-4.1")[key]["cutoff_s"]
    return (
        angle_marks(),
        marks(who, role, [(end, target, f"{who}: cut-off, at the target angle")]),
    )


def _heating_marks(s: Sources) -> tuple[Series, ...]:
    table = printed.values("table-4.1")
    limit = s.heating_limit_w_m2 / 1e3
    return tuple(
        marks(who, role, [(table[key]["jettison_s"], limit, f"{who}: jettison, at the limit")])
        for who, role, key in _PROGRAMS
    )


def _pitch_marks(_: Sources) -> tuple[Series, ...]:
    guess = printed.values("table-6.1")
    return (
        marks(
            "thesis, printed",
            "thesis",
            [
                (
                    printed.values("table-2.2")["start_s"],
                    guess["guess"]["theta_start_deg"],
                    "section 6.2: pitch assumed at the start",
                ),
                (
                    printed.values("table-4.1")["thesis"]["jettison_s"],
                    guess["optimum"]["theta_plf_deg"],
                    "Table 6.1: optimum at the jettison",
                ),
            ],
        ),
    )


_MARKS: dict[str, Marks] = {
    "altitude_m": _altitude_marks,
    "speed_m_s": _speed_marks,
    "mass_kg": _mass_marks,
    "thrust_n": _thrust_marks,
    "flight_path_angle_deg": _angle_marks,
    "heating_w_m2": _heating_marks,
    "pitch_deg": _pitch_marks,
}


def levels(s: Sources, quantity: Quantity) -> tuple[Guide, ...]:
    """Return the heating limit for a figure of heating."""
    if quantity is HEATING:
        return (Guide(s.heating_limit_w_m2 / 1e3, "limit"),)
    return ()


def _nominal(quantity: Quantity, s: Sources) -> Figure:
    """Draw figures 4.1 to 4.6: the optimum, and the optimum with the thesis' jettison time."""
    held = f"here, jettison held at {s.held.t_plf_s:.2f} s"
    curves = [
        quantity.draw("here, optimum", "here", s.optimum_profile),
        quantity.draw(held, "other", s.held_profile, "dashes"),
    ]
    if quantity is THRUST:
        # the effect of the transients that the thesis omits
        curves[1] = quantity.draw("here, with transients", "third", s.transients_profile, "dashes")
    return Figure(
        TIME,
        quantity.axis,
        (*curves, *_MARKS[quantity.column](s)),
        instants(s, s.optimum),
        levels(s, quantity),
    )


def _cases(quantity: Quantity, s: Sources) -> Figure:
    """Draw figures 4.7 and 4.9 to 4.14: 11, 14 and 20 parameters."""
    profiles = (s.optimum_profile, s.optimum14_profile, s.optimum20_profile)
    return Figure(
        TIME,
        quantity.axis,
        (
            quantity.draw("11 parameters", "here", profiles[0], "band"),
            quantity.draw("14 parameters", "other", profiles[1]),
            quantity.draw("20 parameters", "third", profiles[2], "dots"),
            *_MARKS[quantity.column](s),
        ),
        instants(s, s.optimum),
        levels(s, quantity),
        _how_far(quantity, profiles),
    )


#: Difference, in units of the column, below which it is due to rounding.
_ROUNDING = 1e-6


def _how_far(quantity: Quantity, profiles: Sequence[FlightHistory]) -> str:
    """Describe the largest distance between flights at whole seconds."""
    begin = math.ceil(profiles[0].time_s[0])
    times = np.arange(begin, min(profile.time_s[-1] for profile in profiles))
    values = [np.interp(times, p.time_s, getattr(p, quantity.column)) for p in profiles]
    spread = np.ptp(values, axis=0)
    unit = quantity.fine
    if quantity.axis.log:
        spread, unit = 100.0 * spread / values[0], "%"
    apart = float(np.max(spread))
    if apart < _ROUNDING:
        return "The three are the same to the last digit."
    return f"The three are nowhere more than {about(apart)} {unit} apart."


FIGURES: dict[str, Callable[[Sources], Figure]] = {
    "figure-4.1": partial(_nominal, ALTITUDE),
    "figure-4.2": partial(_nominal, SPEED),
    "figure-4.3": partial(_nominal, MASS),
    "figure-4.4": partial(_nominal, THRUST),
    "figure-4.5": partial(_nominal, ANGLE),
    "figure-4.6": partial(_nominal, HEATING),
    "figure-4.7": partial(_cases, PITCH),
    "figure-4.9": partial(_cases, ALTITUDE),
    "figure-4.10": partial(_cases, SPEED),
    "figure-4.11": partial(_cases, MASS),
    "figure-4.12": partial(_cases, THRUST),
    "figure-4.13": partial(_cases, ANGLE),
    "figure-4.14": partial(_cases, HEATING),
}
