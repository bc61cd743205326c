# SPDX-License-Identifier: Apache-2.0
"""Compile kernels once, so that the next start finds them in numba's cache.

    python -m ares_studies.warm_up [LAW]

With a law: what one flight by it calls, and nothing else. Without: every kernel.
"""

import multiprocessing
import sys
from collections.abc import Callable

from ares_guidance.law import PEG, Law
from ares_guidance.laws import find_law
from ares_guidance.registry import law_names
from ares_models.mission import load_mission
from ares_models.mission_warnings import warnings
from ares_studies.closed_loop import fly_compiled, fly_stepwise
from ares_studies.flight_page.geometry import impact_time
from ares_studies.montecarlo.flights import Range, Settings
from ares_vehicle_sim.dispersions import Dispersions


def fly_once(name: str) -> None:
    """The default mission as the nodes fly it; law peg before the laws are registered."""
    mission = load_mission("ares_v")
    warnings(mission)
    law = Law(mission.arrays(foreseen=True)) if name == PEG.name else name
    fly_stepwise(mission, law=law)


def compile_laws(*names: str) -> None:
    """Fly the default mission by each of some laws in every way."""
    mission = load_mission("ares_v")
    for name in names:
        fly_once(name)
        fly_compiled(mission, law=name)
        if not find_law(name).needs_trajectory:
            Range(Settings(mission, Dispersions(), law=name)).fly(0, 1)


def compile_solvers() -> None:
    """Solve analytically, and by the direct methods."""
    from ares_optimizer.solve import solve  # a flight does without

    # first: law `peg_thesis` takes its kernels from the cache when its turn comes
    solve(load_mission("ares_v"), "analytic")
    solve(load_mission("ares_v"), "direct11")
    solve(load_mission("ares_v"), "jump")


def compile_pages() -> None:
    """What the page on a recorded flight calls."""
    mission = load_mission("ares_v")
    start = mission.start()
    impact_time(start.position, start.velocity, mission.environment_array()[0])


def compile_flights() -> None:
    """Solve by the indirect methods, whose kernels law `optimal` takes, and fly every law."""
    from ares_optimizer.solve import solve

    # what they are set beside is compiled with the direct ones
    solve(load_mission("ares_v"), "indirect", verify=False)
    solve(load_mission("ares_v"), "collocation")
    solve(load_mission("ares_v"), "closed_form", verify=False)
    compile_laws(*law_names())
    compile_pages()


def run(*parts: Callable[[], None]) -> int:
    """Call each in a process of its own: a core each, if there is one; exit status."""
    processes = [multiprocessing.Process(target=part) for part in parts]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    return int(any(process.exitcode for process in processes))


if __name__ == "__main__":
    if sys.argv[1:]:
        fly_once(sys.argv[1])
    else:
        sys.exit(run(compile_flights, compile_solvers))
