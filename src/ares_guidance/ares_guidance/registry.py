# SPDX-License-Identifier: Apache-2.0
"""Which guidance laws are installed, without importing any. Standard library only."""

from functools import cache
from importlib.metadata import EntryPoint, entry_points

#: Entry points of this group are laws: `name = module:object`, the object a `law.LawKind`.
GROUP = "ares_guidance.laws"


@cache
def registered_laws() -> dict[str, EntryPoint]:
    """Entry points of the laws by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def law_names() -> list[str]:
    """Names of the laws."""
    return sorted(registered_laws())
