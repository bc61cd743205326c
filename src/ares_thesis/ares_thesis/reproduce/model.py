# SPDX-License-Identifier: Apache-2.0
"""The report on the thesis as plain data, which both the page and the JSON file show."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ares_studies.pages.parts import Cell, Chapter, Role, Table


@dataclass(frozen=True)
class Erratum:
    """A place where the print is wrong or silent, and what holds."""

    key: str
    place: str
    printed: str
    holds: str


@dataclass(frozen=True)
class Dot:
    """A number on a line."""

    label: str
    role: Role
    cell: Cell


@dataclass(frozen=True)
class Report:
    """Everything.

    Attributes:
        mission: name and title of what was flown.
        headline: the few numbers that matter most.
        masses: final masses, least first.
        chapters: in the order of the thesis.
        errata: what is wrong in print.
    """

    mission: Mapping[str, str]
    headline: Table
    masses: tuple[Dot, ...]
    chapters: tuple[Chapter, ...]
    errata: tuple[Erratum, ...]

    def to_json(self) -> dict[str, Any]:
        """Ready for ``json.dumps(allow_nan=False)``."""
        return asdict(self)
