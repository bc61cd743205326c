# SPDX-License-Identifier: Apache-2.0
"""Define the parts of a report: plain data for both its page and its JSON file.

A number carries its text, so that the two files cannot differ.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

#: Origin of a number, which sets its colour. `other` and `third` are further results of ours,
#: `quiet` is the background of a map; the rest are for the many arcs of a flight.
Role = Literal["here", "other", "third", "thesis", "otis", "fourth", "fifth", "sixth", "quiet"]
#: Shape of a series; `over` are dashes above the other lines, which show through the gaps.
Shape = Literal["line", "dashes", "over", "dots", "step", "bars", "band", "marks", "cloud"]

BLANK = "–"
MINUS = "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Cell:
    """Hold a number or a word of a table.

    Attributes:
        text: as shown.
        value: the number; None for a word or a missing number.
        below: small print below it.
    """

    text: str
    value: float | None = None
    below: str = ""


@dataclass(frozen=True)
class Column:
    """Hold the head of a column; `role` marks the origin of its numbers."""

    title: str
    role: Role | None = None


@dataclass(frozen=True)
class Row:
    """Hold one row: label, cells, and a note below if needed."""

    label: str
    cells: tuple[Cell, ...]
    note: str = ""


@dataclass(frozen=True)
class PageTable:
    """Hold a table.

    Attributes:
        columns: without that of the labels.
        rows: each with as many cells as there are columns.
        finding: conclusion, in a sentence.
    """

    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    finding: str = ""


@dataclass(frozen=True)
class Series:
    """Hold a line or a set of marks.

    Attributes:
        name: for the legend.
        role: sets the colour.
        shape: drawing style.
        x, y: equal length; None at a gap.
        texts: tooltip of each mark; empty for a line.
        t: time of each point, s, if x is not time and a cursor links the figures; else empty.
    """

    name: str
    role: Role
    shape: Shape
    x: tuple[float | None, ...]
    y: tuple[float | None, ...]
    texts: tuple[str, ...] = ()
    t: tuple[float, ...] = ()


@dataclass(frozen=True)
class Guide:
    """Hold a vertical (an instant) or a horizontal line (a limit) with a label."""

    at: float
    text: str


@dataclass(frozen=True)
class Axis:
    """Hold name and unit of an axis; `span` fixes its range, None fits the data."""

    title: str
    unit: str
    log: bool = False
    span: tuple[float, float] | None = None


@dataclass(frozen=True)
class Figure:
    """Hold a plot.

    Attributes:
        x, y: axes.
        series: lines and marks, the first one at the back.
        instants: vertical lines.
        levels: horizontal lines.
        finding: conclusion, in a sentence.
        stretch: of a map: ratio of drawn lengths of a unit of y and of x; None: no map.
    """

    x: Axis
    y: Axis
    series: tuple[Series, ...]
    instants: tuple[Guide, ...] = ()
    levels: tuple[Guide, ...] = ()
    finding: str = ""
    stretch: float | None = None


@dataclass(frozen=True)
class Item:
    """Hold a table or a figure with its headings.

    Attributes:
        key: such as `table-4.1`.
        kind: `table` or `figure`.
        name: as in the thesis: `Table 4.1`.
        title: its subject.
        see: hint for the reader.
        content: the table or figure.
        wide: a figure of full width.
    """

    key: str
    kind: Literal["table", "figure"]
    name: str
    title: str
    see: str
    content: PageTable | Figure
    wide: bool = False


@dataclass(frozen=True)
class Chapter:
    """Hold a chapter."""

    number: int
    title: str
    text: str
    items: tuple[Item, ...]


def item(title: str, content: PageTable | Figure, see: str = "", *, wide: bool = False) -> Item:
    """Make a table or a figure with its headings, without a number yet."""
    kind: Literal["table", "figure"] = "table" if isinstance(content, PageTable) else "figure"
    return Item("", kind, "", title, see, content, wide)


def numbered(chapters: Sequence[Chapter]) -> tuple[Chapter, ...]:
    """Assign numbers to the chapters, and to their tables and figures, in order."""
    counts = {"table": 0, "figure": 0}
    done = []
    for number, chapter in enumerate(chapters, 1):
        items = []
        for one in chapter.items:
            counts[one.kind] += 1
            k = counts[one.kind]
            items.append(replace(one, key=f"{one.kind}-{k}", name=f"{one.kind.title()} {k}"))
        done.append(replace(chapter, number=number, items=tuple(items)))
    return tuple(done)


def capitalised(text: str) -> str:
    """Return a text with its first letter in capitals."""
    return text[0].upper() + text[1:]


def number(value: float, decimals: int, *, signed: bool = False) -> Cell:
    """Format a number with thousands separators; round its value alike; BLANK if nan."""
    if not math.isfinite(value):
        return Cell(BLANK)
    rounded = round(value, decimals) + 0.0
    text = f"{rounded:{'+' if signed and rounded else ''},.{decimals}f}"
    return Cell(text.replace("-", MINUS), rounded)


def power(value: float, digits: int = 3, *, signed: bool = False) -> Cell:
    """Format a small number with a power of ten; BLANK if nan."""
    if not math.isfinite(value):
        return Cell(BLANK)
    mantissa, exponent = f"{value:{'+' if signed else ''}.{digits - 1}e}".split("e")
    raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return Cell(
        f"{mantissa}\u00a0×\u00a010{raised}".replace("-", MINUS), float(f"{value:.{digits - 1}e}")
    )


#: Magnitude below which an error, in any unit, is due to rounding.
_NOTHING = 1e-9


def small(value: float) -> Cell:
    """Format a signed error with two significant figures; as a power of ten if small or large."""
    if abs(value) < _NOTHING:
        return word("< 10⁻⁹")
    if not 1e-3 <= abs(value) < 1e3:
        return power(value, 2, signed=True)
    return number(value, max(0, 1 - math.floor(math.log10(abs(value)))), signed=True)


def about(value: float) -> str:
    """Format a number with two significant figures, for a sentence."""
    if 0.0 < abs(value) < 1e-3:
        return power(value, 2).text
    return f"{float(f'{value:.2g}'):,g}"


def word(text: str) -> Cell:
    """Make a cell without a number."""
    return Cell(text)


def unbroken(text: str) -> Cell:
    """Make a cell of words that stay on one line."""
    return word(text.replace(" ", "\u00a0"))


def line(
    name: str,
    role: Role,
    x: ArrayLike,
    y: ArrayLike,
    digits: int,
    shape: Shape = "line",
    *,
    log: bool = False,
    t: ArrayLike | None = None,
) -> Series:
    """Make a line, thinned to visible detail.

    Args:
        name: for the legend.
        role: sets the colour.
        x: shape (n,), increasing unless t is given.
        y: shape (n,); nan at a gap.
        digits: decimals of y that are kept.
        shape: drawing style.
        log: for a logarithmic axis, which has no 0.
        t: time of each point, shape (n,), s, if x is not time.
    """
    xs, ys = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if t is not None:
        ts = np.asarray(t, dtype=float)
        kept = np.union1d(thin(ts, xs), thin(ts, ys))
        times = tuple(np.round(ts[kept], 3).tolist())
        return Series(name, role, shape, _numbers(xs[kept], 3), _numbers(ys[kept], digits), t=times)
    if log:
        ys = np.where(ys > 0.0, ys, np.nan)
    kept = thin(xs, np.log10(ys) if log else ys)
    return Series(name, role, shape, _numbers(xs[kept], 3), _numbers(ys[kept], digits))


def marks(name: str, role: Role, points: Sequence[tuple[float, float, str]]) -> Series:
    """Make marks: x, y and a text each."""
    return Series(
        name,
        role,
        "marks",
        tuple(x for x, _, _ in points),
        tuple(y for _, y, _ in points),
        tuple(text for _, _, text in points),
    )


def _numbers(values: Any, digits: int) -> tuple[float | None, ...]:
    return tuple(round(float(v), digits) + 0.0 if math.isfinite(v) else None for v in values)


#: Distance to the thinned line, as a fraction of its height, below which a point is left out.
_FLAT = 5e-4
#: Number of evenly spread points that are always kept, for the pointer.
_POINTS = 150


def thin(x: Any, y: Any) -> Any:
    """Return the indices of the points a line needs (Ramer, Douglas, Peucker), with ends and gaps.

    Args:
        x: shape (n,).
        y: shape (n,), nan in gaps.
    """
    keep = ~np.isfinite(y)
    keep[:: max(1, len(y) // _POINTS)] = True
    keep[[0, -1]] = True
    finite = np.flatnonzero(np.isfinite(y))
    if len(finite) < 3:
        return np.flatnonzero(keep)
    tolerance = _FLAT * float(np.ptp(y[finite]))
    breaks = np.flatnonzero(np.diff(finite) > 1) + 1
    waiting = [(int(run[0]), int(run[-1])) for run in np.split(finite, breaks)]
    while waiting:
        first, last = waiting.pop()
        keep[[first, last]] = True
        if last - first < 2:
            continue
        inside = slice(first + 1, last)
        width = x[last] - x[first]
        share = (x[inside] - x[first]) / width if width > 0.0 else np.zeros(last - first - 1)
        away = np.abs(y[inside] - y[first] - share * (y[last] - y[first]))
        worst = int(np.argmax(away))
        if away[worst] > tolerance:
            middle = first + 1 + worst
            waiting += [(first, middle), (middle, last)]
    return np.flatnonzero(keep)
