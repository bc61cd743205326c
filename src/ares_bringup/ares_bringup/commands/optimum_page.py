# SPDX-License-Identifier: Apache-2.0
"""Compose the page of an optimum: the parts of a flight's page, and the proof. No ROS."""

import math
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from ares_bringup.commands.optimize import (
    NOT_FOUND,
    VERDICTS,
    arc_figures,
    is_free,
    name_and_state,
    price_of,
    proof_facts,
)
from ares_bringup.commands.report import (
    Told,
    account_of,
    air_numbers,
    budget_table,
    compare,
    guides,
    recording_of,
    told_of,
)
from ares_bringup.marks import NEAR_ON_PAGES, air_marks, apart
from ares_bringup.options import CannotStart
from ares_bringup.recorded import RecordedFlight
from ares_bringup.whole_file import write_whole
from ares_models.arrays import BURN
from ares_models.mission import Mission
from ares_models.passage import passage_of
from ares_models.software import software
from ares_optimizer.solution import Solution
from ares_studies.event_words import Moment, air_moments
from ares_studies.flight_page.data import DrawnFlight, make_flight
from ares_studies.flight_page.optimum import LAW, record_optimum
from ares_studies.flight_page.page import Account, make_report, render
from ares_studies.pages.parts import BLANK, Cell, Column, PageTable, Row, number, power, word

COMMAND = "ares optimize"


def write_page(
    out: Path, mission: Mission, solution: Solution, flown: RecordedFlight | None
) -> None:
    """Write the page of an optimum, with a recorded flight for comparison if given.

    Args:
        out: the page.
        mission: solved mission.
        solution: with a trajectory.
        flown: a recorded flight; None: none.

    Raises:
        CannotStart: the flight is of another mission, or the page cannot be written; one line.
    """
    if flown is not None and flown.mission.name != mission.name:
        raise CannotStart(
            f"--beside is a flight of {flown.mission.name!r}; expected one of {mission.name!r}"
        )
    if flown is not None and flown.mission.digest != mission.digest:
        print(
            f"ares: {flown.path}: {mission.name} has other numbers now than it was flown with",
            file=sys.stderr,
        )
    recording = record_optimum(LAW, mission, solution)
    flights = [make_flight(recording)]
    moments = air_moments(passage_of(recording.truth)) if flights[0].air else []
    accounts = [_account(mission, solution, flights[0], moments)]
    comparison = None
    kicker = f"Optimum, method {solution.method}"
    if flown is not None:
        name = f"flown, {flown.law}"
        flights.append(make_flight(recording_of(name, flown)))
        accounts.append(account_of(name, flown, flights[1]))
        told = [_told(solution, flights[0]), told_of(flown.summary, flights[1])]
        comparison = compare([LAW, name], told)
        kicker += f", beside a flight by {flown.law}"
    report = make_report(flights, accounts, comparison, kicker, COMMAND)
    write_whole(out, render(report).encode())


def _verdict(solution: Solution) -> str:
    word = VERDICTS.get(solution.status, NOT_FOUND)[0]
    return word[0].upper() + word[1:]


def _told(solution: Solution, flight: DrawnFlight) -> Told:
    return Told(
        _verdict(solution),
        _known(solution.m_f_kg),
        _known(solution.t_meco_s),
        _known(solution.t_plf_s),
        {},
        flight.budget,
        flight.air,
    )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _account(
    mission: Mission, solution: Solution, flight: DrawnFlight, moments: Sequence[Moment]
) -> Account:
    events = sorted((*_events(mission, solution, flight), *moments), key=lambda event: event.time_s)
    words = _words(mission, solution)
    numbers = (
        ("final mass", solution.m_f_kg, 2, "kg"),
        ("cut-off", solution.t_meco_s, 3, "s"),
        ("last jettison", solution.t_plf_s, 3, "s"),
        ("delta-V", flight.budget.ideal_m_s, 1, "m/s"),
    )
    good = solution.converged
    return Account(
        name=LAW,
        bag="",
        law=LAW,
        title=mission.title,
        verdict=_verdict(solution),
        good=good,
        problems=() if good else (solution.reason,),
        key_numbers=(
            *(
                (name, number(value, decimals).text, unit)
                for name, value, decimals, unit in numbers
                if math.isfinite(value)
            ),
            *air_numbers(flight),
        ),
        facts=tuple(_facts(mission, solution).items()),
        tables={
            "Constraints and their prices": constraint_table(mission, solution),
            "Steering": steering_table(mission, solution),
            "Delta-V budget": budget_table(flight.budget),
        },
        end="cut-off",
        events=events,
        marks=guides(apart(words, solution.t_meco_s - solution.flown[0].start_s, NEAR_ON_PAGES)),
        air_marks=guides(air_marks(words, moments)),
        diagnostics=(),
    )


def _facts(mission: Mission, solution: Solution) -> dict[str, str]:
    facts = {"mission": mission.name, "method": solution.method, "software": software()}
    for k, line in enumerate(solution.steps, 1):
        facts[f"step {k} of the search"] = mission.with_names(line)
    return facts | proof_facts(solution)


def constraint_table(mission: Mission, solution: Solution) -> PageTable:
    """Tabulate the constraints as found by the independent integration, and their multipliers."""
    rows = []
    for check in solution.constraints:
        name, state = name_and_state(mission, check)
        cells = (
            _price(price_of(check)),
            word(state),
            _figures(check.value),
            word(BLANK) if is_free(check) else _figures(check.limit),
        )
        rows.append(Row(name, cells))
    columns = (Column("price, kg per unit"), Column("state"), Column("value"), Column("limit"))
    finding = (
        "Values by an independent integrator. A price is the final mass that a unit more of a "
        "limit brings that acts."
    )
    return PageTable(columns, tuple(rows), finding)


def steering_table(mission: Mission, solution: Solution) -> PageTable:
    """Tabulate the steering laws: in each, the thrust direction turns at a constant rate."""
    rows = []
    for arc in solution.arcs:
        middle = 0.5 * (arc.start_s + arc.end_s)
        name = next(
            (
                mission.arc_names[flown.arc]
                for flown in solution.flown
                if flown.start_s <= middle <= flown.end_s
            ),
            BLANK,
        )
        rows.append(Row(name, tuple(number(*figure) for figure in arc_figures(arc))))
    titles = ("from, s", "to, s", "mass, kg", "to, kg", "delta-V, m/s", "rate, deg/s")
    return PageTable(tuple(Column(title) for title in titles), tuple(rows))


def _events(mission: Mission, solution: Solution, flight: DrawnFlight) -> list[Moment]:
    """List begin of each arc, jettisons and end, with the mass after each."""
    found = [(arc.start_s, f"begins: {mission.arc_names[arc.arc]}") for arc in solution.flown]
    found += [
        (at, f"jettison: {mission.jettison_names[k]}")
        for k, at in enumerate(solution.jettison_times_s)
        if math.isfinite(at)
    ]
    found.append((solution.t_meco_s, "main-engine cut-off"))
    states = flight.states
    rows = [int(np.searchsorted(states.time_s, at + 1e-6)) - 1 for at, _ in found]
    return [
        Moment(0, at, float(states.mass_kg[max(row, 0)]), text)
        for (at, text), row in zip(found, rows, strict=True)
    ]


def _words(mission: Mission, solution: Solution) -> dict[float, str]:
    """Label the instants marked in the charts: jettisons, staging, coasts, cut-off."""
    arcs, rises = mission.arrays().arcs, mission.vertical_rises
    words = {round(at, 3): "jettison" for at in solution.jettison_times_s if math.isfinite(at)}
    for before, arc in pairwise(solution.flown):
        word = "ignition" if arcs[arc.arc]["kind"] == BURN else "coast"
        if arcs[arc.arc]["stage"] != arcs[before.arc]["stage"]:
            word = "staging"
        words.setdefault(round(arc.start_s, 3), "pitch-over" if before.arc in rises else word)
    words.setdefault(round(solution.t_meco_s, 3), "cut-off")
    return words


def _price(value: float) -> Cell:
    """Format a multiplier with sign and four significant figures; blank if unknown."""
    if value and not 1e-3 <= abs(value) < 1e4:
        return power(value, 4, signed=True)
    size = math.floor(math.log10(abs(value))) if value and math.isfinite(value) else 3
    return number(value, max(3 - size, 0), signed=True)


def _figures(value: float) -> Cell:
    """Format a number with nine significant figures, at most six decimals."""
    size = math.floor(math.log10(abs(value))) if value else 0
    return number(value, min(max(8 - size, 0), 6))
