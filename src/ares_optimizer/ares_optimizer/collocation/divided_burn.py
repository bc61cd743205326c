# SPDX-License-Identifier: Apache-2.0
"""Lay out first guesses by way of the same mission with one burn less.

An upper stage of low thrust raises its apogee by several burns at perigee, with a revolution
between them, which no trial flight of a few steering constants describes. A flight with one burn
less is found more easily. Its last burn is divided: after a whole revolution between both parts the
second one begins where the first one has ended, so that such a flight reaches the target too.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, COAST, MissionArrays
from ares_models.floors import floors_of
from ares_models.kernels.environment import altitude
from ares_models.kernels.kepler import kepler
from ares_models.kernels.vectors import dot, norm
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.ascents import first_guesses, track_of
from ares_optimizer.collocation.pilot import (
    TrialFlight,
    path_of,
    plane_from_ground,
    without_repeats,
)
from ares_optimizer.collocation.points import FoundOptimum, times_of
from ares_optimizer.collocation.search import Search
from ares_optimizer.collocation.transcription import FreeTimes
from ares_optimizer.plan import last_begin, longest_burn

#: Shares of the burn before the revolution.
_SHARES = (0.5, 0.3, 0.7)
#: Angle over which the stage can burn in a low orbit, rad, beyond which it raises its orbit slowly.
_LONG = 2.0
#: States along the revolution.
_STATES = 121
#: Starts of the mission with one burn less without a solution, after which a burn is taken from it
#: too, and most of them.
_UNMET = 2
_MOST_STARTS = 4


def raises_slowly(arrays: MissionArrays, start: NDArray[np.void]) -> bool:
    """Return true if a burn in orbit may be so long that a divided one is likely to be better.

    From the pad the first guesses themselves divide the burns.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
    """
    if _with_one_burn_less(arrays) is None or plane_from_ground(arrays, start) is not None:
        return False
    radius = float(np.linalg.norm(start["position"][0]))
    rate = math.sqrt(float(arrays.environment[0]["mu"]) / radius**3)
    return rate * longest_burn(arrays, len(arrays.arcs) - 1) > _LONG


def try_divided_burn(search: Search) -> None:
    """Solve from a flight with one burn less, if the last two burns and the coast are free.

    Args:
        search: it may get a solution.
    """
    alone = _with_one_burn_less(search.arrays)
    if alone is None:
        return
    less = Search(alone, search.start, floors_of(alone, search.start), search.request)
    for trial in first_guesses(less):
        ended = search.request.deadline.passed or less.best is not None
        if ended or less.starts == _MOST_STARTS:
            break
        less.try_start(trial)
        if less.starts == _UNMET and less.best is None:
            try_divided_burn(less)
    search.iterations += less.iterations
    if less.best is None:
        return
    for trial in _divided(search, less.best):
        if search.request.deadline.passed or search.is_conclusive:
            break
        search.try_start(trial)


def _with_one_burn_less(arrays: MissionArrays) -> MissionArrays | None:
    """Return the mission without its last coast and burn; None if the burn before is no such."""
    arcs = arrays.arcs
    kinds = arcs["kind"][-3:].tolist()
    if kinds != [BURN, COAST, BURN] or not np.isinf(arcs["duration"][-3:]).all():
        return None
    if any(arcs[-3][name] != arcs[-1][name] for name in ("stage", "thrust", "mass_flow")):
        return None
    return arrays._replace(arcs=arcs[:-2].copy())


def _divided(search: Search, found: FoundOptimum) -> Iterator[TrialFlight]:
    """Yield flights with the last burn of a flight divided by a revolution."""
    arrays, mu = search.arrays, float(search.arrays.environment[0]["mu"])
    times, track = times_of(found.program, found.point.x), track_of(found)
    path = path_of(without_repeats(track))
    begin = last_begin(found.program.arrays, search.start[0], times.lengths)
    coast = arrays.arcs[-2]
    for share in _SHARES:
        end = begin + share * (times.cutoff - begin)
        r, v = (tuple(path(end, order).tolist()) for order in (0, 1))
        energy = 0.5 * dot(v, v) - mu / norm(r)
        if energy >= 0.0:
            continue
        period = math.tau * mu / (-2.0 * energy) ** 1.5
        if not coast["shortest"] <= period <= coast["longest"]:
            continue
        before, after = track[track[:, rollout.TIME] < end], track[track[:, rollout.TIME] > end]
        between = np.repeat(before[-1:], _STATES, axis=0)
        for row, elapsed in zip(between, np.linspace(0.0, period, _STATES), strict=True):
            place, velocity = kepler(r, v, elapsed, mu)
            row[rollout.TIME] = end + elapsed
            row[rollout.POSITION : rollout.DIRECTION] = (*place, *velocity)
            row[rollout.ALTITUDE] = altitude(place, arrays.environment[0])
        between[:, rollout.ARC] = len(arrays.arcs) - 2
        after[:, rollout.TIME] += period
        after[:, rollout.ARC] = len(arrays.arcs) - 1
        whole = FreeTimes(
            np.concatenate((times.lengths, [end - begin, period])),
            times.cutoff + period,
            np.where(times.drops > end, times.drops + period, times.drops),
        )
        flown = np.vstack((before, between, after))
        yield TrialFlight(whole, flown, 0.0, limited=True, near=True)
