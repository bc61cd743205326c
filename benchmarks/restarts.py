# SPDX-License-Identifier: Apache-2.0
"""Lose guidance at any time of flight and restart it; count the arrivals by mission and law.

    ./ares exec python benchmarks/restarts.py [--times N] [--planned N] [--away S ...] [--keep]

In one process, without the nodes (`ares_trials.restarts`): at `--times` times over the whole
flight, and after each of its events. A law that needs a plan requests one at each, which takes
seconds: for such missions `--planned` times are tried.
"""

import argparse

from figures import Figures, keep_option

from ares_guidance.registry import law_names
from ares_models.mission import list_missions, load_mission
from ares_trials.restarts import Restarted, Restarts

#: s to the cut-off from which on a flight should arrive.
ENOUGH = 30.0


def report(figures: Figures, what: str, flights: Restarts, ends: list[Restarted]) -> None:
    """Count the arrivals of flights with enough time, and describe the others."""
    due = [end for end in ends if end.left_s >= ENOUGH]
    arrived = sum(end.arrived for end in due)
    figures.add(f"{what}: arrives undisturbed", int(flights.arrives), "")
    figures.add(f"{what}: restarts with {ENOUGH:g} s left or more", len(due), "")
    figures.add(f"{what}: of them arrived", arrived, "")
    figures.add(f"{what}: restarts with less", len(ends) - len(due), "")
    late = sum(end.arrived for end in ends if not end.left_s >= ENOUGH)
    figures.add(f"{what}: of them arrived, with less", late, "")
    without = sum(len(end.reasons) > 0 for end in due)
    figures.add(f"{what}: without a plan at first", without, "")
    hottest = max((end.heating for end in ends if end.heating > 0.0), default=0.0)
    if hottest:
        figures.add(f"{what}: hottest jettison, of its limit", hottest, "")
    for end in due:
        if not end.arrived:
            print(
                f"  lost at {end.lost_s:.1f} s, {end.left_s:.0f} s left, arc {end.arc}: {end.end}, "
                f"{end.mass_kg:.1f} kg {'; '.join(end.reasons[:1])}",
                flush=True,
            )


def main() -> None:
    """Print and keep the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=60)
    parser.add_argument("--planned", type=int, default=10)
    parser.add_argument("--away", type=float, nargs="+", default=[0.1, 5.0, 20.0])
    parser.add_argument("--missions", nargs="+", default=list_missions(), choices=list_missions())
    parser.add_argument("--laws", nargs="+", default=law_names(), choices=law_names())
    keep_option(parser)
    options = parser.parse_args()
    figures = Figures(__file__, "Guidance lost in flight and begun anew after 0.1, 5 and 20 s.")
    for name in options.missions:
        mission = load_mission(name)
        planned = mission.needs_plan
        for law in options.laws:
            try:
                flights = Restarts(mission, law)
            except ValueError as error:
                print(f"{name} by {law}: {error}")
                continue
            times = flights.times(options.planned if planned else options.times)
            if planned:
                times = times[:: max(1, len(times) // options.planned)]
            away = options.away[1:2] if planned else options.away
            report(figures, f"{name} by {law}", flights, list(flights.fly(times, away)))
            if options.keep:
                figures.keep()


if __name__ == "__main__":
    main()
