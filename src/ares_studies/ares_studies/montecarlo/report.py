# SPDX-License-Identifier: Apache-2.0
"""Compose a campaign's page: results, influences, and the flights worth a second look."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    Record,
)
from ares_models.mission_target import target_record
from ares_models.tolerances import FLIGHT_PATH_ANGLE_DEG, RADIUS_M, SPEED_M_S
from ares_studies.flight_page.globe import Globe
from ares_studies.montecarlo.flights import Settings
from ares_studies.montecarlo.footprint_page import CLOUD, TEXT, footprint_items
from ares_studies.montecarlo.reach import Reach
from ares_studies.montecarlo.statistics import (
    CONFIDENCE,
    FAILURES,
    LISTS,
    RESULT_NAMES,
    SAMPLE,
    TOLD,
    Histogram,
    Summary,
)
from ares_studies.montecarlo.table import DRAWN
from ares_studies.montecarlo.ways import ARRIVED, FAILED, FOOTPRINTS, NOMINAL
from ares_studies.pages.parts import (
    BLANK,
    Axis,
    Cell,
    Chapter,
    Column,
    Figure,
    Guide,
    Item,
    PageTable,
    Role,
    Row,
    Series,
    Shape,
    about,
    capitalised,
    item,
    number,
    numbered,
    unbroken,
    word,
)
from ares_studies.pages.templates import make_environment, one_line, render_report
from ares_vehicle_sim.draws import FIELDS

Array = NDArray[np.float64]

#: Targets of radius, speed and angle, whose errors determine the orbit reached.
_AIMED_STATES = (TARGET_RADIUS_SPEED_ANGLE_INCLINATION, TARGET_RADIUS_SPEED_ANGLE_PLANE)

#: Distance of marks without a value from a histogram, as a fraction of its width.
_ASIDE = 0.04

#: Labels of draws and flags.
DRAWN_NAMES = {
    "initial_position_m": "initial position",
    "initial_velocity_m_s": "initial velocity",
    "log_density": "density",
    "specific_impulse": "specific impulse",
    "jettison_limit": "heating limit",
    "stage_mass": "stage mass",
    "jettison_mass": "mass of",
    "latency_s": "guidance latency",
    "start_delay_s": "start delay",
    "start_scale": "start duration",
    "nrlmsis.date_days": "date",
    "nrlmsis.f107a": "solar flux, mean",
    "nrlmsis.f107_deviation": "solar flux of the day",
    "nrlmsis.ap": "geomagnetic index",
    "navigation.position_bias_m": "navigation position",
    "navigation.velocity_bias_m_s": "navigation velocity",
    "navigation.sensed_delta_v_scale": "accelerometer scale",
    "navigation.mass_scale": "mass estimate",
    "navigation.heating_scale": "heating measurement",
    "wind.factor": "wind",
    "gust.amplitude_m_s": "gust, speed",
    "gust.altitude_m": "gust, altitude",
    "gust.length_m": "gust, length",
    "gust.azimuth_deg": "gust, azimuth",
    "ballistic_coefficient": "ballistic coefficient",
}
FLAG_NAMES = {
    "succeeded": "success: all three below",
    "terminal_accuracy": "terminal accuracy",
    "fairing_off": "fairing off before cut-off",
    "heating_kept": "heating limit kept at the jettison",
}


@dataclass(frozen=True)
class Case:
    """Hold a flight worth a second look."""

    flight: int
    why: str
    command: str


@dataclass(frozen=True)
class CampaignReport:
    """Hold the contents of the page.

    Attributes:
        title: of the mission.
        facts: how it was flown, by name.
        headline: counts.
        masses: final mass and propellant.
        chapters: figures and tables.
        cases: flights to look at again, by reason.
        globe: tracks of some flights over the Earth.
        command: repeats flight k with ``--flight k`` appended.
    """

    title: str
    facts: Mapping[str, str]
    headline: PageTable
    masses: PageTable
    chapters: tuple[Chapter, ...]
    cases: Mapping[str, tuple[Case, ...]]
    globe: Globe
    command: str

    @property
    def globe_key(self) -> list[tuple[str, Role, int, Shape]]:
        """Return labels, colours, numbers and shapes of the flights on the globe."""
        key = self.globe.key((ARRIVED, FAILED, NOMINAL))
        if self.globe.areas:
            key.append((*FOOTPRINTS, len(self.globe.areas), "line"))
        return key

    @property
    def globe_text(self) -> str:
        """Describe the flights on the globe."""
        counts = {name: count for name, _, count, _ in self.globe_key}
        arrived = counts.get(ARRIVED[0], 0)
        text = f"{arrived:,} flights of those that arrived, evenly spread"
        if failed := counts.get(FAILED[0], 0):
            text += f", the first {failed:,} that failed" if failed > 1 else ", one that failed"
        return f"{text}, and the one that nothing disperses: each flown again."

    def to_json(self) -> dict[str, Any]:
        """Return an object for ``json.dumps(allow_nan=False)``."""
        return asdict(self)


def render(report: CampaignReport) -> str:
    """Render the page as one self-contained file."""
    return render_report(make_environment(__package__), report, one_line(report.to_json()))


def make_report(
    settings: Settings,
    summary: Summary,
    facts: Mapping[str, str],
    command: str,
    reached: Mapping[int, Reach],
    globe: Globe,
) -> CampaignReport:
    """Compose the contents of the page.

    Args:
        settings: of the flights.
        summary: their statistics.
        facts: how they were flown, for people.
        command: repeats flight k with ``--flight k`` appended.
        reached: optimizer's answer for failed flights, by flight.
        globe: tracks of some flights over the Earth.
    """
    chapters: tuple[Chapter, ...] = (
        Chapter(1, "Results", _results_text(summary), tuple(_result_figures(summary))),
        Chapter(
            2,
            "Insertion",
            "Flown minus target at the end of the flight. Terminal accuracy asks for "
            f"{RADIUS_M:g} m, {SPEED_M_S:g} m/s, {FLIGHT_PATH_ANGLE_DEG:g} deg at most.",
            tuple(_insertion_figures(summary, settings)),
        ),
        Chapter(
            3,
            "What moves it",
            f"Rank correlation (Spearman) of what was drawn with what came of it, in the first "
            f"{min(SAMPLE, summary.tally.n):,} flights: 1 and -1 move together or against each "
            "other, 0 is no influence that is monotonic.",
            tuple(_influence_items(summary)),
        ),
    )
    if items := footprint_items(summary):
        chapters += (Chapter(4, "Where pieces come down", TEXT, tuple(items)),)
    return CampaignReport(
        title=settings.mission.title,
        facts=facts,
        headline=_headline(summary),
        masses=_masses(summary),
        chapters=numbered(chapters),
        cases=_cases(summary, command, reached),
        globe=globe,
        command=command,
    )


def drawn_name(column: str) -> str:
    """Return the label of a drawn quantity: ``thrust_core`` is ``thrust, core``."""
    for base in sorted(FIELDS, key=len, reverse=True):
        flat = base.replace(".", "_")
        if column == flat or column.startswith(flat + "_"):
            name = DRAWN_NAMES.get(base, base)
            part = column[len(flat) + 1 :].replace("_", " ")
            return f"{name} {part}".strip()
    return column


def _headline(summary: Summary) -> PageTable:
    tally = summary.tally
    rows = []
    for name, label in FLAG_NAMES.items():
        low, high = tally.proportion(name)
        count = tally.counts[name]
        cells = (
            Cell(f"{count:,}", count),
            Cell(f"{100.0 * count / tally.n:.3f} %", count / tally.n),
            Cell(f"{100.0 * low:.3f} to {100.0 * high:.3f}\u00a0%"),
        )
        rows.append(Row(label, cells))
    columns = (Column("flights"), Column("share"), Column(f"{100 * CONFIDENCE:.0f} % interval"))
    return PageTable(columns, tuple(rows), _failures_text(summary))


def _failures_text(summary: Summary) -> str:
    failures = {k: n for k, n in summary.tally.outcomes.items() if k != "success"}
    if not failures:
        return "No flight failed."
    told = ", ".join(
        f"{n:,} {name.replace('_', ' ')}"
        for name, n in sorted(failures.items(), key=lambda item: -item[1])
    )
    return f"Failures by their first reason: {told}."


def _masses(summary: Summary) -> PageTable:
    """Make a row of each quantity and a column of each statistic that is known of one."""
    tally, reserve = summary.tally, summary.reserve
    none = word("")
    mean, deviation = (
        replace(number(value, 1), below=f"{number(low, 1).text} to {number(high, 1).text}")
        for value, (low, high) in zip(tally.mass(), tally.mass_intervals(), strict=True)
    )
    ends = number(tally.least, 1), number(tally.most, 1)
    rows = [Row("final mass, kg", (mean, deviation, *ends, none, none))]
    finding = f"In small print below a number: its {100 * CONFIDENCE:.0f} % interval. "
    if tally.n < reserve.needed:
        finding += f"A bound on 99.7 % of all flights takes {reserve.needed} flights."
    else:
        finding += "The bound on 99.7 % of all flights is one with 90 % confidence."
        beyond = f"{number(reserve.reserve_kg, 0).text} over nominal"
        if not math.isfinite(reserve.used_kg):
            beyond = "none: too many flights did not arrive"
        used = replace(number(reserve.used_kg, 0), below=beyond)
        title, unit, _ = RESULT_NAMES["propellant_used_kg"]
        rows.append(Row(f"{title}, {unit}", (none, none, none, none, used, none)))
    for name, load in summary.loads.items():
        title, unit, decimals = RESULT_NAMES[name]
        average, most, bound = (number(one, decimals) for one in (load.mean, load.most, load.bound))
        kept = unbroken(f"{load.kept:,} of {load.limited:,}" if load.limited else "no limit")
        rows.append(Row(f"{title}, {unit}", (average, none, none, most, bound, kept)))
    titles = (
        "mean",
        "standard deviation",
        "least",
        "greatest",
        "bound on 99.7 %",
        "flights within limit",
    )
    known = [
        k for k in range(len(titles)) if any(row.cells[k].text not in ("", BLANK) for row in rows)
    ]
    rows = [replace(row, cells=tuple(row.cells[k] for k in known)) for row in rows]
    return PageTable(tuple(Column(titles[k]) for k in known), tuple(rows), finding)


def _results_text(summary: Summary) -> str:
    peak = summary.sample["heating_peak_after_jettison_w_m2"]
    limit = summary.sample["heating_limit_w_m2"]
    over = peak / limit
    over = over[np.isfinite(over)]
    text = "Final mass as flown: a fairing that stayed on is in it."
    if over.size:
        # the jettison itself is at the limit
        beyond = int(np.count_nonzero(over > 1.001))
        many = f"{beyond:,}" if beyond else "none"
        text += (
            f" From the jettison on the heating passed the limit again in {many} of the "
            f"first {over.size:,} flights that dropped the fairing"
            + (f", at most {over.max():.2f} times it." if beyond else ".")
        )
    return text


def _histogram(
    summary: Summary, name: str, instants: Sequence[Guide] = (), *, log: bool = False
) -> Item:
    title, unit, _ = RESULT_NAMES[name]
    histogram = summary.histograms[name]
    edges = tuple(histogram.edges.tolist())
    kinds: list[tuple[str, Role, NDArray[np.int64]]] = [("success", "here", histogram.counts)]
    if histogram.failed.any():
        kinds.append(("failure", "thesis", histogram.failed))
    flights = Axis("flights", "")
    if log:
        most = max(float(counts.max()) for _, _, counts in kinds)
        flights = Axis("flights", "", log=True, span=(0.5, 2.0 * most))
    # avoid log(0)
    floor = 0.5 if log else 0.0
    series = tuple(
        Series(
            label, role, "bars", edges, (*np.maximum(counts.astype(float), floor).tolist(), floor)
        )
        for label, role, counts in kinds
    )
    each, without = _each_failure(summary, name, floor)
    finding = f"{_beyond(histogram)} {without}".strip()
    figure = Figure(Axis(title, unit), flights, (*series, *each), tuple(instants), finding=finding)
    return item(capitalised(title), figure)


def _each_failure(summary: Summary, name: str, floor: float) -> tuple[tuple[Series, ...], str]:
    """Make a mark for each of the first failed flights; beyond the bins without a value."""
    edges = summary.histograms[name].edges
    beyond = edges[-1] + _ASIDE * (edges[-1] - edges[0])
    x, texts = [], []
    for row in summary.failures:
        value = row[name]
        x.append(beyond if value is None else float(np.clip(value, edges[0], edges[-1])))
        none = "" if value is not None else f"no {RESULT_NAMES[name][0]}; "
        texts.append(_said(row["flight"], none + row["failure"]))
    if not x:
        return (), ""
    without = x.count(beyond)
    told = f"At the right, beyond the bins: {without:,} that have no value." if without else ""
    at = (floor,) * len(x)
    return (Series("each failure", "thesis", "marks", tuple(x), at, tuple(texts)),), told


def _said(flight: int, failure: str) -> str:
    """Format a flight and its failure in short lines for a tooltip."""
    return f"flight {flight}<br>{escape(failure, quote=False).replace('; ', '<br>')}"


def _beyond(histogram: Histogram) -> str:
    """Describe the values outside the bins."""
    sides = (("below", histogram.below), ("beyond", histogram.above))
    told = [f"{count:,} {side}" for side, count in sides if count]
    if not told:
        return ""
    return f"{' and '.join(told)} what is shown, in no bar."


def _result_figures(summary: Summary) -> list[Item]:
    names = (
        "m_f_kg",
        "propellant_used_kg",
        "t_plf_s",
        "t_meco_s",
        "heating_peak_after_jettison_w_m2",
        "max_q_pa",
        "max_q_alpha_pa_rad",
    )
    limits = summary.sample["heating_limit_w_m2"]
    limits = limits[np.isfinite(limits)]
    guides: dict[str, list[Guide]] = {}
    if limits.size and np.ptp(limits) == 0.0:
        guides["heating_peak_after_jettison_w_m2"] = [Guide(float(limits[0]), "limit")]
    if math.isfinite(summary.reserve.used_kg):
        guides["propellant_used_kg"] = [
            Guide(summary.reserve.nominal_kg, "nominal"),
            Guide(summary.reserve.used_kg, "99.7 %"),
        ]
    return [
        # nearly all are at the limit: only a log scale shows the others
        _histogram(summary, name, guides.get(name, []), log=name.startswith("heating"))
        for name in names
        if name in summary.histograms
    ]


def _scatter(summary: Summary, x: Array, y: Array, title: str, x_axis: Axis, y_axis: Axis) -> Item:
    """Make a scatter plot of two numbers of each flight of the sample; mark failed flights."""
    xs, ys = x[:CLOUD], y[:CLOUD]
    flights = summary.sample["flight"][:CLOUD]
    good = summary.sample["succeeded"][:CLOUD].astype(bool)
    known = np.isfinite(xs) & np.isfinite(ys)
    kinds: tuple[tuple[str, Role, Shape, NDArray[np.bool_]], ...] = (
        ("success", "here", "cloud", good),
        ("failure", "thesis", "marks", ~good),
    )
    why = summary.failed
    series = []
    for name, role, shape, which in kinds:
        chosen = np.flatnonzero(known & which)
        if chosen.size:
            texts = tuple(
                _said(flight, why[flight]) if flight in why else f"flight {flight}"
                for flight in flights[chosen].tolist()
            )
            x_points, y_points = tuple(xs[chosen].tolist()), tuple(ys[chosen].tolist())
            series.append(Series(name, role, shape, x_points, y_points, texts))
    figure = Figure(x_axis, y_axis, tuple(series))
    return item(capitalised(title), figure, f"The first {len(xs):,} flights.")


def perigee_apogee(sample: Mapping[str, Array], target: Record, mu: float) -> tuple[Array, Array]:
    """Compute perigee and apogee of the orbits reached, from errors and target.

    Args:
        sample: columns of the table of flights, shape (n,) each.
        target: record of dtype TARGET.
        mu: gravitational parameter, m3/s2.

    Returns:
        Radii of perigee and apogee, shape (n,) each, m; nan where the errors do not determine them,
        or the orbit has none.
    """
    perigee = float(target["perigee_radius"]) + sample["perigee_radius_error_m"]
    apogee = float(target["apogee_radius"]) + sample["apogee_radius_error_m"]
    size = float(target["semi_major_axis"]) + sample["semi_major_axis_error_m"]
    shape = float(target["eccentricity"]) + sample["eccentricity_error"]
    if int(target["kind"]) in _AIMED_STATES:
        radius = float(target["radius"]) + sample["radius_error_m"]
        speed = float(target["speed"]) + sample["speed_error_m_s"]
        error = np.radians(sample["flight_path_angle_error_deg"])
        angle = float(target["flight_path_angle"]) + error
        size = 1.0 / (2.0 / radius - speed**2 / mu)
        parameter = (radius * speed * np.cos(angle)) ** 2 / mu
        shape = np.sqrt(np.maximum(0.0, 1.0 - parameter / size))
    perigee = np.where(np.isfinite(perigee), perigee, size * (1.0 - shape))
    apogee = np.where(np.isfinite(apogee), apogee, size * (1.0 + shape))
    bound = (perigee > 0.0) & (apogee >= perigee)
    return np.where(bound, perigee, math.nan), np.where(bound, apogee, math.nan)


def _insertion_figures(summary: Summary, settings: Settings) -> list[Item]:
    items = []
    environment = settings.mission.environment
    target = target_record(settings.mission)[0]
    ground = environment.earth.equatorial_radius_m
    orbit = perigee_apogee(summary.sample, target, environment.mu_m3_s2)
    if np.any(np.isfinite(orbit[0]) & np.isfinite(orbit[1])):
        axes = [Axis(f"{name} altitude", "km") for name in ("perigee", "apogee")]
        heights = [(radius - ground) / 1e3 for radius in orbit]
        items.append(_scatter(summary, heights[0], heights[1], "Perigee and apogee", *axes))
    pairs = (
        ("speed_error_m_s", "radius_error_m", "Radius against speed"),
        ("inclination_error_deg", "flight_path_angle_error_deg", "Angle against inclination"),
    )
    for x, y, title in pairs:
        if not {x, y} <= set(summary.histograms):
            continue
        axes = [Axis(*RESULT_NAMES[name][:2]) for name in (x, y)]
        items.append(_scatter(summary, summary.sample[x], summary.sample[y], title, *axes))
    names = (
        "radius_error_m",
        "flight_path_angle_error_deg",
        "perigee_radius_error_m",
        "apogee_radius_error_m",
        "semi_major_axis_error_m",
        "eccentricity_error",
        "c3_error_m2_s2",
        "true_anomaly_error_deg",
    )
    return items + [_histogram(summary, name) for name in names if name in summary.histograms]


def _influence_items(summary: Summary) -> list[Item]:
    found = summary.influences
    told = [name for name in TOLD if found[name]]
    if not told:
        return []
    order = list(found[told[0]]) + [name for name in found[told[-1]] if name not in found[told[0]]]
    rows = []
    for draw in order:
        cells = tuple(
            number(found[name][draw], 2, signed=True) if draw in found[name] else word("")
            for name in told
        )
        rows.append(Row(drawn_name(draw), cells))
    columns = tuple(Column(RESULT_NAMES[name][0]) for name in told)
    strongest, correlation = next(iter(found[told[0]].items()))
    finding = (
        f"{capitalised(drawn_name(strongest))} moves the {RESULT_NAMES[told[0]][0]} most: "
        f"{about(correlation**2)} of the variance of its ranks."
    )
    table = PageTable(columns, tuple(rows), finding)
    items = [item("Rank correlation with what was drawn", table)]
    for name in told:
        draw = next(iter(found[name]))
        title, unit, _ = RESULT_NAMES[name]
        axes = Axis(f"drawn: {drawn_name(draw)}", "as in the dispersions file"), Axis(title, unit)
        x, y = summary.sample[DRAWN + draw], summary.sample[name]
        items.append(_scatter(summary, x, y, f"{title} against what moves it most", *axes))
    return items


def _cases(
    summary: Summary, command: str, reached: Mapping[int, Reach]
) -> dict[str, tuple[Case, ...]]:
    columns = {title: name for title, name, _ in LISTS}
    cases = {}
    for title, rows in summary.worst.items():
        found = []
        for row in rows:
            why = row["failure"]
            if title == FAILURES and row["flight"] in reached:
                why = f"{why}; {reached[row['flight']]}"
            elif title != FAILURES:
                _, unit, decimals = RESULT_NAMES[columns[title]]
                why = f"{number(row[columns[title]], decimals).text} {unit}"
            found.append(Case(row["flight"], why, f"{command} --flight {row['flight']}"))
        if found:
            cases[title] = tuple(found)
    return cases
