# SPDX-License-Identifier: Apache-2.0
"""Compose the page of an abort map: ends by time and failure, masses beside the optimum."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

from ares_models.judge import End
from ares_studies.aborts.abort_map import ACCURACY, AbortMap, AbortPoint, MapRow
from ares_studies.aborts.ends import Reached
from ares_studies.flight_page.globe import Globe, ring, spot, way_beside_others
from ares_studies.flight_page.land import land_on
from ares_studies.pages.parts import (
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
    capitalised,
    item,
    line,
    number,
    numbered,
    word,
)
from ares_studies.pages.templates import make_environment, one_line, render_report

#: Colour and name of each end.
ENDS: Mapping[End, tuple[Role, str]] = {
    End.TARGET: ("here", "target"),
    End.LOWERED: ("other", "target lowered"),
    End.SAFE_ORBIT: ("third", "safe orbit"),
    End.SUBORBITAL: ("thesis", "suborbital"),
}
#: Ends compared: field of `Point`, name and colour of its line.
WHO: tuple[tuple[str, str, Role], ...] = (
    ("optimum", "optimizer that knew", "third"),
    ("told", "optimizer told then", "other"),
    ("flown", "flown", "here"),
)
#: Least width of a stretch, percent of the strip, so that a single point is visible.
_LEAST_WIDTH = 0.8
#: Ticks below the map.
_TICKS = 6
#: Largest initial zoom of the globe.
_NEAREST = 5.0

#: Labels and colours on the globe.
_OUTSIDE: tuple[str, Role] = ("falls outside the areas", "here")
_INSIDE: tuple[str, Role] = ("falls inside one", "thesis")
_NOMINAL: tuple[str, Role] = ("the flight in which nothing fails", "other")


@dataclass(frozen=True)
class Stretch:
    """Hold an interval of times with one end, in percent of the width.

    Attributes:
        left, width: its extent.
        role: its colour.
    """

    left: float
    width: float
    role: Role


@dataclass(frozen=True)
class Strip:
    """Hold the ends of one failure over time, of one of `WHO`.

    Attributes:
        who: name of the line.
        text: the ends in words.
        stretches: intervals of equal ends.
    """

    who: str
    text: str
    stretches: tuple[Stretch, ...]


@dataclass(frozen=True)
class Falls:
    """Hold the impacts of flights that reach no orbit.

    Attributes:
        text: summary.
        globe: the impacts, the areas, and the flight without failure.
        key: labels, colours, numbers and shapes on the globe.
        placed: whether the mission defines longitude zero.
        table: number of impacts in each area.
    """

    text: str
    globe: Globe
    key: tuple[tuple[str, Role, int, Shape], ...]
    placed: bool
    table: PageTable


@dataclass(frozen=True)
class MapReport:
    """Hold the contents of the page.

    Attributes:
        title: of the mission.
        facts: how the map was made, by name.
        headline: share of points equal to the optimum.
        strips: the map, by failure.
        ticks: times below it: percent of the width, and label.
        chapters: figures and tables.
        falls: where flights that reach no orbit fall; None: all reach one.
    """

    title: str
    facts: Mapping[str, str]
    headline: PageTable
    strips: Mapping[str, tuple[Strip, ...]]
    ticks: tuple[tuple[float, str], ...]
    chapters: tuple[Chapter, ...]
    falls: Falls | None

    @property
    def key(self) -> list[tuple[Role, str]]:
        """Return the colours and names of the ends."""
        return list(ENDS.values())


def render(report: MapReport) -> str:
    """Render the page as one self-contained file."""
    data: dict[str, Any] = {"chapters": [asdict(chapter) for chapter in report.chapters]}
    if report.falls is not None:
        data["globe"] = asdict(report.falls.globe)
    return render_report(make_environment(__package__), report, one_line(data))


def make_report(made: AbortMap, facts: Mapping[str, str]) -> MapReport:
    """Compose the contents of the page.

    Args:
        made: the map.
        facts: how it was made, for people.
    """
    masses = [row for row in made.rows if math.isfinite(row.points[0].failure.time_s)]
    figures = _seen([_mass_figure(row) for row in masses])
    lacking = _seen([_short_figure(masses), *_lacking_figures(masses)])
    chapters = (
        Chapter(
            1,
            "Final mass",
            "By when it fails, where an orbit is reached. The optimizer that knew steers for the "
            "failure from the start of the flight; the one that was told begins where the flight "
            "is when it fails, and no guidance can do better.",
            tuple(figures),
        ),
        Chapter(
            2,
            "What is lacking",
            "Final mass beside that of the optimizer that was told, and the speed that the energy "
            "of the end is short of.",
            tuple(lacking),
        ),
        Chapter(
            3,
            "Ends",
            "How often each end is reached, and every stretch of times at which the flight ends "
            "otherwise or lighter than that of the optimizer that knew.",
            (_ends_table(made), _beyond_table(made)),
        ),
    )
    return MapReport(
        made.mission.title,
        facts,
        _headline(made),
        {row.name: tuple(_strip(made, row, *who[:2]) for who in WHO) for row in made.rows},
        _ticks(_span(made)),
        numbered([chapter for chapter in chapters if chapter.items]),
        _falls(made) if made.outside.of else None,
    )


# ---- the map


def _span(made: AbortMap) -> tuple[float, float]:
    times = [point.at_s for point in made.points]
    return min(times), max(times) + made.step_s


def _ticks(span: tuple[float, float]) -> tuple[tuple[float, str], ...]:
    begin, end = span
    rough = (end - begin) / _TICKS
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(size * k for k in (1.0, 2.0, 5.0, 10.0) if size * k >= rough)
    first = math.ceil(begin / step)
    times = [step * k for k in range(first, math.floor(end / step) + 1)]
    return tuple((100.0 * (t - begin) / (end - begin), f"{t:g}") for t in times)


def _strip(made: AbortMap, row: MapRow, field: str, who: str) -> Strip:
    begin, end = _span(made)
    scale = 100.0 / (end - begin)
    stretches = []
    told = []
    for ended, times in _runs(row, made.step_s, lambda point: getattr(point, field).end):
        role, name = ENDS[ended]
        width = max(_LEAST_WIDTH, scale * (times[-1] - times[0] + made.step_s))
        left = min(scale * (times[0] - begin), 100.0 - width)
        stretches.append(Stretch(round(left, 3), round(width, 3), role))
        told.append(f"{name} {_from_to(times)}")
    return Strip(who, f"{row.name}, {who}: {'; '.join(told)}", tuple(stretches))


def _runs(
    row: MapRow, step_s: float, key: Callable[[AbortPoint], Any]
) -> Iterator[tuple[Any, list[float]]]:
    """Yield intervals of times whose points have equal keys."""
    for found, points in groupby(row.points, key):
        run: list[float] = []
        for point in points:
            if run and point.at_s - run[-1] > 1.5 * step_s:
                yield found, run
                run = []
            run.append(point.at_s)
        yield found, run


def _from_to(times: list[float]) -> str:
    first, last = f"{times[0]:.6g}", f"{times[-1]:.6g}"
    return f"at {first} s" if first == last else f"{first} to {last} s"


# ---- numbers


def _headline(made: AbortMap) -> PageTable:
    rows = []
    knew, told = made.shares(), made.shares(told=True)
    for name in knew:
        cells: list[Cell] = []
        for share in (knew[name], told[name]):
            cells.append(Cell(f"{share.count:,} of {share.of:,}", share.count))
            cells.append(_percent(share.percent))
        rows.append(Row(name, tuple(cells)))
    columns = (
        Column("as the optimizer that knew"),
        Column("share"),
        Column("as the one told then"),
        Column("share"),
    )
    finding = (
        f"As the optimizer: the same end, and an orbit with a final mass within "
        f"{100 * ACCURACY:g} %."
    )
    if made.wrong:
        finding += (
            f" {len(made.wrong):,} points failed: the flight did better than an optimizer found, "
            "or the optimizer told then better than the one that knew."
        )
    return PageTable(columns, tuple(rows), finding)


def _percent(value: float) -> Cell:
    cell = number(value, 2)
    return Cell(f"{cell.text} %", cell.value) if cell.value is not None else cell


def _ends_table(made: AbortMap) -> Item:
    rows = []
    for row in made.rows:
        cells = []
        for field, _, _ in WHO:
            ends = [getattr(point, field).end for point in row.points]
            told = [f"{ENDS[end][1]} {ends.count(end):,}" for end in End if end in ends]
            cells.append(word(", ".join(told)))
        held = sum(bool(point.flown.left_on) for point in row.points)
        cells.append(Cell(f"{held:,}", held))
        good = sum(point.within for point in row.points)
        told_good = sum(point.within_told for point in row.points)
        cells += [_percent(100.0 * count / len(row.points)) for count in (good, told_good)]
        rows.append(Row(row.name, tuple(cells)))
    columns = (
        *(Column(name, role) for _, name, role in WHO),
        Column("flown with a part still on"),
        Column("as the one that knew"),
        Column("as the one told"),
    )
    return item("Ends by failure", PageTable(columns, tuple(rows)))


def _beyond_table(made: AbortMap) -> Item:
    rows = []
    for row in made.rows:
        by_time = {point.at_s: point for point in row.points}
        kinds = lambda p: (p.within, bool(p.wrong), p.optimum.end, p.told.end, p.flown.end)  # noqa: E731
        for (within, wrong, optimum, told, flown), times in _runs(row, made.step_s, kinds):
            if within and not wrong:
                continue
            points = [by_time[at] for at in times]
            cells = (
                word(_from_to(times)),
                Cell(f"{len(points):,}", len(points)),
                word(ENDS[optimum][1]),
                word(ENDS[told][1]),
                word(ENDS[flown][1]),
                _most(points, "optimum"),
                _most(points, "told"),
            )
            rows.append(Row(row.name, cells, points[0].wrong if wrong else ""))
    columns = (
        Column("times"),
        Column("points"),
        *(Column(name, role) for _, name, role in WHO),
        Column("short of the one that knew, %"),
        Column("of the one told, %"),
    )
    finding = "The mass is that of the worst point." if rows else "There is none."
    title = f"Otherwise, or more than {100 * ACCURACY:g} % from the optimum"
    return item(title, PageTable(columns, tuple(rows), finding))


def _most(points: list[AbortPoint], field: str) -> Cell:
    """Return the largest loss of mass against the optimum among equal ends."""
    shares = [
        _short(point, getattr(point, field))
        for point in points
        if math.isfinite(_short(point, getattr(point, field)))
    ]
    return number(max(shares, key=abs), 2) if shares else word("")


def _short(point: AbortPoint, best: Reached) -> float:
    """Return the loss of final mass in percent; nan if the ends differ."""
    if point.flown.end is not best.end or best.end is End.SUBORBITAL:
        return math.nan
    return 100.0 * (1.0 - point.flown.m_f_kg / best.m_f_kg)


# ---- figures

_TIME = Axis("time of the failure", "s")


def _mass_figure(row: MapRow) -> Item:
    times = [point.at_s for point in row.points]
    series = []
    for field, name, role in WHO:
        ends = [getattr(point, field) for point in row.points]
        masses = [
            reached.m_f_kg if reached.end is not End.SUBORBITAL else math.nan for reached in ends
        ]
        if any(math.isfinite(mass) for mass in masses):
            shape: Shape = "dashes" if field == "optimum" else "line"
            series.append(line(name, role, times, masses, 1, shape))
    figure = Figure(_TIME, Axis("final mass", "kg"), tuple(series))
    return item(capitalised(row.name), figure)


def _short_figure(rows: list[MapRow]) -> Item:
    roles: tuple[Role, ...] = ("here", "other", "third", "thesis", "otis")
    shapes: tuple[Shape, ...] = ("line", "dashes")
    series: list[Series] = []
    for i, row in enumerate(rows):
        role, shape = roles[i % len(roles)], shapes[i // len(roles)]
        times = [point.at_s for point in row.points]
        short = [_short(point, point.told) for point in row.points]
        if any(math.isfinite(value) for value in short):
            series.append(line(row.name, role, times, short, 4, shape))
    limit = 100.0 * ACCURACY
    figure = Figure(
        _TIME,
        Axis("final mass short of the optimizer that was told", "%"),
        tuple(series),
        levels=(Guide(limit, f"{limit:g} %"),),
    )
    return item("Short of what could have been flown", figure, wide=True)


def _lacking_figures(rows: list[MapRow]) -> list[Item]:
    items = []
    for row in rows:
        if all(point.flown.end is End.TARGET for point in row.points):
            continue
        times = [point.at_s for point in row.points]
        lacking = {field: [getattr(p, field).lacking_m_s for p in row.points] for field, *_ in WHO}
        series = tuple(
            line(name, role, times, lacking[field], 2)
            for field, name, role in WHO
            if any(math.isfinite(value) for value in lacking[field])
        )
        figure = Figure(_TIME, Axis("speed that is lacking", "m/s"), series)
        items.append(item(f"{capitalised(row.name)}: speed lacking", figure))
    return items


# ---- impact points


def _falls(made: AbortMap) -> Falls:
    text = "Where flights that reach no orbit would fall, without air."
    if made.areas:
        share = made.outside
        text += (
            f" Outside all {len(made.areas)} areas of the mission fall {share.count:,} of "
            f"{share.of:,}, {share.percent:.2f} %."
        )
    globe = _globe(made)
    outside = _OUTSIDE if made.areas else ("falls", _OUTSIDE[1])
    key = globe.key((outside, _INSIDE, _NOMINAL))
    if made.areas:
        key.append(("areas", _INSIDE[1], len(made.areas), "line"))
    placed = made.mission.zero_longitude_deg is not None
    return Falls(text, globe, tuple(key), placed, _fall_table(made))


def _globe(made: AbortMap) -> Globe:
    way = made.way
    flights = [
        # the first one lies at the back
        way_beside_others(made.mission, way["time"], way["position"], *_NOMINAL, faint=False)
    ]
    for row in made.rows:
        for point in row.points:
            if not point.flown.falls:
                continue
            where = f", in {point.flown.area}" if point.flown.area else ""
            role = _INSIDE[1] if point.flown.area else _OUTSIDE[1]
            name = f"{row.name} at {point.at_s:.6g} s: falls at {_place(*point.flown.impact_deg)}"
            flights.append(spot(name + where, role, *point.flown.impact_deg))
    return Globe(
        flights=tuple(flights),
        land=land_on(made.mission.environment.earth.equatorial_radius_m),
        ends=("",) * len(flights),
        nearest=_NEAREST,
        areas=tuple(map(ring, made.areas.values())),
    )


def _place(latitude_deg: float, longitude_deg: float) -> str:
    north = "S" if latitude_deg < 0.0 else "N"
    east = "W" if longitude_deg < 0.0 else "E"
    return f"{abs(latitude_deg):.2f}° {north}, {abs(longitude_deg):.2f}° {east}"


def _fall_table(made: AbortMap) -> PageTable:
    fallen = Counter(point.flown.area for point in made.points if point.flown.falls)
    names = {"": "outside all areas", **{name: name for name in made.areas}}
    rows = [Row(text, (Cell(f"{fallen[name]:,}", fallen[name]),)) for name, text in names.items()]
    return PageTable((Column("flights that fall"),), tuple(rows))


def _seen(items: list[Item]) -> list[Item]:
    """Return the figures that have data."""
    return [
        item
        for item in items
        if isinstance(item.content, Figure)
        and any(y is not None for one in item.content.series for y in one.y)
    ]
