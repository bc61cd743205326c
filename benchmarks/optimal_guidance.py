# SPDX-License-Identifier: Apache-2.0
"""Measure the optimal law's solutions: after a kick, from a PEG guess, and under dispersions.

The call is that of the guidance cycle, through Python: a few microseconds of each figure are the
call itself.
"""

import argparse
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance.kernels.laws.optimal import solve_optimal
from ares_guidance.law import Law
from ares_guidance.laws import make_law
from ares_models.mission import Mission, load_mission
from ares_vehicle_sim.dispersions import STANDARD, load_dispersions
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions

KICK_M, KICK_M_S = 50.0, 0.5


def timed_solve(mission: Mission, law: Law, nav: Any) -> tuple[float, bool]:
    """Return the time of one solution on board, s, and whether the optimum was found."""
    arrays = mission.arrays(foreseen=True)
    begun = time.perf_counter()
    error = solve_optimal(
        nav,
        arrays.environment[0],
        arrays.atmosphere,
        arrays.arcs,
        arrays.jettisons,
        arrays.target[0],
        law.settings,
        True,
        False,
        law.state,
    )
    return time.perf_counter() - begun, error == 0


def warm_and_cold(mission: Mission, repeats: int, seed: int) -> dict[str, NDArray[np.float64]]:
    """Time solutions at the start of the mission: after a kick, and from PEG's steering."""
    rng = np.random.default_rng(seed)
    start = np.array([Simulator(mission).navigation])
    times: dict[str, list[float]] = {"warm": [], "cold": []}
    for _ in range(repeats):
        law = make_law("optimal", mission.arrays(foreseen=True))
        law.step(start[0])
        kicked = start.copy()
        for name, size in (("position", KICK_M), ("velocity", KICK_M_S)):
            push = rng.standard_normal(3)
            kicked[name] += size * push / np.linalg.norm(push)
        times["warm"].append(timed_solve(mission, law, kicked[0])[0])
        peg = Law(mission.arrays(foreseen=True))
        peg.step(kicked[0])
        times["cold"].append(timed_solve(mission, peg, kicked[0])[0])
    return {name: 1e3 * np.array(found) for name, found in times.items()}


def in_flight(mission: Mission, flights: int) -> tuple[NDArray[np.float64], int]:
    """Return the time of every due guidance cycle of dispersed flights, ms, and the fallbacks."""
    dispersions = load_dispersions(STANDARD)
    options = SimulatorOptions(navigation_period_s=1.0, integration_step_s=1.0)
    times, fell_back = [], 0
    for flight in range(flights):
        simulator = Simulator(mission, options, dispersions, 0, flight)
        law = make_law("optimal", mission.arrays(foreseen=True))
        while not simulator.complete:
            begun = time.perf_counter()
            due = law.step(simulator.navigation)
            if due:
                times.append(time.perf_counter() - begun)
                fell_back += int(law.state["law"] != law.kind.code)
            simulator.command(law.steering)
            simulator.advance()
    return 1e3 * np.array(times), fell_back


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mission", default="ares_v")
    parser.add_argument("--repeats", type=int, default=500)
    parser.add_argument("--flights", type=int, default=100)
    arguments = parser.parse_args()
    mission = load_mission(arguments.mission)
    warm_and_cold(mission, 2, 0)
    print(f"{'':28}{'median':>10}{'99 %':>10}{'99.9 %':>10}{'max':>10}   ms")
    rows = warm_and_cold(mission, arguments.repeats, 1)
    rows = {
        f"warm, {KICK_M:g} m {KICK_M_S:g} m/s kick": rows["warm"],
        "cold, from a PEG guess": rows["cold"],
    }
    cycles, fell_back = in_flight(mission, arguments.flights)
    rows[f"cycles of {arguments.flights} dispersed flights"] = cycles
    for name, found in rows.items():
        marks = (*np.percentile(found, [50.0, 99.0, 99.9]), found.max())
        print(f"{name:28}" + "".join(f"{mark:10.3f}" for mark in marks))
    print(f"{len(cycles)} cycles, {fell_back} of them by PEG")


if __name__ == "__main__":
    main()
