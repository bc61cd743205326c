# SPDX-License-Identifier: Apache-2.0
"""Draw missions, solve each by every method, fly each by every law.

A mission that `auto` calls optimal and another method betters by more than 0.01 % is wrong; one
that another method solves and `auto` does not is missed. Flights are without dispersions.
"""

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from launchers import LAWS, flown, print_losses

from ares_models.judge import End
from ares_models.mission import Mission
from ares_optimizer.solution import OptimizerError, Status
from ares_optimizer.solve import solve
from ares_trials.random_vehicles import random_coasting_mission, random_mission

KEPT = Path(__file__).parent / "results" / "random_missions.json"
KINDS: dict[str, Callable[[int], Mission]] = {
    "plain": random_mission,
    "coasting": random_coasting_mission,
}
METHODS = ("auto", "indirect", "collocation", "direct11")
#: Of the mass: less than another method's by more is wrong.
SAME = 1e-4
LIMIT_S = 60.0
#: %, a loss that is named.
MUCH = 0.3


def row(kind: str, seed: int, laws: tuple[str, ...]) -> dict[str, Any]:
    """Solve one mission by every method, and fly what `auto` found."""
    mission = KINDS[kind](seed)
    result: dict[str, Any] = {"name": mission.name, "kind": kind}
    for method in METHODS:
        began = time.process_time()
        try:
            found = solve(mission, method, time_limit_s=LIMIT_S)
        except OptimizerError as error:
            result[method] = {"status": "refused", "reason": str(error)}
            continue
        result[method] = {
            "status": str(found.status),
            "reason": found.reason,
            "final_mass_kg": found.m_f_kg if found.flyable else None,
            "cpu_s": time.process_time() - began,
        }
    mass = result["auto"].get("final_mass_kg")
    if mass is not None:
        result["laws"] = {law: flown(mission, law, mass) for law in laws}
    return result


def told(one: dict[str, Any]) -> list[str]:
    """Describe the faults of one row and of its flights."""
    others = [one[method].get("final_mass_kg") or 0.0 for method in METHODS[1:]]
    best, auto = max(others), one["auto"]
    mass = auto.get("final_mass_kg")
    said = []
    if auto["status"] == Status.CONVERGED and best > mass * (1.0 + SAME):
        said.append(f"wrong: {mass:.3f} kg is called optimal, {best:.3f} kg was found")
    if mass is None and best > 0.0:
        said.append(f"missed: {best:.3f} kg was found; auto: {auto['reason']}")
    for law, flight in one.get("laws", {}).items():
        if flight["end"] == "refused":
            said.append(f"refused by {law}: {flight['reason']}")
        elif flight["end"] != str(End.TARGET):
            said.append(f"lost by {law}: {flight['end']}")
        elif flight["loss_percent"] > MUCH:
            said.append(f"loss by {law}: {flight['loss_percent']:.3f} %")
    return said


def print_sums(rows: list[dict[str, Any]], laws: tuple[str, ...]) -> None:
    """Print the solutions found and missed, the flights and their losses."""
    solved = [one for one in rows if "laws" in one]
    kinds = Counter(line.partition(":")[0] for one in rows for line in told(one))
    optimal = sum(one["auto"]["status"] == Status.CONVERGED for one in rows)
    print(f"{len(rows)} missions: {len(solved)} with a plan, {optimal} called optimal")
    print("; ".join(f"{count} {kind}" for kind, count in sorted(kinds.items())))
    times = [one["auto"].get("cpu_s", 0.0) for one in rows]
    print(f"CPU s of auto: median {np.median(times):.4f}, greatest {max(times):.2f}")
    print_losses(solved, laws)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=200, help="seeds of each kind")
    parser.add_argument("--first", type=int, default=20_000, help="first of them")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--laws", nargs="*", choices=LAWS, default=LAWS)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help=f"write {KEPT.name}")
    options = parser.parse_args()
    laws = tuple(options.laws)
    rows = []
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        jobs = [
            pool.submit(row, kind, seed, laws)
            for kind in options.kinds
            for seed in range(options.first, options.first + options.n)
        ]
        for job in jobs:
            rows.append(job.result())
            for line in told(rows[-1]):
                print(f"{rows[-1]['name']}: {line}", flush=True)
    print_sums(rows, laws)
    if options.keep:
        KEPT.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
