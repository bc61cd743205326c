# SPDX-License-Identifier: Apache-2.0
"""Measure the time of one compiled guidance cycle and of whole compiled flights.

Navigation states of a nominal 1 Hz flight are recorded first; the cycles are then repeated over
them inside compiled code, so that no Python call is included.
"""

import argparse
import statistics
import time
from typing import Any

import numpy as np
from figures import Figures, keep_option
from numpy.typing import NDArray

from ares_guidance.arrays import OnboardArrays, blank_onboard
from ares_guidance.kernels.cycle import guidance_step
from ares_guidance.kernels.entry import onboard_records
from ares_guidance.laws import find_law, make_law
from ares_guidance.registry import law_names
from ares_guidance.settings import LawSettings
from ares_models.arrays import NAVIGATION, MissionArrays
from ares_models.jit import kernel, specialised
from ares_models.kernels.records import mission_records
from ares_models.mission import load_mission
from ares_studies.closed_loop import fly_compiled, ready_law
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions


@kernel
def cycles(navs: NDArray[Any], mission: MissionArrays, onboard: OnboardArrays) -> int:
    """Run one guidance step on each navigation state; return the iterations made."""
    believed, held = mission_records(mission), onboard_records(onboard)
    for k in range(navs.shape[0]):
        onboard.navigation[0] = navs[k]
        guidance_step(believed, held)
    return onboard.state[0].total_iterations


def record_navigation(mission: Any, settings: LawSettings, name: str) -> NDArray[np.void]:
    """Return the navigation states of a nominal flight, one per second."""
    simulator = Simulator(mission, SimulatorOptions(navigation_period_s=1.0))
    law = make_law(name, mission.arrays(), settings)
    states = []
    while not simulator.complete:
        states.append(simulator.navigation.copy())
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
    return np.array(states, NAVIGATION)


def main() -> None:
    """Print medians over repeats."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mission", default="ares_v")
    laws = [name for name in law_names() if not find_law(name).needs_trajectory]
    parser.add_argument("--law", default="peg", choices=laws)
    parser.add_argument("--repeats", type=int, default=51)
    keep_option(parser)
    options = parser.parse_args()
    mission = load_mission(options.mission)
    kind = find_law(options.law)
    run = specialised("guidance_step", f"of_{kind.name}", guidance_step=kind.step).cycles
    settings = LawSettings()
    arrays = mission.arrays()
    navs = record_navigation(mission, settings, options.law)
    times = []
    iterations = 0
    for _ in range(options.repeats + 1):
        onboard = blank_onboard(settings.record())
        begun = time.perf_counter()
        iterations = run(navs, arrays, onboard)
        times.append((time.perf_counter() - begun) / len(navs))
    step = statistics.median(times[1:])
    figures = Figures(
        __file__, f"Law {options.law} on {mission.name}, compiled, medians of repeats."
    )
    figures.add("guidance cycles of a flight", len(navs), "")
    figures.add("iterations of a cycle, mean", iterations / len(navs), "")
    figures.add("one guidance cycle", 1e6 * step, "us")
    figures.add("one iteration", 1e6 * step * len(navs) / iterations, "us")
    for period in (1.0, 0.1):
        flights = []
        for _ in range(options.repeats + 1):
            begun = time.perf_counter()
            fly_compiled(
                mission,
                SimulatorOptions(navigation_period_s=period),
                law=ready_law(mission, options.law, settings),
            )
            flights.append(time.perf_counter() - begun)
        median = statistics.median(flights[1:])
        figures.add(f"one flight, navigation every {period:g} s", 1e3 * median, "ms")
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
