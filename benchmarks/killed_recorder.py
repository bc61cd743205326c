# SPDX-License-Identifier: Apache-2.0
"""Kill recorders at a random byte of their file, and compare the repaired bags with the promise.

    ./ares exec python benchmarks/killed_recorder.py [--trials N] [--seed S] [--keep]

A publisher sends a synthetic flight, at the rate of a paced or of a lock-step flight, to a recorder
process. When the file has grown to a random size, and up to 0.6 s later, the process is killed, and
its bag repaired.
"""

import argparse
import os
import tempfile
from pathlib import Path
from random import Random

from figures import Figures, keep_option

from ares_bringup.discovery import apply_discovery_settings
from ares_node.domains import claimed_domain
from ares_trials.killed import PROMISE, Killed, killed_recording
from ares_trials.testing.ros import ros_context_on


def trial(domain: int, seed: int, number: int) -> Killed:
    """Run one recorder to its kill."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    with tempfile.TemporaryDirectory() as name, ros_context_on(domain) as context:
        random = Random(f"{seed} {number}")
        return killed_recording(context, environment, Path(name), random)


def main() -> None:
    """Print each trial, and the number that kept the promise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    keep_option(parser)
    options = parser.parse_args()
    apply_discovery_settings()
    results = []
    with claimed_domain() as domain:
        for number in range(options.trials):
            done = trial(domain, options.seed, number)
            results.append(done)
            print(f"{number + 1}: {done}", flush=True)
    figures = Figures(
        __file__,
        f"Recorders killed at a random byte; messages sent more than {PROMISE:g} s before.",
    )
    figures.add("trials", len(results), "")
    figures.add("nothing missing that was due", sum(not done.missing for done in results), "")
    figures.add("trials with messages that were due", sum(done.due > 0 for done in results), "")
    figures.add("messages that were due", sum(done.due for done in results), "")
    figures.add("of these missing", sum(done.missing for done in results), "")
    worst = max(done.youngest_missing_s for done in results)
    figures.add("oldest message lost, before the kill", worst, "s")
    figures.add("smallest file", min(done.size for done in results), "bytes")
    figures.add("largest file", max(done.size for done in results), "bytes")
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
