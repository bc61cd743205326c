# SPDX-License-Identifier: Apache-2.0
"""Print a flight's summary, legible at 80 columns, with or without colours."""

import math
import os
from typing import IO

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ares_bringup.insertion import OrbitState, orbit_state, target_state
from ares_bringup.options import PEG
from ares_bringup.summary import FlightSummary

WIDTH = 80
BLANK = "-"

#: Orbit errors without a column of their own: label and unit.
ORBIT_ERRORS = {
    "perigee_radius_m": ("perigee radius", " m"),
    "apogee_radius_m": ("apogee radius", " m"),
    "semi_major_axis_m": ("semi-major axis", " m"),
    "eccentricity": ("eccentricity", ""),
    "c3_m2_s2": ("C3", " m2/s2"),
    "argument_of_perigee_deg": ("argument of perigee", " deg"),
    "true_anomaly_deg": ("true anomaly", " deg"),
}


def console(file: IO[str] | None = None) -> Console:
    """Make a console at most WIDTH columns wide, coloured on a terminal only."""
    made = Console(file=file, highlight=False, emoji=False, markup=False)
    made.width = min(made.width, WIDTH) if made.is_terminal else WIDTH
    return made


def number(value: float | None, decimals: int) -> str:
    """Format a number with thousands separators; BLANK if unknown."""
    if value is None or not math.isfinite(value):
        return BLANK
    return f"{value:,.{decimals}f}"


def small(value: float) -> str:
    """Format a signed error with three significant figures; BLANK if unknown."""
    return f"{value:+.2e}" if math.isfinite(value) else BLANK


def shown_path(path: str) -> str:
    """Return the shorter of a path and its relative form."""
    relative = os.path.relpath(path)
    return relative if len(relative) < len(path) else path


def print_summary(summary: FlightSummary, out: Console) -> None:
    """Print target, prediction, flown state and errors, times, masses, events, the bag."""
    facts = summary.facts
    out.print(Text(f"{facts.title} ({facts.name}), guidance {summary.guidance}"), style="bold")
    out.print()
    if summary.end is not None:
        out.print(insertion_table(summary))
        for key, (name, unit) in ORBIT_ERRORS.items():
            if key in summary.insertion_error:
                out.print(f"error of {name}: {summary.insertion_error[key]:+.3g}{unit}")
        out.print()
    if summary.events:
        out.print(event_table(summary))
        out.print()
    for name, value in facts_of_flight(summary):
        out.print(Text(f"{name:<20}{value}"), soft_wrap=True)
    for line in summary.shortcomings():
        out.print(Text(line), style="bold red", soft_wrap=True)


def insertion_table(summary: FlightSummary) -> Table:
    """Tabulate target, predicted, flown, error; a column per judged quantity."""
    end = summary.end
    assert end is not None
    target = target_state(summary.facts, end.position)
    flown = orbit_state(end.position, end.velocity)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("")
    for title in ("radius\nkm", "speed\nm/s", "flight path\ndeg", "inclination\ndeg"):
        table.add_column(title, justify="right")
    node = math.isfinite(target.ascending_node_deg)
    if node:
        table.add_column("node\ndeg", justify="right")

    def row(name: str, state: OrbitState) -> None:
        cells = [
            number(state.radius_m / 1e3, 4),
            number(state.speed_m_s, 4),
            number(state.flight_path_angle_deg, 6),
            number(state.inclination_deg, 6),
        ]
        if node:
            cells.append(number(state.ascending_node_deg, 6))
        table.add_row(name, *cells)

    row("target", target)
    predicted = summary.last_converged
    if predicted is not None:
        row("predicted", orbit_state(predicted.predicted_position, predicted.predicted_velocity))
    row("flown", flown)
    errors = summary.insertion_error
    cells = [
        f"{errors['radius_m']:+.3g} m" if "radius_m" in errors else BLANK,
        small(errors.get("speed_m_s", math.nan)),
        small(errors.get("flight_path_angle_deg", math.nan)),
        small(errors.get("inclination_deg", math.nan)),
    ]
    if node:
        cells.append(small(errors["ascending_node_deg"]))
    table.add_row("error", *cells, style="bold")
    return table


def event_table(summary: FlightSummary) -> Table:
    """Tabulate events and moments with time and mass after each."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("time s", justify="right")
    table.add_column("mass kg", justify="right")
    table.add_column("event")
    for moment in summary.timeline:
        table.add_row(number(moment.time_s, 3), number(moment.mass_kg, 2), Text(moment.text))
    return table


def _beside_plan(summary: FlightSummary) -> str:
    """Return the planned mass and the loss to it, to be appended to the flown mass."""
    if summary.beside_plan is None:
        return ""
    loss = 100.0 * (1.0 - summary.beside_plan)
    side = "below" if loss >= 0.0 else "above"
    return f", {abs(loss):.3f} % {side} the plan's {number(summary.planned_m_f_kg, 2)} kg"


def facts_of_flight(summary: FlightSummary) -> list[tuple[str, str]]:
    """Return label and value of the lines below the tables."""
    from ares_guidance.arrays import LAW_PEG

    lines = []
    if summary.m_f_kg is not None:
        lines.append(("final mass", f"{number(summary.m_f_kg, 2)} kg{_beside_plan(summary)}"))
    predicted = summary.last_converged
    if summary.t_meco_s is not None and predicted is not None:
        planned = f"predicted {number(predicted.cutoff_time, 3)} s"
        lines.append(("cut-off", f"{number(summary.t_meco_s, 3)} s, {planned}"))
    # a long name keeps its distance
    lines += [(f"{fall.title:<19} ", fall.words) for fall in summary.falls]
    iterations = summary.first_convergence_iterations
    first = f", first solution after {iterations} iterations" if iterations else ""
    lines.append(("guidance", f"{summary.guidance_cycles} cycles{first}"))
    # where a law has no solution, peg flies
    if summary.guidance != PEG and summary.laws[LAW_PEG]:
        lines.append(("flown by peg", f"{summary.laws[LAW_PEG]} cycles"))
    if summary.longest_cycle_ms is not None:
        lines.append(("longest cycle", f"{summary.longest_cycle_ms:.3g} ms"))
    if summary.diagnostic_count:
        lines.append(("warnings", str(summary.diagnostic_count)))
    if summary.lost_messages:
        lines.append(("lost messages", str(summary.lost_messages)))
    factor = summary.realtime_factor
    pace = f"; flown at {factor:,.3g} times real time" if factor else ""
    lines.append(("wall time", f"{number(summary.wall_s, 1)} s with start-up{pace}"))
    lines.append(("bag", shown_path(summary.bag) if summary.bag else "none"))
    return lines
