# SPDX-License-Identifier: Apache-2.0
"""Solve vehicles with free coasts by `indirect` from the mission alone; count successes and time.

Each solution is compared with a grid over the lengths of the coasts, each point solved as a flight
of given lengths, by `indirect` or, with `--direct`, by `direct11` from its own starts, the best two
then improved by COBYQA. A target reached only by the grid is counted as missed, a better solution
of the grid as wrong.
"""

import argparse
import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ares_models.mission import Mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.direct.free_arcs import solve_direct_planned
from ares_optimizer.indirect.solver import TwoPointSolver
from ares_optimizer.plan import DEEPEST, last_begin, length_bounds, spent, with_lengths
from ares_optimizer.request import Heating, Request
from ares_optimizer.solution import Solution
from ares_optimizer.solve import solve
from ares_trials.random_vehicles import random_coasting_mission

#: s; the longest coast of the grid, and points along one.
LONGEST = 2600.0
POINTS = 20
#: kg that the grid may save before a solution counts as wrong, and s of the last burn: where the
#: other burns reach the target by themselves, what is left of it has no optimum but 0.
SAME_KG = 0.05
SAME_S = 0.1
#: s, of the direct solution of one vehicle.
LIMIT_S = 60.0

Best = tuple[float, NDArray[np.float64]]


def grid(mission: Mission) -> Iterator[NDArray[np.float64]]:
    """Yield lengths of the coasts, s, denser where they are short."""
    low, high = length_bounds(mission.arrays(), mission.start().navigation()[0])
    points = POINTS if len(low) == 1 else POINTS // 2
    axes = [
        np.geomspace(max(a, 1.0), min(b, LONGEST), points - 1)
        for a, b in zip(low, high, strict=True)
    ]
    axes = [np.append(a, axis) for a, axis in zip(low, axes, strict=True)]
    for point in itertools.product(*axes):
        yield np.clip(np.array(point), low, high)


def best_of_grid(mission: Mission) -> Best | None:
    """Return the grid's least propellant of the free burn, kg, and its lengths, s, or None."""
    arrays, start = mission.arrays(), mission.start().navigation()
    ground = (1.0 - DEEPEST) * float(arrays.environment[0]["polar_radius"])
    last = arrays.arcs[-1]
    best = None
    for lengths in grid(mission):
        solver = TwoPointSolver(with_lengths(arrays, start[0], lengths))
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


def best_direct(mission: Mission) -> Best | None:
    """Return the same by `direct11` from every point of the grid, then improved."""
    arrays, start = mission.arrays(), mission.start().navigation()
    with Deadline(LIMIT_S) as deadline:
        heating = Heating(mission.heating_limit_holds)
        request = Request(arrays, start, "direct11", heating, deadline)
        solution = solve_direct_planned(request, grid(mission))
    return taken_by(mission, solution) if solution.converged else None


def taken_by(mission: Mission, solution: Solution) -> Best:
    """Return the propellant of a solution's free burn, kg, and its lengths, s."""
    arrays, start = mission.arrays(), mission.start().navigation()[0]
    lengths = np.array(solution.lengths_s)
    burn = solution.t_meco_s - last_begin(arrays, start, lengths)
    return spent(arrays, start, lengths, burn), lengths


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=200, help="seeds")
    parser.add_argument("--first", type=int, default=0, help="first of them")
    parser.add_argument("--direct", action="store_true", help="beside direct solutions")
    arguments = parser.parse_args()
    solve(random_coasting_mission(0), "indirect")
    solved = missed = wrong = better = 0
    times = []
    for seed in range(arguments.first, arguments.first + arguments.n):
        mission = random_coasting_mission(seed)
        solution = solve(mission, "indirect")
        other = best_direct(mission) if arguments.direct else best_of_grid(mission)
        times.append(solution.solve_ms)
        solved += solution.converged
        if not solution.converged and other is not None:
            missed += 1
            print(f"{mission.name}: missed, {other[0]:.2f} kg at {other[1]}; {solution.reason}")
        if not solution.converged or other is None:
            better += solution.converged
            continue
        more = taken_by(mission, solution)[0] - other[0]
        same = max(SAME_KG, SAME_S * float(mission.arrays().arcs[-1]["mass_flow"]))
        better += more < -same
        if more > same:
            wrong += 1
            print(f"{mission.name}: wrong, {more:.2f} kg less at {other[1]}; {solution.reason}")
    print(f"{solved} solved of {solved + missed} that something solves, {missed} missed")
    print(f"{wrong} worse than the grid, {better} better than it or where it finds nothing")
    print(
        f"ms: median {np.median(times):.1f}, 99 % {np.percentile(times, 99):.1f}, "
        f"greatest {max(times):.1f}"
    )


if __name__ == "__main__":
    main()
