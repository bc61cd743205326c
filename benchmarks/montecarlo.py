# SPDX-License-Identifier: Apache-2.0
"""Measure flights per second of a campaign: ours on one core and on all, RocketPy's, Basilisk's.

    ./ares exec python benchmarks/montecarlo.py [--flights N] [--peers N] [--law peg]

The flights differ: see benchmarks/README.md. Ours are timed with the Parquet file and without
start-up; `--flights` are flown by ours, `--peers` by all. `--throughput` measures only steps of
1 s, of guidance and integration, by the CPU time of one core: from the pad and in vacuum, in turn.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
from figures import Figures, keep_option

from ares_models.mission import load_mission
from ares_studies.montecarlo.campaign import CampaignPlan, fly_campaign
from ares_studies.montecarlo.engines import cores, fly_here, fly_on_cores
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_studies.montecarlo.store import Store
from ares_vehicle_sim.dispersions import load_dispersions

#: From the pad through the air, and above it, with their dispersions.
THROUGHPUT = {"delta_iii_pad": "standard_pad", "delta_iii": "standard"}
ROUNDS = 5
PEERS = {"RocketPy": "montecarlo_rocketpy.py", "Basilisk": "montecarlo_basilisk.py"}


def ours(settings, flights, engine):
    """Return flights per second, and the peak memory of this process, MB."""
    FlightRange(settings).fly(0, 1)
    with tempfile.TemporaryDirectory() as folder, Store(Path(folder), settings) as store:
        begun = time.perf_counter()
        fly_campaign(CampaignPlan(settings, flights), store, engine, lambda _: None)
        seconds = time.perf_counter() - begun
    return flights / seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def throughput(flights, law):
    """Return steps per second of CPU time by mission: medians of rounds that alternate."""
    ranges = {
        name: FlightRange(Settings(load_mission(name), load_dispersions(dispersions), law=law))
        for name, dispersions in THROUGHPUT.items()
    }
    rates = {name: [] for name in THROUGHPUT}
    for number in range(ROUNDS + 1):
        for name, flown in ranges.items():
            begun = time.process_time()
            results = flown.fly(number * flights, flights).results
            seconds = time.process_time() - begun
            start = load_mission(name).initial_state.time_s
            rates[name].append(float(np.sum(results["end_time"] - start)) / seconds)
    # the first round loads what is compiled
    return {name: float(np.median(each[1:])) for name, each in rates.items()}


def peer(script, flights, processes):
    """Return the output of a peer's script; None if the peer is not installed."""
    done = subprocess.run(
        [sys.executable, str(Path(__file__).with_name(script)), str(flights), str(processes)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        print(done.stderr.strip().splitlines()[-1])
        return None
    return json.loads(done.stdout.strip().splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=10_000)
    parser.add_argument("--peers", type=int, default=100)
    parser.add_argument("--law", default="peg")
    parser.add_argument("--throughput", action="store_true", help="steps per second alone")
    keep_option(parser)
    given = parser.parse_args()
    if given.throughput:
        about = f"Campaigns by {given.law}, from the pad and in vacuum, CPU time of one core."
        figures = Figures("montecarlo_throughput", about)
        rates = throughput(given.peers, given.law)
        for name, rate in rates.items():
            figures.add(f"{name}, steps of 1 s", rate, "steps/s")
        pad, vacuum = (rates[name] for name in THROUGHPUT)
        figures.add("from the pad by in vacuum", pad / vacuum, "")
        if given.keep:
            figures.keep()
        return
    settings = Settings(load_mission("ares_v"), load_dispersions("standard"), law=given.law)
    engines = {"1 core": fly_here, f"{cores()} cores": partial(fly_on_cores, count=cores())}
    figures = Figures(__file__, f"Campaigns of ares_v by {given.law}, Parquet files included.")
    for flights in (given.peers, given.flights):
        for name, engine in engines.items():
            rate, memory = ours(settings, flights, engine)
            label = f"ours, {name}, {flights:,} flights"
            figures.add(label, rate, "flights/s")
            figures.add(f"{label}, peak memory", memory, "MB")
    for name, script in PEERS.items():
        for processes in (1, cores()):
            found = peer(script, given.peers, processes)
            if found is None:
                break
            label = f"{name}, {processes} process{'es' if processes > 1 else ''}"
            figures.add(f"{label}, {given.peers} flights", found["flights_per_s"], "flights/s")
            if "bare_flights_per_s" in found and processes == 1:
                figures.add(f"{name}, bare flight", found["bare_flights_per_s"], "flights/s")
    if given.keep:
        figures.keep()


if __name__ == "__main__":
    main()
