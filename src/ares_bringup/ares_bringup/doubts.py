# SPDX-License-Identifier: Apache-2.0
"""What a command says of a mission that is hardly meant. No ROS."""

import sys
from contextlib import suppress

from ares_models.mission_warnings import file_warnings


def show_warnings(name: str) -> None:
    """Print the warnings of a mission on standard error, one line each.

    Args:
        name: shipped name or path; of a wrong one nothing is said, its reader does.
    """
    with suppress(ValueError):
        for line in file_warnings(name):
            print(f"ares: warning: {line}", file=sys.stderr, flush=True)
