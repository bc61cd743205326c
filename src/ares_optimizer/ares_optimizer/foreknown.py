# SPDX-License-Identifier: Apache-2.0
"""Convert a mission with a known failure to arrays, with the burn split at the failure.

Their optimum is the best possible flight with the failure, with steering that anticipates it from
the start.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, MISSION_TIME, MissionArrays
from ares_models.failures import Failure, FailureKind
from ares_models.kernels.sequence import SAME_TIME, arc_after_burnout
from ares_models.kernels.throttle import throttle
from ares_models.kernels.thrust_curve import curve_area, curve_value
from ares_models.kernels.weakened import shut_down_core, weaken_stage
from ares_optimizer.kernels.timetable import (
    HEATING_IGNORED,
    MAX_SEGMENTS,
    SEGMENT,
    Times,
    build_timetable,
    segment_mass,
)
from ares_optimizer.solution import OptimizerError, UnfitMethod

Array = NDArray[np.float64]

_FAR = 1e7  # s, a cut-off beyond every event


class Foreknown(NamedTuple):
    """Hold a mission with its failure.

    Attributes:
        arrays: the mission with the failure; its last arc is a burn of free length.
        end_s: latest end of that burn; inf: depletion.
    """

    arrays: MissionArrays
    end_s: float


def begin_times(arrays: MissionArrays, start_s: float) -> Array:
    """Return the begin of each arc, s, and the end of the last (inf), shape (arcs + 1,).

    Args:
        arrays: a mission whose last arc alone is free.
        start_s: begin of the first arc.

    Raises:
        UnfitMethod: an arc before the last is free.
    """
    durations = arrays.arcs["duration"]
    if not np.isfinite(durations[:-1]).all():
        arc = int(np.argmax(~np.isfinite(durations)))
        raise UnfitMethod(
            f"arc {arc} is free; expected only the last arc to be, so that failures have a time"
        )
    return start_s + np.concatenate(([0.0], np.cumsum(durations)))


def burning_at(arrays: MissionArrays, start_s: float, time_s: float) -> int:
    """Return the index of the arc that burns at a time; -1: none.

    Args:
        arrays, start_s: as in :func:`begin_times`.
        time_s: s; at the boundary of two arcs the later counts.
    """
    begins = begin_times(arrays, start_s)
    k = int(np.searchsorted(begins, time_s + SAME_TIME, side="right")) - 1
    if not 0 <= k < len(arrays.arcs) or arrays.arcs[k]["kind"] != BURN:
        return -1
    return k


def foreknown(arrays: MissionArrays, start: NDArray[np.void], failure: Failure) -> Foreknown:
    """Return the mission with a failure as the plant flies it, see ``ares_models.failures``.

    Args:
        arrays: a mission whose last arc alone is free.
        start: shape (1,), dtype NAVIGATION.
        failure: its time, if it has one, is within a burn.

    Raises:
        UnfitMethod: the mission has other free arcs.
        OptimizerError: no burn at that time, or none left.
    """
    if failure.kind is FailureKind.STUCK_JETTISON:
        return _without_drop(arrays, failure.jettison)
    begins = begin_times(arrays, float(start["time"][0]))
    if failure.kind is FailureKind.FAILED_IGNITION:
        return _cut_short(arrays, begins, failure.arc, float(begins[failure.arc]))
    k = burning_at(arrays, float(start["time"][0]), failure.time_s)
    if k < 0:
        raise OptimizerError(f"failure.time_s is {failure.time_s:g} s; nothing burns then")
    if failure.kind is FailureKind.EARLY_SHUTDOWN:
        return _cut_short(arrays, begins, k, failure.time_s)
    into = failure.time_s - float(begins[k])
    if failure.kind is FailureKind.STUCK_THROTTLE:
        mass = _mass_at(arrays, start, failure.time_s)
        weak = arrays.arcs[k : k + 1].copy()
        fraction = throttle(weak[0], mass)
        weak["thrust"] *= fraction
        weak["mass_flow"] *= fraction
        weak["max_acceleration"] = math.inf
        before, after = _split(arrays.arcs[k : k + 1], weak, into)
        return Foreknown(_with_rows(arrays, k, before, after), math.inf)
    return _weakened(arrays, k, into, failure)


def _without_drop(arrays: MissionArrays, jettison: int) -> Foreknown:
    jettisons = arrays.jettisons.copy()
    jettisons[jettison]["criterion"] = MISSION_TIME
    jettisons[jettison]["value"] = math.inf
    return Foreknown(arrays._replace(jettisons=jettisons), math.inf)


def _cut_short(arrays: MissionArrays, begins: Array, k: int, time_s: float) -> Foreknown:
    """End the whole burn that arc ``k`` belongs to, without a tail-off."""
    arcs = arrays.arcs.copy()
    following = int(arc_after_burnout(k, arcs))
    into = time_s - float(begins[k])
    if following < len(arcs) and arcs[k]["core_thrust"] > 0.0:
        # the boosters beside the engines burn on
        shut_down_core(arcs, k)
        before, after = _split(arrays.arcs[k : k + 1], arcs[k : k + 1], into)
        rest = arcs[k + 1 :]
        arcs = np.concatenate((arcs[:k], before, after, rest[rest["duration"] != 0.0]))
        return Foreknown(arrays._replace(arcs=arcs), math.inf)
    if following < len(arcs):
        arcs[k]["duration"] = into
        arcs[k]["tail_knots"] = 0
        arcs[k]["tail_gain"] = 0.0
        kept = np.concatenate((arcs[: k + 1], arcs[following:]))
        return Foreknown(arrays._replace(arcs=kept), math.inf)
    last, end = k, time_s
    if into <= SAME_TIME:
        burns = np.flatnonzero(arcs["kind"][:k] == BURN)
        if not burns.size:
            raise OptimizerError(f"arc {k} is the first burn; nothing is left without it")
        # arcs after the last burn are not steered
        last = int(burns[-1])
        end = float(begins[last + 1])
    arcs = arcs[: last + 1]
    arcs[last]["duration"] = math.inf
    if last == k:
        arcs[last]["tail_knots"] = 0
        arcs[last]["tail_gain"] = 0.0
    return Foreknown(arrays._replace(arcs=arcs), end)


def _weakened(arrays: MissionArrays, k: int, into: float, failure: Failure) -> Foreknown:
    """Split the burn at the failure; weaken its rest and the later burns of the stage."""
    lost = failure.kind is FailureKind.ENGINE_OUT
    flow_ratio = failure.thrust_ratio if lost else failure.flow_ratio
    weak = arrays.arcs.copy()
    weaken_stage(weak, k, into, (failure.thrust_ratio, flow_ratio), lost)
    before, after = _split(arrays.arcs[k : k + 1], weak[k : k + 1], into)
    return Foreknown(_with_rows(arrays._replace(arcs=weak), k, before, after), math.inf)


def _split(
    whole: NDArray[np.void], weak: NDArray[np.void], into: float
) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Split a burn ``into`` s after its begin; the first part is empty at the begin.

    Args:
        whole: shape (1,), as are ``weak`` and both results.
        weak: the same burn after the failure, with the times of the whole.
        into: time since its begin, s.
    """
    before, after = whole.copy(), weak.copy()
    after["duration"] -= into
    _leave_rest_of_start(after, into)
    if into <= SAME_TIME:
        return before[:0], after
    after["begins_stage"] = 0
    before["duration"] = into
    row = whole[0]
    knots = int(row["start_knots"])
    if knots:
        area = curve_area(row["start_time"], row["start_fraction"], knots, into)
        before["start_loss"] = into - area
    for name in ("tail_knots", "tail_gain"):
        before[name] = 0
    return before, after


def _with_rows(
    arrays: MissionArrays, k: int, before: NDArray[np.void], after: NDArray[np.void]
) -> MissionArrays:
    """Return the mission with two rows in place of arc ``k``."""
    arcs = np.concatenate((arrays.arcs[:k], before, after, arrays.arcs[k + 1 :]))
    return arrays._replace(arcs=arcs)


def _mass_at(arrays: MissionArrays, start: NDArray[np.void], time_s: float) -> float:
    """Return the mass at a time, kg, with heating jettisons done at ignition."""
    none = np.zeros(0)
    segments = np.zeros(MAX_SEGMENTS, SEGMENT)
    times = Times(HEATING_IGNORED, none, none, _FAR)
    count = build_timetable(start[0], arrays.arcs, arrays.jettisons, times, segments)
    i = int(np.searchsorted(segments["start"][:count], time_s, side="right")) - 1
    return float(segment_mass(segments[i], time_s))


def _leave_rest_of_start(arc: NDArray[np.void], into: float) -> None:
    """Keep the part of a burn's start curve after ``into`` s; shape (1,)."""
    row = arc[0]
    knots = int(row["start_knots"])
    times = row["start_time"].copy()
    fractions = row["start_fraction"].copy()
    flows = row["start_flow"].copy()
    ahead = np.flatnonzero(times[:knots] > into)
    if not ahead.size:
        row["start_knots"] = 0
        row["start_loss"] = 0.0
        return
    kept = ahead.size + 1
    now = curve_value(times, fractions, knots, into)
    row["start_time"][:kept] = [0.0, *(times[ahead] - into)]
    row["start_fraction"][:kept] = [now, *fractions[ahead]]
    row["start_flow"][:kept] = [curve_value(times, flows, knots, into), *flows[ahead]]
    row["start_knots"] = kept
    length = float(times[knots - 1])
    done = curve_area(times, fractions, knots, into)
    row["start_loss"] = length - into - (curve_area(times, fractions, knots, length) - done)
