# SPDX-License-Identifier: Apache-2.0
"""What the thesis prints: its numbers, the order of its tables and figures, its errors."""

from functools import cache
from importlib import resources
from typing import Any

import yaml


@cache
def _file(name: str) -> Any:
    return yaml.safe_load(resources.files(__package__).joinpath(name).read_text(encoding="utf-8"))


def values(key: str) -> Any:
    """Printed numbers of a table, such as ``table-4.1``, by name with unit."""
    return _file("printed.yaml")[key]


def contents() -> list[dict[str, Any]]:
    """Chapters in order: number, title, text, items with key, title and what to see."""
    return list(_file("contents.yaml"))


def errata() -> list[dict[str, str]]:
    """Errors in order: key, place, printed, holds; with names of facts in braces."""
    return list(_file("errata.yaml"))
