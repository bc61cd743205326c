# SPDX-License-Identifier: Apache-2.0
"""Parts of a report: plain data that both its page and its JSON file show.

A number carries its text, so that the two files cannot say different things.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

#: Whose number it is; decides the colour. `other` and `third` are further results of ours, what is
#: `quiet` is the ground of a map.
Role = Literal["here", "other", "third", "thesis", "otis", "quiet"]
Shape = Literal["line", "dashes", "dots", "step", "bars", "band", "marks", "cloud"]

BLANK = "–"
MINUS = "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Cell:
    """A number or a word of a table.

    Attributes:
        text: as shown.
        value: the number behind it; None for a word or where there is none.
        below: in small letters below it.
    """

    text: str
    value: float | None = None
    below: str = ""


@dataclass(frozen=True)
class Column:
    """Head of a column; `role` marks whose numbers stand below it."""

    title: str
    role: Role | None = None


@dataclass(frozen=True)
class Row:
    """One row: its name, its cells, and a sentence below it where there is something to say."""

    label: str
    cells: tuple[Cell, ...]
    note: str = ""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        columns: without the one of the labels.
        rows: each with as many cells as there are columns.
        finding: what it shows, in a sentence.
    """

    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    finding: str = ""


@dataclass(frozen=True)
class Series:
    """A line or a set of marks.

    Attributes:
        name: for the legend.
        role: decides the colour.
        shape: how it is drawn.
        x, y: same length; None where there is nothing to draw.
        texts: one per mark, shown beside the pointer; empty for a line.
        t: time of each point, s, where x is none and one cursor goes over all figures; else empty.
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
    """A vertical (an instant) or a horizontal line (a limit) with a word."""

    at: float
    text: str


@dataclass(frozen=True)
class Axis:
    """Name and unit of an axis; `span` fixes what is shown, None shows everything."""

    title: str
    unit: str
    log: bool = False
    span: tuple[float, float] | None = None


@dataclass(frozen=True)
class Figure:
    """A plot.

    Attributes:
        x, y: axes.
        series: lines and marks, the first one at the back.
        instants: vertical lines.
        levels: horizontal lines.
        finding: what it shows, in a sentence.
        stretch: of a map: how much longer a unit of y is drawn than one of x; None: no map.
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
    """A table or a figure in its place.

    Attributes:
        key: as in `table-4.1`.
        kind: `table` or `figure`.
        name: as the thesis calls it: `Table 4.1`.
        title: what it is.
        see: what to look at.
        content: the numbers.
        wide: a figure that takes the whole width.
    """

    key: str
    kind: Literal["table", "figure"]
    name: str
    title: str
    see: str
    content: Table | Figure
    wide: bool = False


@dataclass(frozen=True)
class Chapter:
    """A chapter of the thesis."""

    number: int
    title: str
    text: str
    items: tuple[Item, ...]


def number(value: float, decimals: int, *, signed: bool = False) -> Cell:
    """A number with thousands separators, rounded to what is shown; BLANK if it is nan."""
    if not math.isfinite(value):
        return Cell(BLANK)
    rounded = round(value, decimals) + 0.0
    text = f"{rounded:{'+' if signed and rounded else ''},.{decimals}f}"
    return Cell(text.replace("-", MINUS), rounded)


def power(value: float, digits: int = 3, *, signed: bool = False) -> Cell:
    """A small number with a power of ten; BLANK if it is nan."""
    if not math.isfinite(value):
        return Cell(BLANK)
    mantissa, exponent = f"{value:{'+' if signed else ''}.{digits - 1}e}".split("e")
    raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return Cell(f"{mantissa} × 10{raised}".replace("-", MINUS), float(f"{value:.{digits - 1}e}"))


#: Errors below it, in whatever unit, are those of rounding.
_NOTHING = 1e-9


def small(value: float) -> Cell:
    """An error with two figures and its sign; a power of ten where zeros would fill the cell."""
    if abs(value) < _NOTHING:
        return word("< 10⁻⁹")
    if not 1e-3 <= abs(value) < 1e3:
        return power(value, 2, signed=True)
    return number(value, max(0, 1 - math.floor(math.log10(abs(value)))), signed=True)


def about(value: float) -> str:
    """Two figures of a number, for a sentence."""
    if 0.0 < abs(value) < 1e-3:
        return power(value, 2).text
    return f"{float(f'{value:.2g}'):,g}"


def word(text: str) -> Cell:
    """A cell without a number."""
    return Cell(text)


def beside(
    label: str,
    thesis: float,
    here: float,
    decimals: int,
    of_thesis: int | None = None,
    note: str = "",
) -> Row:
    """Thesis, here, difference.

    Args:
        label: what it is, with its unit.
        thesis: as printed; nan where nothing is printed.
        here: our value.
        decimals: of our value and of the difference.
        of_thesis: decimals as printed, where they are others.
        note: a sentence.
    """
    printed = number(thesis, decimals if of_thesis is None else of_thesis)
    return Row(
        label,
        (printed, number(here, decimals), number(here - thesis, decimals, signed=True)),
        note,
    )


BESIDE = (Column("thesis", "thesis"), Column("here", "here"), Column("difference"))


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
    """A line, thinned to what can be seen.

    Args:
        name: for the legend.
        role: decides the colour.
        x: shape (n,), rising where there is no t.
        y: shape (n,); nan where there is nothing to draw.
        digits: decimals of y that are kept.
        shape: how it is drawn.
        log: seen on a logarithmic axis, on which there is no 0.
        t: time of each point, shape (n,), s, where x is none.
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
    """Printed points: x, y and a text each."""
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


#: A point is left out where the line without it is nearer than this share of its height.
_FLAT = 5e-4
#: So many points stay in any case, evenly spread: the pointer needs something to hold.
_POINTS = 150


def thin(x: Any, y: Any) -> Any:
    """Indices of the points that a line needs (Ramer, Douglas, Peucker), ends and gaps kept.

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
