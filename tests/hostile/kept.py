# SPDX-License-Identifier: Apache-2.0
"""Results of several runs in one file: inputs, code, outcomes.

No input counts twice: a run that gives a target inputs of a seed that it has had is refused.
"""

import fcntl
import json
import os
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

from hostile.run import MOST_GROWTH

#: What decides what an input does: the sources, and what makes the inputs.
_CODE = ("src", "tests/hostile")


def code(root: Path) -> str:
    """Return the commit of a clone, with a mark if the code under test has changed since."""

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", *words], check=False, cwd=root, capture_output=True, text=True
        )
        return done.stdout.strip()

    mark = " and changes" if git("status", "--porcelain", "--", *_CODE) else ""
    return (git("log", "-1", "--format=%h", "--", *_CODE) or "unknown") + mark


def load(path: Path) -> list[dict[str, Any]]:
    """Return the runs of a file; empty without a file."""
    if not path.exists():
        return []
    runs: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["runs"]
    return runs


def same_inputs(runs: list[dict[str, Any]], seed: int, targets: list[str]) -> list[str]:
    """Return the targets that have already had the inputs of a seed."""
    return [
        name
        for name in targets
        if any(run["seed"] == seed and name in run["targets"] for run in runs)
    ]


def figures(runs: list[dict[str, Any]]) -> list[dict[str, str | float]]:
    """Combine all runs in the format of benchmark results."""
    inputs: Counter[str] = Counter()
    on: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    for run in runs:
        failed[run["code"]] += run["failed"]
        for name, account in run["targets"].items():
            inputs[name] += account["inputs"]
            on[run["code"]] += account["inputs"]
    accounts = [account for run in runs for account in run["targets"].values()]
    rows: list[tuple[str, float, str]] = [
        ("inputs", inputs.total(), ""),
        (
            f"unexpected exceptions, hangs, wrong successes, growth over {MOST_GROWTH >> 20} MiB",
            sum(run["failed"] for run in runs),
            "",
        ),
        ("slowest input", max(account["slowest_s"] for account in accounts), "s CPU"),
        ("most that a process has grown", max(run["grown_mib"] for run in runs), "MiB"),
    ]
    for name, count in on.items():
        rows += [(f"inputs on code {name}", count, ""), (f"found on code {name}", failed[name], "")]
    rows += [(f"inputs for {name}", count, "") for name, count in inputs.items()]
    return [{"what": what, "value": value, "unit": unit} for what, value, unit in rows]


def keep(path: Path, about: dict[str, object], run: dict[str, Any]) -> None:
    """Add a run to a file, or bring it up to date there; others may do so at the same time.

    Args:
        path: the file, which is written whole or not at all.
        about: what stands above the figures.
        run: with `begun`, by which it is known.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        runs = [other for other in load(path) if other.get("begun") != run["begun"]] + [run]
        whole = about | {"figures": figures(runs), "runs": runs}
        new = path.with_suffix(".new")
        new.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
        new.replace(path)
    finally:
        os.close(folder)
