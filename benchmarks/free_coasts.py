"""Vehicles with free coasts: which `indirect` solves from the mission alone, and how fast.

Beside each solution stands a grid over the lengths of the coasts, each point solved as a flight of
given lengths: what it reaches and `indirect` does not is missed, what it does better is wrong.
"""

import argparse
import itertools

import numpy as np
from numpy.typing import NDArray

from ares_models.mission import Mission
from ares_optimizer.indirect.solver import TwoPointSolver
from ares_optimizer.plan import DEEPEST, last_begin, length_bounds, spent, with_lengths
from ares_optimizer.solve import solve
from ares_studies.random_vehicles import random_coasting_mission

#: s; the longest coast of the grid, and points along one.
LONGEST = 2600.0
POINTS = 20
#: kg that the grid may save before a solution counts as wrong.
SAME_KG = 0.05


def best_of_grid(mission: Mission) -> tuple[float, NDArray[np.float64]] | None:
    """Least propellant of the free burn on the grid, kg, and its lengths, s; None: none arrives."""
    arrays, start = mission.arrays(), mission.start().navigation()
    low, high = length_bounds(arrays, start[0])
    points = POINTS if len(low) == 1 else POINTS // 2
    axes = [
        np.geomspace(max(a, 1.0), min(b, LONGEST), points) for a, b in zip(low, high, strict=True)
    ]
    ground = (1.0 - DEEPEST) * float(arrays.environment[0]["polar_radius"])
    last = arrays.arcs[-1]
    best = None
    for point in itertools.product(*axes):
        lengths = np.clip(np.array(point), low, high)
        solver = TwoPointSolver(with_lengths(arrays, start[0], lengths))
        solver.options["step"] = 40.0
        root = solver.solve(start)
        if not root.converged:
            continue
        burn = root.cutoff_s - last_begin(arrays, start[0], lengths)
        flown = solver.sample(start, root.unknowns, 10.0)
        deep = np.linalg.norm(flown[:, 1:4], axis=1).min() < ground
        if deep or burn > last["propellant"] / last["mass_flow"]:
            continue
        taken = spent(arrays, start[0], lengths, burn)
        if best is None or taken < best[0]:
            best = taken, lengths
    return best


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=200, help="seeds")
    parser.add_argument("--first", type=int, default=0, help="first of them")
    arguments = parser.parse_args()
    solve(random_coasting_mission(0), "indirect")
    solved = reached = 0
    times = []
    for seed in range(arguments.first, arguments.first + arguments.n):
        mission = random_coasting_mission(seed)
        solution = solve(mission, "indirect")
        grid = best_of_grid(mission)
        times.append(solution.solve_ms)
        reached += solution.converged or grid is not None
        solved += solution.converged
        if grid is None:
            continue
        if not solution.converged:
            print(f"{mission.name}: missed, {solution.reason}")
            continue
        arrays, start = mission.arrays(), mission.start().navigation()
        lengths = np.array(solution.lengths_s)
        burn = solution.t_meco_s - last_begin(arrays, start[0], lengths)
        more = spent(arrays, start[0], lengths, burn) - grid[0]
        if more > SAME_KG and "within" not in solution.reason:
            print(f"{mission.name}: wrong, the grid takes {more:.2f} kg less at {grid[1]}")
    print(f"{solved} of {reached} that something solves")
    print(
        f"ms: median {np.median(times):.1f}, 99 % {np.percentile(times, 99):.1f}, "
        f"greatest {max(times):.1f}"
    )


if __name__ == "__main__":
    main()
