# SPDX-License-Identifier: Apache-2.0
"""Lay out first guesses by way of the best ascent to a parking orbit.

From the pad a flight with a free coast is far from any that a few steering constants describe: its
ascent is solved alone first, to a low orbit, with its limits; what follows begins there, above the
air, and is flown by the constants of a trial flight.
"""

import math
from collections.abc import Iterator
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import NAMES_ASCENDING_NODE, NAMES_INCLINATION, MissionArrays
from ares_models.floors import floors_of
from ares_models.kernels.environment import altitude
from ares_models.kernels.judging import judged_by
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.guess import (
    ascents_to_park,
    in_turn,
    node_times,
    trials,
    without_speed,
)
from ares_optimizer.collocation.pilot import Array, Pilot, TrialFlight, plane_from_ground
from ares_optimizer.collocation.points import FoundOptimum, times_of
from ares_optimizer.collocation.search import Search
from ares_optimizer.collocation.transcription import FreeTimes
from ares_optimizer.plan import last_begin
from ares_optimizer.results import jettison_times

#: Most first guesses of the ascent, and of what follows each ascent.
_MOST_ASCENTS = 3
_MOST_AFTER = 4
#: Cosine of the inclination over that of the latitude from which both planes are one, to the east.
_EASTWARD = 1.0 - 1e-7


def trials_by_parking(search: Search) -> Iterator[TrialFlight]:
    """Yield flights that begin with the best ascent to a parking orbit, the likeliest first.

    Args:
        search: of a mission; nothing is yielded if it does not leave the pad for a free coast.
    """
    arrays, start = search.arrays, search.start
    if plane_from_ground(arrays, start) is None:
        return
    pilot = Pilot(arrays, start, search.floors)
    ways: list[Iterator[TrialFlight]] = []
    for alone in ascents_to_park(pilot):
        ascent = _best_ascent(search, alone) or _best_ascent(search, without_speed(alone))
        if ascent is not None:
            after = _state_after(start, ascent)
            following = trials(arrays, after, floors_of(arrays, after), vary_coasts=True)
            ways.append(map(partial(_joined, pilot, ascent), islice(following, _MOST_AFTER)))
    search.ways = max(1, len(ways))
    # in turn, since the first guesses of each are the likeliest
    yield from in_turn(ways)


def try_other_plane(search: Search) -> None:
    """Solve the best flight from the pad in the other plane of the target's inclination.

    Two planes with a free node pass over a site, one to the north and one to the south of east.
    Their optima differ by the Earth's oblateness. The flight is mirrored at the plane of the
    vertical and the east, where it is a good first guess; the starts that led to it count for its
    image too.

    Args:
        search: with its best solution, if there is any; it may get another.
    """
    best, start, target = search.best, search.start, search.arrays.target[0]
    named = int(judged_by(target))
    one_plane = named & NAMES_ASCENDING_NODE or not named & NAMES_INCLINATION
    if best is None or one_plane or plane_from_ground(search.arrays, start) is None:
        return
    up = start["position"][0] / np.linalg.norm(start["position"][0])
    if abs(math.cos(float(target["inclination"]))) > _EASTWARD * math.hypot(up[0], up[1]):
        return
    east = np.cross([0.0, 0.0, 1.0], up)
    north = np.cross(up, east / np.linalg.norm(east))
    track = _track_of(best)
    for at in (rollout.POSITION, rollout.VELOCITY, rollout.DIRECTION):
        vectors = track[:, at : at + 3]
        vectors -= 2.0 * (vectors @ north)[:, None] * north
    met = search.optima[0].met
    search.try_start(TrialFlight(times_of(best.program, best.point.x), track, 0.0, limited=True))
    search.optima[0].met = max(search.optima[0].met, met)


def _best_ascent(search: Search, alone: MissionArrays) -> FoundOptimum | None:
    """Solve the mission of an ascent alone; return None if none is found."""
    part = Search(alone, search.start, floors_of(alone, search.start), search.request)
    for trial in islice(trials(alone, search.start, part.floors), _MOST_ASCENTS):
        part.try_start(trial)
        if part.best is not None or search.request.deadline.passed:
            break
    search.iterations += part.iterations
    return part.best


def _state_after(start: NDArray[np.void], ascent: FoundOptimum) -> NDArray[np.void]:
    """Return the state at the end of an ascent, in the arc after it, shape (1,)."""
    program, x = ascent.program, ascent.point.x
    times = times_of(program, x)
    after = start.copy()
    end = x[6 * (program.nodes - 1) : 6 * program.nodes]
    after["position"] = program.radius * end[:3]
    after["velocity"] = program.speed * end[3:]
    after["mass"] = program.mass * x[program.ends[-1]]
    after["time"] = node_times(program, program.time * x[program.lengths])[-1]
    after["arc_start_time"] = times.cutoff
    after["arc"] = len(program.arrays.arcs)
    for j in np.flatnonzero(_dropped(ascent)):
        after["jettisoned"] |= 1 << int(j)
    return after


def _dropped(ascent: FoundOptimum) -> NDArray[np.bool_]:
    """Return for each jettison of the mission if it is part of an ascent."""
    program = ascent.program
    times = times_of(program, ascent.point.x)
    start = program.start[0]
    return np.isfinite(
        jettison_times(program.arrays, start, program.segments, times.drops, times.cutoff)
    )


def _joined(pilot: Pilot, ascent: FoundOptimum, trial: TrialFlight) -> TrialFlight:
    """Return a flight of an ascent and a trial flight after it."""
    program, x = ascent.program, ascent.point.x
    times = times_of(program, x)
    burn = times.cutoff - last_begin(program.arrays, pilot.start[0], times.lengths)
    before = _dropped(ascent)[program.waiting_for_heating]
    drops = np.where(before, times.drops, 0.0)
    drops[~before] = trial.times.drops
    lengths = np.concatenate((times.lengths, [burn], trial.times.lengths))
    joined = FreeTimes(lengths, trial.times.cutoff, drops)
    return TrialFlight(
        joined._replace(drops=pilot.inside(joined, drops)),
        np.vstack((_track_of(ascent), trial.track)),
        trial.miss,
        limited=True,
    )


def _track_of(ascent: FoundOptimum) -> Array:
    """Return the track of an ascent, shape (nodes, TRACK_COLUMNS), without its heating."""
    program, x = ascent.program, ascent.point.x
    track = np.zeros((program.nodes, rollout.TRACK_COLUMNS))
    times = node_times(program, program.time * x[program.lengths])
    states = x[: 6 * program.nodes].reshape(-1, 6) * np.repeat((program.radius, program.speed), 3)
    track[:, rollout.TIME] = times
    track[:, rollout.POSITION : rollout.DIRECTION] = states
    guided = program.points[program.points["control"] >= 0]
    at = guided["node"] + guided["number"]
    for c in range(3):
        direction = np.interp(times, times[at], x[guided["control"] + c])
        track[:, rollout.DIRECTION + c] = direction
    environment = program.arrays.environment[0]
    track[:, rollout.ALTITUDE] = [altitude(tuple(r), environment) for r in states[:, :3].tolist()]
    points = program.points
    track[points["node"] + points["number"], rollout.ARC] = program.segments["arc"][points["phase"]]
    track[0, rollout.ARC] = program.segments["arc"][0]
    return track
