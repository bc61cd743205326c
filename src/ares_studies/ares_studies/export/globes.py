# SPDX-License-Identifier: Apache-2.0
"""Prepare a flight for globes of any format.

All of them need dates: mission elapsed time 0 is the mission's epoch, or else NO_EPOCH, which has
no meaning.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from ares_models.geodesy import Places
from ares_studies.export.recording import Export
from ares_studies.flight_page.data import Phase, chosen, phases_of
from ares_vehicle_sim.falls import Fall

NO_EPOCH = datetime(2000, 1, 1, tzinfo=UTC)
#: Colours of the burns in turn, and of coasts: red, green, blue.
BURNS = ((255, 140, 26), (64, 156, 255), (94, 201, 98), (232, 90, 160), (240, 210, 60))
COAST = (170, 170, 170)
#: Width of lines, px.
WIDTH = 3
#: Decimals: 1e-8 deg is a millimetre on the ground.
_DEGREES, _METRES = 8, 3


@dataclass(frozen=True)
class TrackPhase:
    """Hold a phase to be drawn: rows from first to last, times in s, colour."""

    name: str
    first: int
    last: int
    begin_s: float
    end_s: float
    colour: tuple[int, int, int]


@dataclass(frozen=True)
class ExportTrack:
    """Hold a flight in a limited number of points, and its phases."""

    time_s: list[float]
    coordinates: list[tuple[float, float, float]]
    phases: tuple[TrackPhase, ...]


def coordinates_of(places: Places) -> list[tuple[float, float, float]]:
    """Return longitude and latitude in deg and height in m, in the order of globes."""
    return [
        (round(longitude, _DEGREES), round(latitude, _DEGREES), round(height, _METRES))
        for longitude, latitude, height in zip(
            places.longitude_deg.tolist(),
            places.latitude_deg.tolist(),
            places.height_m.tolist(),
            strict=True,
        )
    ]


def falls_of(export: Export) -> Iterator[tuple[Fall, list[tuple[float, float, float]]]]:
    """Yield what comes down, with the coordinates of its way there."""
    for fall in export.falls:
        if fall.impact is not None:
            yield fall, coordinates_of(export.fall_places(fall))


def track_of(export: Export) -> ExportTrack:
    """Return the trajectory of a flight, each phase extended to the begin of the next."""
    truth = export.recording.truth
    rows = chosen(truth)
    picked = {name: values[rows] for name, values in truth.items()}
    coordinates = coordinates_of(export.places())
    time = picked["time"].tolist()
    phases = phases_of(picked, export.recording.mission)
    points = [coordinates[row] for row in rows]
    return ExportTrack(time, points, tuple(_track_phases(phases, time)))


def _track_phases(phases: tuple[Phase, ...], time: list[float]) -> Iterator[TrackPhase]:
    burns = 0
    for phase in phases:
        colour = COAST
        if phase.burns:
            colour = BURNS[burns % len(BURNS)]
            burns += 1
        last = min(phase.last + 1, len(time) - 1)
        yield TrackPhase(phase.name, phase.first, last, time[phase.first], time[last], colour)


def moment(export: Export, time_s: float) -> str:
    """Format a mission elapsed time as date and time in UTC, to the millisecond."""
    epoch = export.recording.mission.epoch or NO_EPOCH
    at = epoch + timedelta(milliseconds=round(1000.0 * time_s))
    return at.strftime("%Y-%m-%dT%H:%M:%S.") + f"{at.microsecond // 1000:03d}Z"


def about(export: Export) -> str:
    """Describe the flight in two sentences."""
    recording = export.recording
    nothing = "" if recording.mission.epoch else ", which means nothing else"
    return (
        f"Flight {recording.name} of {recording.mission.name} by {recording.law}: "
        f"{export.verdict}. Mission elapsed time 0 is {moment(export, 0.0)}{nothing}."
    )
