# SPDX-License-Identifier: Apache-2.0
"""Print benchmark figures as they are measured, and keep them as JSON for the site."""

import argparse
import datetime
import json
import os
import platform
from pathlib import Path

RESULTS = Path(__file__).parent / "results"


class Figures:
    """Hold the figures of one script in order of measurement."""

    def __init__(self, script: str, about: str) -> None:
        """Start without figures.

        Args:
            script: `__file__` of the benchmark.
            about: its subject, one sentence.
        """
        self._path = RESULTS / f"{Path(script).stem}.json"
        self._about = about
        self._rows: list[dict[str, str | float]] = []

    def add(self, what: str, value: float, unit: str) -> None:
        """Print one figure and store it."""
        self._rows.append({"what": what, "value": value, "unit": unit})
        print(f"{what:<56}{value:>14,.4g} {unit}")

    def keep(self) -> None:
        """Write the figures with date and machine."""
        RESULTS.mkdir(exist_ok=True)
        kept = {
            "about": self._about,
            "measured": datetime.date.today().isoformat(),
            "machine": f"{processor()}, {os.cpu_count()} cores, Python {platform.python_version()}",
            "figures": self._rows,
        }
        self._path.write_text(json.dumps(kept, indent=1) + "\n")


def keep_option(parser: argparse.ArgumentParser) -> None:
    """Add the option to keep the figures."""
    parser.add_argument(
        "--keep", action="store_true", help="write the figures to benchmarks/results"
    )


def processor() -> str:
    """Return the name of the processor, as far as known."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
