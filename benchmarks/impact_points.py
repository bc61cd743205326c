# SPDX-License-Identifier: Apache-2.0
"""Measure how reliably the impact point is kept out of an area when a failure leaves no orbit.

    ./ares exec python benchmarks/impact_points.py [--failures N] [--seed S] [--keep]

Dispersed flights, each with a failure of random time and size: the stage below the last shut down
early, or thrust and flow of any burn at 5 to 60 %. Around the impact points of those that fall
although thrust was left, a circle is drawn (30 to 500 km, its centre up to half of that away), and
the same flight is repeated with that area in its mission.
"""

import argparse
import math
from collections import Counter

import numpy as np
from figures import Figures, keep_option

from ares_guidance.arrays import AVOID_LOST
from ares_models.failures import Failure, FailureKind
from ares_models.impacts import find_impact
from ares_models.mission import Mission, load_mission
from ares_studies.closed_loop import fly_compiled
from ares_vehicle_sim.dispersions import load_dispersions
from ares_vehicle_sim.simulator import CAMPAIGN

MISSIONS = ("ares_v", "saturn_v_as506")
#: s of thrust after the failure below which nothing could have been done.
LEAST = 20.0
DEGREE = 111e3


def with_areas(name, areas):
    data = load_mission(name).model_dump(exclude_unset=True)
    data["abort"]["avoid"] = areas
    return Mission.model_validate(data)


def draw(mission, ended, random):
    """Draw one failure."""
    times = mission.ignition_times()
    if random.random() < 0.5:
        at = random.uniform(times[0] + 5.0, times[-1] - 5.0)
        return Failure(FailureKind.EARLY_SHUTDOWN, at)
    at = random.uniform(times[0] + 5.0, ended - 30.0)
    ratio = random.uniform(0.05, 0.6)
    return Failure(FailureKind.THRUST_LOW, at, thrust_ratio=ratio, flow_ratio=ratio)


def fly(mission, failure, seed, flight):
    """Return a flight and its impact."""
    dispersions = load_dispersions("standard")
    flown = fly_compiled(mission, CAMPAIGN, dispersions, seed, flight, failure=failure)
    plant = flown.plant
    environment = mission.environment_array()[0]
    where = plant["position"], plant["velocity"], float(plant["time"])
    return flown, find_impact(*where, environment, mission.area_names)


def area_about(impact, random):
    radius = 1e3 * math.exp(random.uniform(math.log(30.0), math.log(500.0)))
    away, angle = 0.5 * radius * random.random(), random.uniform(0.0, 2.0 * math.pi)
    east = away * math.sin(angle) / DEGREE / math.cos(math.radians(impact.latitude_deg))
    return {
        "name": "area",
        "latitude_deg": impact.latitude_deg + away * math.cos(angle) / DEGREE,
        "longitude_deg": impact.longitude_deg + east,
        "radius_m": radius,
    }


def kept_out(name, count, seed):
    """Count the ends of flights that would fall into an area; list those inside unreported."""
    random = np.random.default_rng(seed)
    plain = with_areas(name, [])
    ended = float(fly_compiled(plain, CAMPAIGN).plant["time"])
    ends = Counter()
    silent = []
    for k in range(count):
        failure = draw(plain, ended, random)
        flown, impact = fly(plain, failure, seed, k)
        if impact is None or float(flown.plant["time"]) < failure.time_s + LEAST:
            continue
        area = area_about(impact, random)
        again, falls = fly(with_areas(name, [area]), failure, seed, k)
        if falls is None or falls.area is None:
            ends["outside"] += 1
        elif again.guidance["avoid"]["mode"] == AVOID_LOST:
            ends["said"] += 1
        else:
            ends["silent"] += 1
            silent.append((k, failure, area, falls, int(again.guidance["avoid"]["mode"])))
    return ends, silent


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--failures", type=int, default=300, help="flown, of each mission")
    parser.add_argument("--seed", type=int, default=0)
    keep_option(parser)
    options = parser.parse_args()
    figures = Figures(__file__, "Impact points kept out of an area, by law peg.")
    for name in MISSIONS:
        ends, silent = kept_out(name, options.failures, options.seed)
        total = ends.total()
        figures.add(f"{name}: would have fallen into the area", total, "flights")
        figures.add(f"{name}: kept out", ends["outside"], f"of {total}")
        figures.add(f"{name}: inside, and guidance says so", ends["said"], f"of {total}")
        figures.add(f"{name}: inside without a word", ends["silent"], f"of {total}")
        for case in silent[:10]:
            print("  silent:", *case)
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
