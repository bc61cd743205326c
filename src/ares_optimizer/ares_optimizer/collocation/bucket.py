# SPDX-License-Identifier: Apache-2.0
"""Lay out first guesses for a throttle bucket: less thrust while the dynamic pressure is high.

When the engine is throttled, and when it is at full thrust again, are lengths of free burns. First
guesses that do not know the pressure give them any lengths. So the best flight without the limit
says first where its pressure is high. With a bucket there it is the first guess of the mission,
whose limit is then narrowed; the bucket opens as it is needed.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, MissionArrays
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.ascents import flight_of, searched, try_coast_to_apogee
from ares_optimizer.collocation.limits import pressure_on
from ares_optimizer.collocation.search import Search
from ares_optimizer.collocation.transcription import FreeTimes
from ares_optimizer.plan import free_arcs

#: Share of the limit from which the engine is throttled first.
_HIGH = 0.75
#: Shares of the time of high pressure, one after the other until enough starts agree, and number of
#: those after which the best flight so far gets such a bucket.
_SHARES = (0.3, 0.6, 1.0, 0.1)
_FROM_FREE = 2
#: Number of free burns of a stage with a bucket: before it, the bucket, and perhaps after it.
_PARTS = (2, 3)
#: Length of a bucket of no use, s.
_NO_BUCKET_S = 1e-3


def try_throttle_bucket(search: Search) -> None:
    """Solve from the best flight without the pressure limit, if the mission has a free bucket.

    Args:
        search: it may get a solution.
    """
    arrays, start = search.arrays, search.start
    bucket = bucket_of(arrays, start)
    if bucket < 0:
        return
    limit = float(arrays.arcs[bucket]["max_dynamic_pressure"])
    unlimited = arrays._replace(arcs=arrays.arcs.copy())
    unlimited.arcs["max_dynamic_pressure"][arrays.arcs["stage"] == arrays.arcs[bucket]["stage"]] = (
        math.inf
    )
    without, burns = _with_lengths(unlimited, bucket, (_NO_BUCKET_S, _NO_BUCKET_S))
    free = searched(search, without)
    try_coast_to_apogee(free)
    if free.best is None:
        return
    flight = flight_of(free.best)
    pressure, clock = pressure_on(arrays, flight.track), flight.track[:, rollout.TIME]
    begin = float(clock[np.argmax(flight.track[:, rollout.ARC] >= bucket - 1)])
    # where the limit is kept without a bucket, an empty one
    high = clock[pressure > _HIGH * limit] if pressure.max() > limit else clock[[pressure.argmax()]]
    at = free_arcs(arrays, start[0]).index(bucket - 1)
    known = 0
    for i, share in enumerate(_SHARES):
        if search.is_conclusive or search.request.deadline.passed:
            break
        if i >= _FROM_FREE and search.best is not None:
            flight, known = flight_of(search.best), len(burns)
            burns = flight.times.lengths[at : at + known].tolist()
        placed = float(high[0]) - begin, share * float(np.ptp(high))
        _, lengths = _with_lengths(arrays, bucket, placed)
        later = sum(lengths) - sum(burns)
        others = np.delete(flight.times.lengths, slice(at, at + known))
        times = FreeTimes(
            np.insert(others, at, lengths), flight.times.cutoff + later, flight.times.drops + later
        )
        search.try_start(replace(flight, times=times, limited=False))


def bucket_of(arrays: MissionArrays, start: NDArray[np.void]) -> int:
    """Return the arc of a throttle bucket, by index; -1: there is none.

    It is a free burn after a free burn of more thrust of the same stage, whose dynamic pressure is
    limited. The stage has no other free burn, but for one right after it, and is not lit yet.
    """
    arcs = arrays.arcs
    lit = bool(start["time"][0] > start["arc_start_time"][0])
    for stage in np.unique(arcs["stage"][np.isfinite(arcs["max_dynamic_pressure"])]):
        own = _free_burns(arrays, int(stage))
        if len(own) not in _PARTS or np.ptp(own) != len(own) - 1 or own[-1] == len(arcs) - 1:
            continue
        before, bucket = own[:2]
        ahead = before > start["arc"][0] or (before == start["arc"][0] and not lit)
        if ahead and arcs[bucket]["thrust"] < arcs[before]["thrust"]:
            return int(bucket)
    return -1


def _free_burns(arrays: MissionArrays, stage: int) -> NDArray[np.int64]:
    """Return the free burns of a stage, by index."""
    arcs = arrays.arcs
    free = (arcs["kind"] == BURN) & np.isinf(arcs["duration"]) & (arcs["stage"] == stage)
    return np.flatnonzero(free)


def _with_lengths(
    arrays: MissionArrays, bucket: int, placed: tuple[float, float]
) -> tuple[MissionArrays, list[float]]:
    """Return the mission with a bucket of given place and length, and the lengths, s.

    The burn after it, if it is free, is as long as the propellant lasts: such a mission is like one
    that is never throttled, whose first guesses suffice.

    Args:
        arrays: the mission.
        bucket: index of its arc.
        placed: lengths of the burn before the bucket and of the bucket, s.
    """
    arcs = arrays.arcs.copy()
    own = (arcs["stage"] == arcs[bucket]["stage"]) & (arcs["kind"] == BURN)
    lengths: list[float] = []
    for k in _free_burns(arrays, int(arcs[bucket]["stage"])):
        known = own & np.isfinite(arcs["duration"])
        burnt = float((arcs["mass_flow"][known] * arcs["duration"][known]).sum())
        most = (float(arcs[k]["propellant"]) - burnt) / float(arcs[k]["mass_flow"])
        length = min(max(placed[k - bucket + 1], _NO_BUCKET_S), most) if k <= bucket else most
        lengths.append(length)
        for name in ("duration", "shortest", "longest"):
            arcs[name][k] = length
    return arrays._replace(arcs=arcs), lengths
