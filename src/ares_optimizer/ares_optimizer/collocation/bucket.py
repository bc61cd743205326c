# SPDX-License-Identifier: Apache-2.0
"""Lay out first guesses for a throttle bucket: less thrust while the dynamic pressure is high.

When the engine is throttled, and when it is at full thrust again, are lengths of free burns. First
guesses that do not know the pressure give them any lengths. So the best flight without the limit
says first where its pressure is high; the best flight with a bucket of that place and length, which
keeps the limit, is the first guess of the whole mission.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, MissionArrays
from ares_models.kernels.environment import log_density
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.ascents import flight_of, searched
from ares_optimizer.collocation.pilot import Array
from ares_optimizer.collocation.search import Search
from ares_optimizer.plan import free_arcs

#: Share of the limit from which the engine is throttled first.
_HIGH = 0.75
#: Factors on the time of high pressure, one after the other until enough starts agree.
_LONGER = (1.5, 2.5, 4.0)
#: Length of a bucket of no use, s.
_NO_BUCKET_S = 1e-3


def try_throttle_bucket(search: Search) -> None:
    """Solve from the best flight with a bucket of given lengths, if the mission has a free one.

    Args:
        search: it may get a solution.
    """
    arrays, start = search.arrays, search.start
    bucket = _bucket_of(arrays, start)
    if bucket < 0:
        return
    limit = float(arrays.arcs[bucket]["max_dynamic_pressure"])
    unlimited = arrays._replace(arcs=arrays.arcs.copy())
    unlimited.arcs["max_dynamic_pressure"][arrays.arcs["stage"] == arrays.arcs[bucket]["stage"]] = (
        math.inf
    )
    free = searched(search, _with_lengths(unlimited, bucket, (_NO_BUCKET_S, _NO_BUCKET_S)))
    if free.best is None:
        return
    track = flight_of(free.best).track
    pressure, times = _pressure(arrays, track), track[:, rollout.TIME]
    begin = float(times[np.argmax(track[:, rollout.ARC] >= bucket - 1)])
    # where the limit is kept without a bucket, an empty one
    high = times[pressure > _HIGH * limit] if pressure.max() > limit else times[[pressure.argmax()]]
    at = free_arcs(arrays, start[0]).index(bucket - 1)
    for longer in _LONGER:
        if search.is_conclusive or search.request.deadline.passed:
            break
        lengths = (
            max(float(high[0]) - begin, _NO_BUCKET_S),
            max(longer * float(np.ptp(high)), _NO_BUCKET_S),
        )
        for optimum in searched(search, _with_lengths(arrays, bucket, lengths)).optima:
            flight = flight_of(optimum.found, optimum.met)
            whole = np.insert(flight.times.lengths, at, lengths)
            search.try_start(replace(flight, times=flight.times._replace(lengths=whole)))


def _bucket_of(arrays: MissionArrays, start: NDArray[np.void]) -> int:
    """Return the arc of a throttle bucket, by index; -1: there is none.

    It is a free burn after a free burn of more thrust of the same stage, whose dynamic pressure is
    limited.
    """
    arcs = arrays.arcs
    free = free_arcs(arrays, start[0])
    for before, k in pairwise(free):
        one, other = arcs[before], arcs[k]
        burns = one["kind"] == BURN == other["kind"]
        if not burns or k != before + 1 or one["stage"] != other["stage"]:
            continue
        if other["thrust"] < one["thrust"] and math.isfinite(other["max_dynamic_pressure"]):
            return k
    return -1


def _pressure(arrays: MissionArrays, track: Array) -> Array:
    """Return the dynamic pressure on a track without wind, Pa, shape (n,)."""
    environment = arrays.environment[0]
    turning = np.array([0.0, 0.0, float(environment["rotation_rate"])])
    position = track[:, rollout.POSITION : rollout.VELOCITY]
    air = track[:, rollout.VELOCITY : rollout.DIRECTION] - np.cross(turning, position)
    density = [
        math.exp(log_density(height, arrays.atmosphere)[0])
        for height in track[:, rollout.ALTITUDE].tolist()
    ]
    density_factor = float(environment["density_factor"])
    return 0.5 * density_factor * np.array(density) * (air * air).sum(axis=1)


def _with_lengths(
    arrays: MissionArrays, bucket: int, lengths: tuple[float, float]
) -> MissionArrays:
    """Return the mission with given lengths of the bucket and of the burn before it, s."""
    arcs = arrays.arcs.copy()
    for name in ("duration", "shortest", "longest"):
        arcs[name][bucket - 1 : bucket + 1] = lengths
    return arrays._replace(arcs=arcs)
