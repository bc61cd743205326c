"""Compile every kernel once, so that the next start finds them in numba's cache."""

import multiprocessing

from ares_guidance.peg_thesis import ThesisPeg
from ares_models.mission import load_mission
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, fly_stepwise
from ares_studies.montecarlo.flights import Range, Settings
from ares_vehicle_sim.dispersions import Dispersions


def fly() -> None:
    """Fly the default mission all ways: whatever the nodes call is compiled by then."""
    mission = load_mission("ares_v")
    fly_compiled(mission)
    Range(Settings(mission, Dispersions())).fly(0, 1)
    fly_stepwise(mission)
    fly_stepwise(mission, law=ThesisPeg(mission.arrays()))


def optimize_directly() -> None:
    """Solve by the direct methods, and analytically."""
    solve(load_mission("ares_v"), "direct11")
    solve(load_mission("ares_v"), "jump")
    solve(load_mission("ares_v"), "analytic")


def optimize_indirectly() -> None:
    """Solve by the indirect methods; what they are set beside is compiled with the direct ones."""
    solve(load_mission("ares_v"), "indirect", verify=False)
    solve(load_mission("ares_v"), "closed_form", verify=False)


def fly_the_optimum() -> None:
    """The indirect methods first: the flight's law `optimal` takes their kernels from the cache."""
    optimize_indirectly()
    fly()


def main() -> None:
    """Compile in as many processes as there are parts: a core each, if there is one."""
    parts = (fly_the_optimum, optimize_directly)
    processes = [multiprocessing.Process(target=part) for part in parts]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    if any(process.exitcode for process in processes):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
