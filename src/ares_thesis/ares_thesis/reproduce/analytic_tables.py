# SPDX-License-Identifier: Apache-2.0
"""Compute the tables of the analytic solutions: 5.1, 5.2 and 6.1 to 6.6."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from ares_studies.pages.parts import (
    Cell,
    Column,
    PageTable,
    Row,
    about,
    number,
    word,
)
from ares_thesis.analytic.flight import PlanarFlight
from ares_thesis.analytic.solve import AnalyticPart, AnalyticSolution
from ares_thesis.reproduce import printed
from ares_thesis.reproduce.model import BESIDE, beside
from ares_thesis.reproduce.sources import Sources


@dataclass(frozen=True)
class PlanarAscent:
    """Hold a planar ascent with the times of its events, s."""

    flight: PlanarFlight
    staging_s: float
    jettison_s: float
    cutoff_s: float

    def at(self, time_s: float) -> dict[str, float]:
        """Return radius km, speed km/s, flight-path angle and pitch deg just before an event."""
        flight = self.flight
        i = int(np.searchsorted(flight.time_s, time_s - 1e-6))
        return {
            "radius": flight.radius[i] / 1e3,
            "speed": flight.speed[i] / 1e3,
            "gamma": math.degrees(flight.flight_path_angle[i]),
            "theta": math.degrees(flight.theta[i]),
        }


def optimum_ascent(s: Sources) -> PlanarAscent:
    """Return the optimum as a planar ascent."""
    return PlanarAscent(s.planar_optimum, s.staging_s, s.optimum.t_plf_s, s.optimum.t_meco_s)


def analytic_ascent(s: Sources, found: AnalyticSolution) -> PlanarAscent:
    """Return an analytic solution as a planar ascent."""
    one, two = parts(found)
    assert found.flight is not None
    return PlanarAscent(found.flight, s.staging_s, one.burns[-1].end_s, two.burns[-1].end_s)


def parts(found: AnalyticSolution) -> tuple[AnalyticPart, AnalyticPart]:
    """Return both parts, which the sources guarantee."""
    assert found.part_one is not None and found.part_two is not None
    return found.part_one, found.part_two


def _ascents(s: Sources) -> tuple[PlanarAscent, ...]:
    return (
        analytic_ascent(s, s.analytic_printed),
        analytic_ascent(s, s.analytic_improved),
        optimum_ascent(s),
    )


_CONDITIONS = (
    Column("condition", "thesis"),
    Column("as printed", "third"),
    Column("improved", "here"),
    Column("optimum", "other"),
)
_QUANTITIES = {
    "radius": ("radius, km", 3),
    "speed": ("speed, km/s", 4),
    "gamma": ("flight-path angle, deg", 3),
    "theta": ("pitch, deg", 2),
}


def _event(
    name: str,
    ascents: Iterable[PlanarAscent],
    when: Callable[[PlanarAscent], float],
    conditions: dict[str, str],
) -> list[Row]:
    """Make the rows of one event: one per quantity with a condition."""
    states = [ascent.at(when(ascent)) for ascent in ascents]
    return [
        Row(
            f"{name}: {_QUANTITIES[key][0]}",
            (word(condition), *(number(state[key], _QUANTITIES[key][1]) for state in states)),
        )
        for key, condition in conditions.items()
    ]


def _duration(
    label: str,
    condition: str,
    ascents: Iterable[PlanarAscent],
    last: Callable[[PlanarAscent], float],
) -> Row:
    return Row(label, (word(condition), *(number(last(ascent), 2) for ascent in ascents)))


def table_5_1(s: Sources) -> PageTable:
    """Tabulate the parameters of part one, with their converged values."""
    ascents = _ascents(s)
    start = s.mission.initial_state.time_s
    known = dict.fromkeys(("radius", "speed", "gamma"), "known")
    free = dict.fromkeys(("radius", "speed", "gamma"), "free")
    theta = {"theta": "free"}
    return PageTable(
        _CONDITIONS,
        (
            *_event("Start", ascents, lambda _: start, known | theta),
            *_event("Staging", ascents, lambda ascent: ascent.staging_s, free),
            _duration(
                "Burn of stage 1, s", "known", ascents, lambda ascent: ascent.staging_s - start
            ),
            *_event("Jettison", ascents, lambda ascent: ascent.jettison_s, known | theta),
            _duration(
                "Staging to jettison T_go, s",
                "free",
                ascents,
                lambda ascent: ascent.jettison_s - ascent.staging_s,
            ),
        ),
        "The thesis takes the state at the jettison from its optimum. The improved profile does "
        "not need it: from the heating limit of the mission file alone it puts the jettison at "
        f"{s.analytic_alone.solution.t_plf_s:.2f} s; the optimum has {s.optimum.t_plf_s:.2f} s.",
    )


def table_5_2(s: Sources) -> PageTable:
    """Tabulate the parameters of part two, with their converged values."""
    ascents = _ascents(s)
    known = dict.fromkeys(("radius", "speed", "gamma"), "known")
    return PageTable(
        _CONDITIONS,
        (
            *_event(
                "Jettison", ascents, lambda ascent: ascent.jettison_s, known | {"theta": "free"}
            ),
            *_event("Cut-off", ascents, lambda ascent: ascent.cutoff_s, known),
            _duration(
                "Jettison to cut-off T_go, s",
                "free",
                ascents,
                lambda ascent: ascent.cutoff_s - ascent.jettison_s,
            ),
        ),
    )


def table_6_1(s: Sources) -> PageTable:
    """Tabulate the first guesses beside the optimum."""
    thesis = printed.values("table-6.1")
    ascent = optimum_ascent(s)
    jettison, staging = ascent.at(ascent.jettison_s), ascent.at(ascent.staging_s)
    start = ascent.at(s.mission.initial_state.time_s)
    rows = (
        ("Part one θ_PLF, deg", "theta_plf_deg", jettison["theta"], ""),
        ("Part one γ_stage1, deg", "gamma_staging_deg", staging["gamma"], ""),
        (
            "Part one T_go, s",
            "time_to_go_s",
            ascent.jettison_s - ascent.staging_s,
            "The jettison of our optimum is earlier, see Table 4.1.",
        ),
        ("Part two θ_PLF, deg", "theta_plf_deg", jettison["theta"], ""),
        (
            "θ_0, assumed, deg",
            "theta_start_deg",
            start["theta"],
            "Section 6.2 of the thesis; it prints no optimum for it.",
        ),
    )
    return PageTable(
        (Column("first guess", "thesis"), *_named(BESIDE, "optimum")),
        tuple(
            beside(
                *(label, thesis["optimum"].get(key, math.nan), ours, 2),
                note=note,
                before=(number(thesis["guess"][key], 0),),
            )
            for label, key, ours, note in rows
        ),
        "Our optimum drops the fairing earlier, so T_go is shorter and the pitch there higher.",
    )


def _named(columns: tuple[Column, ...], what: str) -> tuple[Column, ...]:
    return tuple(Column(f"{what}" if c.role else c.title, c.role) for c in columns)


#: Label, key of the print, decimals in print, our decimals.
_CONVERGED = (
    ("Iterations", "iterations", 0, 0),
    ("T_go, s", "time_to_go_s", 2, 2),
    ("θ_PLF, deg", "theta_plf_deg", 2, 2),
    ("γ_stage1, deg", "gamma_staging_deg", 2, 2),
)


def _converged(found: AnalyticSolution) -> dict[str, float]:
    one, _ = parts(found)
    return {
        "iterations": one.iterations,
        "time_to_go_s": one.time_to_go_s,
        "theta_plf_deg": one.theta_end_deg,
        "gamma_staging_deg": one.gamma_joint_deg,
    }


def table_6_2(s: Sources) -> PageTable:
    """Tabulate part one, converged."""
    thesis = printed.values("table-6.3")[0]
    ascent = optimum_ascent(s)
    optimum = {
        "time_to_go_s": ascent.jettison_s - ascent.staging_s,
        "theta_plf_deg": ascent.at(ascent.jettison_s)["theta"],
        "gamma_staging_deg": ascent.at(ascent.staging_s)["gamma"],
    }
    here, exact, improved = (
        _converged(found) for found in (s.analytic_printed, s.analytic_exact, s.analytic_improved)
    )
    rows = tuple(
        beside(
            *(label, thesis[key], here[key], digits),
            after=(exact[key], improved[key], optimum.get(key, math.nan)),
        )
        for label, key, digits, _ in _CONVERGED
    )
    return PageTable(
        (
            *BESIDE,
            Column("exact integral", "third"),
            Column("improved", "here"),
            Column("optimum", "other"),
        ),
        rows,
        'Under "here" stands the method as printed, with its trapezoid. What is left of its '
        "distance to the optimum comes from the polynomials; what the thesis has beyond it comes "
        "from partials that were one and the same number [E24].",
    )


def table_6_3(s: Sources) -> PageTable:
    """Compare the trapezoid with other steps and scales."""
    cases = printed.values("table-6.3")
    rows = []
    times: tuple[list[float], list[float]] = ([], [])
    for i, case in enumerate(cases):
        found = s.analytic(
            profile="thesis",
            position_integral="trapezoid",
            steps=tuple(case["steps"]),
            step_scale=float(case["scale"]),
        )
        ours = _converged(found)
        times[0].append(case["time_to_go_s"])
        times[1].append(ours["time_to_go_s"])
        cells: list[Cell] = []
        for _, key, of_thesis, digits in _CONVERGED:
            cells += [number(case[key], of_thesis), number(ours[key], digits)]
        cells.append(number(ours["time_to_go_s"] - case["time_to_go_s"], 2, signed=True))
        steps = " and ".join(str(n) for n in case["steps"])
        rows.append(Row(f"{i + 1}. α_s = {case['scale']:g}, {steps} steps", tuple(cells)))
    spread = [max(values) - min(values) for values in times]
    return PageTable(
        (
            *(
                Column(label.replace("Iterations", "iterations"), role)
                for label, *_ in _CONVERGED
                for role in ("thesis", "here")
            ),
            Column("difference of T_go"),
        ),
        tuple(rows),
        f"T_go moves by {spread[0]:.1f} s in print and by {about(spread[1])} s here: a trapezoid "
        "that is right hardly depends on its steps, and the scale decides only how many "
        "iterations it takes [E24].",
    )


def _part_two(found: AnalyticSolution) -> dict[str, float]:
    _, two = parts(found)
    return {
        "iterations": two.iterations,
        "time_to_go_s": two.time_to_go_s,
        "theta_plf_deg": two.theta_start_deg,
        "theta_end_deg": two.theta_end_deg,
    }


def table_6_4(s: Sources) -> PageTable:
    """Tabulate part two, converged."""
    thesis = printed.values("table-6.4")
    ascent = optimum_ascent(s)
    optimum = {
        "time_to_go_s": ascent.cutoff_s - ascent.jettison_s,
        "theta_plf_deg": ascent.at(ascent.jettison_s)["theta"],
        "theta_end_deg": ascent.at(ascent.cutoff_s)["theta"],
    }
    here, improved = _part_two(s.analytic_printed), _part_two(s.analytic_improved)
    return PageTable(
        (*BESIDE, Column("improved", "here"), Column("optimum", "other")),
        tuple(
            beside(
                *(label, thesis[key], here[key], digits),
                note=note,
                after=(improved[key], optimum.get(key, math.nan)),
            )
            for label, key, digits, note in (
                ("Iterations", "iterations", 0, ""),
                (
                    "T_go, s",
                    "time_to_go_s",
                    2,
                    "The thesis starts from another optimum, later and nearer to cut-off.",
                ),
                ("θ_PLF, deg", "theta_plf_deg", 2, ""),
                ("θ_f, deg", "theta_end_deg", 2, ""),
            )
        ),
        "Both profiles come within half a degree and half a second of the optimum: this part has "
        "no staging in it.",
    )


def _ends(ascent: PlanarAscent) -> dict[str, float]:
    end = ascent.at(ascent.cutoff_s)
    return {
        "jettison_s": ascent.jettison_s,
        "cutoff_s": ascent.cutoff_s,
        "radius_km": end["radius"],
        "speed_km_s": end["speed"],
    }


def table_6_5(s: Sources) -> PageTable:
    """Tabulate both parts in sequence."""
    thesis = printed.values("table-6.5")
    optimum = _ends(optimum_ascent(s))
    here, improved = (
        _ends(analytic_ascent(s, found)) for found in (s.analytic_printed, s.analytic_improved)
    )
    return PageTable(
        (
            Column("optimum", "thesis"),
            Column("optimum", "here"),
            Column("analytic", "thesis"),
            Column("analytic, as printed", "here"),
            Column("difference"),
            Column("analytic, improved", "here"),
        ),
        tuple(
            beside(
                *(label, thesis["analytic"][key], here[key], 2),
                note=note,
                before=(number(thesis["optimum"][key], 2), number(optimum[key], 2)),
                after=(improved[key],),
            )
            for label, key, note in (
                ("Jettison t_PLF, s", "jettison_s", ""),
                ("Cut-off t_f, s", "cutoff_s", ""),
                (
                    "Radius r_f, km",
                    "radius_km",
                    "As printed: metres are lost between the trapezoid and the exact integral.",
                ),
                ("Speed V_f, km/s", "speed_km_s", ""),
            )
        ),
        _lateness(thesis["optimum"], thesis["analytic"], optimum, here, improved),
    )


def _lateness(
    thesis_optimum: dict[str, float], thesis: dict[str, float], *ours: dict[str, float]
) -> str:
    """Describe the delay of each analytic solution against its own optimum."""
    optimum, here, improved = ours
    pairs = ((thesis, thesis_optimum), (here, optimum), (improved, optimum))
    late = [
        " and ".join(
            f"{number(found[key] - best[key], 2, signed=True).text} s"
            for key in ("jettison_s", "cutoff_s")
        )
        for found, best in pairs
    ]
    return (
        f"Against its own optimum the thesis is off by {late[0]} at jettison and cut-off. Its "
        f"polynomials with right partials are off by {late[1]}, the better ones by {late[2]}."
    )


def table_6_6(s: Sources) -> PageTable:
    """Tabulate scalar delta-V between events."""
    thesis = printed.values("table-6.6")
    keys = ("to_staging_km_s", "to_jettison_km_s", "to_cutoff_km_s")
    printed_values = [thesis[key] for key in keys]
    columns: list[list[float]] = [
        [v / 1e3 for v in found.delta_v_m_s] for found in (s.analytic_printed, s.analytic_improved)
    ]
    columns.append(_delta_v_of_optimum(s))
    labels = ("Start to staging, km/s", "Staging to jettison, km/s", "Jettison to cut-off, km/s")
    notes = (
        "Fixed by Table 2.2: the burn of the core.",
        "",
        "",
        "",
    )
    table: list[tuple[str, float, list[float]]] = [
        (label, printed_values[i], [column[i] for column in columns])
        for i, label in enumerate(labels)
    ]
    table.append(("All, km/s", sum(printed_values), [sum(column) for column in columns]))
    return PageTable(
        (*BESIDE, Column("improved", "here"), Column("optimum", "other")),
        tuple(
            beside(label, of_thesis, ours[0], 4, note=note, after=ours[1:])
            for (label, of_thesis, ours), note in zip(table, notes, strict=True)
        ),
        "The thesis' later jettison moves velocity from the third row to the second. Its sum is "
        f"{1e3 * (sum(printed_values) - sum(columns[2])):,.0f} m/s more than the optimum needs.",
    )


def _delta_v_of_optimum(s: Sources) -> list[float]:
    """Sum delta-V over the optimum's steering arcs between its events, km/s."""
    ends = (s.staging_s, s.optimum.t_plf_s, s.optimum.t_meco_s)
    sums = [0.0, 0.0, 0.0]
    for arc in s.optimum.arcs:
        sums[int(np.searchsorted(ends, arc.end_s - 1e-6))] += arc.delta_v_m_s / 1e3
    return sums


TABLES: dict[str, Callable[[Sources], PageTable]] = {
    "table-5.1": table_5_1,
    "table-5.2": table_5_2,
    "table-6.1": table_6_1,
    "table-6.2": table_6_2,
    "table-6.3": table_6_3,
    "table-6.4": table_6_4,
    "table-6.5": table_6_5,
    "table-6.6": table_6_6,
}
