# SPDX-License-Identifier: Apache-2.0
"""Read the print of the thesis: its numbers, the order of its tables and figures, its errors."""

from functools import cache
from importlib import resources
from typing import Any

import yaml


@cache
def _file(name: str) -> Any:
    return yaml.safe_load(resources.files(__package__).joinpath(name).read_text(encoding="utf-8"))


def values(key: str) -> Any:
    """Return the printed numbers of a table, such as ``table-4.1``, by name with unit."""
    return _file("printed.yaml")[key]


def contents() -> list[dict[str, Any]]:
    """Return the chapters in order: number, title, text, items with key, title and hint."""
    return list(_file("contents.yaml"))


def errata() -> list[dict[str, str]]:
    """Return the errors in order: key, place, printed, correction, with facts in braces."""
    return list(_file("errata.yaml"))
