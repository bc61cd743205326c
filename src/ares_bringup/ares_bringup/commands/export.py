# SPDX-License-Identifier: Apache-2.0
"""Export a recorded flight for `ares export`. No ROS."""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ares_bags.files import find_file
from ares_bringup.commands.report import recording_of
from ares_bringup.options import ExportFormat, ExportTable
from ares_bringup.outcomes import VERDICTS
from ares_bringup.recorded import RecordedFlight, read_flight, tell_notes
from ares_bringup.whole_file import check_file, write_whole
from ares_studies.export.czml import as_czml
from ares_studies.export.kml import as_kml
from ares_studies.export.recording import Export, ExportEvent
from ares_studies.export.tables import as_csv, as_parquet, event_table, flight_table

Array = NDArray[np.float64]

EXIT_INCOMPLETE = 1

_TABLES = {ExportTable.FLIGHT: flight_table, ExportTable.EVENTS: event_table}
_AS_TABLE = {ExportFormat.CSV: as_csv, ExportFormat.PARQUET: as_parquet}
_AS_GLOBE = {ExportFormat.KML: as_kml, ExportFormat.CZML: as_czml}


def export(
    path: Path, form: ExportFormat, table: ExportTable, out: Path | None, mission: str | None = None
) -> int:
    """Write a recorded flight in another format, and print the file's path.

    Args:
        path: bag.
        form: the format.
        table: which table, for the formats with tables.
        out: the file; None: named after table and format, in the bag's folder.
        mission: to use instead of that of the flight.

    Returns:
        Exit status: 0, or 1 if the bag is damaged or incomplete, with a line on standard error; its
        intact part is written anyway.

    Raises:
        CannotStart: no such bag, no flight in it, its mission cannot be read, or the file
            cannot be written; one line.
    """
    flown = read_flight(path, mission)
    tell_notes([flown])
    if out is None:
        out = find_file(path).parent / f"{table.value}.{form.value}"
    check_file(out)
    what = _exported(flown)
    if form in _AS_GLOBE:
        write_whole(out, _AS_GLOBE[form](what))
    else:
        write_whole(out, _AS_TABLE[form](_TABLES[table](what)))
    if flown.missing:
        print(f"ares: {flown.missing}", file=sys.stderr)
    print(out)
    return EXIT_INCOMPLETE if flown.missing else 0


def _exported(flown: RecordedFlight) -> Export:
    summary = flown.summary
    return Export(
        recording=recording_of(find_file(flown.path).absolute().parent.name, flown),
        commands=flown.columns["thrust_command"],
        events=_events(flown),
        verdict=VERDICTS[summary.outcome],
        falls=summary.falls,
    )


def _events(flown: RecordedFlight) -> list[ExportEvent]:
    """List events, and moments at interpolated states, in the order of time."""
    summary, truth = flown.summary, flown.columns["vehicle_state"]
    found = [
        ExportEvent(e.time, summary.event_name(e), e.position, e.velocity, e.mass)
        for e in summary.events
    ]
    for moment in summary.moments:
        position = _at(moment.time_s, truth["time"], truth["position"])
        velocity = _at(moment.time_s, truth["time"], truth["velocity"])
        found.append(ExportEvent(moment.time_s, moment.text, position, velocity, moment.mass_kg))
    return sorted(found, key=lambda event: event.time_s)


def _at(at: float, time: Array, vectors: Array) -> tuple[float, float, float]:
    """Interpolate vectors, shape (n, 3)."""
    x, y, z = (float(np.interp(at, time, axis)) for axis in vectors.T)
    return x, y, z
