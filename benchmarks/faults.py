"""Faults into real flights: how many were survived. Writes the table of docs/reliability.md."""

import argparse
import json
import sys

from figures import RESULTS, Figures, keep_option

from ares_bringup.faults.campaign import SUMS, as_object, fly_all, spread
from ares_bringup.faults.rows import ROWS


def main() -> None:
    """Fly a campaign of every row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=1000, help="faults in all")
    parser.add_argument("--seed", type=int, default=1, help="of what is drawn")
    parser.add_argument("--workers", type=int, default=2, help="flights at a time")
    keep_option(parser)
    options = parser.parse_args()

    def tell(trial: object) -> None:
        print(trial, file=sys.stderr, flush=True)

    tasks = spread([row.name for row in ROWS], options.n)
    trials = fly_all(tasks, options.seed, options.workers, tell)
    result = as_object(trials, options.n, options.seed)
    figures = Figures(__file__, "Faults injected into flights of processes of their own.")
    for key in SUMS:
        figures.add(f"faults {key}", result[key], "")
    if options.keep:
        figures.keep()
        path = RESULTS / "faults.json"
        kept = json.loads(path.read_text())
        path.write_text(json.dumps({**kept, **result}, indent=1) + "\n")


if __name__ == "__main__":
    main()
