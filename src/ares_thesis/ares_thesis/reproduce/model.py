# SPDX-License-Identifier: Apache-2.0
"""Define the report on the thesis as plain data for both the page and the JSON file."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ares_studies.pages.parts import Cell, Chapter, PageTable, Role


@dataclass(frozen=True)
class Erratum:
    """Hold an error or omission of the print, and its correction."""

    key: str
    place: str
    printed: str
    holds: str


@dataclass(frozen=True)
class Dot:
    """Hold a number on a line."""

    label: str
    role: Role
    cell: Cell


@dataclass(frozen=True)
class Report:
    """Hold the contents of the report.

    Attributes:
        mission: name and title of the mission.
        headline: most important numbers.
        masses: final masses, smallest first.
        chapters: in the order of the thesis.
        errata: errors of the print.
    """

    mission: Mapping[str, str]
    headline: PageTable
    masses: tuple[Dot, ...]
    chapters: tuple[Chapter, ...]
    errata: tuple[Erratum, ...]

    def to_json(self) -> dict[str, Any]:
        """Return an object for ``json.dumps(allow_nan=False)``."""
        return asdict(self)
