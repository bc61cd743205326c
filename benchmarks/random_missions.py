# SPDX-License-Identifier: Apache-2.0
"""Draw missions, solve each by every method, fly each by every law.

A mission that `auto` calls optimal and another method betters by more than 0.01 % is wrong; one
that another method solves and `auto` does not is missed. Flights are without dispersions; `ares
fly` refuses those that end off the target, since it flies ahead what it is asked to fly. Where the
burns of fixed length reach the target without the free one, no law wastes what they give too much.
From the pad the other method is the peer of `pad_peer.py`, from ten starts.
"""

import argparse
import math
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
from figures import Figures, keep_option
from launchers import LAWS, flown, losses

from ares_models.judge import End
from ares_models.mission import Mission, load_mission
from ares_optimizer.solution import OptimizerError, Status
from ares_optimizer.solve import solve
from ares_trials.random_launchers import random_launcher
from ares_trials.random_vehicles import random_coasting_mission, random_mission

KINDS: dict[str, Callable[[int], Mission]] = {
    "plain": random_mission,
    "coasting": random_coasting_mission,
    "pad": random_launcher,
}
PEER = "peer"
#: `auto` begins with `collocation`, the only method that knows the air.
OTHERS = {"plain": ("indirect", "direct11"), "coasting": ("indirect", "direct11"), "pad": (PEER,)}
#: Of the mass: less than another method's by more is wrong.
SAME = 1e-4
LIMIT_S = 60.0
#: Propellant of the last burn, kg, below which the burns of fixed length suffice.
NOTHING_KG = 1.0
#: %, a loss that is named.
MUCH = 0.3


def solved(mission: Mission, method: str) -> dict[str, Any]:
    """Solve a mission by a method; return what was found, and the CPU time, s."""
    began = time.process_time()
    if method == PEER:
        from pad_peer import Peer

        answer = Peer(mission).plan()
        return {
            "status": f"{answer.solved} of {answer.starts}",
            "final_mass_kg": answer.flight.mass if answer.flight else None,
            "cpu_s": time.process_time() - began,
        }
    try:
        found = solve(mission, method, time_limit_s=LIMIT_S)
    except OptimizerError as error:
        return {"status": "refused", "reason": str(error)}
    return {
        "status": str(found.status),
        "reason": found.reason,
        "final_mass_kg": found.m_f_kg if found.flyable else None,
        "last_burn_kg": found.last_burn_kg,
        "cpu_s": time.process_time() - began,
    }


def row(kind: str, seed: int, laws: tuple[str, ...]) -> dict[str, Any]:
    """Solve one mission by every method, and fly what `auto` found."""
    mission = KINDS[kind](seed)
    result: dict[str, Any] = {"name": mission.name, "kind": kind}
    for method in ("auto", *OTHERS[kind]):
        result[method] = solved(mission, method)
    mass = result["auto"].get("final_mass_kg")
    if mass is not None:
        result["laws"] = {law: flown(mission, law, mass) for law in laws}
        result["surplus"] = result["auto"]["last_burn_kg"] < NOTHING_KG
    return result


def warm() -> None:
    """Load what is compiled."""
    solve(load_mission("delta_iii_pad"), "auto")


def told(one: dict[str, Any]) -> list[str]:
    """Describe the faults of one row and of its flights."""
    others = [one[method].get("final_mass_kg") or 0.0 for method in OTHERS[one["kind"]]]
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
            said.append(f"refused by {law}: {flight['end']} when flown ahead")
        elif flight["loss_percent"] > MUCH:
            said.append(f"loss by {law}: {flight['loss_percent']:.3f} %")
    return said


def summary(one: dict[str, Any]) -> str:
    """Return what each method found, in one line."""
    parts = [one["name"]]
    for method in ("auto", *OTHERS[one["kind"]]):
        found = one[method]
        mass = found.get("final_mass_kg") or math.nan
        parts.append(f"{method} {mass:.3f} kg, {found['status']}, {found.get('cpu_s', 0.0):.1f} s")
    return "; ".join(parts)


def add_sums(figures: Figures, rows: list[dict[str, Any]], laws: tuple[str, ...]) -> None:
    """Add what was found, missed, flown and lost to the figures."""
    solved = [one for one in rows if "laws" in one]
    optimal = sum(one["auto"]["status"] == Status.CONVERGED for one in rows)
    figures.add("missions", len(rows), "")
    figures.add("with a plan", len(solved), "")
    figures.add("called optimal", optimal, "")
    kinds = Counter(line.partition(":")[0] for one in rows for line in told(one))
    for kind in ("wrong", "missed"):
        figures.add(kind, kinds[kind], "")
    known = [one for one in rows if one.get(PEER, {}).get("final_mass_kg") is not None]
    if known:
        figures.add("solved by the peer", len(known), "")
        planned = sum("laws" in one for one in known)
        figures.add("of these with a plan", 100.0 * planned / len(known), "%")
    for method in ("auto", *([PEER] if known else [])):
        for group, those in (("", rows), (", with a plan", solved)):
            times = [one[method].get("cpu_s", 0.0) for one in those if method in one]
            figures.add(f"CPU time of {method}{group}, median", float(np.median(times)), "s")
            figures.add(f"CPU time of {method}{group}, greatest", max(times), "s")
    for law in laws:
        lost = losses(solved, law)
        figures.add(f"{law}, on target", len(lost), "")
        figures.add(f"{law}, refused", kinds[f"refused by {law}"], "")
        surplus = sum(
            one["laws"][law]["end"] != str(End.TARGET) for one in solved if one["surplus"]
        )
        figures.add(f"{law}, of these with surplus", surplus, "")
        if lost:
            figures.add(f"{law}, loss in the median", float(np.median(lost)), "%")
            figures.add(f"{law}, loss at worst", max(lost), "%")


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=200, help="seeds of each kind")
    parser.add_argument("--first", type=int, default=20_000, help="first of them")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--laws", nargs="*", choices=LAWS, default=LAWS)
    parser.add_argument("--workers", type=int, default=1)
    keep_option(parser)
    options = parser.parse_args()
    laws = tuple(options.laws)
    rows = []
    with ProcessPoolExecutor(options.workers, get_context("spawn"), warm) as pool:
        jobs = [
            pool.submit(row, kind, seed, laws)
            for kind in options.kinds
            for seed in range(options.first, options.first + options.n)
        ]
        for job in jobs:
            rows.append(job.result())
            print(summary(rows[-1]), flush=True)
            for line in told(rows[-1]):
                print(f"{rows[-1]['name']}: {line}", flush=True)
    seeds = f"{options.first} to {options.first + options.n - 1}"
    about = f"Random missions, seeds {seeds}, {' and '.join(options.kinds)}, warm process."
    name = "random_missions_pad" if options.kinds == ["pad"] else __file__
    figures = Figures(name, about)
    add_sums(figures, rows, laws)
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
