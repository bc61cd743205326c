# SPDX-License-Identifier: Apache-2.0
"""Compute the results of PEG: Tables 6.7 and 6.8, Figures 6.8 to 6.17."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from ares_models.orbits import Insertion
from ares_studies.pages.parts import (
    Axis,
    Column,
    Figure,
    Guide,
    PageTable,
    Role,
    Row,
    Series,
    line,
    marks,
    number,
    small,
)
from ares_thesis.history import History
from ares_thesis.pins import WATCHED
from ares_thesis.reproduce import printed
from ares_thesis.reproduce.figures import (
    ANGLE,
    HEATING,
    MASS,
    PITCH,
    RADIUS,
    SPEED,
    TIME,
    Quantity,
    levels,
)
from ares_thesis.reproduce.model import beside
from ares_thesis.reproduce.sources import Sources
from ares_vehicle_sim.arrays import JETTISON_DONE

OURS = "multi-stage PEG"
PRINTED = "PEG of the thesis, flown here"


NODE = Quantity("ascending_node_deg", Axis("ascending node", "deg"), "deg", 1.0, 8)
INCLINATION = Quantity("inclination_deg", Axis("inclination", "deg"), "deg", 1.0, 8)


def jettison_s(history: History) -> float:
    """Return the time of the fairing jettison, s."""
    events = history.flight.events
    return float(events["time"][events["type"] == JETTISON_DONE][0])


def _end(s: Sources, history: History) -> dict[str, float]:
    """Return times, errors at cut-off and final mass, by the names of Table 6.7."""
    plant = history.flight.plant
    flown = Insertion.from_state(plant["position"], plant["velocity"])
    target = s.arrays.target[0]
    cutoff = float(plant["time"])
    degrees = math.degrees(1.0)
    return {
        "cutoff_s": cutoff,
        "burn_s": cutoff - jettison_s(history),
        "radius_error_m": flown.radius - float(target["radius"]),
        "speed_error_m_s": flown.speed - float(target["speed"]),
        "flight_path_angle_error_deg": degrees
        * (flown.flight_path_angle - float(target["flight_path_angle"])),
        "inclination_error_deg": degrees * (flown.inclination - float(target["inclination"])),
        "final_mass_kg": float(plant["mass"]),
        "jettison_s": jettison_s(history),
    }


def table_6_7(s: Sources) -> PageTable:
    """Tabulate the ends of PEG's flights."""
    thesis = printed.values("table-6.7")
    here, ours = _end(s, s.peg_printed), _end(s, s.peg)
    rows = []
    for key, label, digits in (
        ("cutoff_s", "Cut-off, s", 2),
        ("burn_s", "Burn after the jettison, s", 1),
        ("radius_error_m", "Radius error, m", None),
        ("speed_error_m_s", "Speed error, m/s", None),
        ("flight_path_angle_error_deg", "Flight-path angle error, deg", None),
        ("inclination_error_deg", "Inclination error, deg", None),
        ("final_mass_kg", "Final mass, kg", 0),
    ):
        note = _NOTES_6_7.get(key, "").format_map(s.facts)
        if digits is None:
            values = (thesis[key], here[key], here[key] - thesis[key], ours[key])
            rows.append(Row(label, tuple(small(value) for value in values), note))
        else:
            rows.append(
                beside(label, thesis[key], here[key], digits, note=note, after=(ours[key],))
            )
    return PageTable(
        (
            Column("PEG", "thesis"),
            Column("PEG of the thesis", "here"),
            Column("difference"),
            Column(OURS, "here"),
        ),
        tuple(rows),
        "The thesis' jettison and cut-off are later because its whole ascent is, the optimum "
        "included [E2].",
    )


_NOTES_6_7 = {
    "radius_error_m": (
        "The simulator here cuts off at the predicted instant, not at the next step, and the "
        "law re-times the cut-off on every navigation state."
    ),
    "final_mass_kg": (
        "At the thesis' cut-off time, full flow leaves {peg_full_flow_kg:,.0f} kg: "
        "{peg_gap_kg:,.0f} kg of the print do not close [E4]."
    ),
}


def table_6_8(s: Sources) -> PageTable:
    """Compare PEG with the optimum."""
    table = printed.values("table-6.8")
    here, ours = _end(s, s.peg_printed), _end(s, s.peg)
    optimum = {
        "jettison_s": s.optimum.t_plf_s,
        "cutoff_s": s.optimum.t_meco_s,
        "final_mass_kg": s.optimum.m_f_kg,
    }
    return PageTable(
        (
            Column("optimum", "thesis"),
            Column("optimum", "here"),
            Column("PEG", "thesis"),
            Column("PEG of the thesis", "here"),
            Column("difference"),
            Column(OURS, "here"),
        ),
        tuple(
            beside(
                *(label, table["peg"][key], here[key], digits, of_thesis),
                before=(number(table["optimum"][key], of_thesis), number(optimum[key], digits)),
                after=(ours[key],),
            )
            for key, label, of_thesis, digits in (
                ("jettison_s", "Jettison t_PLF, s", 2, 2),
                ("cutoff_s", "Cut-off t_f, s", 2, 2),
                ("final_mass_kg", "Final mass m_f, kg", 0, 1),
            )
        ),
        f"Below our optimum: {optimum['final_mass_kg'] - here['final_mass_kg']:,.0f} kg with the "
        f"thesis' PEG, {optimum['final_mass_kg'] - ours['final_mass_kg']:,.0f} kg with the "
        f"multi-stage PEG. In print it is "
        f"{table['optimum']['final_mass_kg'] - table['peg']['final_mass_kg']:,} kg, of which "
        f"{s.facts['peg_gap_kg']:,.0f} kg do not close [E4]. A jettison as late as the thesis' "
        f"costs the optimum itself {optimum['final_mass_kg'] - s.held.m_f_kg:,.0f} kg.",
    )


def table_6_8_pins(s: Sources) -> PageTable:
    """Tabulate the cost of each pin of the thesis' architecture."""
    return PageTable(
        (
            Column("jettison, s"),
            Column("cut-off, s"),
            Column("final mass, kg"),
            Column("below optimum, kg"),
            Column("prediction moves, s"),
        ),
        tuple(
            Row(
                _name_of(row.name),
                (
                    number(row.t_plf_s, 2),
                    number(row.t_f_s, 2),
                    number(row.m_f_kg, 1),
                    number(row.cost_kg, 1),
                    number(row.jitter_s, 2),
                ),
            )
            for row in s.pins.values()
        ),
        "Not the pins cost the mass but the one unsettled pass per cycle: iterated until nothing "
        f"moves, the thesis' architecture loses {s.facts['settled_kg']:.1f} kg instead of "
        f"{s.facts['pinned_kg']:.0f} kg. Releasing node and inclination gives back "
        f"{s.facts['plane_kg']:.2f} kg. The last column is how far the predicted jettison moves "
        "within 20 s of staging [E29].",
    )


def _name_of(row: str) -> str:
    name = row.replace("peg_thesis", "PEG of the thesis")
    return name[0].upper() + name[1:]


def table_6_8_thrust(s: Sources) -> PageTable:
    """Tabulate final masses with wrong thrust."""
    return PageTable(
        (
            Column("PEG of the thesis, kg", "third"),
            Column("the same, settled, kg", "third"),
            Column("multi-stage PEG, kg", "here"),
            Column("the pins cost, kg"),
        ),
        tuple(
            Row(
                f"Thrust {number(100.0 * row.error, 0, signed=True).text} %",
                (
                    number(row.pinned_kg, 0),
                    number(row.converged_kg, 0),
                    number(row.free_kg, 0),
                    number(row.free_kg - row.pinned_kg, 0),
                ),
            )
            for row in s.wrong_thrust
        ),
        "A state at the jettison that was right for the engines foreseen is wrong for others. "
        "With too little thrust the pins cost tonnes.",
    )


TABLES: dict[str, Callable[[Sources], PageTable]] = {
    "table-6.7": table_6_7,
    "table-6.8": table_6_8,
    "table-6.8-pins": table_6_8_pins,
    "table-6.8-thrust": table_6_8_thrust,
}


def _instants(s: Sources) -> tuple[Guide, ...]:
    """Return staging, and jettison and cut-off of the thesis' PEG."""
    return (
        Guide(s.staging_s, "staging"),
        Guide(round(jettison_s(s.peg_printed), 3), "jettison"),
        Guide(round(float(s.peg_printed.flight.plant["time"]), 3), "cut-off"),
    )


def _flights(quantity: Quantity, s: Sources) -> list[Series]:
    return [
        quantity.draw("optimum", "other", s.optimum_profile, "band"),
        quantity.draw(PRINTED, "third", s.peg_printed),
        quantity.draw(OURS, "here", s.peg),
    ]


def _point(key: str, value: float, words: str) -> Series:
    """Mark a value printed for the thesis' PEG, at one of its times."""
    time = printed.values("table-6.8")["peg"][key]
    return marks("thesis, printed", "thesis", [(time, value, words)])


def _printed_end(quantity: Quantity) -> tuple[Series, ...]:
    target = printed.values("table-2.1")["target"]
    mass = printed.values("table-6.7")["final_mass_kg"]
    ends = {
        RADIUS.column: (target["radius_m"] / 1e3, "target radius at the thesis' cut-off"),
        SPEED.column: (target["speed_m_s"] / 1e3, "target speed at the thesis' cut-off"),
        ANGLE.column: (target["flight_path_angle_deg"], "target angle at the thesis' cut-off"),
        INCLINATION.column: (target["inclination_deg"], "target inclination, met to 7e-8 deg"),
        MASS.column: (mass / 1e3, f"Table 6.7: {mass:,} kg"),
    }
    if quantity.column not in ends:
        return ()
    return (_point("cutoff_s", *ends[quantity.column]),)


def _flown(quantity: Quantity, s: Sources) -> Figure:
    """Draw figures 6.8 to 6.13, 6.16 and 6.17."""
    points = _printed_end(quantity)
    if quantity is HEATING:
        points = (_point("jettison_s", s.heating_limit_w_m2 / 1e3, "Table 6.8: jettison"),)
    return Figure(
        TIME,
        quantity.axis,
        (*_flights(quantity, s), *points),
        _instants(s),
        levels(s, quantity),
    )


def _predicted(column: str, title: str, key: str, s: Sources) -> Figure:
    """Draw figures 6.14 and 6.15: guidance's predictions during the flight."""
    value = printed.values("table-6.8")["peg"][key]

    def draw(name: str, role: Role, history: History) -> Series:
        return line(name, role, history.time_s, getattr(history, column), 3, "step")

    return Figure(
        TIME,
        Axis(title, "s"),
        (
            draw(PRINTED, "third", s.peg_printed),
            draw(OURS, "here", s.peg),
            _point(key, value, f"Table 6.8: {value:.2f} s"),
        ),
        _instants(s)[: 2 if key == "jettison_s" else 3],
        finding=_settling(s, column),
    )


def _settling(s: Sources, column: str) -> str:
    """Describe the range of the predictions from staging to their end."""
    spans = []
    for history in (s.peg_printed, s.peg):
        values = getattr(history, column)[history.time_s > s.staging_s - WATCHED]
        spans.append(float(np.ptp(values[np.isfinite(values)])))
    return (
        f"From {WATCHED:.0f} s before staging on, the prediction moves by {spans[0]:.1f} s with "
        f"the thesis' PEG and by {spans[1]:.1f} s with the multi-stage PEG."
    )


FIGURES: dict[str, Callable[[Sources], Figure]] = {
    "figure-6.8": partial(_flown, RADIUS),
    "figure-6.9": partial(_flown, SPEED),
    "figure-6.10": partial(_flown, MASS),
    "figure-6.11": partial(_flown, HEATING),
    "figure-6.12": partial(_flown, PITCH),
    "figure-6.13": partial(_flown, ANGLE),
    "figure-6.14": partial(_predicted, "predicted_jettison_s", "predicted jettison", "jettison_s"),
    "figure-6.15": partial(_predicted, "predicted_cutoff_s", "predicted cut-off", "cutoff_s"),
    "figure-6.16": partial(_flown, NODE),
    "figure-6.17": partial(_flown, INCLINATION),
}
