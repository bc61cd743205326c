# SPDX-License-Identifier: Apache-2.0
"""Inject faults into real flights and count survivals. Writes the table of docs/reliability.md."""

import argparse
import json
import sys

from figures import RESULTS, Figures, keep_option

from ares_trials.faults.campaign import SUMS, as_object, fly_all, spread
from ares_trials.faults.rows import ROWS


def tell(trial: object) -> None:
    """Print the result of a completed trial."""
    print(trial, file=sys.stderr, flush=True)


def again(word: str, workers: int) -> None:
    """Repeat rows of the kept campaign with the same seed, and replace their results."""
    path = RESULTS / "faults.json"
    kept = json.loads(path.read_text())
    names = [row.name for row in ROWS]
    tasks = [task for task in spread(names, kept["n"]) if word in task[0]]
    new = as_object(fly_all(tasks, kept["seed"], workers, tell), kept["n"], kept["seed"])
    rows = {row["row"]: row for row in (*kept["rows"], *new["rows"])}
    flown = {row["row"] for row in new["rows"]}
    kept["rows"] = list(rows.values())
    kept["trials"] = [t for t in kept["trials"] if t["row"] not in flown] + new["trials"]
    kept |= {key: sum(row[key] for row in kept["rows"]) for key in SUMS}
    kept["flown_again"] = sorted({*kept.get("flown_again", ()), *flown})
    for figure, key in zip(kept["figures"], SUMS, strict=True):
        figure["value"] = kept[key]
    path.write_text(json.dumps(kept, indent=1) + "\n")


def main() -> None:
    """Fly a campaign of every row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=1000, help="faults in all")
    parser.add_argument("--seed", type=int, default=1, help="of what is drawn")
    parser.add_argument("--workers", type=int, default=2, help="flights at a time")
    keep_option(parser)
    parser.add_argument(
        "--again", help="fly the rows with this in their name once more, as in the kept campaign"
    )
    options = parser.parse_args()
    if options.again:
        again(options.again, options.workers)
        return
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
