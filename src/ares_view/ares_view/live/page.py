# SPDX-License-Identifier: Apache-2.0
"""Render the live page as it is before any message."""

from dataclasses import asdict, dataclass
from functools import cache

from ares_studies import flight_page
from ares_studies.flight_page.globe import Globe
from ares_studies.flight_page.land import read_land
from ares_studies.pages import parts
from ares_studies.pages.parts import Axis, Chapter, Figure, Item, Series, item, numbered
from ares_studies.pages.templates import PALETTES, embedded, make_environment, one_line
from ares_view.live.story import STATE_FIELDS, STATUS_FIELDS


@dataclass(frozen=True)
class Gauge:
    """Hold a number on the page.

    Attributes:
        key: its field, of a state or of a guidance status.
        label: shown text.
        unit: as shown.
        digits: decimals.
        full: value of a full bar: a field of a status, `limit`, or `most`, the largest so far,
            which stands in for a missing limit too.
        in_air: shown while the vehicle is in the air.
    """

    key: str
    label: str
    unit: str
    digits: int
    full: str
    in_air: bool = False


@dataclass(frozen=True)
class LiveLine:
    """Hold a line of a chart: its name, its field, its colour."""

    name: str
    field: str
    role: parts.Role
    shape: parts.Shape = "line"


@dataclass(frozen=True)
class LiveChart:
    """Hold a chart: its title, its axis, its lines; in_air: over the part in the air."""

    title: str
    axis: Axis
    lines: tuple[LiveLine, ...]
    in_air: bool = False


def _of_one_line(
    title: str, axis: Axis, field: str, *, shape: parts.Shape = "line", in_air: bool = False
) -> LiveChart:
    """Make a chart of one line, named as its axis."""
    return LiveChart(title, axis, (LiveLine(axis.title, field, "here", shape),), in_air)


GAUGES = (
    Gauge("altitude_km", "altitude", "km", 2, "predicted_altitude_km"),
    Gauge("speed_m_s", "speed", "m/s", 1, "predicted_speed_m_s"),
    Gauge("dynamic_pressure_kpa", "dynamic pressure", "kPa", 2, "limit", in_air=True),
    Gauge("mach", "Mach number", "", 2, "", in_air=True),
    Gauge("flight_path_angle_deg", "flight-path angle", "deg", 3, "most"),
    Gauge("mass_t", "mass", "t", 2, "most"),
    Gauge("thrust_kn", "thrust", "kN", 0, "most"),
    Gauge("acceleration_m_s2", "acceleration", "m/s²", 2, "most"),
    Gauge("heating_w_m2", "heating rate", "W/m²", 0, "limit"),
    Gauge("time_to_go_s", "time to go", "s", 1, "most"),
    Gauge("cutoff_s", "predicted cut-off", "s", 2, ""),
    Gauge("iterations", "iterations", "per cycle", 0, ""),
    Gauge("pitch_deg", "pitch of the thrust", "deg", 2, ""),
    Gauge("yaw_deg", "yaw of the thrust", "deg", 3, ""),
)

CHARTS = (
    _of_one_line("Altitude", Axis("altitude", "km"), "altitude_km"),
    LiveChart(
        "Speed",
        Axis("speed", "m/s"),
        (
            LiveLine("inertial", "speed_m_s", "here"),
            LiveLine("against the air", "relative_speed_m_s", "other"),
        ),
    ),
    LiveChart(
        "Angles",
        Axis("angle", "deg"),
        (
            LiveLine("pitch of the thrust", "pitch_deg", "here"),
            LiveLine("flight-path angle", "flight_path_angle_deg", "other"),
        ),
    ),
    _of_one_line(
        "Dynamic pressure", Axis("dynamic pressure", "kPa"), "dynamic_pressure_kpa", in_air=True
    ),
    _of_one_line("Mach number", Axis("Mach number", ""), "mach", in_air=True),
    _of_one_line("Q alpha", Axis("q alpha", "kPa rad"), "q_alpha_kpa_rad", in_air=True),
    _of_one_line("Acceleration", Axis("acceleration", "m/s²"), "acceleration_m_s2"),
    _of_one_line("Heating", Axis("heating rate", "W/m²", log=True), "heating_w_m2"),
    _of_one_line("Predicted cut-off", Axis("predicted cut-off", "s"), "cutoff_s", shape="step"),
)
TIME = Axis("mission elapsed time", "s", span=(0.0, 1.0))
#: Real-time factors with a button, and its text; 0: as fast as possible.
PACES = ((1, "1"), (5, "5"), (10, "10"), (50, "50"), (0, "max"))


def _items() -> tuple[Item, ...]:
    """Return the charts without data."""
    items = []
    for chart in CHARTS:
        series = tuple(Series(one.name, one.role, one.shape, (), ()) for one in chart.lines)
        items.append(item(chart.title, Figure(TIME, chart.axis, series)))
    return numbered([Chapter(1, "", "", tuple(items))])[0].items


@cache
def render(query: str) -> str:
    """Render the page.

    Args:
        query: query string of every URL of the server.
    """
    items = _items()
    figures = [
        {**asdict(figure), "fields": [one.field for one in chart.lines], "in_air": chart.in_air}
        for figure, chart in zip(items, CHARTS, strict=True)
    ]
    data = {
        "chapters": [{"items": figures}],
        "globe": asdict(Globe((), read_land(), ("",))),
        "states": STATE_FIELDS,
        "statuses": STATUS_FIELDS,
    }
    return (
        make_environment(__package__, flight_page.__package__)
        .get_template("live.html")
        .render(
            palettes=PALETTES,
            items=items,
            gauges=GAUGES,
            paces=PACES,
            query=query,
            data=embedded(one_line(data)),
        )
    )
