# SPDX-License-Identifier: Apache-2.0
"""Read a flight and its verdict from a bag. No ROS."""

import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ares_bags.errors import BagError
from ares_bags.reader import LOG_TIME, Bag, open_bag
from ares_bags.repair import repair
from ares_bags.writer import INCOMPLETE_KEY
from ares_bringup.facts import facts_of
from ares_bringup.flown_mission import flown_mission
from ares_bringup.observed import Diagnostic, Event, GuidanceSample
from ares_bringup.options import CannotStart
from ares_bringup.summary import FlightSummary
from ares_guidance.arrays import PHASE_BOOST
from ares_models.mission import Mission
from ares_models.passage import passage_of
from ares_models.plans import flies_in_air
from ares_models.units import NANOSECONDS
from ares_studies.event_words import hand_over

Columns = Mapping[str, NDArray[Any]]
Row = TypeVar("Row", Event, GuidanceSample)

#: Topics and fields read from a bag.
TOPICS = {
    "vehicle_state": (
        *("sequence", "position", "velocity", "mass", "thrust_direction", "thrust", "altitude"),
        *("relative_speed", "flight_path_angle", "inclination", "heating_rate"),
        *("arc", "jettisoned"),
    ),
    "nav_state": ("sequence", "position", "velocity"),
    "thrust_command": ("reference_time", "direction", "direction_rate", "cutoff_time"),
    "guidance_status": (
        *("cycle", "converged", "iterations", "total_iterations", "stale_cycles", "time_to_go"),
        *("cutoff_time", "jettison_time", "predicted_position", "predicted_velocity"),
    ),
    "flight_event": ("type", "index", "time", "position", "velocity", "mass"),
}
DIAGNOSTICS = "/diagnostics"
#: Levels of DiagnosticStatus other than OK.
LEVELS = {1: "WARN", 2: "ERROR", 3: "STALE"}


@dataclass(frozen=True)
class RecordedFlight:
    """Hold a flight read from a bag.

    Attributes:
        path: of the bag, as given.
        mission: flown mission.
        law: guidance law.
        columns: of TOPICS, with `time` in s; only `time` for a topic without messages.
        summary: the verdict; losses of the bag are among its problems.
        missing: losses of the bag, one line; "": none.
        custom: the bag's custom data.
        note: on its mission, see `FlownMission`.
    """

    path: Path
    mission: Mission
    law: str
    columns: Mapping[str, Columns]
    summary: FlightSummary
    missing: str
    custom: Mapping[str, str]
    note: str


@dataclass(frozen=True)
class _Contents:
    """Hold the readable contents of a bag, and its losses in one line, "" if none."""

    custom: Mapping[str, str]
    columns: Mapping[str, Columns]
    complaints: Sequence[Diagnostic]
    missing: str


def read_flight(path: Path, given: str | None = None) -> RecordedFlight:
    """Read a flight from its bag; from a damaged bag, the intact part, with a note on the loss.

    Args:
        path: the bag.
        given: mission to use instead of that of the flight.

    Raises:
        CannotStart: there is no such bag, nothing in it can be read, it holds no flight, or
            its mission cannot be read; one line.
    """
    try:
        contents = _read(path, open_bag(path))
    except BagError as error:
        contents = _salvage(path, error)
    if not len(contents.columns["vehicle_state"]["time"]):
        raise CannotStart(f"bag {path} holds no flight: vehicle_state is empty")
    found = flown_mission(path, contents.custom, given)
    law = contents.custom.get("law", "unknown")
    summary = FlightSummary(facts_of(found.mission), law, str(path))
    for event in _rows(Event, contents.columns["flight_event"]):
        summary.add_event(event)
    statuses = contents.columns["guidance_status"]
    if "phase" in statuses:
        statuses = {**statuses, "boosts": statuses["phase"] == PHASE_BOOST}
    for status in _rows(GuidanceSample, statuses):
        summary.add_status(status)
    _find_moments(summary, found.mission, contents.columns["vehicle_state"])
    for complaint in contents.complaints:
        summary.add_diagnostic(complaint)
    if contents.missing:
        summary.problems.append(contents.missing)
    columns, missing = contents.columns, contents.missing
    return RecordedFlight(
        path, found.mission, law, columns, summary, missing, contents.custom, found.note
    )


def tell_notes(flown: Sequence[RecordedFlight]) -> None:
    """Print the notes on the missions of flights on standard error."""
    for flight in flown:
        if flight.note:
            print(f"ares: {flight.path}: {' '.join(flight.note.split())}", file=sys.stderr)


def _read(path: Path, bag: Bag) -> _Contents:
    ends = {name.rsplit("/", maxsplit=1)[-1] for name in bag.topics}
    if "vehicle_state" not in ends:
        raise CannotStart(f"bag {path} holds no flight: it has no vehicle_state")
    columns = {name: _columns(bag, name) if name in ends else _NOTHING for name in TOPICS}
    left_out = sum(_leave_out(columns, name) for name in _PLACED if name in ends)
    complaints = list(_complaints(bag)) if bag.holds(DIAGNOSTICS) else []
    why = bag.custom_data.get(INCOMPLETE_KEY)
    missing = [f"bag incomplete: {why}"] if why else []
    if left_out:
        missing.append(f"{left_out} messages left out: their positions are impossible")
    return _Contents(bag.custom_data, columns, complaints, "; ".join(missing))


#: Fields that must be finite for a message to be plotted, by topic.
_PLACED = {
    "vehicle_state": ("time", "position", "velocity", "mass", "altitude"),
    "nav_state": ("time", "position", "velocity", "mass"),
    "flight_event": ("time", "position", "velocity", "mass"),
}
#: Largest magnitude that can be plotted, SI.
_LARGEST = 1e15


def _leave_out(columns: dict[str, Columns], topic: str) -> int:
    """Drop the messages of a topic without a valid position; return their number."""
    told = columns[topic]
    good = np.ones(len(told["time"]), dtype=np.bool_)
    for name in _PLACED[topic]:
        values = np.reshape(told[name], (len(good), -1))
        good &= np.all(np.abs(values) <= _LARGEST, axis=1)
    if not np.all(good):
        columns[topic] = {name: values[good] for name, values in told.items()}
    return int(np.sum(~good))


_NOTHING: Columns = {"time": np.empty(0)}


def _columns(bag: Bag, topic: str) -> Columns:
    columns = bag.columns(topic)
    times = columns[LOG_TIME] / NANOSECONDS
    absent = [name for name in TOPICS[topic] if name not in columns]
    if absent and len(times):
        raise CannotStart(f"bag {bag.path} holds another kind of {topic}: it has no {absent[0]}")
    # the time field of an event, unlike its stamp, is not rounded
    return {"time": times, **columns}


def _salvage(path: Path, error: BagError) -> _Contents:
    """Read the intact part of a damaged bag, from a repaired copy."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            saved = repair(path, Path(folder) / "saved")
            contents = _read(path, open_bag(saved.path))
        except BagError:
            raise CannotStart(str(error)) from error
    return replace(contents, missing=f"{saved.problem}; {saved.loss}")


def _rows(kind: type[Row], columns: Columns) -> Iterator[Row]:
    """Make an object of each row of some columns, which have the names of its fields."""
    if len(columns["time"]):
        values = [columns[item.name].tolist() for item in fields(kind)]
        for row in zip(*values, strict=True):
            cells: list[Any] = [tuple(value) if isinstance(value, list) else value for value in row]
            yield kind(*cells)


def _find_moments(summary: FlightSummary, mission: Mission, truth: Columns) -> None:
    """Find Mach 1 and the greatest dynamic pressure, and the mass at the hand-over."""
    if not flies_in_air(mission.arrays().arcs) or "mach" not in truth:
        return
    summary.moments = [
        hand_over(moment.time_s, float(np.interp(moment.time_s, truth["time"], truth["mass"])))
        for moment in summary.moments
    ]
    summary.set_air(passage_of(truth))


def _complaints(bag: Bag) -> Iterator[Diagnostic]:
    for time, message in bag.messages(DIAGNOSTICS):
        for status in message.status:
            level = LEVELS.get(int(status.level))
            if level is not None:
                node = status.name.rsplit("/", maxsplit=1)[-1]
                yield Diagnostic(time / NANOSECONDS, node, level, status.message)
