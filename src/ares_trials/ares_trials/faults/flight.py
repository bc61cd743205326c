# SPDX-License-Identifier: Apache-2.0
"""Fly one trial as `ares fly --json` does: python -m ares_trials.faults.flight.

The one argument is a JSON object: `options` of FlyOptions or parameters of nodes, `modules` in
place of the nodes' own.
"""

import json
import sys
from dataclasses import fields
from pathlib import Path

from ares_bringup.fly import fly
from ares_bringup.options import CannotStart, FlyOptions
from ares_bringup.outcomes import EXIT_CANNOT_START
from ares_bringup.processes import MODULES
from ares_bringup.summary_json import to_json


def main() -> int:
    """Fly; print the summary as one JSON object."""
    given = json.loads(sys.argv[1])
    options = given["options"]
    if "bag" in options:
        options["bag"] = Path(options["bag"])
    own = {item.name for item in fields(FlyOptions)}
    options["settings"] = {name: options.pop(name) for name in set(options) - own}
    try:
        summary = fly(FlyOptions(**options), modules={**MODULES, **given["modules"]})
    except CannotStart as error:
        print(f"ares: {error}", file=sys.stderr)
        return EXIT_CANNOT_START
    print(json.dumps(to_json(summary), allow_nan=False))
    return summary.exit_code


if __name__ == "__main__":
    sys.exit(main())
