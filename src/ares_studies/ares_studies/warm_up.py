# SPDX-License-Identifier: Apache-2.0
"""Compile kernels once, so that the next start finds them in numba's cache.

    python -m ares_studies.warm_up [LAW]

With a law: only the kernels of one flight by it. Without: every kernel.
"""

import multiprocessing
import sys
from collections.abc import Callable
from contextlib import suppress

from ares_guidance.law import PEG, Law
from ares_guidance.laws import find_law
from ares_guidance.registry import law_names
from ares_models.kernels.aerodynamics import air_at, body_force, pressure_loss
from ares_models.kernels.environment import (
    air_velocity,
    density,
    relative_velocity,
    vertical_stretch,
)
from ares_models.mission import load_mission
from ares_models.mission_warnings import warnings
from ares_models.registry import registered
from ares_optimizer.registry import GROUP
from ares_studies.closed_loop import fly_compiled, fly_stepwise
from ares_studies.flight_page.geometry import impact_time
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_vehicle_sim.dispersions import STANDARD_PAD, load_dispersions
from ares_vehicle_sim.falls import find_falls

#: Laws compiled beside the indirect methods; all others in the second process.
FIRST_LAWS = ("optimal", "igm")


def plan_from_pad() -> None:
    """Plan the mission that `ares fly` flies by default, if what solves is installed."""
    with suppress(ImportError):
        from ares_optimizer.solve import solve  # not every verb installs it

        solve(load_mission("delta_iii_pad"), "collocation")


def fly_once(name: str) -> None:
    """Fly Ares V as the nodes do; law peg without the registry."""
    mission = load_mission("ares_v")
    warnings(mission)
    law = Law(mission.arrays(foreseen=True)) if name == PEG.name else name
    find_falls(mission, fly_stepwise(mission, law=law).events)


def compile_laws(*names: str) -> None:
    """Fly Ares V by each law: stepwise, compiled and in a campaign."""
    mission, dispersions = load_mission("ares_v"), load_dispersions(STANDARD_PAD)
    for name in names:
        fly_once(name)
        fly_compiled(mission, law=name)
        if not find_law(name).needs_trajectory:
            FlightRange(Settings(mission, dispersions, law=name)).fly(0, 1)


def compile_plans() -> None:
    """Plan missions with free arcs, and fly one of them by its plan."""
    from ares_optimizer.solve import solve

    solve(load_mission("electron_sso"), "auto")
    fly_stepwise(load_mission("falcon9_gto"), law=PEG.name)


def compile_pages() -> None:
    """Call the kernels of a recorded flight's page."""
    mission = load_mission("ares_v")
    start = mission.start()
    impact_time(start.position, start.velocity, mission.environment_array()[0])
    arrays = load_mission("delta_iii_pad").arrays()
    place, velocity = tuple(start.position.tolist()), tuple(start.velocity.tolist())
    surroundings = arrays.environment[0], arrays.atmosphere
    body_force(arrays.arcs[0], place, velocity, (1.0, 0.0, 0.0), *surroundings)
    pressure_loss(arrays.arcs[0], place, *surroundings)
    density(place, *surroundings)
    air_at(0.0, *surroundings)
    air_velocity(place, velocity, surroundings[0])
    relative_velocity(place, velocity, surroundings[0])
    vertical_stretch(surroundings[0])


def compile_optimum() -> None:
    """Solve by the indirect methods and collocation; fly by the laws that use most kernels."""
    from ares_optimizer.solve import solve  # a flight does without

    # without verification, whose kernels are compiled with the direct methods
    solve(load_mission("ares_v"), "indirect", verify=False)
    solve(load_mission("ares_v"), "collocation")
    plan_from_pad()
    solve(load_mission("ares_v"), "closed_form", verify=False)
    compile_laws(*FIRST_LAWS)


def compile_others() -> None:
    """Fly by the other laws; solve by the methods of other packages and by the direct methods."""
    from ares_optimizer.solve import solve  # a flight does without

    compile_laws(PEG.name)
    # those of others first: their laws load the kernels from the cache
    for method in (*registered(GROUP), "direct11", "jump"):
        solve(load_mission("ares_v"), method)
    compile_laws(*sorted({*law_names()} - {PEG.name, *FIRST_LAWS}))
    compile_pages()
    compile_plans()


def run(*parts: Callable[[], None]) -> int:
    """Call each part in a process of its own, in parallel; return the exit status."""
    processes = [multiprocessing.Process(target=part) for part in parts]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    return int(any(process.exitcode for process in processes))


if __name__ == "__main__":
    if sys.argv[1:]:
        fly_once(sys.argv[1])
        plan_from_pad()
    else:
        sys.exit(run(compile_optimum, compile_others))
