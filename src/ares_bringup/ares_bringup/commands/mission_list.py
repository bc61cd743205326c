# SPDX-License-Identifier: Apache-2.0
"""List and check files for `ares missions` and `ares dispersions`. No ROS."""

import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ares_bringup.doubts import show_warnings
from ares_bringup.report import console
from ares_models.input_file import format_kilograms
from ares_models.mission import Mission, list_missions, load_mission
from ares_models.stage_figures import stage_figures
from ares_vehicle_sim.dispersions import DISPERSIONS, load_dispersions

#: Description of a file: label and text of each row.
Rows = list[tuple[str, str]]


def load(name: str) -> Mission:
    """Load a mission and check that it can be flown, as far as its file shows.

    Raises:
        ValueError: one line on the fault.
    """
    mission = load_mission(name)
    mission.arrays()
    return mission


def show_missions(names: Sequence[str] = ()) -> int:
    """Print a table of missions; the fault of an invalid one is one line on standard error.

    Args:
        names: names or paths, each shown with the figures of its stages; empty: all shipped
            missions.

    Returns:
        0, or 2 if one of them is invalid.
    """
    return _show(names or list_missions(), partial(_mission_rows, by_stage=bool(names)))


def show_dispersions(names: Sequence[str] = ()) -> int:
    """Print a table of dispersions; the fault of an invalid one is one line on standard error.

    Args:
        names: names or paths; empty: all shipped dispersions.

    Returns:
        0, or 2 if one of them is invalid.
    """
    return _show(names or DISPERSIONS.shipped(), _dispersions_rows)


def _mission_rows(name: str, by_stage: bool) -> tuple[str, Rows, Table | None]:
    mission = load(name)
    show_warnings(name)
    texts = mission.describe()
    rows = [("valid", mission.title)]
    if mission.held is not None:
        held = f"{mission.held.time_s:.4g} s after ignition, {mission.held.burnt_kg:,.0f} kg burnt"
        if mission.held.speed_m_s > 0.0:
            held += f", at {mission.held.speed_m_s:.1f} m/s"
        rows.append(("released", held))
    keys = ("jettisons", "target") if by_stage else ("stages", "jettisons", "target")
    rows += [(key, texts[key]) for key in keys]
    return mission.name, rows, _stage_table(mission) if by_stage else None


def _stage_table(mission: Mission) -> Table:
    """Tabulate what shows a slip in the numbers of a stage: T/W, burn time, Isp and delta-V."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="")
    table.add_column("stage")
    for head in ("kg", "T/W", "burn, s", "Isp, s", "delta-V, m/s"):
        table.add_column(head, justify="right", no_wrap=True)
    stages = stage_figures(mission)
    for stage in stages:
        table.add_row(
            Text(stage.name),
            format_kilograms(stage.ignition_mass_kg),
            f"{stage.thrust_to_weight:.2f}",
            f"{stage.burn_time_s:,.1f}",
            ", ".join(f"{isp:.1f}" for isp in stage.isp_s),
            f"{stage.delta_v_m_s:,.0f}",
        )
        for count, name, burn_s, isp in stage.boosters:
            table.add_row(Text(f"  {count} {name}"), "", "", f"{burn_s:,.1f}", f"{isp:.1f}", "")
    if len(stages) > 1:
        total = sum(stage.delta_v_m_s for stage in stages)
        table.add_row("in all", "", "", "", "", f"{total:,.0f}")
    return table


def _dispersions_rows(name: str) -> tuple[str, Rows, None]:
    dispersions = load_dispersions(name)
    said = dispersions.model_fields_set
    keys = [key for key in type(dispersions).model_fields if key in said]
    return name, [("valid", ", ".join(keys) or "nothing is dispersed")], None


def _rows_table() -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    table.add_column(no_wrap=True)
    return table


def _show(names: Iterable[str], read: Callable[[str], tuple[str, Rows, Table | None]]) -> int:
    """Print the rows of files in one table; a table below the rows of a file ends it."""
    table, status = _rows_table(), 0
    for name in names:
        try:
            title, rows, below = read(name)
        except ValueError as error:
            print(f"ares: {' '.join(str(error).split())}", file=sys.stderr)
            status = 2
            continue
        for k, (key, text) in enumerate(rows):
            first = Text("" if k else title, style="bold")
            table.add_row(first, key, Text(text))
        if below is not None:
            console().print(table)
            console().print(Padding(below, (0, 0, 0, 2)))
            table = _rows_table()
    if table.row_count:
        console().print(table)
    return status
