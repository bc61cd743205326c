# SPDX-License-Identifier: Apache-2.0
"""Measure memory, descriptors, threads and shared memory over many consecutive flights.

    ./ares exec python benchmarks/many_flights.py [--flights N] [--processes N] [--keep]

`--flights` are flown in this process, `--processes` in child processes; each is a recorded burn of
a minute of flight time. The resources are measured after each.
"""

import argparse
import gc
import tempfile
from pathlib import Path

import yaml
from figures import Figures, keep_option

from ares_bringup.fly import fly
from ares_bringup.held import used_by_family
from ares_bringup.options import FlyOptions
from ares_trials.testing.flights import short_burn
from ares_trials.testing.held import Held, held, orphans

#: Flights before what is held is taken for the beginning: what is loaded once is loaded then.
FIRST = 5


def flown(folder: Path, count: int, in_process: bool) -> tuple[list[Held], set[str]]:
    """Return the resources after each flight, and the orphans in shared memory."""
    mission = folder / "burn.yaml"
    mission.write_text(yaml.safe_dump(short_burn()))
    used: set[str] = set()
    rows = []
    for k in range(count):
        bag = folder / f"{'one' if in_process else 'many'}_{k}"
        options = FlyOptions(mission=str(mission), in_process=in_process, bag=bag)
        summary = fly(options, show=lambda _monitor: used.update(used_by_family()))
        if summary.exit_code:
            raise SystemExit(f"flight {k}: {summary.verdict}")
        gc.collect()
        rows.append(held())
        if k % 10 == 9:
            print(f"{k + 1} flights: {rows[-1]}", flush=True)
    return rows, orphans(used)


def report(figures: Figures, what: str, rows: list[Held], left: set[str]) -> None:
    """Add the first and last resources."""
    first, last = rows[min(FIRST, len(rows) - 1)], rows[-1]
    figures.add(f"flights {what}", len(rows), "")
    for name, unit in (
        ("memory_mib", "MiB"),
        ("descriptors", ""),
        ("threads", ""),
        ("mapped", "files"),
        ("children", ""),
    ):
        figures.add(f"{what}: {name}, after {FIRST}", getattr(first, name), unit)
        figures.add(f"{what}: {name}, at the end", getattr(last, name), unit)
    figures.add(f"{what}: left in shared memory", len(left), "files")


def main() -> None:
    """Print the resources at the beginning and at the end."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=200)
    parser.add_argument("--processes", type=int, default=200)
    keep_option(parser)
    options = parser.parse_args()
    figures = Figures(__file__, "What is held after many flights, in one process and in many.")
    with tempfile.TemporaryDirectory() as name:
        for what, count in (
            ("in one process", options.flights),
            ("of processes", options.processes),
        ):
            if count:
                rows, left = flown(Path(name), count, what == "in one process")
                report(figures, what, rows, left)
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
