# SPDX-License-Identifier: Apache-2.0
"""Plot a recorded flight. No ROS."""

import math
from io import BytesIO
from pathlib import Path

import numpy as np

from ares_bags.files import find_file
from ares_bringup.commands.report import recording_of
from ares_bringup.marks import air_marks, apart, marks_of, words_of
from ares_bringup.options import CannotStart
from ares_bringup.recorded import RecordedFlight, read_flight, tell_notes
from ares_bringup.whole_file import check_file, write_whole
from ares_models.arrays import HEATING_LIMIT
from ares_models.mission import Mission
from ares_studies.flight_page.data import DrawnFlight, make_flight
from ares_studies.plots import draw_flight

FORMATS = (".png", ".svg", ".pdf")


def plot_bag(path: Path, out: Path | None, mission: str | None = None) -> tuple[Path, str]:
    """Plot a flight to an image file; of a damaged bag, the intact part.

    Args:
        path: bag.
        out: image file, whose suffix sets the format; None: flight.png in the bag's folder.
        mission: to use instead of that of the flight.

    Returns:
        The image file, and the losses of the bag in one line, "" if there are none.

    Raises:
        CannotStart: no such bag, no flight in it, or the image cannot be written; one line.
    """
    flown = read_flight(path, mission)
    tell_notes([flown])
    if out is None:
        out = find_file(path).parent / "flight.png"
    if out.suffix not in FORMATS:
        raise CannotStart(f"--out is {str(out)!r}; expected a file ending in {', '.join(FORMATS)}")
    check_file(out)
    flight = make_flight(recording_of(flown.law, flown))
    figure = draw_flight(
        f"{flown.mission.title} - {flown.law}",
        flown.columns["vehicle_state"],
        flown.columns["guidance_status"],
        flight,
        marks_of(flown.summary),
        _heating_limit(flown.mission),
        _target(flown.mission),
        _air_marks(flown, flight),
    )
    image = BytesIO()
    figure.savefig(image, format=out.suffix[1:])
    write_whole(out, image.getvalue())
    return out, flown.missing


def _heating_limit(mission: Mission) -> float | None:
    jettisons = mission.arrays().jettisons
    limits = jettisons["value"][jettisons["criterion"] == HEATING_LIMIT]
    return float(np.min(limits)) if len(limits) else None


def _air_marks(flown: RecordedFlight, flight: DrawnFlight) -> list[tuple[float, str]]:
    """Return the instants to mark in the part in the air, so that labels do not overlap."""
    if flight.air is None:
        return []
    first, until = float(flight.states.time_s[0]), flight.air.until_s
    words = air_marks(words_of(flown.summary), flown.summary.moments)
    return apart({at: word for at, word in words if at <= until}, until - first)


def _target(mission: Mission) -> dict[str, float]:
    target = mission.arrays().target[0]
    if not target["speed"] > 0.0:
        return {}
    return {
        "speed_m_s": float(target["speed"]),
        "flight_path_angle_deg": math.degrees(target["flight_path_angle"]),
    }
