# SPDX-License-Identifier: Apache-2.0
"""Solve real launchers from public figures by `auto` and by another program, and fly the laws.

Those in `launchers` begin above the air, those in `pads` on the ground. The answers in
`answers.json` are of a program that shares nothing with the project: Radau collocation by CasADi
with IPOPT from up to ten starts, the best solved again on a finer mesh; where it cannot state a
mission there is none. It keeps coasts 100 km above a sphere of the equatorial radius; here they
stay 100 km above the ellipsoid, which allows more where a coast touches that bound far from the
equator.
"""

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np

from ares_models.judge import End
from ares_models.mission import Mission, load_mission
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled
from ares_trials.testing.arrivals import judged

HERE = Path(__file__).parent
FOLDERS = ("launchers", "pads")
LAWS = ("peg", "igm", "optimal")
#: Of the mass: less than the other program's by more is worse.
SAME = 1e-5
LIMIT_S = 300.0


def flown(mission: Mission, law: str, optimum_kg: float) -> dict[str, Any]:
    """Fly a mission by a law; return the end, and the loss against the optimum, %."""
    try:
        flight = fly_compiled(mission, law=law)
    except ValueError as error:
        return {"end": "refused", "reason": str(error)}
    mass = float(flight.plant["mass"])
    end = str(judged(mission, flight.plant).end)
    return {"end": end, "final_mass_kg": mass, "loss_percent": 100.0 * (1.0 - mass / optimum_kg)}


def losses(rows: list[dict[str, Any]], law: str) -> list[float]:
    """Return what the flights of a law that reach the target lose, %.

    Args:
        rows: of missions with a plan, with `laws`, the flights by law.
        law: by name.
    """
    flights = [one["laws"][law] for one in rows]
    return [each["loss_percent"] for each in flights if each["end"] == str(End.TARGET)]


def row(path: Path, known_kg: float, laws: tuple[str, ...]) -> dict[str, Any]:
    """Solve and fly one mission."""
    mission = load_mission(path)
    began, worked = time.perf_counter(), time.process_time()
    found = solve(mission, "auto", time_limit_s=LIMIT_S, verify=False)
    result: dict[str, Any] = {
        "name": path.stem,
        "status": str(found.status),
        "reason": found.reason,
        "method": found.method,
        "final_mass_kg": found.m_f_kg,
        "other_program_kg": known_kg,
        "difference_percent": 100.0 * (found.m_f_kg / known_kg - 1.0),
        "wall_s": time.perf_counter() - began,
        "cpu_s": time.process_time() - worked,
    }
    if found.flyable:
        result["laws"] = {law: flown(mission, law, found.m_f_kg) for law in laws}
    return result


def main() -> None:
    """Print a row per mission, and the totals."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="missions; default: all")
    parser.add_argument("--plan-only", action="store_true", help="fly nothing")
    parser.add_argument("--folder", choices=FOLDERS, default=FOLDERS[0])
    parser.add_argument("--keep", action="store_true", help="write results.json there")
    options = parser.parse_args()
    files = HERE / options.folder
    answers = json.loads((files / "answers.json").read_text())
    laws = () if options.plan_only else LAWS
    rows = []
    for name in options.names or sorted(path.stem for path in files.glob("*.yaml")):
        known_kg = answers[name]["final_mass_kg"] if name in answers else math.nan
        one = row(files / f"{name}.yaml", known_kg, laws)
        rows.append(one)
        flights = " ".join(
            f"{law} {flight['end']} {flight.get('loss_percent', math.nan):+.4f} %"
            for law, flight in one.get("laws", {}).items()
        )
        print(
            f"{name:22s} {one['status']:10s} {one['final_mass_kg']:11.3f} kg "
            f"{one['difference_percent']:+.4f} % {one['cpu_s']:6.2f} s  {flights}",
            flush=True,
        )
    solved = [one for one in rows if one["status"] == "converged"]
    worse = [one for one in solved if one["difference_percent"] < -100.0 * SAME]
    print(f"{len(solved)} of {len(rows)} optimal; {len(worse)} of them below the other program")
    print("CPU time, median:", f"{np.median([one['cpu_s'] for one in rows]):.2f} s")
    for law in laws:
        if lost := losses(solved, law):
            print(
                f"{law}: {len(lost)} of {len(solved)} on target, "
                f"loss {np.median(lost):.4f} % in the median, {max(lost):.4f} % at worst"
            )
    if options.keep:
        (files / "results.json").write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
