# SPDX-License-Identifier: Apache-2.0
"""Compute all tables and figures of the thesis, in the order of the page."""

from collections.abc import Callable
from typing import Any, Literal

from ares_studies.pages.parts import Chapter, Item
from ares_thesis.reproduce import analytic_figures, analytic_tables, figures, peg, printed, tables
from ares_thesis.reproduce.headline import headline, masses
from ares_thesis.reproduce.model import Erratum, Report
from ares_thesis.reproduce.sources import Sources

Progress = Callable[[str], None]

TABLES = {**tables.TABLES, **analytic_tables.TABLES, **peg.TABLES}
FIGURES = {**figures.FIGURES, **analytic_figures.FIGURES, **peg.FIGURES}


def make_report(progress: Progress) -> Report:
    """Compute the report.

    Args:
        progress: gets the name of each part before it is computed.

    Raises:
        OptimizerError: a solution did not converge.
    """
    sources = Sources()
    chapters = tuple(
        Chapter(
            chapter["number"],
            chapter["title"],
            chapter["text"],
            tuple(_item(item, sources, progress) for item in chapter["items"]),
        )
        for chapter in printed.contents()
    )
    progress("Errata")
    errata = tuple(
        Erratum(**{name: text.format_map(sources.facts) for name, text in entry.items()})
        for entry in printed.errata()
    )
    progress("In short")
    mission = {"name": sources.mission.name, "title": sources.mission.title}
    return Report(mission, headline(sources), masses(sources), chapters, errata)


def parts() -> list[str]:
    """Return the names of all parts, in the order of computation."""
    items = [_name(item) for chapter in printed.contents() for item in chapter["items"]]
    return [*items, "Errata", "In short"]


def _name(item: dict[str, Any]) -> str:
    """Return `Table 4.1` for `table-4.1`, unless another name is given."""
    return str(item.get("name", item["key"].replace("-", " ").capitalize()))


def _item(item: dict[str, Any], sources: Sources, progress: Progress) -> Item:
    key = item["key"]
    progress(_name(item))
    kind: Literal["table", "figure"] = "table" if key in TABLES else "figure"
    make = TABLES[key] if key in TABLES else FIGURES[key]
    return Item(
        key,
        kind,
        _name(item),
        item["title"],
        item["see"],
        make(sources),
        item.get("wide", False),
    )
