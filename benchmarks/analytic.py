# SPDX-License-Identifier: Apache-2.0
"""Time of the analytic solution of the default mission; asked for is 1 ms or less.

The search alone, in a warm process: jettison target, part one, part two, Python around the
kernels included; sampling the flight and verifying it are not. Beside it the optimum.
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
    """One analytic solution without its verification flight."""
    return solve_analytic(mission, options, optimum=optimum, verify=False).solution


def main() -> None:
    """Every profile with every jettison target."""
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
