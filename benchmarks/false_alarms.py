# SPDX-License-Identifier: Apache-2.0
"""Count alarms of navigation gate and monitors in standard dispersed flights: expected are none.

    ./ares exec python benchmarks/false_alarms.py [--flights N] [--others N]

`--flights` are flown of ares_v by peg, `--others` by each other law and of each other mission.
"""

import argparse
import time

from figures import Figures, keep_option

from ares_guidance.registry import law_names
from ares_models.mission import list_missions, load_mission
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_vehicle_sim.dispersions import STANDARD, load_dispersions

CHUNK = 1000


def alarms(mission: str, law: str, flights: int) -> tuple[int, int, int, float]:
    """Count flights with refused states, with violations, successful ones; flights per second."""
    flyer = FlightRange(Settings(load_mission(mission), load_dispersions(STANDARD), law=law))
    flyer.fly(0, 1)
    refused = violated = good = 0
    begun = time.perf_counter()
    for first in range(0, flights, CHUNK):
        results = flyer.fly(first, min(CHUNK, flights - first)).results
        refused += int((results["navigation_refused"] > 0).sum())
        violated += int((results["violations"] > 0).sum())
        good += int((results["terminal_accuracy"] > 0).sum())
    return refused, violated, good, flights / (time.perf_counter() - begun)


def main() -> None:
    """Print and keep the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=100_000)
    parser.add_argument("--others", type=int, default=2000)
    keep_option(parser)
    options = parser.parse_args()
    figures = Figures(
        __file__,
        "Standard dispersed flights, 1 Hz, on one core: how many have navigation states refused, "
        "or answers held back by a monitor.",
    )
    cases = [("ares_v", "peg", options.flights)]
    cases += [("ares_v", law, options.others) for law in law_names() if law != "peg"]
    cases += [(name, "peg", options.others) for name in list_missions() if name != "ares_v"]
    for mission, law, flights in cases:
        refused, violated, good, rate = alarms(mission, law, flights)
        what = f"{mission} by {law}, of {flights}"
        figures.add(f"{what}: with states refused", refused, "flights")
        figures.add(f"{what}: with answers held back", violated, "flights")
        figures.add(f"{what}: on target", good, "flights")
        figures.add(f"{what}: speed", rate, "flights/s")
        if options.keep:
            figures.keep()


if __name__ == "__main__":
    main()
