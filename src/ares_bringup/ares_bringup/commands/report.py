# SPDX-License-Identifier: Apache-2.0
"""Write the page of recorded flights for `ares report`. No ROS."""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ares_bags.files import find_file
from ares_bags.writer import DATE_KEY, GUIDANCE_KEY, MACHINE_KEY
from ares_bringup.insertion import orbit_of, orbit_state
from ares_bringup.marks import NEAR_ON_PAGES, air_marks, marks_of, words_of
from ares_bringup.observed import Diagnostic
from ares_bringup.options import CannotStart
from ares_bringup.outcomes import Outcome
from ares_bringup.recorded import RecordedFlight, read_flight, tell_notes
from ares_bringup.report import ORBIT_ERRORS, number, shown_path
from ares_bringup.summary import FlightSummary
from ares_bringup.whole_file import check_file, write_whole
from ares_studies.flight_page.budget import Budget
from ares_studies.flight_page.data import AirPart, DrawnFlight, Recording, make_flight
from ares_studies.flight_page.page import MAX_FLIGHTS, Account, Complaint, make_report, render
from ares_studies.pages import parts
from ares_studies.pages.parts import Cell, Column, Guide, PageTable, Row, small, word
from ares_studies.pages.templates import chosen_name
from ares_vehicle_sim.falls import Fall

PAGE = "report.html"
COMPARISON = "comparison.html"
#: Most texts of diagnostics on a page.
MAX_COMPLAINTS = 100

#: Label of the last mark on the globe.
ENDINGS = {Outcome.TARGET: "insertion", Outcome.IMPACT: "impact"}

_DECIMALS = {"eccentricity": 7, "argument_of_perigee_deg": 5, "true_anomaly_deg": 5}
#: Judged quantities: name, unit, decimals.
QUANTITIES = {
    "radius_m": ("radius", " m", 2),
    "speed_m_s": ("speed", " m/s", 4),
    "flight_path_angle_deg": ("flight-path angle", " deg", 6),
    "inclination_deg": ("inclination", " deg", 6),
    "ascending_node_deg": ("ascending node", " deg", 6),
    **{key: (name, unit, _DECIMALS.get(key, 1)) for key, (name, unit) in ORBIT_ERRORS.items()},
}


def report(paths: Sequence[Path], out: Path | None, mission: str | None = None) -> Path:
    """Write the page of one flight, or of several overlaid.

    Args:
        paths: bags, MAX_FLIGHTS at most; missions may differ.
        out: the page; None: `report.html`, of several `comparison.html`, in the folder of the
            first bag.
        mission: to use instead of that of each flight.

    Returns:
        The page.

    Raises:
        CannotStart: no such bag, no flight in it, its mission cannot be read, or the page
            cannot be written; one line.
    """
    if len(paths) > MAX_FLIGHTS:
        raise CannotStart(f"{len(paths)} bags; expected {MAX_FLIGHTS} at most, a colour each")
    flown = [read_flight(path, mission) for path in paths]
    tell_notes(flown)
    if out is None:
        out = find_file(paths[0]).parent / (PAGE if len(paths) == 1 else COMPARISON)
    check_file(out)
    names = short_names(flown)
    flights = [make_flight(recording_of(name, one)) for name, one in zip(names, flown, strict=True)]
    accounts = [
        account_of(name, one, flight)
        for name, one, flight in zip(names, flown, flights, strict=True)
    ]
    comparison = None
    if len(flown) > 1:
        told = [told_of(one.summary, flight) for one, flight in zip(flown, flights, strict=True)]
        comparison = compare(names, told)
    write_whole(out, render(make_report(flights, accounts, comparison)).encode())
    return out


def recording_of(name: str, flown: RecordedFlight) -> Recording:
    """Convert a flight from its bag for charts, globes and tables."""
    return Recording(
        name=name,
        law=flown.law,
        mission=flown.mission,
        truth=flown.columns["vehicle_state"],
        navigation=flown.columns["nav_state"],
        status=flown.columns["guidance_status"],
    )


def short_names(flown: Sequence[RecordedFlight]) -> list[str]:
    """Name each flight: its law if unique, else with its bag, else with a number too."""
    names = [flight.law for flight in flown]
    if len(set(names)) < len(names):
        names = [f"{flight.law}, {_bag_name(flight.path)}" for flight in flown]
    if len(set(names)) < len(names):
        names = [f"{k + 1}: {name}" for k, name in enumerate(names)]
    return names


def _bag_name(path: Path) -> str:
    return find_file(path).absolute().parent.name


# ---- account of a flight


def account_of(name: str, flown: RecordedFlight, flight: DrawnFlight) -> Account:
    """Describe a recorded flight.

    Args:
        name: unique on the page.
        flown: the flight.
        flight: the same, ready to be drawn.
    """
    summary = flown.summary
    problems, falls = summary.shortcomings(), summary.falls
    tables = {"Insertion": _insertion(summary), "Delta-V budget": budget_table(flight.budget)}
    if falls:
        tables["Where stages come down"] = falls_table(falls)
    verdict = summary.verdict
    if summary.outcome is Outcome.INCOMPLETE:
        verdict += ": no end in this bag"
    return Account(
        name=name,
        bag=shown_path(str(flown.path)),
        law=flown.law,
        title=flown.mission.title,
        verdict=verdict,
        good=not problems,
        problems=tuple(problems),
        key_numbers=(*_key_numbers(summary), *air_numbers(flight)),
        facts=tuple(_facts(flown)),
        tables=tables,
        end=ENDINGS.get(summary.outcome, "end"),
        events=summary.timeline,
        marks=guides(marks_of(summary, NEAR_ON_PAGES)),
        air_marks=guides(air_marks(words_of(summary), summary.moments)),
        diagnostics=tuple(_complaints(summary.diagnostics)),
        falls=falls,
    )


def guides(marks: Sequence[tuple[float, str]]) -> tuple[Guide, ...]:
    """Return instants with their labels as lines of a chart."""
    return tuple(Guide(*mark) for mark in marks)


def _key_numbers(summary: FlightSummary) -> list[tuple[str, str, str]]:
    """List name, value, unit of the known key figures."""
    fairing = summary.facts.fairing
    jettison = "" if fairing is None else f"jettison of {summary.facts.jettisons[fairing]}"
    values = (
        ("final mass", summary.m_f_kg, 2, "kg"),
        ("cut-off", summary.t_meco_s, 3, "s"),
        (jettison, summary.t_plf_s, 3, "s"),
    )
    return [
        (name, number(value, decimals), unit)
        for name, value, decimals, unit in values
        if value is not None
    ]


def air_numbers(flight: DrawnFlight) -> list[tuple[str, str, str]]:
    """List name, value, unit of the key figures in the air; none above it."""
    air = flight.air
    return [] if air is None else [("max q", number(air.max_q_pa / 1e3, 2), "kPa")]


def _facts(flown: RecordedFlight) -> list[tuple[str, str]]:
    summary = flown.summary
    times = flown.columns["vehicle_state"]["time"]
    lines = [
        ("bag", shown_path(str(flown.path))),
        ("mission", summary.facts.name + (f" ({flown.note})" if flown.note else "")),
        ("guidance", flown.law),
        ("flown", f"{number(times[0], 2)} to {number(times[-1], 2)} s, {len(times):,} states"),
    ]
    lines += _made_by(flown.custom)
    if summary.guidance_cycles:
        iterations = summary.first_convergence_iterations
        cycles = f"{summary.guidance_cycles:,}"
        cycles += f", first solution after {iterations} iterations" if iterations else ""
        cycles += f", {summary.lost_messages:,} not recorded" if summary.lost_messages else ""
        lines.append(("cycles", cycles))
    if summary.diagnostic_count:
        lines.append(("warnings", f"{summary.diagnostic_count:,}"))
    return lines


def _made_by(custom: Mapping[str, str]) -> list[tuple[str, str]]:
    """List date, machine and software of the flight, as far as the bag has them."""
    lines = [(key, custom[key]) for key in (DATE_KEY, MACHINE_KEY) if custom.get(key)]
    for key, text in custom.items():
        if not key.startswith(GUIDANCE_KEY):
            continue
        try:
            settings = json.loads(text)
        except ValueError:
            continue
        if isinstance(settings, dict):
            told = (("software", "software"), ("mission_digest", "mission digest"))
            lines += [(name, str(settings[key])) for key, name in told if settings.get(key)]
    # a restarted guidance repeats them
    return list(dict.fromkeys(lines))


def _complaints(diagnostics: Sequence[Diagnostic]) -> list[Complaint]:
    """List each text once, with its first time and its count."""
    counts = Counter((line.level, line.node, line.message) for line in diagnostics)
    first = {(line.level, line.node, line.message): line.time for line in reversed(diagnostics)}
    found = [Complaint(first[key], *key, count) for key, count in counts.items()]
    return sorted(found, key=lambda complaint: complaint.time_s)[:MAX_COMPLAINTS]


# ---- tables


def _insertion(summary: FlightSummary) -> PageTable | None:
    """Tabulate error, tolerance, flown and target value of the judged quantities."""
    end = summary.end
    if end is None:
        return None
    values = _judged(summary)
    judged = summary.judgement
    assert judged is not None
    rows = []
    for key, error in judged.errors.items():
        name, unit, decimals = QUANTITIES[key]
        flown = values[key]
        rows.append(
            Row(
                f"{name},{unit}" if unit else name,
                (
                    small(error),
                    _tolerance(judged.allowed[key]),
                    parts.number(flown, decimals),
                    parts.number(flown - error, decimals),
                ),
            )
        )
    columns = (Column("error"), Column("tolerance"), Column("flown"), Column("target"))
    return PageTable(columns, tuple(rows), f"At {number(end.time, 3)} s, when the flight was over.")


def _tolerance(value: float) -> Cell:
    return Cell(f"{value:,.3g}" if 1e-3 <= value < 1e3 else parts.power(value, 2).text, value)


def _judged(summary: FlightSummary) -> dict[str, float]:
    """Return the flown values of all quantities that may be judged, by error name."""
    end = summary.end
    assert end is not None
    elements = orbit_of(summary.facts, end.position, end.velocity)
    return vars(orbit_state(end.position, end.velocity)) | {
        "perigee_radius_m": elements.perigee_radius,
        "apogee_radius_m": elements.apogee_radius,
        "semi_major_axis_m": elements.semi_major_axis,
        "eccentricity": elements.eccentricity,
        "c3_m2_s2": -summary.facts.mu / elements.semi_major_axis,
        "argument_of_perigee_deg": math.degrees(elements.argument_of_perigee),
        "true_anomaly_deg": math.degrees(elements.true_anomaly),
    }


#: Rows of a delta-V budget: name, attribute, explanation.
_BUDGET = (
    ("ideal", "ideal_m_s", "integral of the thrust acceleration"),
    ("gravity", "gravity_m_s", "its pull against the velocity"),
    ("steering", "steering_m_s", "thrust beside the velocity"),
    ("drag", "drag_m_s", "the air against the velocity"),
    ("pressure", "pressure_m_s", "of the air on the nozzles"),
    ("gained", "gained_m_s", "inertial speed at the end minus that at the begin"),
)


def budget_table(budget: Budget) -> PageTable:
    """Tabulate the delta-V budget: ideal minus all losses is the speed gained."""
    rows = [
        Row(f"{name}: {meaning}", (parts.number(getattr(budget, field), 2),))
        for name, field, meaning in _BUDGET
    ]
    if math.isfinite(budget.left_m_s):
        left = f"left: with the {number(budget.left_kg, 1)} kg of propellant in the last stage"
        rows.append(Row(left, (parts.number(budget.left_m_s, 2),)))
    columns = (Column("delta-V, m/s"),)
    finding = (
        "Ideal minus gravity, steering, drag and pressure is the speed gained, within "
        f"{parts.about(abs(budget.open_m_s))} m/s."
    )
    return PageTable(columns, tuple(rows), finding)


def falls_table(falls: Sequence[Fall]) -> PageTable:
    """Tabulate where and when the pieces come down, and how fast."""
    rows = []
    for fall in falls:
        cells = [parts.number(fall.time_s, 1), parts.number(fall.coefficient_kg_m2, 0)]
        note = "without drag" if math.isinf(fall.coefficient_kg_m2) else ""
        if fall.impact is None:
            cells += [word(parts.BLANK)] * 4
            note = fall.words
        else:
            cells += [
                parts.number(fall.impact.time_s, 1),
                parts.unbroken(fall.impact.place),
                parts.number(fall.downrange_m / 1e3, 0),
                parts.number(fall.speed_m_s, 0),
            ]
            if fall.impact.area:
                note = f"in {fall.impact.area}"
        rows.append(Row(fall.title, tuple(cells), note))
    titles = ("dropped, s", "ballistic coefficient, kg/m2", "down, s", "at", "downrange, km")
    columns = tuple(map(Column, (*titles, "speed, m/s")))
    finding = (
        "In the air of the mission, as points; a piece without a coefficient of its own tumbles."
    )
    return PageTable(columns, tuple(rows), finding)


@dataclass(frozen=True)
class Told:
    """Hold a flight's column in the table of several flights.

    Attributes:
        verdict: in a few words.
        m_f_kg, t_meco_s, t_plf_s: final mass, cut-off and jettison; None: unknown.
        errors: flown minus target, by the names of the judge.
        budget: its delta-V budget.
        air: its part in the air; None: none.
    """

    verdict: str
    m_f_kg: float | None
    t_meco_s: float | None
    t_plf_s: float | None
    errors: Mapping[str, float]
    budget: Budget
    air: AirPart | None


def told_of(summary: FlightSummary, flight: DrawnFlight) -> Told:
    """Return the column of a recorded flight."""
    return Told(
        summary.verdict,
        summary.m_f_kg,
        summary.t_meco_s,
        summary.t_plf_s,
        summary.insertion_error,
        flight.budget,
        flight.air,
    )


def compare(names: Sequence[str], told: Sequence[Told]) -> PageTable:
    """Tabulate flights side by side, with each number's difference from the first."""
    columns = tuple(Column(chosen_name(name)) for name in names)
    rows = [
        Row("", tuple(word(one.verdict) for one in told)),
        _compared("final mass, kg", [one.m_f_kg for one in told], 2),
        _compared("cut-off, s", [one.t_meco_s for one in told], 3),
    ]
    if any(one.t_plf_s is not None for one in told):
        rows.append(_compared("jettison, s", [one.t_plf_s for one in told], 3))
    if any(one.air for one in told):
        for label, field in (
            ("max q, kPa", "max_q_pa"),
            ("max q alpha, kPa rad", "max_q_alpha_pa_rad"),
        ):
            most = [getattr(one.air, field) / 1e3 if one.air else None for one in told]
            rows.append(_compared(label, most, 3))
    for key in dict.fromkeys(key for one in told for key in one.errors):
        name, unit, _ = QUANTITIES[key]
        label = f"error of {name},{unit}" if unit else f"error of {name}"
        rows.append(_compared(label, [one.errors.get(key) for one in told], None))
    for name, field in (*((name, field) for name, field, _ in _BUDGET), ("left", "left_m_s")):
        values = [getattr(one.budget, field) for one in told]
        if any(math.isfinite(value) and value for value in values):
            rows.append(_compared(f"delta-V, {name}, m/s", values, 2))
    return PageTable(columns, tuple(rows), "In small letters: the difference from the first.")


def _compared(label: str, values: Sequence[float | None], decimals: int | None) -> Row:
    """Make a row of `compare`; `decimals` None: two significant figures."""

    def cell(value: float, *, signed: bool = False) -> Cell:
        if math.isnan(value):
            return word(parts.BLANK)
        return small(value) if decimals is None else parts.number(value, decimals, signed=signed)

    known = [math.nan if value is None else value for value in values]
    cells = [cell(known[0])]
    for value in known[1:]:
        away = value - known[0]
        below = cell(away, signed=True).text if math.isfinite(away) else ""
        cells.append(replace(cell(value), below=below))
    return Row(label, tuple(cells))
