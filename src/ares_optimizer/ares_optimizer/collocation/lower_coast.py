# SPDX-License-Identifier: Apache-2.0
"""Solve a launch again whose coast begins on its default floor, without that floor."""

import math

from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.ascents import flight_of, track_of
from ares_optimizer.collocation.points import FoundOptimum, lowest_in
from ares_optimizer.collocation.search import Search

#: Distance from a floor up to which a coast begins on it, m.
_ON_FLOOR_M = 10.0


def try_lower_coast(search: Search) -> None:
    """Solve without the default floor of a coast that begins on it in the ascent.

    A coast that begins lower than that floor, and rises, has none.

    Args:
        search: with its best solution, if there is any; it may get another.
    """
    best = search.best
    if best is None:
        return
    for floor in search.floors:
        if floor.said or not best.program.floor_rows.get(floor.arc):
            continue
        if abs(_highest_before(best, floor.arc) - floor.altitude_m) > _ON_FLOOR_M:
            continue
        others = tuple(other for other in search.floors if other is not floor)
        lower = Search(search.arrays, search.start, others, search.request)
        for optimum in search.optima:
            if lower.is_conclusive or search.request.deadline.passed:
                break
            agreed = search.again if optimum.found is best else optimum.met
            lower.try_start(flight_of(optimum.found, agreed))
        search.iterations += lower.iterations
        if lower.best is None:
            continue
        begin = _highest_before(lower.best, floor.arc)
        if lowest_in(lower.best, floor.arc) > begin - _ON_FLOOR_M:
            search.keep(lower.best, lower.again)


def _highest_before(found: FoundOptimum, arc: int) -> float:
    """Return the greatest altitude of a flight up to the begin of an arc, m."""
    track = track_of(found)
    return float(track[track[:, rollout.ARC] < arc, rollout.ALTITUDE].max(initial=-math.inf))
