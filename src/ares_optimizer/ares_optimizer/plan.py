# SPDX-License-Identifier: Apache-2.0
"""Handle arcs of free length: bounds, trial lengths, missions with given lengths."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, MissionArrays, Record

Array = NDArray[np.float64]

#: Trial lengths of coasts, fractions of the period of a low orbit, and of burns, fractions of the
#: longest that the propellant allows.
_COASTS = (0.01, 0.1, 0.03, 0.3, 0.55, 0.8, 0.2, 0.42, 0.68, 0.93)
_BURNS = (0.5, 0.8, 0.25)
#: Depth below ground, relative to the radius, down to which a flight is returned, to be refused by
#: its floor; deeper ones are discarded.
DEEPEST = 0.01
#: Least throttle assumed where a mission has none.
_LEAST_THROTTLE = 1e-2
#: Least length of an arc that may vanish, s.
SHORTEST = 1e-3
#: Propellant fraction of a last stage that has more than any flight takes.
_MOST_PROPELLANT = 0.97


def free_arcs(arrays: MissionArrays, start: Record) -> list[int]:
    """Return the free arcs before the last one from the start on, in flight order.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
    """
    free = np.isinf(arrays.arcs["duration"][:-1])
    return [int(k) for k in np.flatnonzero(free) if k >= int(start["arc"])]


def plans_arcs(arrays: MissionArrays, start: Record) -> bool:
    """Return true if free arcs precede the last burn, or its length is fixed."""
    return bool(free_arcs(arrays, start)) or math.isfinite(arrays.arcs[-1]["duration"])


def saving_stage(arrays: MissionArrays, start: Record) -> int:
    """Return the last stage with a free burn, whose propellant is saved; -1: none.

    Propellant left in a stage is dropped with it. If no burn of the last stage is free, the mass
    at cut-off is fixed.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
    """
    arcs = arrays.arcs[int(start["arc"]) :]
    free = arcs["stage"][(arcs["kind"] == BURN) & np.isinf(arcs["duration"])]
    return int(free.max(initial=-1))


def throttled_ahead(arrays: MissionArrays, start: Record) -> NDArray[np.bool_]:
    """Mark the throttled burns among the arcs from the start on.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
    """
    ahead = arrays.arcs[int(start["arc"]) :]
    throttled: NDArray[np.bool_] = (ahead["kind"] == BURN) & np.isfinite(ahead["max_acceleration"])
    return throttled


def held_ahead(arrays: MissionArrays, start: Record) -> list[int]:
    """Return the burns in held attitude from the start on.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
    """
    return [int(k) for k in np.flatnonzero(arrays.arcs["held"]) if k >= int(start["arc"])]


def waiting_for_heating(arrays: MissionArrays, start: Record) -> list[int]:
    """Return the jettisons to come that wait for the heating, in the order of the file.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
    """
    return [
        j
        for j, jettison in enumerate(arrays.jettisons)
        if jettison["criterion"] == HEATING_LIMIT and not (int(start["jettisoned"]) >> j) & 1
    ]


def with_lengths(arrays: MissionArrays, start: Record, lengths: Array) -> MissionArrays:
    """Return the mission with free arcs of given lengths; the last arc is free.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        lengths: of :func:`free_arcs`, shape (n,), s.
    """
    arcs = arrays.arcs.copy()
    for k, length in zip(free_arcs(arrays, start), lengths, strict=True):
        arcs[k]["duration"] = length
    arcs[-1]["duration"] = math.inf
    return arrays._replace(arcs=arcs)


def with_more_propellant(arrays: MissionArrays, start: Record) -> MissionArrays:
    """Return the mission with a saving stage, or else a last one, that is nearly all propellant.

    A flight is found in it faster. The one of greatest mass takes the least propellant: it is that
    of the mission if it takes no more than there is.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
    """
    arcs = arrays.arcs.copy()
    stage = saving_stage(arrays, start)
    more = arcs["stage"] == (stage if stage >= 0 else arcs[-1]["stage"])
    most = _MOST_PROPELLANT * float(arcs["stack_mass"][more][0])
    arcs["propellant"][more] = max(float(arcs["propellant"][more][-1]), most)
    return arrays._replace(arcs=arcs)


def longest_burn(arrays: MissionArrays, k: int) -> float:
    """Return the length of burn ``k`` with all propellant of its stage, s.

    A burn with a limit of acceleration is throttled as the mass falls: thrust and flow are
    proportional to the mass, from the limit on down to the least throttle.
    """
    arc = arrays.arcs[k]
    flow, propellant = float(arc["mass_flow"]), float(arc["propellant"])
    if math.isfinite(arc["max_acceleration"]):
        # least mass: all jettisons may have been dropped before
        end = float(arc["stack_mass"]) - propellant - float(arrays.jettisons["mass"].sum())
        limit = float(arc["thrust"] / arc["max_acceleration"])
        least = max(float(arc["min_throttle"]), _LEAST_THROTTLE)
        knee = least * limit
        begin = end + propellant
        full = max(begin - max(end, limit), 0.0)
        faded = min(begin, limit) / min(max(end, knee, 1.0), limit)
        low = max(min(begin, knee) - end, 0.0)
        fading = limit * math.log(faded) if faded > 1.0 else 0.0
        return (full + fading + low / least) / flow
    return float(propellant / flow + arc["start_loss"] - arc["tail_gain"])


def length_bounds(arrays: MissionArrays, start: Record) -> tuple[Array, Array]:
    """Return the shortest and longest lengths of the free arcs, s, within the propellant."""
    low = []
    high = []
    for k in free_arcs(arrays, start):
        arc = arrays.arcs[k]
        low.append(max(float(arc["shortest"]), SHORTEST))
        longest = float(arc["longest"])
        if arc["kind"] == BURN:
            longest = min(longest, longest_burn(arrays, k))
        high.append(max(longest, low[-1]))
    return np.array(low), np.array(high)


def trial_lengths(arrays: MissionArrays, start: NDArray[np.void]) -> Iterator[Array]:
    """Yield initial lengths of the free arcs, s, the likeliest first.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
    """
    radius = float(np.linalg.norm(start["position"][0]))
    period = math.tau * math.sqrt(radius**3 / float(arrays.environment[0]["mu"]))
    choices = []
    for k, low, high in zip(
        free_arcs(arrays, start[0]), *length_bounds(arrays, start[0]), strict=True
    ):
        burn = arrays.arcs[k]["kind"] == BURN
        if burn:
            parts = [part * high for part in _BURNS]
        else:
            parts = [low + part * min(period, 2.0 * (high - low)) for part in _COASTS]
        choices.append([min(max(part, low), high) for part in parts])
    count = max((len(choice) for choice in choices), default=1)
    seen = set()
    # a diagonal through the grid first, then its neighbours
    for shift in range(count):
        for turn in range(count):
            lengths = tuple(
                choice[(turn + f * shift) % len(choice)] for f, choice in enumerate(choices)
            )
            if lengths not in seen:
                seen.add(lengths)
                yield np.array(lengths)


def last_begin(arrays: MissionArrays, start: Record, lengths: Array) -> float:
    """Return the begin of the last arc, s, if no burn of fixed length is depleted early."""
    planned = with_lengths(arrays, start, lengths).arcs
    first = int(start["arc"])
    return float(start["arc_start_time"]) + float(planned["duration"][first:-1].sum())


def spent(arrays: MissionArrays, start: Record, lengths: Array, last: float) -> float:
    """Return the propellant of the free burns from the start on, without thrust curves, kg.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        lengths: of :func:`free_arcs`, s.
        last: length of the last burn, s.
    """
    total = 0.0
    for k, length in zip(free_arcs(arrays, start), lengths, strict=True):
        if arrays.arcs[k]["kind"] == BURN:
            total += float(arrays.arcs[k]["mass_flow"] * length)
    return total + float(arrays.arcs[-1]["mass_flow"]) * last
