# SPDX-License-Identifier: Apache-2.0
"""Find parts that packages register as entry points, without importing any. Standard library only.

A package offers a guidance law, a method of the optimizer or a verb of the command line as
`name = module:object` in its `setup.py`; nothing that takes it has to know of the package.
"""

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

_Part = TypeVar("_Part")


@cache
def registered(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name."""
    return {entry.name: entry for entry in _installed().select(group=group)}


@cache
def _installed() -> Any:
    """Read the entry points of every installed package, once."""
    return entry_points()


def load_registered(group: str, noun: str, name: str, kind: type[_Part]) -> _Part:
    """Import what is registered under a name.

    Args:
        group: of the entry points.
        noun: what it is, for the error.
        name: of the entry point; it must be registered.
        kind: class that the object must have; its `name` must be that of the entry point.

    Raises:
        ValueError: it cannot be imported, or is something else; one line.
    """
    entry = registered(group)[name]
    try:
        part = entry.load()
    except (ImportError, AttributeError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{noun} is {name!r}, which {entry.value} should be: {reason}") from error
    if not isinstance(part, kind) or getattr(part, "name", None) != name:
        raise ValueError(
            f"{noun} is {name!r}; expected {entry.value} to be the {kind.__name__} of that name"
        )
    return part
