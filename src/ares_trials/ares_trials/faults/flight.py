# SPDX-License-Identifier: Apache-2.0
"""Fly one trial as `ares fly --json` does: python -m ares_trials.faults.flight.

The one argument is a JSON object: `options` of FlyOptions, `modules` in place of the nodes' own.
"""

import json
import sys
from pathlib import Path

from ares_bringup.fly import MODULES, fly
from ares_bringup.options import CannotStart, FlyOptions, InitialGuess
from ares_bringup.summary import EXIT_CANNOT_START


def main() -> int:
    """Fly; print the summary as one JSON object."""
    given = json.loads(sys.argv[1])
    options = given["options"]
    if "bag" in options:
        options["bag"] = Path(options["bag"])
    if "initial_guess" in options:
        options["initial_guess"] = InitialGuess(options["initial_guess"])
    try:
        summary = fly(FlyOptions(**options), modules={**MODULES, **given["modules"]})
    except CannotStart as error:
        print(f"ares: {error}", file=sys.stderr)
        return EXIT_CANNOT_START
    print(json.dumps(summary.to_json(), allow_nan=False))
    return summary.exit_code


if __name__ == "__main__":
    sys.exit(main())
