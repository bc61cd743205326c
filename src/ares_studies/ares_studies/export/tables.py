# SPDX-License-Identifier: Apache-2.0
"""Export flights as tables: CSV and Parquet, each column's unit in its name."""

import io
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from ares_studies.export.recording import Export
from ares_studies.flight_page.data import Columns, States, phases_of, states_from_start

#: Unit by suffix of the column name, longest suffix first.
UNITS = {
    "_pa_rad": "Pa rad",
    "_m_s2": "m/s2",
    "_w_m2": "W/m2",
    "_per_s": "1/s",
    "_m_s": "m/s",
    "_deg": "deg",
    "_kg": "kg",
    "_pa": "Pa",
    "_n": "N",
    "_m": "m",
    "_s": "s",
}
#: Columns without a unit: counts, words, ratios, components of unit vectors.
PLAIN = frozenset(
    ("sequence", "arc", "arc_name", "phase", "jettisoned", "eccentricity", "mach", "event")
    + tuple(f"{whose}_direction_{axis}" for whose in ("thrust", "command") for axis in "xyz")
    + ("guidance_cycle", "guidance_converged", "guidance_iterations", "guidance_stale_cycles")
)
_AXES = "xyz"

Series = dict[str, NDArray[Any]]


def unit_of(column: str) -> str:
    """Return the unit of a column, by its name; "" if it has none."""
    if column in PLAIN:
        return ""
    return next((unit for end, unit in UNITS.items() if column.endswith(end)), "")


def flight_table(export: Export) -> pa.Table:
    """Tabulate one row per state: truth, navigation, guidance status and command.

    The status is that of the latest cycle, the command the one that answers the state. Unknown
    values are null.
    """
    recording = export.recording
    truth = recording.truth
    time = truth["time"]
    series: Series = {"time_s": time, "sequence": truth["sequence"]}
    series |= _phases(export)
    series |= _vector("position", "_m", truth["position"])
    series |= _vector("velocity", "_m_s", truth["velocity"])
    places = export.places()
    series |= {
        "latitude_deg": places.latitude_deg,
        "longitude_deg": places.longitude_deg,
        "height_m": places.height_m,
    }
    states = states_from_start(truth, recording.mission)
    left_out = {"time_s", "track"}
    names = [each.name for each in fields(States) if each.name not in left_out]
    series |= {name: getattr(states, name) for name in names}
    series |= _vector("thrust_direction", "", truth["thrust_direction"])
    series |= _navigation(recording.navigation, truth)
    series |= _latest(_GUIDANCE, recording.status, time)
    series |= _commands(export.commands, time)
    return _table(series, export)


def event_table(export: Export) -> pa.Table:
    """Tabulate one row per event."""
    events, places = export.events, export.event_places()
    position = np.array([event.position for event in events]).reshape(-1, 3)
    velocity = np.array([event.velocity for event in events]).reshape(-1, 3)
    series: Series = {
        "time_s": np.array([event.time_s for event in events]),
        "event": np.array([event.name for event in events], dtype=object),
        "mass_kg": np.array([event.mass_kg for event in events]),
        "latitude_deg": places.latitude_deg,
        "longitude_deg": places.longitude_deg,
        "height_m": places.height_m,
        "speed_m_s": np.linalg.norm(velocity, axis=1),
    }
    series |= _vector("position", "_m", position)
    series |= _vector("velocity", "_m_s", velocity)
    return _table(series, export)


def as_csv(table: pa.Table) -> bytes:
    """Write a table as CSV with a header line; unknown values are empty."""
    out = io.BytesIO()
    pyarrow.csv.write_csv(table, out)
    return out.getvalue()


def as_parquet(table: pa.Table) -> bytes:
    """Write a table as Parquet, with units as field metadata."""
    out = io.BytesIO()
    pyarrow.parquet.write_table(table, out, compression="zstd")
    return out.getvalue()


def _table(series: Series, export: Export) -> pa.Table:
    recording = export.recording
    arrays = [_array(name, values) for name, values in series.items()]
    schema = pa.schema(
        [
            pa.field(name, array.type, metadata={"unit": unit} if (unit := unit_of(name)) else None)
            for name, array in zip(series, arrays, strict=True)
        ],
        metadata={
            "mission": recording.mission.name,
            "guidance": recording.law,
            "flight": recording.name,
            "verdict": export.verdict,
            "frame": "positions, velocities and directions: ares_eci",
        },
    )
    return pa.Table.from_arrays(arrays, schema=schema)


def _array(name: str, values: NDArray[Any]) -> pa.Array:
    """Make a column; nan becomes null, and counts and flags get their types back."""
    array = pa.array(values, from_pandas=True)
    if name == "guidance_converged":
        return array.cast(pa.bool_())
    return array.cast(pa.int64()) if name.startswith("guidance_") else array


def _vector(name: str, unit: str, values: NDArray[Any]) -> Series:
    return {f"{name}_{axis}{unit}": values[:, k] for k, axis in enumerate(_AXES)}


def _phases(export: Export) -> Series:
    recording = export.recording
    truth, names = recording.truth, recording.mission.arc_names
    phase = np.empty(len(truth["time"]), dtype=object)
    for stretch in phases_of(truth, recording.mission):
        phase[stretch.first : stretch.last + 1] = stretch.name
    arcs = [names[arc] if arc < len(names) else None for arc in truth["arc"].tolist()]
    return {
        "arc": truth["arc"],
        "arc_name": np.array(arcs, dtype=object),
        "phase": phase,
        "jettisoned": truth["jettisoned"],
    }


def _navigation(navigation: Columns, truth: Columns) -> Series:
    """Return the navigation state of each state; null for the last state of a flight."""
    rows = len(truth["time"])
    found = {name: np.full((rows, 3), np.nan) for name in ("position", "velocity")}
    if len(navigation["time"]):
        _, theirs, ours = np.intersect1d(
            navigation["sequence"], truth["sequence"], return_indices=True
        )
        for name, values in found.items():
            values[ours] = navigation[name][theirs]
    return _vector("navigation_position", "_m", found["position"]) | _vector(
        "navigation_velocity", "_m_s", found["velocity"]
    )


#: Columns of the guidance status, and its fields.
_GUIDANCE = {
    "guidance_cycle": "cycle",
    "guidance_converged": "converged",
    "guidance_iterations": "iterations",
    "guidance_stale_cycles": "stale_cycles",
    "time_to_go_s": "time_to_go",
    "predicted_cutoff_s": "cutoff_time",
    "predicted_jettison_s": "jettison_time",
}


def _latest(names: Mapping[str, str], columns: Columns, time: NDArray[Any]) -> Series:
    """Return fields of the latest message up to each time."""
    said = columns["time"]
    row = np.searchsorted(said, time, side="right") - 1
    found: Series = {}
    for name, field_name in names.items():
        values = np.full(len(time), np.nan)
        if len(said):
            values[row >= 0] = columns[field_name][row[row >= 0]]
        found[name] = values
    return found


def _commands(commands: Columns, time: NDArray[Any]) -> Series:
    """Return the command that answers each state, referred to its time; null without one.

    Until the next state the thrust points to unit(direction + rate (t - time)), the law of
    ThrustCommand; both are scaled so that the direction has unit length at that time.
    """
    said = commands["time"]
    direction, rate = np.full((2, len(time), 3), np.nan)
    cutoff = np.full(len(time), np.nan)
    if len(said):
        row = np.minimum(np.searchsorted(said, time), len(said) - 1)
        answered = said[row] == time
        row = row[answered]
        late = (said[row] - commands["reference_time"][row])[:, None]
        turned = commands["direction"][row] + late * commands["direction_rate"][row]
        length = np.linalg.norm(turned, axis=1, keepdims=True)
        direction[answered] = turned / length
        rate[answered] = commands["direction_rate"][row] / length
        cutoff[answered] = commands["cutoff_time"][row]
    return {
        **_vector("command_direction", "", direction),
        **_vector("command_direction_rate", "_per_s", rate),
        "command_cutoff_s": cutoff,
    }
