# SPDX-License-Identifier: Apache-2.0
"""Define the report on the thesis as plain data for both the page and the JSON file."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ares_studies.pages.parts import Cell, Chapter, Column, PageTable, Role, Row, number


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


def beside(
    label: str,
    thesis: float,
    here: float,
    decimals: int,
    of_thesis: int | None = None,
    note: str = "",
    before: Sequence[Cell] = (),
    after: Iterable[float] = (),
) -> Row:
    """Make a row: thesis, here, difference.

    Args:
        label: quantity with its unit.
        thesis: as printed; nan if not printed.
        here: our value.
        decimals: of our value and of the difference.
        of_thesis: decimals as printed, if different.
        note: a sentence.
        before: cells that come before these.
        after: further values of ours.
    """
    printed = number(thesis, decimals if of_thesis is None else of_thesis)
    difference = number(here - thesis, decimals, signed=True)
    more = (number(value, decimals) for value in after)
    return Row(label, (*before, printed, number(here, decimals), difference, *more), note)


BESIDE = (Column("thesis", "thesis"), Column("here", "here"), Column("difference"))
