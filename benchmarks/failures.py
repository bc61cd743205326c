# SPDX-License-Identifier: Apache-2.0
"""Measure guidance's failure detection: false alarms, and the time to detection.

    ./ares exec python benchmarks/failures.py [--only found|alarms] [--flights N] [--others N]
        [--failures N] [--threads N] [--keep]

False alarms: dispersed flights without failure, of `ares_v` and of every other shipped mission of
which only the last burn is free, above the air and from the pad. Found: dispersed flights with one
failure each, of random kind, time and size; see docs/aborts.md.
"""

import argparse
import math
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path

import numpy as np
from figures import Figures, keep_option

from ares_models.arrays import BURN
from ares_models.failures import Failure, FailureKind
from ares_models.mission import list_missions, load_mission
from ares_models.plans import flies_in_air
from ares_studies.closed_loop import fly_compiled, ready_law
from ares_studies.montecarlo.engines import cores
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_vehicle_sim.dispersions import load_dispersions
from ares_vehicle_sim.simulator import CAMPAIGN

#: s from a failure to its finding.
WITHIN = 2.0 + 1e-6
#: Least thrust over what it was.
WEAKEST = 0.01
#: s to the end of a stage from which an early end is not told from a dispersed one.
END = 12.0
#: s to the last cut-off from which nothing is left to find it in.
LAST = 4.0
CHUNK = 250
#: Thrust that falls behind a throttle, the mass flow at full thrust as before.
HIDDEN = "hidden"


def settings(name, seed):
    """Load a mission with the standard dispersions, and the gravity of its own body."""
    mission = load_mission(name)
    in_air = flies_in_air(mission.arrays().arcs)
    dispersions = load_dispersions("standard_pad" if in_air else "standard")
    if mission.environment.mu_m3_s2 < 1e14:
        dispersions = dispersions.model_copy(update={"j2": None})
    return Settings(mission, dispersions, seed)


def is_watched(name):
    """Return true if only the last burn of a mission is free, and no burn is a solid motor's."""
    arcs = load_mission(name).arrays().arcs
    return np.isfinite(arcs["duration"][:-1]).all() and not arcs["tabled"].any()


def by_threads(plan, work, parts, threads):
    """Compute each part by threads with a flyer of their own: work(flyer, part)."""
    own = threading.local()

    def one(part):
        if not hasattr(own, "flyer"):
            own.flyer = FlightRange(plan)
        return work(own.flyer, part)

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(one, parts))


def false_alarms(name, flights, seed, threads):
    """Count the flights without failure that report one, by kind."""

    def kinds(flyer, first):
        results = flyer.fly(first, min(CHUNK, flights - first)).results
        return Counter(int(kind) for kind in results["found"] if kind)

    parts = range(0, flights, CHUNK)
    return sum(by_threads(settings(name, seed), kinds, parts, threads), Counter())


def burns(mission, ended):
    """Return arc, ignition command, full-thrust time and end of every burn, s, undispersed."""
    arcs = mission.arrays().arcs
    at = mission.initial_state.time_s
    for k, arc in enumerate(arcs):
        end = at + arc["duration"] if math.isfinite(arc["duration"]) else ended - LAST
        knots = int(arc["start_knots"])
        if arc["kind"] == BURN:
            yield k, at, at + (arc["start_time"][knots - 1] if knots else 0.0), end
        at = end


def throttled_from(mission, ended):
    """Return the begin of throttling in the last burn, s, undispersed; its end if never."""
    arc = mission.arrays().arcs[-1]
    if not math.isfinite(arc["max_acceleration"]):
        return ended
    _, begin, _, _ = list(burns(mission, ended))[-1]
    full = arc["stack_mass"] - arc["thrust"] / arc["max_acceleration"]
    return begin + full / arc["mass_flow"]


def draw(mission, ended, random):
    """Draw one failure and the time at which it takes effect, s."""
    arcs = mission.arrays().arcs
    final = arcs["stage"][-1]
    limited = throttled_from(mission, ended)
    spans = []
    for k, command, begin, end in burns(mission, ended):
        # the end of a stage by its propellant is dispersed, and so is where the throttle begins
        ends = k + 1 < len(arcs) and not (
            arcs["kind"][k + 1] == BURN and arcs["stage"][k + 1] == arcs["stage"][k]
        )
        last = min(end - END if ends else end, limited - END if limited < ended else end)
        if last > begin:
            spans.append((k, command, begin, last))
    lower = [span for span in spans if arcs["stage"][span[0]] < final]
    parts = mission.jettisons
    timed = [j for j, part in enumerate(parts) if part.time_s is not None]
    kinds = [FailureKind.ENGINE_OUT, FailureKind.THRUST_LOW]
    kinds += [FailureKind.EARLY_SHUTDOWN, FailureKind.FAILED_IGNITION] if lower else []
    kinds += [FailureKind.STUCK_JETTISON] if timed else []
    # behind a throttle a loss of thrust alone shows, by the propellant that it takes
    kinds += [FailureKind.STUCK_THROTTLE, HIDDEN] if limited < ended else []
    kind = kinds[random.integers(len(kinds))]
    if kind is FailureKind.STUCK_JETTISON:
        j = timed[random.integers(len(timed))]
        return Failure(kind, jettison=j), parts[j].time_s
    if kind is FailureKind.FAILED_IGNITION:
        k, command, _, _ = lower[random.integers(len(lower))]
        return Failure(kind, arc=k), command
    if kind is FailureKind.STUCK_THROTTLE:
        at = random.uniform(limited + END, ended - LAST)
        return Failure(kind, at), at
    if kind == HIDDEN:
        at = random.uniform(limited + END, ended - LAST)
        return Failure(FailureKind.THRUST_LOW, at, thrust_ratio=random.uniform(WEAKEST, 0.95)), at
    if kind is FailureKind.EARLY_SHUTDOWN:
        spans = lower
    lengths = np.array([last - begin for _, _, begin, last in spans])
    _, _, begin, last = spans[random.choice(len(spans), p=lengths / lengths.sum())]
    at = random.uniform(begin, last)
    ratio = random.uniform(WEAKEST, 0.95)
    if kind is FailureKind.ENGINE_OUT:
        return Failure(kind, at, thrust_ratio=ratio), at
    if kind is FailureKind.THRUST_LOW:
        return Failure(kind, at, thrust_ratio=ratio, flow_ratio=random.uniform(ratio, 1.0)), at
    return Failure(kind, at), at


def found_in_time(name, count, seed, threads):
    """Count the failures that took effect, and those not found within two seconds."""
    plan = settings(name, seed)
    mission = plan.mission
    ended = fly_compiled(mission, CAMPAIGN, law=ready_law(mission, "peg")).plant["time"]
    random = np.random.default_rng(seed)
    drawn = [draw(mission, ended, random) for _ in range(count)]

    def fly(flyer, first):
        some = drawn[first : first + CHUNK]
        return flyer.fly_failing(first, [failure for failure, _ in some]).results

    flown = by_threads(plan, fly, range(0, count, CHUNK), threads)
    struck = 0
    missed = []
    for (failure, at), result in zip(drawn, chain.from_iterable(flown), strict=True):
        untimed = failure.kind is FailureKind.STUCK_JETTISON
        if not (untimed or result["struck"] == 1) or result["end_time"] < at + WITHIN:
            # where it would have struck, this flight was over, or in a coast
            continue
        late = result["found_time"] - at
        struck += 1
        if not (result["found"] and late <= WITHIN):
            missed.append((failure, int(result["found"]), float(late)))
    return struck, missed


def measure_found(missions, options):
    """Print and keep the number of failures found in time."""
    script = Path(__file__).with_stem("failures_found")
    figures = Figures(str(script), "How surely guidance finds what fails within 2 s, by law peg.")
    total = late = 0
    for name in missions:
        struck, missed = found_in_time(name, options.failures, options.seed, options.threads)
        total += struck
        late += len(missed)
        figures.add(f"{name}: failures found within 2 s", struck - len(missed), f"of {struck}")
        for failure, kind, after in missed:
            print("  not in time:", failure, kind, after)
    figures.add("all: found within 2 s", 100.0 * (total - late) / total, f"% of {total}")
    if options.keep:
        figures.keep()


def measure_alarms(missions, options):
    """Print and keep the number of false alarms."""
    script = Path(__file__).with_stem("failures_false_alarms")
    about = "Standard dispersed flights in which nothing fails and guidance finds something, peg."
    figures = Figures(str(script), about)
    for name in missions:
        flights = options.flights if name == "ares_v" else options.others
        alarms = false_alarms(name, flights, options.seed, options.threads)
        figures.add(f"{name}: false alarms", alarms.total(), f"in {flights} flights")
        if alarms:
            print("  by kind:", dict(alarms))
    if options.keep:
        figures.keep()


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", choices=("found", "alarms"), help="default: both")
    parser.add_argument("--flights", type=int, default=100_000, help="of ares_v, nothing fails")
    parser.add_argument("--others", type=int, default=3_000, help="of every other mission")
    parser.add_argument("--failures", type=int, default=1_800, help="flown, of every mission")
    parser.add_argument("--threads", type=int, default=cores())
    parser.add_argument("--seed", type=int, default=0)
    keep_option(parser)
    options = parser.parse_args()
    missions = [name for name in list_missions() if is_watched(name)]
    if options.only != "alarms":
        measure_found(missions, options)
    if options.only != "found":
        measure_alarms(missions, options)


if __name__ == "__main__":
    main()
