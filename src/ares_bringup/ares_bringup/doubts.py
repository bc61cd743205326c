# SPDX-License-Identifier: Apache-2.0
"""Print the warnings of a mission. No ROS."""

import sys
from contextlib import suppress

from ares_models.mission_warnings import file_warnings


def show_warnings(name: str) -> None:
    """Print the warnings of a mission on standard error, one line each.

    Args:
        name: shipped name or path; an invalid one is left to its reader to report.
    """
    with suppress(ValueError):
        for line in file_warnings(name):
            show_warning(line)


def show_warning(line: str) -> None:
    """Print a warning on standard error."""
    print(f"ares: warning: {line}", file=sys.stderr, flush=True)
