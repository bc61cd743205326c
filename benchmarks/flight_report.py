# SPDX-License-Identifier: Apache-2.0
"""Measure the time of `ares report`: the whole command, and its parts in a warm process."""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from figures import Figures, keep_option

from ares_bringup.commands.report import report
from ares_bringup.recorded import read_flight
from ares_studies.flight_page.data import Recording, make_flight
from ares_studies.pages.templates import plotly


def median(work: Callable[[], object], repeats: int) -> float:
    """Return the median wall time, s, after a first call that is not counted."""
    work()
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


def main() -> None:
    """Print medians over repeats."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag", type=Path, help="folder of a bag")
    parser.add_argument("--repeats", type=int, default=5)
    keep_option(parser)
    options = parser.parse_args()
    flown = read_flight(options.bag)
    recording = Recording(
        "flight",
        flown.law,
        flown.mission,
        flown.columns["vehicle_state"],
        flown.columns["nav_state"],
        flown.columns["guidance_status"],
    )
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        command = [sys.executable, "-m", "ares_bringup", "report", str(options.bag)]
        parts: dict[str, Callable[[], object]] = {
            "the command": lambda: subprocess.run(
                [*command, "--out", str(page)], check=True, capture_output=True
            ),
            "in a warm process": lambda: report([options.bag], page),
            "of this: read and judge": lambda: read_flight(options.bag),
            "of this: series": lambda: make_flight(recording),
            "of this: pack plotly.js": plotly,
        }
        states = len(recording.truth["time"])
        figures = Figures(__file__, "The page on one flight, medians of repeats.")
        figures.add("states of the flight", states, "")
        for name, work in parts.items():
            figures.add(name, median(work, options.repeats), "s")
        figures.add("page", page.stat().st_size / 1e6, "MB")
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
