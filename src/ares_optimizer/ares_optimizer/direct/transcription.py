# SPDX-License-Identifier: Apache-2.0
"""Transcribe a mission to the finite problem of the direct methods.

One linear-tangent law (Eq. 3.36) per piece of the flight, its rate free or continuous at each
boundary; one direction per burn in held attitude, after which the law continues. Two stages and
one heating-limited jettison give the thesis' 11, 14 and 20 parameters.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    LONGEST_FLIGHT,
    MISSION_TIME,
    TIME_AFTER_IGNITION,
    MissionArrays,
    Record,
)
from ares_optimizer.direct.kernels.problem import (
    AT_DROP,
    AT_FIXED_TIME,
    AT_START,
    HEATING_AT_JETTISON,
    HEATING_FROM_JETTISON,
    MINIMISE_TIME,
    P_FLOW,
    P_FLOW_SLOPE,
    P_MASS,
    P_THRUST,
    P_THRUST_SLOPE,
    P_TIME,
    Problem,
)
from ares_optimizer.kernels.timetable import (
    HEATING_IGNORED,
    HEATING_TIMED,
    MAX_SEGMENTS,
    SEGMENT,
    Times,
    build_timetable,
    propellant_used,
)
from ares_optimizer.pieces import first_ignitions
from ares_optimizer.request import Heating
from ares_optimizer.solution import OptimizerError, UnfitMethod

Array = NDArray[np.float64]

#: Longest integration step, s. At order 6 the error is 0.05 m in position, 1e-3 kg in mass.
LONGEST_STEP = 20.0
#: Least length of a law between boundaries at fixed times, s.
SHORTEST_LAW = 40.0
_FAR = 1.0e7  # a cut-off beyond every event, s
_SHORTEST_BURN = 0.05  # of the last arc, s
_USABLE = 0.97  # fraction of the last stack that the search may burn; propellant is checked later


@dataclass(frozen=True)
class Transcription:
    """Hold a finite problem and the meaning of its variables.

    Attributes:
        problem: for the compiled solver.
        heating_jettisons: index into the mission's jettisons of each free drop.
        fixed_jettisons: (index, time s) of the drops at known times.
        depletion_s: cut-off time at which the last stage's propellant is spent.
        flow_kg_s: full mass flow of the last arc.
    """

    problem: Problem
    heating_jettisons: tuple[int, ...]
    fixed_jettisons: tuple[tuple[int, float], ...]
    depletion_s: float
    flow_kg_s: float


def _sequence(
    arrays: MissionArrays, start: Record, heating: Heating
) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return the thrust profile up to cut-off and after it, free drops still aboard."""
    segments = np.zeros(MAX_SEGMENTS, SEGMENT)
    count = build_timetable(
        start,
        arrays.arcs,
        arrays.jettisons,
        Times(
            HEATING_IGNORED if heating is Heating.IGNORED else HEATING_TIMED,
            np.full(len(arrays.jettisons), math.inf),
            np.zeros(0),
            _FAR,
        ),
        segments,
    )
    if count == 0:
        raise OptimizerError(
            f"no flight can be computed from arc {int(start['arc'])} at "
            f"{float(start['time']):g} s: too many events, or the last burn does not begin"
        )
    segments = segments[:count]
    return segments[segments["after_cutoff"] == 0], segments[segments["after_cutoff"] == 1]


def _profile(main: NDArray[np.void]) -> Array:
    profile = np.empty((len(main), 6))
    profile[:, P_TIME] = main["start"]
    profile[:, P_THRUST] = main["thrust"]
    profile[:, P_THRUST_SLOPE] = main["thrust_slope"]
    profile[:, P_FLOW] = main["flow"]
    profile[:, P_FLOW_SLOPE] = main["flow_slope"]
    profile[:, P_MASS] = main["mass"]
    return profile


def _tail(after: NDArray[np.void]) -> Array:
    """Return the pieces after cut-off, as ``Problem.tail``; the last row is the end of thrust."""
    tail = np.zeros((len(after) + 1 if len(after) else 0, 5))
    tail[:-1, P_TIME] = after["start"] - _FAR
    tail[:-1, P_THRUST] = after["thrust"]
    tail[:-1, P_THRUST_SLOPE] = after["thrust_slope"]
    tail[:-1, P_FLOW] = after["flow"]
    tail[:-1, P_FLOW_SLOPE] = after["flow_slope"]
    if len(after):
        tail[-1, P_TIME] = after[-1]["end"] - _FAR
    return tail


def _jettisons(
    arrays: MissionArrays, start: Record, heating: Heating, ignitions: Sequence[float]
) -> tuple[list[int], list[tuple[int, float]]]:
    """Return the drops with free time, greatest limit first, and (index, time s) of others."""
    now = float(start["time"])
    free = []
    fixed = []
    for j, jettison in enumerate(arrays.jettisons):
        if (int(start["jettisoned"]) >> j) & 1:
            continue
        ignition = ignitions[int(jettison["stage"])]
        value = float(jettison["value"])
        if jettison["criterion"] == MISSION_TIME:
            fixed.append((j, max(now, ignition, value)))
        elif jettison["criterion"] == TIME_AFTER_IGNITION:
            fixed.append((j, max(now, ignition + value)))
        elif heating is Heating.IGNORED:
            fixed.append((j, max(now, ignition)))
        else:
            free.append(j)
    # the greater limit is reached first
    free.sort(key=lambda j: -float(arrays.jettisons[j]["value"]))
    return free, fixed


def _depletion(arrays: MissionArrays, start: Record, main: NDArray[np.void]) -> float:
    """Return the cut-off time at which the last stage's propellant is spent, s."""
    arcs = arrays.arcs
    last = arcs[-1]
    used = 0.0
    if arcs[start["arc"]]["stage"] == last["stage"]:
        used = propellant_used(start, float(main[0]["mass"]), arcs, arrays.jettisons)
    for piece in main[:-1]:
        if arcs[piece["arc"]]["stage"] == last["stage"]:
            length = piece["end"] - piece["start"]
            used += length * (piece["flow"] + 0.5 * length * piece["flow_slope"])
    return float(main[-1]["start"] + (last["propellant"] - used) / main[-1]["flow"])


def _boundaries(start_time: float, wanted: Iterable[float], fixed: Iterable[float]) -> list[float]:
    """Return the times at which laws begin, at least SHORTEST_LAW apart.

    Args:
        start_time: s.
        wanted: s, always kept.
        fixed: s, kept where no other boundary is closer than SHORTEST_LAW.
    """
    times = sorted({time for time in wanted if start_time < time < math.inf})
    for time in sorted(fixed):
        if all(abs(time - other) >= SHORTEST_LAW for other in [start_time, *times]):
            times.append(time)
    return sorted(times)


def _laws(
    method: str, start_time: float, boundaries: list[float], drops: int
) -> tuple[NDArray[np.int64], Array, int]:
    """Lay out the steering laws: where each begins and which of its parameters are variables.

    Returns:
        ``Problem.laws``, ``Problem.law_time`` and the number of variables taken.
    """
    rows: list[tuple[int, int, int, int]] = [(AT_START, -1, 0, 3)]
    times = [start_time]
    column = 6
    for k, time in enumerate([*boundaries, *([math.nan] * drops)]):
        begins, drop = (
            (AT_FIXED_TIME, -1) if k < len(boundaries) else (AT_DROP, k - len(boundaries))
        )
        times.append(time)
        if begins == AT_DROP and method == "jump":
            rows.append((begins, drop, -1, -1))
            continue
        direction = -1
        if method == "direct20":
            direction = column
            column += 3
        rows.append((begins, drop, direction, column))
        column += 3
    return np.array(rows, np.int64), np.array(times), column


def _held(main: NDArray[np.void], column: int) -> tuple[NDArray[np.int64], Array]:
    """Return ``Problem.held``, from ``column`` on, and ``Problem.held_time``."""
    times = []
    for number in range(1, int(main["held"].max()) + 1):
        pieces = main[main["held"] == number]
        if len(pieces):
            end = float(pieces[-1]["end"])
            times.append((float(pieces[0]["start"]), end if end < _FAR else math.inf))
    columns = column + 3 * np.arange(len(times), dtype=np.int64)
    return columns, np.array(times).reshape(len(times), 2)


def _guiding(start_time: float, boundaries: list[float], main: NDArray[np.void]) -> list[float]:
    """Return the boundaries without those of laws that steer no thrust.

    Such laws exist only where burns are in held attitude.
    """
    if not main["held"].any():
        return boundaries
    guided = main[(main["held"] == 0) & (main["flow"] + main["flow_slope"] > 0.0)]

    def thrusts(begin: float, end: float) -> bool:
        return bool(((guided["start"] < end) & (guided["end"] > begin)).any())

    kept: list[float] = []
    for begin in sorted(boundaries, reverse=True):
        if thrusts(begin, kept[0] if kept else math.inf):
            kept.insert(0, begin)
    while kept and not thrusts(start_time, kept[0]):
        kept.pop(0)
    return kept


def _law_boundaries(
    method: str,
    start_time: float,
    splits: Iterable[float],
    ignitions: Iterable[float],
    fixed: Iterable[tuple[int, float]],
    main: NDArray[np.void],
) -> list[float]:
    """Return the boundaries of a method's laws, s; ``fixed`` as :func:`_jettisons` returns it."""
    wanted = list(splits)
    if method in ("direct14", "direct20"):
        wanted += ignitions
    spare = [] if method == "jump" else [time for _, time in fixed]
    return _guiding(start_time, _boundaries(start_time, wanted, spare), main)


def _drops(
    arrays: MissionArrays, start_time: float, free: Sequence[int], ignitions: Sequence[float]
) -> Array:
    """Return ``Problem.drops`` of the jettisons with free time."""
    jettisons = arrays.jettisons
    rows = [
        (
            jettisons[j]["mass"],
            math.log(jettisons[j]["value"]),
            max(start_time, ignitions[int(jettisons[j]["stage"])]),
        )
        for j in free
    ]
    return np.array(rows).reshape(len(free), 3)


def _cutoff_bounds(
    method: str,
    arcs: NDArray[np.void],
    main: NDArray[np.void],
    start_time: float,
    drops: Array,
) -> tuple[float, float]:
    """Return the earliest and the latest cut-off of the last burn, s.

    Raises:
        OptimizerError: it begins too late.
        UnfitMethod: it is a solid motor.
    """
    if arcs[-1]["tabled"]:
        raise UnfitMethod(
            f"method is {method}; expected auto or collocation: the last burn has a thrust_table"
        )
    last_piece = main[-1]
    left = float(last_piece["mass"]) - float(drops[:, 0].sum())
    last_arc = main[main["arc"] == len(arcs) - 1][0]
    earliest = float(last_arc["start"]) + _SHORTEST_BURN
    latest = float(last_piece["start"]) + _USABLE * left / float(last_piece["flow"])
    if not earliest < start_time + LONGEST_FLIGHT:
        raise OptimizerError(
            f"the last burn begins at {earliest - _SHORTEST_BURN:g} s; expected less than "
            f"{LONGEST_FLIGHT:g} s after the start, {start_time:g} s"
        )
    return earliest, min(latest, start_time + LONGEST_FLIGHT)


def transcribe(
    arrays: MissionArrays,
    start: Record,
    method: str,
    heating: Heating = Heating.AT_JETTISON,
    longest_step: float = LONGEST_STEP,
    splits: Sequence[float] = (),
) -> Transcription:
    """Build the finite problem of a method.

    Args:
        arrays: the mission.
        start: record NAVIGATION: time, position, velocity, mass (0: that of the stack),
            arc, arc_start_time, jettisoned.
        method: ``direct11``, ``direct14``, ``direct20`` or ``jump``.
        heating: where the heating limit holds.
        longest_step: longest integration step, s.
        splits: further times at which the rate is free, s.

    Raises:
        OptimizerError: no timetable exists from this start.
        UnfitMethod: the last burn is a solid motor.
    """
    main, after = _sequence(arrays, start, heating)
    ignitions = first_ignitions(start, main, arrays.arcs)
    now = float(start["time"])
    free, fixed = _jettisons(arrays, start, heating, ignitions)
    drops = _drops(arrays, now, free, ignitions)
    boundaries = _law_boundaries(method, now, splits, ignitions, fixed, main)
    laws, law_times, columns = _laws(method, now, boundaries, len(free))
    held, held_times = _held(main, columns)
    earliest, latest = _cutoff_bounds(method, arrays.arcs, main, now, drops)
    problem = Problem(
        environment=arrays.environment,
        atmosphere=arrays.atmosphere,
        target=arrays.target,
        state=np.concatenate((start["position"], start["velocity"])),
        start_time=now,
        profile=_profile(main),
        tail=_tail(after),
        drops=drops,
        laws=laws,
        law_time=law_times,
        held=held,
        held_time=held_times,
        longest_step=longest_step,
        earliest_cutoff=earliest,
        latest_cutoff=latest,
        heating=HEATING_FROM_JETTISON if heating is Heating.FROM_JETTISON else HEATING_AT_JETTISON,
        objective=MINIMISE_TIME,
        variables=columns + 3 * len(held) + len(free) + 1,
        stop=np.zeros(1, np.int64),
    )
    return Transcription(
        problem,
        tuple(free),
        tuple(fixed),
        _depletion(arrays, start, main),
        float(main[-1]["flow"]),
    )
