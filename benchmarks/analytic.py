# SPDX-License-Identifier: Apache-2.0
"""Measure the time of the default mission's analytic solution; the goal is 1 ms.

Only the search in a warm process counts: jettison target, part one, part two, with the Python
around the kernels, without sampling and verification of the flight. The optimum is timed too.
"""

import argparse
import statistics
from collections.abc import Callable
from functools import partial

from rich.console import Console
from rich.table import Table

from ares_models.mission import Mission, load_mission
from ares_optimizer.solution import Solution
from ares_optimizer.solve import solve
from ares_thesis.analytic.options import JETTISON_TARGETS, PROFILES, AnalyticOptions
from ares_thesis.analytic.solve import solve_analytic


def analytic(mission: Mission, options: AnalyticOptions, optimum: Solution) -> Solution:
    """Solve analytically, without the verification flight."""
    return solve_analytic(mission, options, optimum=optimum, verify=False).solution


def main() -> None:
    """Time every profile with every jettison target."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=201)
    repeats = parser.parse_args().repeats
    mission = load_mission("ares_v")
    optimum = solve(mission, "direct11")
    table = Table(title="Analytic solution, warm process")
    for column in ("method", "profile", "jettison target"):
        table.add_column(column)
    for column in ("median ms", "best ms", "t_PLF s", "t_f s"):
        table.add_column(column, justify="right")
    runs: dict[tuple[str, str, str], Callable[[], Solution]] = {}
    for profile in PROFILES:
        for target in JETTISON_TARGETS:
            options = AnalyticOptions(profile=profile, jettison_target=target)
            runs["analytic", profile, target] = partial(analytic, mission, options, optimum)
    for method in ("direct11", "indirect"):
        runs[method, "", ""] = partial(solve, mission, method, verify=False)
    for names, run in runs.items():
        found = [run() for _ in range(repeats + 1)][1:]
        times = [one.solve_ms for one in found]
        figures = (statistics.median(times), min(times))
        table.add_row(
            *names,
            *(f"{ms:.3f}" for ms in figures),
            f"{found[-1].t_plf_s:.2f}",
            f"{found[-1].t_meco_s:.2f}",
        )
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
