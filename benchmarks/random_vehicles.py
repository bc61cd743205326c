# SPDX-License-Identifier: Apache-2.0
"""Vehicles that no law was made for: which are flown, and what that costs.

Of the missions of some seeds (`ares_studies.random_vehicles`) those that `indirect` solves are
flown by each law, without dispersions.
"""

import argparse

import numpy as np

from ares_guidance.registry import law_names
from ares_studies.random_vehicles import Solved, fly_as_planned, solvable
from ares_vehicle_sim.arrays import DEPLETION

#: %, a loss that is named.
MUCH = 1.0


def fly_all(solved: list[Solved], law: str) -> None:
    """Fly them by one law; print what was lost, and who did not arrive."""
    lost = []
    for each in solved:
        try:
            flown = fly_as_planned(each.mission, law)
        except ValueError as error:
            print(f"  {each.mission.name}: {error}")
            continue
        if flown["terminal_accuracy"] and flown["fairing_off"] and flown["heating_kept"]:
            lost.append(100.0 * (1.0 - flown["mass"] / each.optimum_kg))
            if lost[-1] > MUCH:
                print(f"  {each.mission.name}: {lost[-1]:.2f} % below the optimum")
            continue
        dry = "ran dry, " if flown["ended"] == DEPLETION else ""
        heat = "" if flown["heating_kept"] else ", heating limit passed"
        print(
            f"  {each.mission.name}: {dry}radius {flown['radius_error']:.1f} m, speed "
            f"{flown['speed_error']:.2f} m/s off{heat}; its optimum leaves {each.spare_kg:.2f} kg"
        )
    print(
        f"{law:10}{len(lost):5} of {len(solved)} flown; below the optimum by "
        f"{np.median(lost):.4f} % in the median, {max(lost):.3f} % at worst"
    )


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=330, help="seeds")
    parser.add_argument("--first", type=int, default=1000, help="first of them")
    parser.add_argument("--laws", nargs="+", choices=law_names(), default=["peg", "igm", "optimal"])
    arguments = parser.parse_args()
    solved = list(solvable(range(arguments.first, arguments.first + arguments.n)))
    print(f"{len(solved)} of {arguments.n} vehicles have an optimum that `indirect` finds")
    for law in arguments.laws:
        fly_all(solved, law)


if __name__ == "__main__":
    main()
