# SPDX-License-Identifier: Apache-2.0
"""Compute the tables of the thesis, each by a function of the sources."""

import math
from collections.abc import Callable

import numpy as np

from ares_optimizer.solution import Solution
from ares_studies.pages.parts import (
    BLANK,
    Column,
    PageTable,
    Row,
    number,
    power,
    word,
)
from ares_thesis.closed_form import gravity_table
from ares_thesis.reproduce import printed
from ares_thesis.reproduce.model import BESIDE, beside
from ares_thesis.reproduce.sources import Sources
from ares_thesis.transients import mass_after_full_flow


def table_2_1(s: Sources) -> PageTable:
    """Tabulate initial state and target."""
    thesis = printed.values("table-2.1")
    target = s.arrays.target[0]
    states = {
        "initial": {name: float(getattr(s.start, name)) for name in _INSERTION},
        "target": {name: float(target[name]) for name in _INSERTION},
    }
    rows = []
    for when, state in states.items():
        for name, (label, unit, scale, of_thesis, decimals) in zip(
            _INSERTION, _INSERTION_ROWS, strict=True
        ):
            rows.append(
                beside(
                    f"{when.capitalize()} {label}, {unit}",
                    thesis[when][f"{name}_{unit.replace('/', '_')}"],
                    scale * state[name],
                    decimals,
                    of_thesis=of_thesis,
                    note=_NOTES_2_1.get((when, name), ""),
                )
            )
    return PageTable(BESIDE, tuple(rows))


_INSERTION = ("radius", "speed", "flight_path_angle", "inclination")
_INSERTION_ROWS = (
    ("radius", "m", 1.0, 0, 0),
    ("speed", "m/s", 1.0, 3, 3),
    ("flight-path angle", "deg", math.degrees(1.0), 4, 4),
    ("inclination", "deg", math.degrees(1.0), 1, 4),
)
_NOTES_2_1 = {
    ("initial", "radius"): "The vectors give the next whole metre.",
    ("initial", "speed"): "The print is rounded up.",
    ("initial", "flight_path_angle"): (
        "The vectors of Eqs. 2.17 and 2.19 give 10.44 deg, and they are what is flown [E1]."
    ),
    ("initial", "inclination"): "From the vectors; the print is rounded.",
}


def table_2_2(s: Sources) -> PageTable:
    """Tabulate the vehicle, and check that its masses are consistent."""
    thesis = printed.values("table-2.2")
    core_arc, upper_arc = s.arrays.arcs[0], s.arrays.arcs[-1]
    burnout = float(core_arc["stack_mass"]) - float(core_arc["mass_flow"]) * (
        s.staging_s - s.mission.initial_state.time_s
    )
    rows = (
        beside("Start, s", thesis["start_s"], s.mission.initial_state.time_s, 1),
        beside("Mass at the start, kg", thesis["start_mass_kg"], s.mission.ignition_mass(0), 0),
        beside("Core thrust, N", thesis["core_thrust_n"], float(core_arc["thrust"]), 0),
        beside("Core specific impulse, s", thesis["core_isp_s"], _isp(s, 0), 1),
        beside("Staging, s", thesis["staging_s"], s.staging_s, 2),
        beside("Mass after staging, kg", thesis["upper_mass_kg"], s.mission.ignition_mass(1), 0),
        beside("Upper-stage thrust, N", thesis["upper_thrust_n"], float(upper_arc["thrust"]), 0),
        beside("Upper-stage specific impulse, s", thesis["upper_isp_s"], _isp(s, -1), 1),
        beside("Fairing, kg", thesis["fairing_kg"], float(s.arrays.jettisons["mass"][0]), 0),
        Row(
            "Jettison, s",
            (word("free"), number(s.optimum.t_plf_s, 2), number(math.nan, 2)),
            "Found by the optimizer.",
        ),
        beside("Flow of the core, kg/s", math.nan, float(core_arc["mass_flow"]), 2),
        beside("Mass at core burnout, kg", math.nan, burnout, 0),
        beside("Stays behind at staging, kg", math.nan, burnout - s.mission.ignition_mass(1), 0),
        beside("Flow of the upper stage, kg/s", math.nan, float(upper_arc["mass_flow"]), 3),
    )
    closes = mass_after_full_flow(s.mission, printed.values("table-4.1")["thesis"]["cutoff_s"])
    return PageTable(
        BESIDE,
        rows,
        f"Full flow to the thesis' cut-off leaves {closes:,.0f} kg, which is what Table 4.1 "
        "prints, rounded. The data are complete.",
    )


def _isp(s: Sources, arc: int) -> float:
    return float(s.arrays.arcs[arc]["exhaust_velocity"]) / s.mission.environment.g0_m_s2


def table_3_1(s: Sources) -> PageTable:
    """Compare inverse-square and linear gravity along the optimum."""
    thesis = printed.values("table-3.1")
    flight = s.optimum_profile
    last_of_core = int((flight.time_s < s.staging_s).sum())
    radii = [float(flight.radius_m[i]) for i in (0, last_of_core, -1)]
    ours = gravity_table(s.mission.environment.mu_m3_s2, radii)
    rows = []
    for i, when in enumerate(("start", "staging", "cut-off")):
        here = ours[i]
        rows.append(
            Row(
                f"At {when}",
                (
                    number(thesis["inverse_square"][i], 3),
                    number(here.inverse_square_m_s2, 3),
                    power(thesis["linear"][i]),
                    number(here.linear_m_s2, 3),
                    number(here.linear_m_s2 - here.inverse_square_m_s2, 3, signed=True),
                ),
                _note_3_1(s, i),
            )
        )
    return PageTable(
        (
            Column("inverse-square, m/s²", "thesis"),
            Column("inverse-square, m/s²", "here"),
            Column("linear, m/s²", "thesis"),
            Column("linear, m/s²", "here"),
            Column("linear too strong by, m/s²"),
        ),
        tuple(rows),
        "Restarted from the present radius in every cycle, linear gravity has no error at all; "
        "held over a burn of 430 s it ends kilometres off [E16].",
    )


def _note_3_1(s: Sources, row: int) -> str:
    mu = s.mission.environment.mu_m3_s2
    radius = math.sqrt(mu / printed.values("table-3.1")["inverse_square"][row])
    literal = (mu / radius**3) ** 2 * radius / 1e3
    if row == 0:
        return (
            "The printed linear column is Eq. 3.4 taken literally: with ω_0 = μ/r³ squared, "
            f"without the root, ω_0² r is {power(literal).text} km/s² here, and so on down "
            "the column [E12, E13]."
        )
    if row == 1:
        flight = s.optimum_profile
        above = int(np.argmax(flight.radius_m >= radius))
        return (
            f"The print belongs to a radius of {radius / 1e3:,.1f} km. The optimum passes there at "
            f"{flight.time_s[above]:,.0f} s, long after staging."
        )
    return ""


def table_4_1(s: Sources) -> PageTable:
    """Tabulate the result of the optimization."""
    table = printed.values("table-4.1")
    otis, thesis = table["otis"], table["thesis"]
    ours = _results(s.optimum)
    notes = {
        "jettison_s": "Lofted higher, the vehicle leaves the heating sooner. The time follows the "
        "density above 110 km, which the thesis does not print [E7].",
        "burn_s": "The earlier the jettison, the longer the burn that is left.",
        "cutoff_s": "Less propellant is needed, and flow is constant.",
        "final_mass_kg": f"With the jettison held at the thesis' {s.held.t_plf_s:.2f} s it is "
        f"still {s.held.m_f_kg:,.1f} kg [E2].",
    }
    rows = [
        beside(
            *(label, thesis[key], ours[key], fine, digits, notes.get(key, "")),
            before=(number(otis[key], digits),),
        )
        for key, label, digits, fine in _RESULT_ROWS
    ]
    for label, solution, note in (
        ("Final mass, jettison held at the thesis' time, kg", s.held, "Not the cause."),
        (
            "Final mass, altitude above a sphere, kg",
            s.spherical,
            "The ellipsoid of Eq. 2.15 read as a sphere: not the cause either.",
        ),
        (
            "Final mass, heating ignored, kg",
            s.unheated,
            "Fairing off at staging: the most that Table 2.2 can lift.",
        ),
    ):
        mass = thesis["final_mass_kg"]
        rows.append(beside(label, mass, solution.m_f_kg, 1, 0, note, before=(word(BLANK),)))
    return PageTable(
        (
            Column("OTIS", "otis"),
            Column("thesis", "thesis"),
            Column("here", "here"),
            Column("here − thesis"),
        ),
        tuple(rows),
    )


def table_4_1_otis(s: Sources) -> PageTable:
    """Compare OTIS' row of Table 4.1 with the effect of transients."""
    otis = printed.values("table-4.1")["otis"]
    rows = [
        Row(
            row.name[0].upper() + row.name[1:],
            (
                number(row.t_plf_s, 2),
                number(row.t_meco_s, 2),
                number(row.t_meco_change_s, 2, signed=True),
                number(row.m_f_kg, 0),
                number(row.m_f_change_kg, 0, signed=True),
                number(row.m_f_kg - otis["final_mass_kg"], 0, signed=True),
            ),
            _NOTES_OTIS.get(row.name, ""),
        )
        for row in s.transient_rows.values()
    ]
    printed_row = (
        *(number(otis[key], 2) for key in ("jettison_s", "cutoff_s")),
        word(BLANK),
        number(otis["final_mass_kg"], 0),
        word(BLANK),
        word(BLANK),
    )
    return PageTable(
        (
            Column("jettison, s"),
            Column("cut-off, s"),
            Column("later by, s"),
            Column("final mass, kg"),
            Column("change, kg"),
            Column("above OTIS, kg"),
        ),
        (*rows, Row("OTIS, printed", printed_row)),
        f"Full flow from staging until {otis['cutoff_s']:.2f} s leaves "
        f"{s.facts['otis_full_flow_kg']:,.0f} kg, and any slower start leaves more. The last "
        f"{s.facts['otis_gap_kg']:,.0f} kg no transient explains: OTIS flew other masses [E3].",
    )


_NOTES_OTIS = {
    "RS-68 tail-off": "Assumed worth 0.958 s of full thrust, as that of the Shuttle's main engine.",
    "separation": "A coast of 0.7 s, as on the Saturn V.",
    "J-2X start": "A ramp like that of the J-2, full thrust after 3.2 s.",
    "all three, and RS-68 thrust lost": "As much more as it takes to cut off when OTIS does.",
    "full flow from staging on": "A bound, not a flight.",
}


#: Key, label, decimals in print, our decimals.
_RESULT_ROWS = (
    ("jettison_s", "Jettison t_PLF, s", 2, 2),
    ("burn_s", "Burn after it t_burn, s", 2, 2),
    ("cutoff_s", "Cut-off t_f, s", 2, 2),
    ("final_mass_kg", "Final mass m_f, kg", 0, 1),
)


def _results(solution: Solution) -> dict[str, float]:
    return {
        "jettison_s": solution.t_plf_s,
        "burn_s": solution.t_meco_s - solution.t_plf_s,
        "cutoff_s": solution.t_meco_s,
        "final_mass_kg": solution.m_f_kg,
    }


TABLES: dict[str, Callable[[Sources], PageTable]] = {
    "table-2.1": table_2_1,
    "table-2.2": table_2_2,
    "table-3.1": table_3_1,
    "table-4.1": table_4_1,
    "table-4.1-otis": table_4_1_otis,
}
