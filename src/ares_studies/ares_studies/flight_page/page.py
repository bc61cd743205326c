# SPDX-License-Identifier: Apache-2.0
"""Compose a page of one flight, or of several overlaid."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from ares_studies.event_words import Moment
from ares_studies.flight_page.charts import ROLES, make_chapters
from ares_studies.flight_page.data import DrawnFlight
from ares_studies.flight_page.globe import Globe, make_globe
from ares_studies.pages.parts import Chapter, Guide, PageTable, Role
from ares_studies.pages.templates import make_environment, one_line, render_report
from ares_vehicle_sim.falls import Fall

#: Most flights on a page, one colour each.
MAX_FLIGHTS = len(ROLES)


@dataclass(frozen=True)
class Complaint:
    """Hold a warning or an error of a node: time of the first (s), count."""

    time_s: float
    level: str
    node: str
    text: str
    count: int


@dataclass(frozen=True)
class Account:
    """Describe a flight in words and numbers.

    Attributes:
        name: short and unique on the page.
        bag: path of the bag, for people; "": none.
        law: guidance law.
        title: of the mission.
        verdict: in a few words.
        good: ended as required, with no data missing.
        problems: faults, a line each.
        key_numbers: most important numbers: name, value, unit.
        facts: further facts: name and value.
        tables: insertion, delta-V budget and others, by title; None: the bag has no end of the
            flight.
        end: label of the last mark on the globe.
        events: in the order of time.
        marks: instants for the charts over the whole flight.
        air_marks: instants for the charts over its part in the air.
        diagnostics: complaints of nodes.
        falls: of what was dropped.
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
    tables: Mapping[str, PageTable | None]
    end: str
    events: Sequence[Moment]
    marks: tuple[Guide, ...]
    air_marks: tuple[Guide, ...]
    diagnostics: tuple[Complaint, ...]
    falls: Sequence[Fall] = ()


@dataclass(frozen=True)
class FlightReport:
    """Hold the contents of the page.

    Attributes:
        title: of the missions.
        kicker: kind of page, in a few words.
        command: that made it.
        accounts: of the flights.
        roles: their colours.
        comparison: differences; None for one flight.
        chapters: charts.
        globe: tracks over the ground.
        placed: every mission defines longitude zero.
    """

    title: str
    kicker: str
    command: str
    accounts: tuple[Account, ...]
    roles: tuple[Role, ...]
    comparison: PageTable | None
    chapters: tuple[Chapter, ...]
    globe: Globe
    placed: bool


def make_report(
    flights: Sequence[DrawnFlight],
    accounts: Sequence[Account],
    comparison: PageTable | None,
    kicker: str = "",
    command: str = "ares report",
) -> FlightReport:
    """Compose the contents of the page.

    Args:
        flights: to be drawn, MAX_FLIGHTS at most.
        accounts: description of each.
        comparison: differences between several.
        kicker: kind of page; "": one flight by its law, or the number of flights.
        command: that makes it.
    """
    if not kicker and len(flights) > 1:
        kicker = f"{len(flights)} flights over each other"
    names = [account.name for account in accounts]
    titles = list(dict.fromkeys(account.title for account in accounts))
    marks = (accounts[0].marks, accounts[0].air_marks) if len(flights) == 1 else ((), ())
    return FlightReport(
        title=" and ".join(titles),
        kicker=kicker or f"Flight report, guidance {accounts[0].law}",
        command=command,
        accounts=tuple(accounts),
        roles=ROLES[: len(flights)],
        comparison=comparison,
        chapters=make_chapters(flights, names, *marks),
        globe=make_globe(
            flights,
            names,
            [account.end for account in accounts],
            [account.falls for account in accounts],
        ),
        placed=all(flight.mission.zero_longitude_deg is not None for flight in flights),
    )


def render(report: FlightReport) -> str:
    """Render the page as one self-contained file."""
    chapters = [asdict(chapter) for chapter in report.chapters]
    data = one_line({"chapters": chapters, "globe": asdict(report.globe)})
    return render_report(make_environment(__package__), report, data)
