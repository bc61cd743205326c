"""Draw a recorded flight. No ROS."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_bags.errors import BagError
from ares_bags.reader import LOG_TIME, Bag, open_bag
from ares_bringup.options import CannotStart
from ares_models.arrays import HEATING_LIMIT
from ares_models.mission import Mission, MissionError, load_mission
from ares_studies.event_words import MARKS
from ares_studies.plots import draw_flight

FORMATS = (".png", ".svg", ".pdf")


def plot_bag(path: Path, out: Path | None) -> Path:
    """Draw a flight into an image file.

    Args:
        path: bag.
        out: image file, its ending chooses the format; None: flight.png in the bag's folder.

    Returns:
        The image file.

    Raises:
        CannotStart: no such bag, no flight in it, or the image cannot be written; one line.
    """
    try:
        bag = open_bag(path)
        truth, status = (_timed(bag.columns(name)) for name in ("vehicle_state", "guidance_status"))
        events = bag.columns("flight_event")
    except BagError as error:
        raise CannotStart(str(error)) from error
    if not len(truth["time"]):
        raise CannotStart(f"bag {path} holds no flight: vehicle_state is empty")
    if out is None:
        out = bag.file.parent / "flight.png"
    if out.suffix not in FORMATS:
        raise CannotStart(f"--out is {str(out)!r}; expected a file ending in {', '.join(FORMATS)}")
    mission = _mission(bag)
    title = mission.title if mission else bag.custom_data.get("mission", str(path))
    law = bag.custom_data.get("law", "")
    figure = draw_flight(
        f"{title} - {law}".rstrip(" -"),
        truth,
        status,
        _marks(events),
        _heating_limit(mission),
        _target(mission),
    )
    try:
        figure.savefig(out)
    except OSError as error:
        raise CannotStart(f"{out} cannot be written: {error.strerror}") from error
    return out


def _timed(columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    return {**columns, "time": columns[LOG_TIME] / 1e9}


def _mission(bag: Bag) -> Mission | None:
    try:
        return load_mission(bag.custom_data.get("mission", ""))
    except MissionError:
        return None


def _marks(events: dict[str, NDArray[Any]]) -> list[tuple[float, str]]:
    """One mark an instant: a word is not printed over another."""
    marks: dict[float, str] = {}
    for time, kind in zip(events["time"], events["type"], strict=True):
        word = MARKS.get(int(kind))
        if word and word not in marks.get(float(time), ""):
            marks[float(time)] = word
    return list(marks.items())


def _heating_limit(mission: Mission | None) -> float | None:
    if mission is None:
        return None
    jettisons = mission.arrays().jettisons
    limits = jettisons["value"][jettisons["criterion"] == HEATING_LIMIT]
    return float(np.min(limits)) if len(limits) else None


def _target(mission: Mission | None) -> dict[str, float]:
    if mission is None:
        return {}
    target = mission.arrays().target[0]
    if not target["speed"] > 0.0:
        return {}
    return {
        "speed_m_s": float(target["speed"]),
        "flight_path_angle_deg": math.degrees(target["flight_path_angle"]),
    }
