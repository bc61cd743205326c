# SPDX-License-Identifier: Apache-2.0
"""Try hostile input on every reader of foreign data, by the million.

    ./ares exec python benchmarks/fuzz.py [--inputs N] [--seed S] [--only WORD ...] [--keep]

Counts the outcomes of each target's inputs; forbidden ones (an exception, more than 5 s, a wrong
success, a growing process) are printed, and the input is kept in build/fuzz for a test (`Run`,
`unpack`: `tests/hostile/run.py`). `--keep` adds the run, with the commit of its code, to
benchmarks/results/fuzz.json; the same seed is not counted twice.
"""

import argparse
import datetime
import os
import platform
import sys
from contextlib import ExitStack
from pathlib import Path

from ares_node.entry import set_up_libraries

set_up_libraries()

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from figures import RESULTS, processor  # noqa: E402

from ares_bringup.discovery import apply_discovery_settings  # noqa: E402
from hostile import kept  # noqa: E402
from hostile.run import Run, memory  # noqa: E402
from hostile.targets import all_targets  # noqa: E402

KEPT = ROOT / "build" / "fuzz"


def main() -> int:
    """Run the given number of inputs; return 0 if none failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=2_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=[""], help="targets with this in the name")
    parser.add_argument("--without", nargs="+", default=[], help="and none with this")
    parser.add_argument("--keep", action="store_true", help="add to benchmarks/results/fuzz.json")
    options = parser.parse_args()
    apply_discovery_settings()
    path = RESULTS / "fuzz.json" if options.keep else KEPT / "fuzz.json"
    named = [
        target
        for target in all_targets(ROOT / "bags" / "reference")
        if any(word in target.name for word in options.only)
        and not any(word in target.name for word in options.without)
    ]
    again = kept.same_inputs(kept.load(path), options.seed, [target.name for target in named])
    if options.keep and again:
        parser.error(f"seed is {options.seed}; expected one that {again[0]} has not had")
    code = kept.code(ROOT)
    begun = datetime.datetime.now(datetime.UTC)
    about: dict[str, object] = {
        "about": "Hostile inputs by target, and what must not come of them.",
        "measured": begun.date().isoformat(),
        "machine": f"{processor()}, {os.cpu_count()} cores, Python {platform.python_version()}",
    }
    with ExitStack() as held:
        targets = [held.enter_context(target) for target in named]
        run = Run(targets, options.seed, KEPT)
        while run.inputs < options.inputs:
            run.round()
            seconds = (datetime.datetime.now(datetime.UTC) - begun).total_seconds()
            head = {"begun": begun.isoformat(), "code": code, "seconds": round(seconds)}
            kept.keep(path, about, head | run.as_json())
            print(
                f"{run.inputs:,} inputs in {seconds:.0f} s, {memory() / 2**20:.0f} MiB: "
                f"{run.failures} failures",
                flush=True,
            )
    for name, account in run.accounts.items():
        print(f"{name}: {account.as_json()}")
    return 1 if run.failures else 0


if __name__ == "__main__":
    sys.exit(main())
