# SPDX-License-Identifier: Apache-2.0
"""Tabulate flights: draws, results, and reasons of failure."""

from collections.abc import Sequence
from enum import StrEnum
from typing import Any

import numpy as np
import pyarrow as pa

from ares_models.judge import FIGURES, End, JudgedQuantity
from ares_studies.montecarlo.flights import Flown
from ares_vehicle_sim.arrays import DEPLETION, IMPACT, TIME_LIMIT


class Verdict(StrEnum):
    """Name the verdicts on a flight; the first that applies counts."""

    ERROR = "error"
    IMPACT = "impact"
    TIME_LIMIT = "time_limit"
    NOT_CONVERGED = "not_converged"
    DEPLETION = "depletion"
    TARGET_MISSED = "target_missed"
    FAIRING_ON = "fairing_on"
    HEATING_EXCEEDED = "heating_exceeded"
    SUCCESS = "success"


#: Prefix of the columns of draws.
DRAWN = "draw_"

#: Decimals of a miss, by its figure.
_DECIMALS = {
    "radius_m": 0,
    "speed_m_s": 2,
    "flight_path_angle_deg": 4,
    "inclination_deg": 3,
    "ascending_node_deg": 3,
    "argument_of_perigee_deg": 3,
    "perigee_radius_m": 0,
    "apogee_radius_m": 0,
    "semi_major_axis_m": 0,
    "eccentricity": 6,
    "c3_m2_s2": 0,
    "true_anomaly_deg": 4,
}


def error_column(figure: JudgedQuantity) -> str:
    """Return the name of the column with the error of a figure."""
    return f"{figure.name}_error{figure.suffix}"


#: Numeric columns: name, field of RESULT, whether it is an angle, converted to degrees.
NUMBERS = (
    ("m_f_kg", "mass", False),
    ("t_end_s", "end_time", False),
    ("t_meco_s", "cutoff_time", False),
    ("t_plf_s", "jettison_time", False),
    ("heating_at_jettison_w_m2", "jettison_heating", False),
    ("heating_limit_w_m2", "jettison_limit", False),
    ("heating_peak_after_jettison_w_m2", "peak_heating_after", False),
    ("propellant_used_kg", "propellant_used", False),
    ("max_q_pa", "most_dynamic_pressure", False),
    ("max_q_alpha_pa_rad", "most_q_alpha", False),
    ("max_q_of_limit", "dynamic_pressure_share", False),
    ("max_q_alpha_of_limit", "q_alpha_share", False),
    *((error_column(f), f"{f.name}_error", f.unit == "deg") for f in FIGURES),
)
#: Prefix of the columns of what comes down, and their ends with fields of FALL.
FALLEN = "fall_"
_FALLS = {"_t_s": "down_time", "_latitude_deg": "latitude", "_longitude_deg": "longitude"}
#: Conditions of a success.
FLAGS = ("terminal_accuracy", "fairing_off", "heating_kept")


def drawn_columns(columns: Sequence[str]) -> list[str]:
    """Return the column names of the draws."""
    return [DRAWN + column.replace(".", "_") for column in columns]


def schema(columns: Sequence[str], pieces: Sequence[str] = ()) -> Any:
    """Return the table's schema, a pyarrow.Schema.

    Args:
        columns: draws, as named by the sampler.
        pieces: as in :func:`make_table`.
    """
    fields = [("flight", pa.int64())]
    fields += [(name, pa.float64()) for name in drawn_columns(columns)]
    fields += [(name, pa.float64()) for name, _, _ in NUMBERS]
    fields += [(f"{FALLEN}{piece}{end}", pa.float64()) for piece in pieces for end in _FALLS]
    fields += [("iterations", pa.int64())]
    fields += [(name, pa.bool_()) for name in (*FLAGS, "succeeded")]
    fields += [(name, pa.string()) for name in ("end", "outcome", "failure")]
    return pa.schema(fields)


def make_table(
    flown: Flown, columns: Sequence[str], jettisons: Sequence[str], pieces: Sequence[str] = ()
) -> Any:
    """Tabulate flights as a pyarrow.Table; unknown values are null.

    Args:
        flown: the flights.
        columns: draws, as named by the sampler.
        jettisons: name of each jettison, for the failures.
        pieces: what may come down, as in columns' names.
    """
    results = flown.results
    count = len(results)
    failed = np.zeros(count, np.bool_)
    failed[[flight - flown.first for flight in flown.errors]] = True
    data: dict[str, Any] = {"flight": np.arange(flown.first, flown.first + count)}
    for k, name in enumerate(drawn_columns(columns)):
        data[name] = pa.array(np.ascontiguousarray(flown.inputs[:, k]), from_pandas=True)
    for name, field, angle in NUMBERS:
        values = np.degrees(results[field]) if angle else results[field].copy()
        values[failed] = np.nan
        data[name] = pa.array(values, from_pandas=True)
    for k, piece in enumerate(pieces):
        fall = results["falls"][:, k]
        for end, field in _FALLS.items():
            values = fall[field] if field == "down_time" else np.degrees(fall[field])
            down = (fall["dropped"] == 1) & np.isfinite(fall["down_time"])
            data[f"{FALLEN}{piece}{end}"] = pa.array(values, mask=~down)
    data["iterations"] = pa.array(results["iterations"].copy(), mask=failed)
    good = np.ones(count, np.bool_)
    for name in FLAGS:
        flag = (results[name] == 1) & ~failed
        good &= flag
        data[name] = flag
    data["succeeded"] = good
    bad = np.flatnonzero(~good)
    outcomes = np.full(count, Verdict.SUCCESS, dtype=object)
    failures = np.full(count, None, dtype=object)
    for k in bad.tolist():
        error = flown.errors.get(flown.first + k)
        if error is not None:
            outcomes[k], failures[k] = Verdict.ERROR, error
        else:
            outcomes[k], failures[k] = explain(results[k], jettisons)
    ends = [str(end) for end in End]
    data["end"] = [None if failed[k] else ends[results["end"][k]] for k in range(count)]
    data["outcome"] = [str(outcome) for outcome in outcomes]
    data["failure"] = list(failures)
    return pa.table(data, schema=schema(columns, pieces))


def explain(result: Any, jettisons: Sequence[str]) -> tuple[Verdict, str]:
    """Return why a flight failed: the first outcome that applies, and all reasons in words.

    Args:
        result: record RESULT of a failed flight.
        jettisons: name of each jettison.
    """
    reasons = []
    if result["ended"] == IMPACT:
        reasons.append((Verdict.IMPACT, f"met the ground at {result['end_time']:.1f} s"))
    if result["ended"] == TIME_LIMIT:
        reasons.append((Verdict.TIME_LIMIT, f"not over at {result['end_time']:.1f} s"))
    if not result["converged"]:
        reasons.append((Verdict.NOT_CONVERGED, "guidance never converged"))
    if result["ended"] == DEPLETION:
        reasons.append(
            (Verdict.DEPLETION, f"propellant gone at {result['end_time']:.1f} s, before cut-off")
        )
    misses = _misses(result)
    if misses:
        reasons.append((Verdict.TARGET_MISSED, "target missed: " + ", ".join(misses)))
    on_board = [name for k, name in enumerate(jettisons) if int(result["on_board"]) >> k & 1]
    if on_board:
        reasons.append((Verdict.FAIRING_ON, f"{', '.join(on_board)} on at cut-off"))
    if not result["heating_kept"]:
        heating, limit = result["jettison_heating"], result["jettison_limit"]
        text = f"heating at jettison {heating:.1f} W/m2, limit {limit:.1f}"
        reasons.append((Verdict.HEATING_EXCEEDED, text))
    return reasons[0][0], "; ".join(text for _, text in reasons)


def _misses(result: Any) -> list[str]:
    """Describe the errors beyond their limits."""
    misses = []
    for figure in FIGURES:
        error = figure.in_unit(result[f"{figure.name}_error"])
        judged = int(result["judged"]) & figure.bit
        if judged and not abs(error) <= figure.in_unit(result[f"{figure.name}_allowed"]):
            name = figure.name.replace("_", " ")
            unit = "" if figure.unit == "1" else f" {figure.unit}"
            misses.append(f"{name} by {error:+.{_DECIMALS[figure.key]}f}{unit}")
    return misses
