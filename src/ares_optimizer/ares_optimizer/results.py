# SPDX-License-Identifier: Apache-2.0
"""Build the parts of a solution that all methods have in common."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import HEATING_LIMIT, MISSION_TIME, MissionArrays, Record
from ares_models.kernels.vectors import Vector
from ares_optimizer.pieces import first_ignitions
from ares_optimizer.plan import free_arcs, length_bounds
from ares_optimizer.solution import Check, ConstraintCheck, SteeringArc

Array = NDArray[np.float64]

#: Difference of two lengths, s, that counts as zero.
SAME_LENGTH = 1e-3
#: Distance from a bound that is worth next to nothing, relative to it, at which a length is on it.
_SAME_SHARE = 1e-6


def jettison_times(
    arrays: MissionArrays,
    start: Record,
    pieces: NDArray[np.void],
    heated: Iterable[float] | None,
    cutoff_s: float,
) -> tuple[float, ...]:
    """Return the time of every jettison, s; nan: done before, or not in this flight.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        pieces: of the flight, dtype SEGMENT.
        heated: times of the heating jettisons aboard, s; None: these limits are ignored.
        cutoff_s: end of the flight, s.
    """
    ignitions = first_ignitions(start, pieces, arrays.arcs)
    now = float(start["time"])
    waiting = None if heated is None else iter(heated)
    times = []
    for j, jettison in enumerate(arrays.jettisons):
        stage = int(jettison["stage"])
        # an ascent alone ends before the stages after it
        if (int(start["jettisoned"]) >> j) & 1 or stage >= len(ignitions):
            times.append(math.nan)
            continue
        ignition = ignitions[stage]
        at = max(now, ignition)
        if jettison["criterion"] == HEATING_LIMIT:
            if waiting is not None:
                at = max(at, float(next(waiting)))
        elif jettison["criterion"] == MISSION_TIME:
            at = max(at, float(jettison["value"]))
        else:
            at = max(now, ignition + float(jettison["value"]))
        times.append(at if at <= cutoff_s else math.nan)
    return tuple(times)


def vector_of(x: Array) -> Vector:
    """Convert an array of three numbers to a vector of the kernels."""
    return (float(x[0]), float(x[1]), float(x[2]))


def steering_arc(
    span: tuple[float, float],
    direction: Array,
    rate: Array,
    masses: tuple[float, float],
    delta_v: float,
    primer_rate: Array | None = None,
) -> SteeringArc:
    """Build a steering law that refers to its start.

    Args:
        span: start and end, s.
        direction: at the start, shape (3,), unit vector.
        rate: of the direction, shape (3,), 1/s.
        masses: at start and end, kg.
        delta_v: m/s.
        primer_rate: shape (3,), 1/s; None: not known.
    """
    begin, end = map(float, span)
    return SteeringArc(
        begin,
        end,
        begin,
        vector_of(direction),
        vector_of(rate),
        float(masses[0]),
        float(masses[1]),
        float(delta_v),
        vector_of(np.full(3, math.nan) if primer_rate is None else primer_rate),
    )


def length_checks(
    arrays: MissionArrays, start: Record, lengths: Array, worths: Array, dry: NDArray[np.bool_]
) -> tuple[ConstraintCheck, ...]:
    """Return checks on the lengths of the free arcs, with kg of final mass per second.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        lengths: of the free arcs, s.
        worths: kg/s by a larger bound, per free arc; nan: not known.
        dry: arcs that end at depletion, before their bound.
    """
    low, high = length_bounds(arrays, start)
    checks = []
    for f, k in enumerate(free_arcs(arrays, start)):
        length = float(lengths[f])
        short = length < low[f] + SAME_LENGTH + _SAME_SHARE * low[f]
        limited = math.isfinite(high[f])
        long = limited and length > high[f] - SAME_LENGTH - _SAME_SHARE * high[f]
        active = bool(short or long or dry[f])
        bound = float(low[f]) if short or math.isinf(high[f]) else float(high[f])
        checks.append(
            ConstraintCheck(
                Check.ARC_LENGTH,
                f"length of arc {k}",
                length,
                length if dry[f] else bound,
                active,
                "s",
                bool(low[f] - SAME_LENGTH <= length <= high[f] + SAME_LENGTH),
                float(worths[f]) if active else 0.0,
            )
        )
    return tuple(checks)


def with_multipliers(
    checks: Iterable[ConstraintCheck], per_unit: Mapping[tuple[Check, int | None], float]
) -> tuple[ConstraintCheck, ...]:
    """Return checks with kg of final mass per unit of each limit, where known.

    Args:
        checks: of a flight.
        per_unit: kg per unit, by key and number of the jettison or stage.
    """
    return tuple(
        replace(check, multiplier=per_unit.get((check.key, check.number), check.multiplier))
        for check in checks
    )
