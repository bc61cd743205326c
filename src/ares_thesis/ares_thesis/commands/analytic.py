# SPDX-License-Identifier: Apache-2.0
"""Solve for `ares optimize --method analytic`. No ROS."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ares_bringup.commands.optimize import (
    EXIT_NOT_FOUND,
    EXIT_OPTIMAL,
    arc_table,
    constraint_table,
    plain_table,
    proof_facts,
)
from ares_bringup.options import CannotStart, refusal
from ares_bringup.report import console, number
from ares_models.mission import Mission, MissionError, load_mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.solution import OptimizerError, Solution
from ares_optimizer.solve import solve
from ares_thesis.analytic.flight import KeyFigures, key_figures, planar_flight
from ares_thesis.analytic.options import JETTISON_TARGETS, AnalyticOptions
from ares_thesis.analytic.solve import AnalyticSolution, solve_analytic

#: Tables 6.2, 6.4, 6.5 and 6.6 of the thesis; it gives neither the jettison state nor theta_0.
THESIS_COLUMN: dict[str, float] = {
    "staging to jettison, s": 131.81,
    "gamma at staging, deg": 9.36,
    "theta at jettison, deg": 21.36,
    "iterations, part one": 247,
    "jettison to cut-off, s": 336.52,
    "theta after jettison, deg": 17.64,
    "theta at cut-off, deg": 20.56,
    "iterations, part two": 5,
    "jettison, s": 468.93,
    "cut-off, s": 805.46,
    "delta-V to staging, m/s": 4076.3,
    "delta-V to jettison, m/s": 562.0,
    "delta-V to cut-off, m/s": 1970.7,
}
_DECIMALS = {"iterations, part one": 0, "iterations, part two": 0, "jettison radius, m": 0}


def optimize(
    mission_name: str,
    as_json: bool,
    asked: Mapping[str, Any],
    time_limit_s: float,
) -> int:
    """Solve with both jettison targets and print both beside the optimum.

    Args:
        mission_name: shipped name or path.
        as_json: one JSON object instead of the tables.
        asked: options given of `AnalyticOptions`, by name.
        time_limit_s: wall time of the iterations, and of the search for the optimum, s.

    Returns:
        0 if the iteration converged, else 1; the output has the reason.

    Raises:
        CannotStart: bad mission or option, or the method cannot solve the mission; one line.
    """
    if "steps" in asked and asked.get("position_integral") != "trapezoid":
        raise CannotStart("--steps goes with --position-integral trapezoid only")
    try:
        options = AnalyticOptions(**asked)
        mission = load_mission(mission_name)
        # loads the kernels, and refuses the mission before the search for the optimum
        solve_analytic(mission, verify=False)
        solve(load_mission("ares_v"))
        optimum = solve(mission, time_limit_s=time_limit_s)
        with Deadline(time_limit_s) as deadline:
            found = {
                name: solve_analytic(
                    mission,
                    replace(options, jettison_target=name),
                    optimum=optimum,
                    deadline=deadline,
                )
                for name in JETTISON_TARGETS
            }
    except (MissionError, OptimizerError) as error:
        raise refusal(error) from error
    chosen = found[options.jettison_target]
    if as_json:
        print(json.dumps(_json(mission, chosen, found, optimum), indent=2, allow_nan=False))
    else:
        _print(mission, chosen, found, optimum, console())
    return EXIT_OPTIMAL if chosen.solution.converged else EXIT_NOT_FOUND


def _staging_s(mission: Mission) -> float:
    return mission.ignition_times()[1]


def _figures_of_optimum(mission: Mission, optimum: Solution) -> KeyFigures | None:
    if not optimum.converged:
        return None
    return key_figures(planar_flight(optimum), _staging_s(mission), optimum.t_plf_s)


def _json(
    mission: Mission,
    chosen: AnalyticSolution,
    found: Mapping[str, AnalyticSolution],
    optimum: Solution,
) -> dict[str, Any]:
    """Return the JSON summary of every method, with this one's details under `analytic`."""
    figures = _figures_of_optimum(mission, optimum)
    return {
        **chosen.solution.to_json(),
        "analytic": {
            "jettison_target": chosen.options.jettison_target,
            "by_jettison_target": {name: one.to_json() for name, one in found.items()},
            "optimum": {
                **optimum.to_json(),
                "figures": None if figures is None else asdict(figures),
            },
        },
    }


def _print(
    mission: Mission,
    chosen: AnalyticSolution,
    found: Mapping[str, AnalyticSolution],
    optimum: Solution,
    out: Console,
) -> None:
    profile = chosen.options.profile
    title = f"{mission.title} ({mission.name}), analytic, profile {profile}"
    out.print(Text(title), style="bold", soft_wrap=True)
    out.print(Text(chosen.solution.reason), soft_wrap=True)
    for name, one in found.items():
        if one is not chosen and not one.solution.converged:
            out.print(Text(f"jettison target {name}: {one.solution.reason}"), soft_wrap=True)
    out.print()
    out.print(_comparison(mission, found, optimum))
    solution = chosen.solution
    if solution.trajectory is None:
        return
    out.print()
    out.print(arc_table(solution))
    out.print()
    out.print(Text("its steering, flown open loop:"))
    out.print(constraint_table(mission, solution))
    out.print()
    for name, text in proof_facts(solution).items():
        out.print(f"{name}: {text}", soft_wrap=True)


def _comparison(
    mission: Mission, found: Mapping[str, AnalyticSolution], optimum: Solution
) -> Table:
    """Tabulate both jettison targets beside the optimum and, for its mission, the thesis."""
    columns = {name: _column(one) for name, one in found.items()}
    columns["optimum"] = _optimum_column(mission, optimum)
    if mission.name == "ares_v":
        columns["thesis"] = THESIS_COLUMN
    table = plain_table("jettison target of", *columns)
    for name in columns["mission"]:
        values = [column.get(name, math.nan) for column in columns.values()]
        table.add_row(name, *(number(value, _DECIMALS.get(name, 2)) for value in values))
    return table


def _column(one: AnalyticSolution) -> dict[str, float]:
    target, first, second = one.jettison, one.part_one, one.part_two
    unknown = math.nan
    burns = [] if first is None or not first.converged else first.burns
    burns = [*burns, *([] if second is None else second.burns)]
    delta_v = [burn.delta_v_m_s for burn in burns] if len(burns) == 3 else [unknown] * 3
    return {
        "jettison radius, m": target.radius_m if target else unknown,
        "jettison speed, m/s": target.speed_m_s if target else unknown,
        "jettison gamma, deg": target.flight_path_angle_deg if target else unknown,
        "staging to jettison, s": first.time_to_go_s if first else unknown,
        "theta at start, deg": first.theta_start_deg if first else unknown,
        "gamma at staging, deg": first.gamma_joint_deg if first else unknown,
        "theta at jettison, deg": first.theta_end_deg if first else unknown,
        "iterations, part one": first.iterations if first else unknown,
        "jettison to cut-off, s": second.time_to_go_s if second else unknown,
        "theta after jettison, deg": second.theta_start_deg if second else unknown,
        "theta at cut-off, deg": second.theta_end_deg if second else unknown,
        "iterations, part two": second.iterations if second else unknown,
        "jettison, s": one.solution.t_plf_s,
        "cut-off, s": one.solution.t_meco_s,
        "final mass, kg": one.solution.m_f_kg,
        "delta-V to staging, m/s": delta_v[0],
        "delta-V to jettison, m/s": delta_v[1],
        "delta-V to cut-off, m/s": delta_v[2],
    }


def _optimum_column(mission: Mission, optimum: Solution) -> dict[str, float]:
    figures = _figures_of_optimum(mission, optimum)
    if figures is None:
        return {}
    flight = planar_flight(optimum)
    before = flight.between(float(flight.time_s[0]), optimum.t_plf_s)
    after = flight.between(optimum.t_plf_s, optimum.t_meco_s)
    delta_v = [arc.delta_v_m_s for arc in optimum.arcs]
    named = dict(zip(("staging", "jettison", "cut-off"), delta_v, strict=False))
    return {
        "jettison radius, m": float(before.radius[-1]),
        "jettison speed, m/s": float(before.speed[-1]),
        "jettison gamma, deg": math.degrees(before.flight_path_angle[-1]),
        "staging to jettison, s": figures.staging_to_jettison_s,
        "theta at start, deg": figures.theta_0_deg,
        "gamma at staging, deg": figures.gamma_staging_deg,
        "theta at jettison, deg": figures.theta_plf_deg,
        "jettison to cut-off, s": figures.jettison_to_cutoff_s,
        "theta after jettison, deg": math.degrees(after.theta[0]),
        "theta at cut-off, deg": figures.theta_f_deg,
        "jettison, s": optimum.t_plf_s,
        "cut-off, s": optimum.t_meco_s,
        "final mass, kg": optimum.m_f_kg,
        **{f"delta-V to {name}, m/s": value for name, value in named.items()},
    }
