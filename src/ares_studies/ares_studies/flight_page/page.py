# SPDX-License-Identifier: Apache-2.0
"""A page on one flight, or on several that lie over each other."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ares_studies.flight_page.charts import ROLES, make_chapters
from ares_studies.flight_page.data import Flight
from ares_studies.flight_page.globe import Globe, make_globe
from ares_studies.pages.parts import Chapter, Guide, Role, Table
from ares_studies.pages.templates import make_environment, one_line, render_report

#: As many flights as there are colours.
MAX_FLIGHTS = len(ROLES)


@dataclass(frozen=True)
class Happening:
    """An event of a flight: when (s), what, and the mass after it (kg)."""

    time_s: float
    text: str
    mass_kg: float


@dataclass(frozen=True)
class Complaint:
    """A warning or an error of a node: said first when (s), how often."""

    time_s: float
    level: str
    node: str
    text: str
    count: int


@dataclass(frozen=True)
class Account:
    """What is told of a flight in words and numbers.

    Attributes:
        name: short, unlike those of the other flights on the page.
        bag: path of the bag, for people; empty: there is none.
        law: that steered.
        title: of the mission.
        verdict: how it ended, in a few words.
        good: as it should have ended, and nothing is missing.
        problems: what was not as it should be, a line each.
        key_numbers: the most important ones: name, value, unit.
        facts: more of them: name and value.
        tables: insertion, delta-V budget and what else there is, by title; None: the flight has
            no end in its bag.
        end: what the last mark on the globe is called.
        events: in the order of time.
        marks: instants for the charts.
        diagnostics: what nodes complained of.
    """

    name: str
    bag: str
    law: str
    title: str
    verdict: str
    good: bool
    problems: tuple[str, ...]
    key_numbers: tuple[tuple[str, str, str], ...]
    facts: tuple[tuple[str, str], ...]
    tables: Mapping[str, Table | None]
    end: str
    events: tuple[Happening, ...]
    marks: tuple[Guide, ...]
    diagnostics: tuple[Complaint, ...]


@dataclass(frozen=True)
class FlightReport:
    """Everything on the page.

    Attributes:
        title: what was flown.
        kicker: what the page is, in a few words.
        command: that made it.
        accounts: of the flights.
        roles: their colours.
        comparison: differences; None for one flight.
        chapters: charts.
        globe: ways over the ground.
        placed: every mission says where longitude zero is.
    """

    title: str
    kicker: str
    command: str
    accounts: tuple[Account, ...]
    roles: tuple[Role, ...]
    comparison: Table | None
    chapters: tuple[Chapter, ...]
    globe: Globe
    placed: bool


def make_report(
    flights: Sequence[Flight],
    accounts: Sequence[Account],
    comparison: Table | None,
    kicker: str = "",
    command: str = "ares report",
) -> FlightReport:
    """What the page shows.

    Args:
        flights: what is drawn, MAX_FLIGHTS at most.
        accounts: what is told of each.
        comparison: differences between several.
        kicker: what the page is; empty: one flight by its law, or so many over each other.
        command: that makes it.
    """
    if not kicker and len(flights) > 1:
        kicker = f"{len(flights)} flights over each other"
    names = [account.name for account in accounts]
    titles = list(dict.fromkeys(account.title for account in accounts))
    marks = accounts[0].marks if len(flights) == 1 else ()
    return FlightReport(
        title=" and ".join(titles),
        kicker=kicker or f"Flight report, guidance {accounts[0].law}",
        command=command,
        accounts=tuple(accounts),
        roles=ROLES[: len(flights)],
        comparison=comparison,
        chapters=make_chapters(flights, names, marks),
        globe=make_globe(flights, names, [account.end for account in accounts]),
        placed=all(flight.mission.zero_longitude_deg is not None for flight in flights),
    )


def _data(report: FlightReport) -> dict[str, Any]:
    """What the scripts draw from."""
    return {
        "chapters": [asdict(chapter) for chapter in report.chapters],
        "globe": asdict(report.globe),
    }


def render(report: FlightReport) -> str:
    """The page, with everything in it."""
    return render_report(make_environment(__package__), report, one_line(_data(report)))
