# SPDX-License-Identifier: Apache-2.0
"""Which guidance laws are installed, without importing any. Standard library only."""

from ares_models.registry import registered

#: Entry points of this group are laws: `name = module:object`, the object a `law.LawKind`.
GROUP = "ares_guidance.laws"


def law_names() -> list[str]:
    """Names of the laws."""
    return sorted(registered(GROUP))
