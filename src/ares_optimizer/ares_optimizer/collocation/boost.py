# SPDX-License-Identifier: Apache-2.0
"""Fly the boost programme of a mission, to the state from which the rest is free."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, MISSION_TIME, MissionArrays
from ares_models.kernels.boost import is_over
from ares_models.kernels.sequence import SAME_TIME
from ares_models.plans import flies_open_loop
from ares_optimizer.collocation import rollout
from ares_optimizer.kernels import timetable
from ares_optimizer.plan import free_arcs, longest_burn, waiting_for_heating
from ares_optimizer.proof.checks import programme_checks
from ares_optimizer.solution import ConstraintCheck, OptimizerError, UnfitMethod

Array = NDArray[np.float64]

_STEP_S = 0.025
_MOST_ROWS = 200_000
#: Longest free coast that is flown for a programme, s.
_LONGEST_COAST_S = 1e4
#: Share of the largest heating below which its peak is past, as guidance has it.
_PAST_PEAK = 0.9


def after_boost(
    arrays: MissionArrays, state: NDArray[np.void]
) -> tuple[NDArray[np.void], tuple[ConstraintCheck, ...]]:
    """Return the state at the end of a mission's boost programme, or the given one after it.

    With it come the checks of the pressure limits along the programme.

    Args:
        arrays: the mission.
        state: shape (1,), dtype NAVIGATION.

    Raises:
        UnfitMethod: the programme flies the whole mission.
        OptimizerError: the flight does not come to the end of the programme.
    """
    start, environment = state[0], arrays.environment[0]
    r, v = tuple(start["position"].tolist()), tuple(start["velocity"].tolist())
    if is_over(float(start["time"]), r, v, int(start["arc"]), environment):
        return state, ()
    if flies_open_loop(environment):
        raise UnfitMethod(
            "programme has no until: it flies the whole mission, and nothing is left to optimize"
        )
    drops, track = _flown(arrays, state)
    return _state_at_end(arrays, state, drops, track), _checks(arrays, track)


def _checks(arrays: MissionArrays, track: Array) -> tuple[ConstraintCheck, ...]:
    """Return the checks of the pressure limits along the burns of a track."""
    arcs = track[:, rollout.ARC].astype(np.int64)
    lit = arrays.arcs["kind"][arcs] == BURN
    r, v, u = (
        track[lit, at : at + 3] for at in (rollout.POSITION, rollout.VELOCITY, rollout.DIRECTION)
    )
    return programme_checks(arrays, (r, v, u), arcs[lit])


def _flown(arrays: MissionArrays, state: NDArray[np.void]) -> tuple[Array, Array]:
    """Fly the programme; return the times of its heating jettisons, s, and its track."""
    drops: Array = np.full(len(arrays.jettisons), math.inf)
    track = _fly(arrays, state, drops)
    for _ in arrays.jettisons:
        due = _heating_drops(arrays, state, track)
        if np.array_equal(due, drops):
            break
        drops = due
        track = _fly(arrays, state, drops)
    return drops, track


def _fly(arrays: MissionArrays, state: NDArray[np.void], drops: Array) -> Array:
    """Fly the programme, with heating jettisons at given times, s; return its track."""
    arcs, start = arrays.arcs, state[0]
    waiting = waiting_for_heating(arrays, start)
    ends, now = [], float(start["arc_start_time"])
    free = free_arcs(arrays, start)
    for k in range(int(start["arc"]), len(arcs)):
        length = float(arcs[k]["duration"])
        if math.isinf(length):
            most = longest_burn(arrays, k) if arcs[k]["kind"] == BURN else _LONGEST_COAST_S
            length = min(float(arcs[k]["longest"]), most)
        now += length
        if k in free:
            ends.append(now)
    laws = np.zeros((len(arcs), rollout.LAW_COLUMNS))
    laws[:, rollout.FRAME] = rollout.BY_PROGRAMME
    track = np.zeros((_MOST_ROWS, rollout.TRACK_COLUMNS))
    rows = rollout.fly_track(
        start,
        arrays.records(),
        timetable.Times(
            timetable.HEATING_PASSIVE,
            np.array([*np.minimum(drops[waiting], now), 0.0]),
            np.array([*ends, 0.0]),
            now,
        ),
        laws,
        _STEP_S,
        np.zeros(timetable.MAX_SEGMENTS, timetable.SEGMENT),
        np.zeros(1, timetable.LAYOUT),
        track,
    )
    last = track[max(rows - 1, 0)]
    r, v = last[rollout.POSITION : rollout.VELOCITY], last[rollout.VELOCITY : rollout.DIRECTION]
    t, k = float(last[rollout.TIME]), int(last[rollout.ARC])
    if rows == 0 or not is_over(t, tuple(r), tuple(v), k, arrays.environment[0]):
        raise OptimizerError("programme.until is not met before the propellant is gone")
    return track[:rows]


def _heating_drops(arrays: MissionArrays, state: NDArray[np.void], track: Array) -> Array:
    """Return when the programme drops what waits for the heating, s; inf: not before its end."""
    heating = track[:, rollout.LOG_HEATING]
    past = heating < np.maximum.accumulate(heating) + math.log(_PAST_PEAK)
    stage = arrays.arcs["stage"][track[:, rollout.ARC].astype(np.int64)]
    drops = np.full(len(arrays.jettisons), math.inf)
    for j, jettison in enumerate(arrays.jettisons):
        if jettison["criterion"] != HEATING_LIMIT or (int(state["jettisoned"][0]) >> j) & 1:
            continue
        due = past & (heating <= math.log(jettison["value"])) & (stage >= jettison["stage"])
        if due.any():
            drops[j] = track[int(np.argmax(due)), rollout.TIME]
    return drops


def _state_at_end(
    arrays: MissionArrays, state: NDArray[np.void], drops: Array, track: Array
) -> NDArray[np.void]:
    """Return the navigation state of the last row of a track, shape (1,)."""
    arcs, row = arrays.arcs, track[-1]
    k = int(row[rollout.ARC])
    now = float(row[rollout.TIME])
    found = state.copy()
    found["time"] = now
    found["position"] = row[rollout.POSITION : rollout.VELOCITY]
    found["velocity"] = row[rollout.VELOCITY : rollout.DIRECTION]
    found["mass"] = row[rollout.MASS]
    found["heating_rate"] = math.nan
    flown = track[:, rollout.ARC].astype(np.int64)
    if k != state["arc"][0]:
        found["arc"] = k
        found["arc_start_time"] = track[int(np.argmax(flown == k)), rollout.TIME]
    lit = arcs["kind"][flown] == BURN
    # at an event there are two rows: what drops just then is off in the second only
    passed = len(track) > 1 and now - track[-2, rollout.TIME] < SAME_TIME
    for j, jettison in enumerate(arrays.jettisons):
        at = drops[j]
        if jettison["criterion"] == MISSION_TIME:
            at = float(jettison["value"])
        elif jettison["criterion"] != HEATING_LIMIT:
            burns = lit & (arcs["stage"][flown] == jettison["stage"])
            at = math.inf
            if burns.any():
                at = float(track[int(np.argmax(burns)), rollout.TIME] + jettison["value"])
        due_now = abs(at - now) < SAME_TIME
        off = passed if due_now else at < now
        if off or arcs["stage"][k] > jettison["stage"]:
            found["jettisoned"] |= 1 << j
    return found
