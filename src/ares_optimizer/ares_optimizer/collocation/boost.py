# SPDX-License-Identifier: Apache-2.0
"""Fly the boost programme of a mission, to the state from which the rest is free."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, MissionArrays, Record
from ares_models.kernels.boost import PAST_PEAK, is_over, measure
from ares_models.kernels.sequence import SAME_TIME, drop_time, last_ignition
from ares_models.mission_programme import OVER
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
#: Depth at which a programme is below the ground, m: a start on it is not, whatever the rounding.
_DEEP_M = 1.0


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
    if rows == 0:
        raise OptimizerError("programme.until is not met before the propellant is gone")
    _check_track(track[:rows], arrays.environment[0])
    return track[:rows]


def _check_track(track: Array, environment: Record) -> None:
    """Check that a programme comes to its end, above the ground and after its kick.

    Args:
        track: of the programme, to its end or until the propellant is gone.
        environment: record ENVIRONMENT.

    Raises:
        OptimizerError: it does not; one line that begins with the key.
    """
    boost = environment["boost"]

    def come_to(over: int, row: Array) -> float:
        """Return the time, altitude or speed of a row, by code."""
        r, v = row[rollout.POSITION : rollout.VELOCITY], row[rollout.VELOCITY : rollout.DIRECTION]
        return measure(over, float(row[rollout.TIME]), tuple(r), tuple(v), environment)

    deep = np.flatnonzero(track[:, rollout.ALTITUDE] < -_DEEP_M)
    if deep.size:
        at = track[deep[0], rollout.TIME]
        raise OptimizerError(f"programme meets the ground at {at:,.1f} s, before it ends")
    over, end, t = int(boost["end_over"]), float(boost["end"]), track[-1, rollout.TIME]
    if track[-1, rollout.ARC] <= boost["last_arc"] and come_to(over, track[-1]) < end:
        key = next(key for key, code in OVER.items() if code == over)
        most = max(come_to(over, row) for row in track)
        raise OptimizerError(
            f"programme.until.{key} is {end:g}; expected what the programme comes to before the "
            f"propellant is gone, at {t:,.1f} s: at most {most:,.6g}"
        )
    kicks = boost["knots"] == 2 and boost["follows"] and boost["at"][0] == boost["at"][1]
    if kicks and come_to(int(boost["over"]), track[-1]) < boost["at"][0]:
        raise OptimizerError(
            f"programme.until is met at {t:,.1f} s, before the kick; expected an end after it"
        )


def _heating_drops(arrays: MissionArrays, state: NDArray[np.void], track: Array) -> Array:
    """Return when the programme drops what waits for the heating, s; inf: not before its end."""
    heating = track[:, rollout.LOG_HEATING]
    past = heating < np.maximum.accumulate(heating) + math.log(PAST_PEAK)
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
    ignited, ignition = last_ignition(k, float(found["arc_start_time"][0]), arcs)
    # at an event there are two rows: what drops just then is off in the second only
    passed = len(track) > 1 and now - track[-2, rollout.TIME] < SAME_TIME
    for j, jettison in enumerate(arrays.jettisons):
        at = drop_time(jettison, ignited, ignition, now, drops[j])
        due_now = abs(at - now) < SAME_TIME
        off = passed if due_now else at < now
        if off or arcs["stage"][k] > jettison["stage"]:
            found["jettisoned"] |= 1 << j
    return found
