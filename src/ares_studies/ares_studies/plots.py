# SPDX-License-Identifier: Apache-2.0
"""Plot a flight from the columns of its bag, and its part in the air as its page has it."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ares_studies.flight_page.charts import AIR
from ares_studies.flight_page.data import DrawnFlight

Columns = Mapping[str, NDArray[np.float64]]
#: An instant to mark: mission elapsed time in s, and a label.
Mark = tuple[float, str]

INK = "#1f2933"
FAINT = "#d5dbe1"
LINE = "#0b6bcb"
ACCENT = "#c8511b"
#: Width of a letter of a label, as a share of a panel's width, and height of a row, points.
LETTER, ROW = 0.0108, 9


def draw_flight(
    title: str,
    truth: Columns,
    status: Columns,
    flight: DrawnFlight,
    marks: Sequence[Mark] = (),
    heating_limit_w_m2: float | None = None,
    target: Mapping[str, float] | None = None,
    air_marks: Sequence[Mark] = (),
) -> Figure:
    """Plot one flight in six panels against mission elapsed time; four more for its air.

    Args:
        title: above the plot.
        truth: columns of VehicleState, `time` in s; vectors have shape (n, 3).
        status: columns of GuidanceStatus, `time` in s.
        flight: the same flight as its page draws it; without a part in the air: no such panels.
        marks: instants to mark: mission elapsed time in s, and a label.
        heating_limit_w_m2: drawn in the heating panel.
        target: values to draw as dashed lines: speed_m_s, flight_path_angle_deg.
        air_marks: instants to mark in these.
    """
    whole: Any = Figure(figsize=(11.0, 7.4), dpi=130, layout="constrained", facecolor="white")
    figure = whole
    if flight.air is not None:
        figure.set_figheight(7.4 + 5.0)
        whole, below = figure.subfigures(2, 1, height_ratios=(7.4, 5.0))
        _draw_air(below, flight, [mark for mark in air_marks if mark[0] <= flight.air.until_s])
    figure.suptitle(title, fontsize=13, color=INK, x=0.012, ha="left", weight="bold")
    axes: Any = whole.subplots(3, 2, sharex=True)
    target = target or {}
    t = truth["time"]
    speed = np.linalg.norm(truth["velocity"], axis=1)

    _line(axes[0, 0], t, truth["altitude"] / 1e3, "altitude, km")
    _line(axes[0, 1], t, speed, "inertial speed, m/s")
    _level(axes[0, 1], target.get("speed_m_s"), "target")
    _line(axes[1, 0], t, np.degrees(truth["flight_path_angle"]), "flight-path angle, deg")
    _level(axes[1, 0], target.get("flight_path_angle_deg"), "target")
    states = flight.states
    _line(axes[1, 1], states.time_s, states.pitch_deg, "pitch of the thrust above the horizon, deg")
    _line(axes[2, 0], t, truth["heating_rate"], "free molecular heating, W/m²")
    if np.any(truth["heating_rate"] > 0.0):
        axes[2, 0].set_yscale("log")
    _level(axes[2, 0], heating_limit_w_m2, "limit")
    # a damaged bag may have no guidance status
    predicted = status.get("cutoff_time", status["time"])
    _line(axes[2, 1], status["time"], predicted, "predicted cut-off, s", step=True)
    axes[2, 1].ticklabel_format(axis="y", useOffset=False)
    _mark(axes, marks)
    return figure


def _draw_air(figure: Any, flight: DrawnFlight, marks: Sequence[Mark]) -> None:
    """Plot the part of a flight in the air: the charts of its page, a panel each."""
    axes: Any = figure.subplots(2, 2, sharex=True)
    for panel, chart in zip(axes.flat, AIR, strict=True):
        unit = f", {chart.axis.unit}" if chart.axis.unit else ""
        for one in chart.lines(flight):
            _line(panel, one.x, one.y, chart.axis.title + unit)
        for level in chart.levels(flight):
            _level(panel, level.at, level.text + level.spare)
    _mark(axes, marks)


def _mark(axes: Any, marks: Sequence[Mark]) -> None:
    """Mark instants in all panels, label them above the first row, and time below the last."""
    for panel in axes.flat:
        for at, _ in marks:
            panel.axvline(at, color=FAINT, linewidth=1.0, zorder=0)
    for panel in axes[0]:
        low, high = panel.get_xlim()
        end, row = -math.inf, 0
        for at, word in ((at, word) for at, word in marks if word):
            half = 0.5 * LETTER * len(word) * (high - low)
            # over the one before it there is room for a second row
            row = (row + 1) % 2 if at - half < end else 0
            end = at + half
            panel.annotate(
                word,
                (at, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 3 + ROW * row),
                textcoords="offset points",
                fontsize=7.5,
                color=INK,
                ha="center",
            )
    for panel in axes[-1]:
        panel.set_xlabel("mission elapsed time, s", fontsize=9, color=INK)


def _line(
    panel: Axes, t: NDArray[np.float64], y: NDArray[np.float64], label: str, *, step: bool = False
) -> None:
    panel.plot(t, y, color=LINE, linewidth=1.6, drawstyle="steps-post" if step else "default")
    panel.set_title(label, fontsize=9.5, color=INK, loc="left", pad=23)
    panel.tick_params(labelsize=8.5, colors=INK)
    panel.grid(axis="y", color=FAINT, linewidth=0.6)
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)
    panel.margins(x=0.01)


def _level(panel: Axes, value: float | None, word: str) -> None:
    if value is None or not math.isfinite(value):
        return
    panel.axhline(value, color=ACCENT, linewidth=1.1, linestyle=(0, (5, 3)))
    panel.annotate(
        word,
        (0.015, value),
        xycoords=("axes fraction", "data"),
        xytext=(0, 3),
        textcoords="offset points",
        fontsize=8,
        color=ACCENT,
    )
