# SPDX-License-Identifier: Apache-2.0
"""Registry of the installed guidance laws; imports none of them, only the standard library."""

from ares_models.registry import registered

#: Entry points of this group are laws: `name = module:object`, the object a `law.LawKind`.
GROUP = "ares_guidance.laws"


def law_names() -> list[str]:
    """Return the names of the laws, sorted."""
    return sorted(registered(GROUP))
