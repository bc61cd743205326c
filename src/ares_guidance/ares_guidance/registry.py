# SPDX-License-Identifier: Apache-2.0
"""Registry of the installed guidance laws; imports none of them, only the standard library."""

from functools import cache
from importlib.metadata import EntryPoint, entry_points

#: Entry points of this group are laws: `name = module:object`, the object a `law.LawKind`.
GROUP = "ares_guidance.laws"


@cache
def registered_laws() -> dict[str, EntryPoint]:
    """Return the entry points of the laws by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def law_names() -> list[str]:
    """Return the names of the laws, sorted."""
    return sorted(registered_laws())
