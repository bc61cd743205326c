# SPDX-License-Identifier: Apache-2.0
"""Lay out first guesses by way of the best ascent to a parking orbit.

From the pad a flight with a free coast is far from any that a few steering constants describe: its
ascent is solved alone first, to a low orbit, with its limits; what follows begins there, above the
air, and is flown by the constants of a trial flight.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain, islice
from typing import NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ares_models.arrays import (
    COAST,
    HEADINGS,
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_ASCENDING_NODE,
    NAMES_INCLINATION,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    MissionArrays,
)
from ares_models.floors import floors_of
from ares_models.kernels.environment import altitude, heating_rate
from ares_models.kernels.judging import judged_by
from ares_models.kernels.sequence import loaded_mass
from ares_models.kernels.targets import named_plane
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.guess import (
    ROUND,
    in_turn,
    is_on_transfer,
    trials,
)
from ares_optimizer.collocation.parking import HIGH_UP, ascents_to_park, without_speed
from ares_optimizer.collocation.pilot import (
    Array,
    Pilot,
    TrialFlight,
    are_alike,
    names_plane,
    plane_from_ground,
)
from ares_optimizer.collocation.points import (
    FoundOptimum,
    jettison_times_of,
    times_of,
)
from ares_optimizer.collocation.search import ENOUGH, LEAST_MET, LocalOptimum, Search
from ares_optimizer.collocation.target_orbit import target_apogee, target_perigee
from ares_optimizer.collocation.transcription import FreeTimes
from ares_optimizer.collocation.variables import node_times
from ares_optimizer.plan import (
    free_arcs,
    last_begin,
    saving_stage,
    waiting_for_heating,
    with_more_propellant,
)
from ares_optimizer.results import SAME_LENGTH
from ares_optimizer.solution import OptimizerError, Solution

#: Most starts of a search.
_MOST_STARTS = 12
#: Most first guesses of the ascent, of the rest of the flight alone from its last burn and from the
#: prescribed orbit, and of what follows an ascent.
_MOST_ASCENTS = 3
_MOST_RESTS = 2
_MOST_WHOLE_RESTS = 8
_MOST_AFTER = 4
#: Most first guesses with a coast to the apogee: to find a flight better than the best, and to
#: confirm it.
_MOST_TO_APOGEE = 3
#: Most local optima beside the best one that are mirrored.
_MOST_IMAGES = 2
#: Miss of a trial flight from which it is no first guess: it goes through the ground.
_HOPELESS = 100.0
#: Share of the greatest final mass from which a flight must be tried.
_NEARLY_BEST = 0.99
#: Cosine of the inclination over that of the latitude from which both planes are one, to the east.
_EASTWARD = 1.0 - 1e-7
#: Heating that counts as none, W/m2.
_NO_HEATING_W_M2 = 1e-30

_Found = TypeVar("_Found")


class Beginning(NamedTuple):
    """Hold the part of an ascent with which a whole flight begins.

    Attributes:
        lengths: of its free arcs, s.
        drops: of its heating jettisons, s.
        dropped: which of these happen in it.
        track: shape (n, TRACK_COLUMNS).
        after: state at its end, in the arc after it, shape (1,).
    """

    lengths: Array
    drops: Array
    dropped: NDArray[np.bool_]
    track: Array
    after: NDArray[np.void]


def first_guesses(search: Search) -> Iterator[TrialFlight]:
    """Return the trial flights from which a search starts, by parking orbits first."""
    others = trials(search.arrays, search.start, search.floors)
    near = (trial for trial in chain(trials_by_parking(search), others) if trial.miss < _HOPELESS)
    return islice(near, _MOST_STARTS)


def trials_by_parking(search: Search) -> Iterator[TrialFlight]:
    """Yield flights that begin with the best ascent to a parking orbit, the likeliest first.

    Args:
        search: of a mission; nothing is yielded if it does not leave the pad for a free coast.
    """
    arrays, start = search.arrays, search.start
    if plane_from_ground(arrays, start) is None:
        return
    pilot = Pilot(arrays, start, search.floors)
    rests: list[tuple[float, TrialFlight]] = []
    coasts: list[Iterator[TrialFlight]] = []
    for alone in ascents_to_park(pilot):
        ascent = _best_ascent(search, alone) or _best_ascent(search, without_speed(alone))
        if ascent is not None:
            rests += _with_best_rests(search, ascent, pilot.parks)
            coasts.append(_with_coasts(search, ascent))
    if rests:
        best_kg, best = max(rests, key=lambda rest: rest[0])
        search.least_starts = sum(mass > _NEARLY_BEST * best_kg for mass, _ in rests)

        def rank(rest: tuple[float, TrialFlight]) -> tuple[bool, bool, float]:
            alike = are_alike(rest[1].times.lengths, best.times.lengths)
            return rest[0] <= _NEARLY_BEST * best_kg, not alike, -rest[0]

        # of lighter ones those first that will confirm the best
        yield from (trial for _, trial in sorted(rests, key=rank))
    # in turn, since the first guesses of each are the likeliest
    yield from in_turn(coasts)


def _with_best_rests(
    search: Search, ascent: FoundOptimum, whole: bool
) -> list[tuple[float, TrialFlight]]:
    """Return an ascent to its last burn, with the best flights from there as if without air.

    Args:
        search: of the whole mission.
        ascent: to the parking orbit.
        whole: its last burn is part of it; else there is more propellant than in the mission.

    Returns:
        final masses, kg, and flights.
    """
    arcs_alone = len(ascent.program.arrays.arcs)
    begin = _beginning(search, ascent, arcs_alone if whole else arcs_alone - 1)
    if begin is None or begin.track[-1, rollout.ALTITUDE] < rollout.THIN_AIR_M:
        return []
    arcs = search.arrays.arcs.copy()
    if not whole and saving_stage(search.arrays, search.start[0]) == arcs["stage"][-1]:
        arcs = with_more_propellant(search.arrays, search.start[0]).arcs
    arcs["drag_area"] = arcs["exit_area"] = 0.0
    arcs["vertical"] = 0
    arcs["max_dynamic_pressure"] = arcs["max_q_alpha"] = math.inf
    arrays = search.arrays._replace(arcs=arcs)
    solved = partial(_solved_rests, search, arrays, begin.after, whole)
    joined: list[tuple[float, TrialFlight]] = []
    kept: list[Array] = []
    alone = ascent.program.arrays
    coasts = any(alone.arcs[k]["kind"] == COAST for k in free_arcs(alone, search.start[0]))
    for optimum in _kept(search, arrays, begin.after, solved):
        if not any(are_alike(optimum.lengths, each) for each in kept):
            kept.append(optimum.lengths)
            # rests that agree say nothing of a coast in the ascent
            trial = flight_of(optimum.found, 1 if coasts else optimum.met)
            joined.append((optimum.found.m_f_kg, _joined(search, begin, trial)))
    return joined


def _solved_rests(
    search: Search, arrays: MissionArrays, after: NDArray[np.void], whole: bool
) -> list[LocalOptimum]:
    """Solve the mission of a rest alone from a few first guesses."""
    rest = Search(arrays, after, floors_of(arrays, after), search.request)
    following = trials(arrays, after, rest.floors)
    if not whole:
        # the second one is the transfer to the apogee of the target, if it is higher
        following = reversed(list(islice(following, _MOST_RESTS)))
    for trial in islice(following, _MOST_WHOLE_RESTS):
        if search.request.deadline.passed or rest.again >= ENOUGH:
            break
        rest.try_start(trial)
    search.iterations += rest.iterations
    return rest.optima


def _with_coasts(search: Search, ascent: FoundOptimum) -> Iterator[TrialFlight]:
    """Yield a whole ascent, with trial flights after it."""
    begin = _beginning(search, ascent, len(ascent.program.arrays.arcs))
    if begin is not None:
        arrays, after = search.arrays, begin.after
        following = trials(arrays, after, floors_of(arrays, after), vary_coasts=True)
        yield from map(partial(_joined, search, begin), islice(following, _MOST_AFTER))


def try_other_plane(search: Search) -> None:
    """Solve the best flight from the pad in the other plane of the target's inclination.

    Two planes with a free node pass over a site, to the north and to the south of east. Their
    optima differ by the Earth's oblateness, less than by the intervals: both are solved on those
    for the same flight. It and the next local optima are mirrored at the plane of the vertical and
    the east; starts that led to a flight count for its image too. If the target names its argument
    of perigee, the image has another: it counts for itself alone, and the ascents are mirrored too,
    whose rests are others, or else the first guesses.

    Args:
        search: with its best solution, if there is any; it may get another.
    """
    best, start, target = search.best, search.start, search.arrays.target[0]
    named = int(judged_by(target))
    node = named & NAMES_ASCENDING_NODE or int(target["named"]) & HEADINGS
    if best is None or node or not named & NAMES_INCLINATION:
        return
    if plane_from_ground(search.arrays, start) is None:
        return
    up = start["position"][0] / np.linalg.norm(start["position"][0])
    if abs(math.cos(float(target["inclination"]))) > _EASTWARD * math.hypot(up[0], up[1]):
        return
    met, here = search.again, flight_of(best, 0)
    others = [flight_of(one.found, one.met) for one in search.optima[1 : 1 + _MOST_IMAGES]]
    search.try_start(here)
    image = _in_other_plane(here, start)
    if named & NAMES_ARGUMENT_OF_PERIGEE:
        for trial in chain([replace(image, met=1)], _trials_in_other_plane(search)):
            search.try_start(trial)
        return
    search.try_start(image)
    search.optima[0].met = max(search.optima[0].met, met)
    for other in others:
        search.try_start(_in_other_plane(other, start))


def _trials_in_other_plane(search: Search) -> Iterator[TrialFlight]:
    """Yield flights that begin with an ascent in the other plane.

    Where none parks, they are mirrored first guesses.
    """
    pilot = Pilot(search.arrays, search.start, search.floors)
    to_park = list(ascents_to_park(pilot))
    if not to_park:
        likely = islice(trials(search.arrays, search.start, search.floors), _MOST_RESTS)
        yield from (_in_other_plane(trial, search.start) for trial in likely)
    for alone in to_park:
        ascent = _best_ascent(search, alone)
        if ascent is None:
            continue
        other = Search(alone, search.start, floors_of(alone, search.start), search.request)
        other.try_start(_in_other_plane(flight_of(ascent), search.start))
        search.iterations += other.iterations
        if other.best is not None:
            yield from (trial for _, trial in _with_best_rests(search, other.best, pilot.parks))


def searched(search: Search, arrays: MissionArrays) -> Search:
    """Search a like mission from a few first guesses; count the iterations."""
    like = Search(arrays, search.start, search.floors, search.request)
    for trial in islice(first_guesses(like), _MOST_ASCENTS):
        if like.is_conclusive or search.request.deadline.passed:
            break
        like.try_start(trial)
    search.iterations += like.iterations
    return like


def flight_of(found: FoundOptimum, met: int = 1) -> TrialFlight:
    """Return a solution as a trial flight, to which ``met`` first guesses led."""
    times = times_of(found.program, found.point.x)
    return TrialFlight(times, track_of(found), 0.0, limited=True, met=met)


def _in_other_plane(flight: TrialFlight, start: NDArray[np.void]) -> TrialFlight:
    """Mirror a flight at the plane of the vertical and the east at the start."""
    up = start["position"][0] / np.linalg.norm(start["position"][0])
    east = np.cross([0.0, 0.0, 1.0], up)
    north = np.cross(up, east / np.linalg.norm(east))
    track = flight.track.copy()
    for at in (rollout.POSITION, rollout.VELOCITY, rollout.DIRECTION):
        vectors = track[:, at : at + 3]
        vectors -= 2.0 * (vectors @ north)[:, None] * north
    return replace(flight, track=track)


def try_free_node(search: Search) -> None:
    """Solve from the best flights from the pad to the target's inclination, with a free node.

    Args:
        search: of a mission that names its plane; it may get a solution.
    """
    arrays, start = search.arrays, search.start
    target = arrays.target.copy()
    if (
        not names_plane(arrays)
        or target["kind"] == TARGET_KEPLERIAN
        or plane_from_ground(arrays, start) is None
    ):
        return
    target["named"] &= ~NAMES_ASCENDING_NODE
    if target["kind"] == TARGET_RADIUS_SPEED_ANGLE_PLANE:
        target["kind"] = TARGET_RADIUS_SPEED_ANGLE_INCLINATION
    free = searched(search, arrays._replace(target=target))
    if free.best is None:
        return
    here = flight_of(free.best, free.again)
    normal = np.array(named_plane(arrays.target[0]))

    def along_normal(trial: TrialFlight) -> float:
        end = trial.track[-1]
        r, v = end[rollout.POSITION : rollout.VELOCITY], end[rollout.VELOCITY : rollout.DIRECTION]
        return float(np.cross(r, v) @ normal)

    search.try_start(max(here, _in_other_plane(here, start), key=along_normal))


def try_coast_to_apogee(search: Search) -> None:
    """Solve from the best flight from the pad with its first free coast ended at apogee.

    The last burn of a transfer may be so short that the length of the coast before it matters
    little, and several are local optima. A flight that coasts on a low orbit is one of two: the
    other coasts after a single burn to the apogee of the target, and raises its perigee there.

    Args:
        search: with its best solution, if there is any; it may get another.
    """
    arrays, start = search.arrays, search.start
    coasts = [k for k in free_arcs(arrays, start[0]) if arrays.arcs[k]["kind"] == COAST]
    if search.best is None or not coasts or plane_from_ground(arrays, start) is None:
        return
    lengths = search.optima[0].lengths
    for _ in range(_MOST_TO_APOGEE):
        best = search.best
        trial = _to_apogee(search, best, coasts[0])
        if trial is None or are_alike(trial.times.lengths, lengths):
            return
        search.try_start(trial)
        if search.is_conclusive or search.request.deadline.passed or search.best is best:
            return


def _to_apogee(search: Search, best: FoundOptimum, coast: int) -> TrialFlight | None:
    """Return a flight that coasts to the apogee, of its own orbit or of a high target.

    Args:
        search: of the mission.
        best: with whose ascent it begins.
        coast: the first free one.
    """
    arrays = search.arrays
    begin = _beginning(search, best, coast)
    if begin is None:
        return None
    pilot = Pilot(arrays, begin.after, search.floors)
    high = HIGH_UP * target_perigee(arrays) < target_apogee(arrays) < math.inf
    if high and not is_on_transfer(pilot):
        to_park = list(ascents_to_park(Pilot(arrays, search.start, search.floors)))
        # the last one is that to the apogee of the target
        ascent = _best_ascent(search, to_park[-1]) if to_park else None
        return None if ascent is None else next(_with_coasts(search, ascent), None)
    if pilot.eccentricity < ROUND:
        return None
    after = trials(arrays, begin.after, floors_of(arrays, begin.after), vary_coasts=True)
    trial = next(after, None)
    return None if trial is None else _joined(search, begin, trial)


def _best_ascent(search: Search, alone: MissionArrays) -> FoundOptimum | None:
    """Return the best flight of the mission of an ascent alone; None if none is found."""
    return _kept(search, alone, search.start, partial(_solved_ascent, search, alone))


def _kept(
    search: Search, part: MissionArrays, start: NDArray[np.void], solved: Callable[[], _Found]
) -> _Found:
    """Return the solution of a part of a mission; solve it if no like search has."""
    parts = search.request.parts
    key = b"".join(each.tobytes() for each in (*part, start))
    if key in parts:
        return cast(_Found, parts[key])
    found = solved()
    if not search.request.deadline.passed:
        parts[key] = found
    return found


def _solved_ascent(search: Search, alone: MissionArrays) -> FoundOptimum | None:
    """Solve the mission of an ascent alone; return None if none is found."""
    part = Search(alone, search.start, floors_of(alone, search.start), search.request)
    for trial in islice(trials(alone, search.start, part.floors), _MOST_ASCENTS):
        part.try_start(trial)
        if part.best is not None or search.request.deadline.passed:
            break
    if part.best is not None:
        _drop_at_once(part)
    search.iterations += part.iterations
    return part.best


def _drop_at_once(ascent: Search) -> None:
    """Solve an ascent with energy to spare with drops as early as its heating allows.

    What drops serves as ballast in it, and is in the way of what follows.

    Args:
        ascent: with its best solution.
    """
    flight, pilot = flight_of(ascent.optima[0].found), Pilot(ascent.arrays, ascent.start, ())
    if not len(flight.times.drops) or not pilot.has_needless_burn(flight.times):
        return
    early = replace(flight, times=pilot.with_drops(flight.times, flight.track))
    other = Search(ascent.arrays, ascent.start, ascent.floors, ascent.request)
    other.try_start(early)
    ascent.iterations += other.iterations
    if other.best is not None:
        ascent.optima = other.optima


def _beginning(search: Search, found: FoundOptimum, arc: int) -> Beginning | None:
    """Return a flight up to an arc, or the whole ascent up to the arc after its last.

    Args:
        search: of the whole mission.
        found: solution of the mission, or of its first arcs.
        arc: index of the first arc that is left out.

    Returns:
        None if nothing is left.
    """
    program, x, start = found.program, found.point.x, search.start
    times, phases = times_of(program, x), len(program.segments)
    free = free_arcs(program.arrays, start[0])
    lengths = times.lengths[: sum(k < arc for k in free)]
    if arc < len(program.arrays.arcs):
        end = program.arc_phases[arc][0]
    else:
        end = phases
        if np.isinf(search.arrays.arcs["duration"][arc - 1]):
            begin = last_begin(program.arrays, start[0], times.lengths)
            lengths = np.concatenate((lengths, [times.cutoff - begin]))
    if end == 0:
        return None
    node = int(program.first[end])
    now = float(node_times(program, program.time * x[program.lengths])[node])
    after = start.copy()
    after["position"] = program.radius * x[6 * node : 6 * node + 3]
    after["velocity"] = program.speed * x[6 * node + 3 : 6 * node + 6]
    after["mass"] = program.mass * x[program.masses[end] if end < phases else program.ends[-1]]
    after["time"] = after["arc_start_time"] = now
    after["arc"] = arc
    due = jettison_times_of(program, x, times)
    off = np.array([t <= now + SAME_LENGTH for t in due], bool)
    for j in np.flatnonzero(off):
        after["jettisoned"] |= 1 << int(j)
    arcs, stage = search.arrays.arcs, search.arrays.arcs["stage"]
    if stage[arc] > stage[arc - 1]:
        dropped = int(after["jettisoned"][0])
        after["mass"] = loaded_mass(int(stage[arc]), arcs, search.arrays.jettisons, dropped)
    track = track_of(found)[: node + 1]
    return Beginning(lengths, times.drops, off[program.waiting_for_heating], track, after)


def _joined(search: Search, begin: Beginning, trial: TrialFlight) -> TrialFlight:
    """Return a flight of a beginning and a trial flight after it."""
    drops = np.where(begin.dropped, begin.drops, 0.0)
    drops[~begin.dropped] = trial.times.drops
    lengths = np.concatenate((begin.lengths, trial.times.lengths))
    joined = FreeTimes(lengths, trial.times.cutoff, drops)
    pilot = Pilot(search.arrays, search.start, search.floors)
    return TrialFlight(
        joined._replace(drops=pilot.inside(joined, drops)),
        np.vstack((begin.track, trial.track)),
        trial.miss,
        limited=True,
        met=trial.met,
    )


def track_of(ascent: FoundOptimum) -> Array:
    """Return the track of an ascent, shape (nodes, TRACK_COLUMNS)."""
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
    _add_air(track, program.arrays)
    points = program.points
    track[points["node"] + points["number"], rollout.ARC] = program.segments["arc"][points["phase"]]
    track[0, rollout.ARC] = program.segments["arc"][0]
    return track


def _add_air(track: Array, arrays: MissionArrays) -> None:
    """Fill in the altitudes and heating of a track."""
    environment = arrays.environment[0]
    places = [tuple(r) for r in track[:, rollout.POSITION : rollout.VELOCITY].tolist()]
    speeds = [tuple(v) for v in track[:, rollout.VELOCITY : rollout.DIRECTION].tolist()]
    track[:, rollout.ALTITUDE] = [altitude(r, environment) for r in places]
    rates = [
        heating_rate(*state, environment, arrays.atmosphere)
        for state in zip(places, speeds, strict=True)
    ]
    track[:, rollout.LOG_HEATING] = np.log(np.maximum(rates, _NO_HEATING_W_M2))


def try_known(search: Search) -> None:
    """Solve from the solution of a like mission, if the request has one, turned to the start.

    The starts that led to it count for what it leads to.

    Args:
        search: it may get a solution.

    Raises:
        OptimizerError: the mission of that solution has other free arcs.
    """
    known, start = search.request.guess, search.start[0]
    if not isinstance(known, Solution):
        return
    free, flight = len(free_arcs(search.arrays, start)), known.trajectory
    if flight is None or len(known.lengths_s) != free:
        raise OptimizerError(
            f"guess is a solution with {len(known.lengths_s)} free arcs before the last one; "
            f"expected {free}, and a trajectory"
        )
    track = np.zeros((len(flight.time_s), rollout.TRACK_COLUMNS))
    track[:, rollout.TIME] = flight.time_s
    here, there = (math.atan2(r[1], r[0]) for r in (start["position"], flight.position[0]))
    turn = Rotation.from_euler("z", here - there)
    for at, vectors in (
        (rollout.POSITION, flight.position),
        (rollout.VELOCITY, flight.velocity),
        (rollout.DIRECTION, flight.direction),
    ):
        track[:, at : at + 3] = turn.apply(vectors)
    begins = [flown.start_s for flown in known.flown]
    arcs = np.array([flown.arc for flown in known.flown])
    track[:, rollout.ARC] = arcs[np.searchsorted(begins, flight.time_s, side="right") - 1]
    _add_air(track, search.arrays)
    waiting = waiting_for_heating(search.arrays, start)
    drops = np.array([known.jettison_times_s[j] for j in waiting])
    times = FreeTimes(np.array(known.lengths_s), known.t_meco_s, drops)
    met = LEAST_MET if known.converged else 1
    search.try_start(TrialFlight(times, track, 0.0, limited=True, met=met))
