# SPDX-License-Identifier: Apache-2.0
"""Run the whole sweep: every input with every action. Exit status 1: something broke.

python -m ares_trials.sweep
"""

import sys
import time

from ares_trials.sweep.attempts import ACTIONS
from ares_trials.sweep.plan import all_inputs, tasks, warm_up
from ares_trials.sweep.pool import attempt_all


def main() -> int:
    """Run the sweep; print failures and counts."""
    begun = time.monotonic()
    todo = [task for kind in ACTIONS for task in tasks(kind, all_inputs(kind), everything=True)]
    results = list(attempt_all(todo, warm_up()))
    broken = [result for result in results if result.broken]
    for result in broken:
        print(result)
    print(
        f"{len(todo):,} inputs, {len(results):,} attempts, {len(broken)} broken, "
        f"{time.monotonic() - begun:.0f} s",
        file=sys.stderr,
    )
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
