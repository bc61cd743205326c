# SPDX-License-Identifier: Apache-2.0
"""Registry of the methods; imports none of them, only the standard library."""

from ares_models.registry import registered

DIRECT_METHODS = ("direct11", "direct14", "direct20", "jump")
INDIRECT_METHODS = ("indirect", "closed_form")
COLLOCATION = "collocation"
#: Method chosen by the mission.
AUTO = "auto"
#: Methods that plan burns in held attitude.
HELD_METHODS = ("auto", "collocation", "indirect", "direct11", "direct14", "direct20")
#: Methods of this package.
METHODS = (AUTO, COLLOCATION, *INDIRECT_METHODS, *DIRECT_METHODS)

#: Environment variable with a folder in which the processes of a flight, or of several, share
#: solutions.
SHARED_SOLUTIONS = "ARES_SHARED_SOLUTIONS"

#: Entry points of this group are methods: `name = module:object`, the object a
#: `methods.MethodKind`.
GROUP = "ares_optimizer.methods"


def method_names() -> tuple[str, ...]:
    """Return the names of the methods: those of this package, then those of others."""
    return (*METHODS, *sorted(registered(GROUP)))
