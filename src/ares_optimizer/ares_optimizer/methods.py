# SPDX-License-Identifier: Apache-2.0
"""Methods that other packages bring (`ares_optimizer.registry` has their names)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from ares_models.registry import load_registered
from ares_optimizer.registry import GROUP
from ares_optimizer.request import Request
from ares_optimizer.solution import OptimizerError, Solution


@dataclass(frozen=True)
class MethodKind:
    """A method as one part: what a package registers under `ares_optimizer.methods`.

    Attributes:
        name: what it is chosen by.
        solve: solves a request for a mission whose last arc alone is free.
    """

    name: str
    solve: Callable[[Request], Solution]


@cache
def find_method(name: str) -> MethodKind:
    """Find a registered method by its name.

    Raises:
        OptimizerError: it cannot be imported, or is none; one line.
    """
    try:
        return load_registered(GROUP, "method", name, MethodKind)
    except ValueError as error:
        raise OptimizerError(str(error)) from error
