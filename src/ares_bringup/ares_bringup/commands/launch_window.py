# SPDX-License-Identifier: Apache-2.0
"""Seek and print the launch window for `ares optimize --window`. No ROS."""

import math
from typing import Any

from ares_bringup.commands.optimize import NOT_FOUND, VERDICTS, plain_table, sought
from ares_bringup.plain_json import print_json
from ares_bringup.report import BLANK, console
from ares_models.mission import Mission
from ares_optimizer.window import Launch, Window, launch_window


def optimize_launch(mission_name: str, minutes: int, as_json: bool, time_limit_s: float) -> int:
    """Seek the best launch time, print it and its neighbours; return the status of the best.

    Args:
        mission_name: shipped name or path.
        minutes: before and after the best time.
        as_json: one JSON object instead of the table.
        time_limit_s: wall time of each search, s.

    Raises:
        CannotStart: bad mission, or one whose launch time does not matter; one line.
    """
    mission, found = sought(
        mission_name,
        as_json,
        lambda mission, tell: launch_window(mission, minutes, time_limit_s, tell),
    )
    if as_json:
        rows = [_facts(launch, found.best) for launch in found.launches]
        print_json({"best": _facts(found.best, found.best), "launches": rows})
    else:
        _print(mission, found)
    return _verdict(found.best)[1]


def _verdict(launch: Launch) -> tuple[str, int]:
    return VERDICTS.get(launch.solution.status, NOT_FOUND)


def _facts(launch: Launch, best: Launch) -> dict[str, Any]:
    """Return what is told of a launch, by name; None: not known."""
    mass = launch.final_mass_kg
    moment = launch.mission.epoch
    flies = math.isfinite(mass)
    return {
        "after_file_s": launch.later_s,
        "after_best_s": launch.later_s - best.later_s,
        "epoch": None if moment is None else moment.isoformat(timespec="milliseconds"),
        "zero_longitude_deg": launch.mission.zero_longitude_deg,
        "final_mass_kg": mass if flies else None,
        "cost_kg": best.final_mass_kg - mass if flies else None,
        "status": _verdict(launch)[0],
        "reason": launch.mission.with_names(launch.solution.reason),
    }


def _print(mission: Mission, found: Window) -> None:
    out = console()
    best = _facts(found.best, found.best)
    late = best["after_file_s"]
    beside = f"{abs(late):,.0f} s {'after' if late > 0.0 else 'before'} that of the file"
    out.print(f"best launch time of {mission.name}: {beside}")
    there = {
        "epoch": mission.epoch,
        "zero_longitude_deg": mission.environment.earth.zero_longitude_deg,
    }
    moved = [key for key, value in there.items() if value is not None]
    for key in moved:
        out.print(f"  {key}: {best[key]}")
    out.print()
    table = plain_table("min", moved[0], "final mass kg", "costs kg", "")
    # what does not fit is a reason
    for column in table.columns[:-1]:
        column.no_wrap = True
    for launch in found.launches:
        facts = _facts(launch, found.best)
        minute = round(facts["after_best_s"] / 60.0)
        mass, cost = facts["final_mass_kg"], facts["cost_kg"]
        table.add_row(
            f"{minute:+d}" if minute else "0",
            str(facts[moved[0]]),
            BLANK if mass is None else f"{mass:,.1f}",
            BLANK if cost is None else f"{cost:,.1f}",
            facts["status"] if facts["status"] == facts["reason"] else facts["reason"],
        )
    out.print(table)
