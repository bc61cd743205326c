# SPDX-License-Identifier: Apache-2.0
"""Measure how many flights of two abort maps equal the optimizer that knows the failure.

    ./ares exec python benchmarks/aborts.py [--step-s S] [--proofs N] [--keep]

Also compare, at random points, the map's optimum with that of another method, with its proof.
"""

import argparse
import random
import time

from figures import Figures, keep_option

from ares_models.judge import End
from ares_models.mission import load_mission
from ares_optimizer.foreknown import foreknown
from ares_optimizer.solve import solve
from ares_studies.aborts.abort_map import MapMaker, MapSettings

MISSIONS = ("ares_v", "saturn_v_as506")
METHOD = "direct14"
TIME_LIMIT_S = 20.0


def make(settings):
    """Make the map."""
    work = MapMaker(settings).make()
    while True:
        try:
            next(work)
        except StopIteration as over:
            return over.value


def prove(mission, made, count, figures):
    """Compare optima of the map with another method's."""
    reached = [p for p in made.points if p.optimum.end is End.TARGET]
    worst, proven = 0.0, 0
    for point in random.Random(1).sample(reached, min(count, len(reached))):
        start = mission.start().navigation()
        known = foreknown(mission.arrays(), start, point.failure)
        other = solve(known.arrays, METHOD, state=start, time_limit_s=TIME_LIMIT_S)
        if not other.converged:
            print(f"  {point.failure.kind} at {point.at_s:g} s: {METHOD}: {other.reason}")
            continue
        proven += 1
        worst = max(worst, abs(other.m_f_kg / point.optimum.m_f_kg - 1.0))
    figures.add(f"{made.mission}, optima drawn and proven by {METHOD}", proven, "")
    figures.add(f"{made.mission}, greatest difference of their final mass", 100.0 * worst, "%")


def main():
    """Make the maps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--step-s", type=float, default=1.0)
    parser.add_argument("--proofs", type=int, default=30)
    keep_option(parser)
    args = parser.parse_args()
    figures = Figures(
        __file__, f"Every failure every {args.step_s:g} s, law peg, within 0.5 % of the optimum."
    )
    for name in MISSIONS:
        mission = load_mission(name)
        begun = time.perf_counter()
        made = make(MapSettings(mission, "peg", args.step_s))
        figures.add(f"{name}, points", len(made.points), "")
        figures.add(f"{name}, wall time", time.perf_counter() - begun, "s")
        figures.add(f"{name}, points that failed", len(made.wrong), "")
        for told in (False, True):
            who = "told then" if told else "that knew"
            for reach, share in made.shares(told=told).items():
                figures.add(f"{name}, {reach}, as optimizer {who}", share.percent, "%")
        near = sum(point.near for point in made.points)
        figures.add(f"{name}, of these with the radius let go, which was dear", near, "")
        for row in made.rows:
            n = len(row.points)
            knew = sum(point.within for point in row.points)
            late = sum(point.within_told for point in row.points)
            figures.add(f"{name}, {row.name}, as optimizer that knew", 100.0 * knew / n, "%")
            figures.add(f"{name}, {row.name}, as optimizer told then", 100.0 * late / n, "%")
        if args.proofs:
            prove(mission, made, args.proofs, figures)
    if args.keep:
        figures.keep()


if __name__ == "__main__":
    main()
