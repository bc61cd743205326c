# SPDX-License-Identifier: Apache-2.0
"""Lay out the trial flights of a search, the likeliest first."""

import math
from collections.abc import Iterator
from itertools import chain, tee

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ares_models.arrays import (
    BURN,
    COAST,
    NAMES_ARGUMENT_OF_PERIGEE,
    MissionArrays,
)
from ares_models.floors import Floor
from ares_models.kernels.environment import gravity
from ares_models.kernels.judging import judged_by
from ares_models.orbits import Elements
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.parking import LOW_M, ascent_to, end_of_ascent, without_speed
from ares_optimizer.collocation.pilot import (
    CONSTANTS,
    Array,
    Pilot,
    TrialFlight,
)
from ares_optimizer.collocation.target_orbit import target_apogee, target_energy, target_perigee
from ares_optimizer.collocation.transcription import FreeTimes
from ares_optimizer.plan import free_arcs, last_begin, longest_burn
from ares_optimizer.results import SAME_LENGTH

#: Trial pitch and yaw at begin and end of an ascent, deg.
_ASCENTS = (
    (25.0, 0.0, 0.0, 0.0),
    (40.0, 0.0, -10.0, 0.0),
    (10.0, 0.0, 0.0, 0.0),
    (60.0, 0.0, -20.0, 0.0),
    (-10.0, 0.0, 10.0, 0.0),
)
#: The same from the ground, where the first angle stands for the exponent of time, in deg for rad.
_LIFT_OFFS = (
    (24.0, 0.0, 0.0, 0.0),
    (14.0, 0.0, -10.0, 0.0),
    (40.0, 0.0, 0.0, 0.0),
    (8.0, 0.0, 10.0, 0.0),
    (57.0, 0.0, -10.0, 0.0),
)
#: Flight-path angles at which zero-lift turns enter thin air, deg, first tilts between which those
#: are found, rad, and steps to find one.
_TURNS = (25.0, 35.0, 15.0, 45.0, 8.0)
_TILTS = (0.0, 1.2)
_TILT_STEPS = 14
#: The same of a burn in orbit, relative to the velocity.
_BURNS = (
    (0.0, 0.0, 0.0, 0.0),
    (80.0, 0.0, -80.0, 0.0),
    (-80.0, 0.0, 80.0, 0.0),
    (0.0, 80.0, 0.0, -80.0),
    (0.0, -80.0, 0.0, 80.0),
)
#: Trial lengths of a coast, fractions of a revolution, the likeliest first.
COASTS = (0.12, 0.03, 0.3, 0.5, 0.8, 0.2, 0.65, 0.4, 0.93)
#: Trial lengths beyond a revolution, if the coast may be so long.
_LATER_COASTS = (1.12, 1.5, 1.8, 1.3)
#: End of a coast after the first, as fraction of a revolution from perigee: the apogee; and the
#: longest such coast, in revolutions of a low orbit.
_TO_APOGEE = 0.5
_LONGEST_TO_APOGEE = 10.0
#: End of a first coast at the target's argument of perigee, or after a revolution where it begins
#: on no orbit, and fraction of a revolution by which it ends before: a burn around perigee begins
#: there.
_TO_PERIGEE = -1.0
_BEFORE_PERIGEE = 0.02
#: Another trial length of such a coast, fraction of a revolution.
_SOON = 0.12
#: The same between two burns at perigee.
_REVOLUTION = 0.97
#: Miss beyond which the lengths of coasts are varied too.
_FAR = 1e-2
#: Miss of an ascent alone beyond which its burns do not reach the orbit.
_OUT_OF_REACH = 0.2
#: Number of steering constants that are kept of several.
_LIKELY = 2
#: Eccentricity from which a coast to apogee is tried first after an ascent, and relative difference
#: of lengths up to which two such flights are one.
ROUND = 0.01
_SAME_ARCS = 0.02
#: Other length of free burns before the last one, relative to the longest.
_MAIN_BURN = 0.9
#: Length of a burn, relative to the longest, below which it is not needed.
_NEEDLESS = 0.01
#: Fraction of the target's apogee at which a burn towards it ends.
_APOGEE = 0.98
#: Ratio of apogee to perigee from which a coast to apogee is tried.
_HIGH = 1.01
#: Revolutions over which the passages of a first coast through a round target are sought, the most
#: that are tried, and the accuracy of that coast.
_PASSED_REVOLUTIONS = 3.0
_MOST_PASSAGES = 4
_PASSED_ACCURACY = 1e-9


def _first_crossing(track: Array, above: Array, default: float) -> float:
    """Return the time of the first zero of a rising value, s; the default if none."""
    reached = above >= 0.0
    if not reached.any():
        return default
    i = int(np.argmax(reached))
    times = track[:, rollout.TIME]
    if i == 0:
        return float(times[0])
    part = above[i - 1] / (above[i - 1] - above[i])
    return float(times[i - 1] + part * (times[i] - times[i - 1]))


def trials(
    arrays: MissionArrays,
    start: NDArray[np.void],
    floors: tuple[Floor, ...],
    vary_coasts: bool = False,
) -> Iterator[TrialFlight]:
    """Fly first guesses of a search, the likeliest first.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        floors: of the arcs.
        vary_coasts: fit the lengths of the coasts too, from those of the choice.
    """
    pilot = Pilot(arrays, start, floors)
    parking = _ascent_alone(pilot, pilot.apogee_m)
    known = {} if parking is None else parking[1]
    coasts = [k for k in pilot.free if arrays.arcs[k]["kind"] == COAST and k not in known]
    if not coasts:
        pilots = [pilot]
        if pilot.plane is not None and _has_limits(arrays):
            pilots.insert(0, Pilot(arrays, start, floors, turns=True))
        yield from in_turn([_best_first(each) for each in pilots])
        return
    tried: set[tuple[float, ...]] = set()
    likely: list[_Begin] = []
    yielded: list[FreeTimes] = []
    eccentric = vary_coasts and pilot.eccentricity > ROUND
    for begins, parts in _choices(pilot, parking, coasts, eccentric):
        found = []
        for begin in likely if len(begins) > _LIKELY and likely else begins:
            constants, known = begin
            times = _first_times(pilot, constants, known, dict(zip(coasts, parts, strict=True)))
            key = () if times is None else (*constants, *np.round(times.lengths, 0))
            if times is None or key in tried:
                continue
            tried.add(key)
            trial, there = pilot.aim(times, constants, vary_coasts)
            if math.isfinite(trial.miss):
                found.append((trial, there, begin))
        found.sort(key=lambda one: one[0].miss)
        if len(found) > _LIKELY:
            likely = [begin for _, _, begin in found[:_LIKELY]]
        if found:
            trial, constants, _ = found[0]
            if trial.miss > _FAR:
                again, _ = pilot.aim(trial.times, constants, coasts=True)
                trial = min(trial, again, key=lambda one: one.miss)
            if vary_coasts and any(_is_same(trial.times, times) for times in yielded):
                continue
            yielded.append(trial.times)
            yield trial


def _is_same(one: FreeTimes, other: FreeTimes) -> bool:
    """Return true if two flights have nearly the same lengths."""
    near = _SAME_ARCS * np.maximum(one.lengths, other.lengths) + SAME_LENGTH
    return bool((np.abs(one.lengths - other.lengths) <= near).all())


def _has_limits(arrays: MissionArrays) -> bool:
    """Return true if a stage limits the dynamic pressure or q alpha."""
    names = ("max_dynamic_pressure", "max_q_alpha")
    return any(bool(np.isfinite(arrays.arcs[name]).any()) for name in names)


def _best_first(pilot: Pilot) -> Iterator[TrialFlight]:
    """Fit the steering of a flight without free coasts; yield a good fit at once.

    Free burns before the last one end on the target's energy, then a little before their stage is
    empty: a weak last burn, such as that of verniers alone, may be longer than the first fit finds.
    """
    others = []
    burns = {k: _MAIN_BURN * pilot.longest(k) for k in pilot.free}
    # a zero-lift turn is sought when it is needed: that takes several flights
    starts, again = tee(_start_constants(pilot))
    tries = chain(((each, {}) for each in starts), ((each, burns) for each in again if burns))
    for (constants, known), split in tries:
        times = _first_times(pilot, constants, known | split, {})
        if times is None:
            continue
        trial, _ = pilot.aim(times, constants)
        if trial.miss < _FAR:
            yield trial
        elif math.isfinite(trial.miss):
            others.append(trial)
    yield from sorted(others, key=lambda trial: trial.miss)


def in_turn(ways: list[Iterator[TrialFlight]]) -> Iterator[TrialFlight]:
    """Yield one of each in turn."""
    while ways:
        for way in list(ways):
            trial = next(way, None)
            if trial is None:
                ways.remove(way)
            else:
                yield trial


#: Initial steering constants, and the known lengths of free arcs, s, by arc.
_Begin = tuple[Array, dict[int, float]]


def _choices(
    pilot: Pilot, parking: _Begin | None, coasts: list[int], apogee_first: bool
) -> Iterator[tuple[list[_Begin], tuple[float, ...]]]:
    """Yield initial steering, with lengths of free coasts as fractions of a revolution.

    Args:
        pilot: of the mission.
        parking: its ascent to a parking orbit; None: there is none.
        coasts: the free coasts, without those in that ascent.
        apogee_first: the coast to the apogee is the likeliest.
    """
    ascents = [parking] if parking is not None else list(_start_constants(pilot))
    longest = pilot.longest(coasts[0]) / pilot.period
    firsts = [*COASTS, *(part for part in _LATER_COASTS if part < longest)]
    if longest < COASTS[0]:
        firsts = [longest, *(part * longest for part in COASTS[3:])]
    if apogee_first:
        firsts.sort(key=lambda part: part != _TO_APOGEE)
    if int(judged_by(pilot.arrays.target[0])) & NAMES_ARGUMENT_OF_PERIGEE:
        firsts.insert(0, _TO_PERIGEE)
    later = len(coasts) - 1
    arc = int(pilot.start["arc"][0])
    burns = bool(pilot.arrays.arcs[arc]["kind"] == BURN)
    if burns and arc in pilot.free and is_on_transfer(pilot):
        # this burn is not needed
        yield [(np.zeros(CONSTANTS * pilot.count), {arc: 0.0})], (_TO_APOGEE,) * len(coasts)
    for length in () if burns or later or arc not in pilot.free else _passages(pilot):
        yield [(constants, {arc: length}) for constants, _ in ascents[:_LIKELY]], (0.0,)
    # several burns at perigee raise the apogee
    first = _REVOLUTION if burns and not pilot.ascends else firsts[0]
    if later and target_perigee(pilot.arrays) < pilot.parking_m + LOW_M:
        yield ascents, (first, *([_REVOLUTION] * later))
    elif later > 1:
        yield ascents, (first, *([_REVOLUTION] * (later - 1)), _TO_APOGEE)
    yield ascents, (firsts[0], *([_TO_APOGEE] * later))
    apogee = target_apogee(pilot.arrays)
    if parking is not None and apogee >= _HIGH * pilot.parking_m:
        # the first burn continues to the apogee of the target, or to escape
        transfer = _ascent_alone(pilot, apogee)
        if transfer is not None:
            yield [transfer], (_TO_APOGEE, *([_TO_APOGEE] * later))
    if later:
        yield ascents, (firsts[0], *([_SOON] * later))
    if parking is None:
        # burns of fixed length may follow each other at once
        yield ascents, (0.0,) * len(coasts)
        if later:
            yield ascents, (0.0, *([_SOON] * later))
            yield ascents, (firsts[0], *([0.0] * later))
    for part in firsts[1:]:
        yield ascents, (part, *([_TO_APOGEE] * later))
        if later:
            yield ascents, (part, *([_SOON] * later))


def _passages(pilot: Pilot) -> list[float]:
    """Return the times at which a first coast is best placed for a round target, s, the best first.

    A short burn must begin at the radius of the target. On an oblate body an orbit passes it at
    other times than its apogee.
    """
    low, high = target_perigee(pilot.arrays), target_apogee(pilot.arrays)
    if pilot.energy >= 0.0 or not high - low < ROUND * low:
        return []
    environment, wanted = pilot.arrays.environment[0], 0.5 * (low + high)

    def motion(_t: float, state: Array) -> Array:
        return np.concatenate((state[3:], gravity(tuple(state[:3].tolist()), environment)))

    def above(_t: float, state: Array) -> float:
        return float(np.linalg.norm(state[:3])) - wanted

    def climb(_t: float, state: Array) -> float:
        return float(state[:3] @ state[3:]) / wanted

    flown = solve_ivp(
        motion,
        (0.0, min(pilot.longest(int(pilot.start["arc"][0])), _PASSED_REVOLUTIONS * pilot.period)),
        np.concatenate((pilot.start["position"][0], pilot.start["velocity"][0])),
        method="DOP853",
        rtol=_PASSED_ACCURACY,
        events=(above, climb),
    )
    speed = math.sqrt(float(environment["mu"]) / wanted)
    costs: list[tuple[float, float]] = []
    assert flown.t_events is not None
    assert flown.y_events is not None
    for passed, states in zip(flown.t_events, flown.y_events, strict=True):
        for t, state in zip(passed, states, strict=True):
            up = climb(t, state)
            along = float(np.linalg.norm(np.cross(state[:3], state[3:]))) / wanted
            late = abs(above(t, state)) * speed / wanted
            costs.append((math.hypot(up, along - speed) + late, float(t)))
    return [t for _, t in sorted(costs)[:_MOST_PASSAGES]]


def is_on_transfer(pilot: Pilot) -> bool:
    """Return true if a flight begins on an ellipse to the target's apogee."""
    if pilot.energy >= 0.0 or pilot.eccentricity < ROUND:
        return False
    mu = float(pilot.arrays.environment[0]["mu"])
    highest = -0.5 * mu / pilot.energy * (1.0 + pilot.eccentricity)
    return highest > _APOGEE * target_apogee(pilot.arrays)


def _start_constants(pilot: Pilot) -> Iterator[tuple[Array, dict[int, float]]]:
    """Yield initial steering constants, without known lengths."""
    if pilot.turns:
        for angle in _TURNS:
            yield _turn_constants(pilot, math.radians(angle)), {}
        return
    choices = _ASCENTS if pilot.ascends else _BURNS
    if pilot.plane is not None:
        choices = _LIFT_OFFS
    for angles in choices:
        constants = np.zeros(CONSTANTS * pilot.count)
        constants[:CONSTANTS] = np.radians(angles)
        yield constants, {}


def _turn_constants(pilot: Pilot, angle: float) -> Array:
    """Return constants of a zero-lift turn that enters thin air at a flight-path angle, rad."""
    constants = np.zeros(CONSTANTS * pilot.count)
    constants[1] = angle
    lengths = _untried_lengths(pilot)
    last = longest_burn(pilot.arrays, len(pilot.arrays.arcs) - 1)
    cutoff = float(pilot.begins(lengths, min(last, float(pilot.arrays.arcs[-1]["duration"])))[-1])
    times = FreeTimes(lengths, cutoff, _late(pilot, lengths, last))
    low, high = _TILTS
    for _ in range(_TILT_STEPS):
        constants[0] = 0.5 * (low + high)
        if pilot.angle_in_thin_air(pilot.fly(times, constants)) > angle:
            low = constants[0]
        else:
            high = constants[0]
    return constants


def _ascent_alone(pilot: Pilot, apogee: float) -> _Begin | None:
    """Fit an ascent to a low orbit; return None where there is none.

    Args:
        pilot: of the mission.
        apogee: apogee radius of that orbit, m; inf: with the energy of the target.
    """
    start, last = pilot.start, end_of_ascent(pilot)
    if last is None:
        return None
    alone = ascent_to(pilot, last, pilot.parking_m, apogee)
    best = _aimed(alone, start)
    needless = _NEEDLESS * pilot.longest(last)
    if best is not None and best[0].times.cutoff < needless + _last_begin(alone, start, best[0]):
        # the burns of fixed length suffice: leave the speed free
        best = _aimed(without_speed(alone), start, needless) or best
    if best is None or best[0].miss > _OUT_OF_REACH:
        return None
    trial, constants = best
    whole = np.zeros(CONSTANTS * pilot.count)
    whole[: constants.size] = constants
    lengths = dict(zip(free_arcs(alone, start[0]), trial.times.lengths, strict=True))
    lengths[last] = trial.times.cutoff - _last_begin(alone, start, trial)
    return whole, lengths


def _last_begin(arrays: MissionArrays, start: NDArray[np.void], trial: TrialFlight) -> float:
    """Return the begin of the last arc of a flight, s."""
    return last_begin(arrays, start[0], trial.times.lengths)


def _aimed(
    alone: MissionArrays, start: NDArray[np.void], last: float | None = None
) -> tuple[TrialFlight, Array] | None:
    """Return the best fit of a mission of one group, and its constants.

    Args:
        alone: the mission.
        start: shape (1,), dtype NAVIGATION.
        last: initial length of its last burn, s; None: until the energy is reached.
    """
    part = Pilot(alone, start, ())
    best: tuple[TrialFlight, Array] | None = None
    for constants, lengths in _start_constants(part):
        times = _first_times(part, constants, lengths, {})
        if times is None:
            continue
        if last is not None:
            begin = float(part.begins(times.lengths, 0.0)[-1])
            times = part.with_drops(times._replace(cutoff=begin + last), part.fly(times, constants))
        found = part.aim(times, constants)
        if best is None or found[0].miss < best[0].miss:
            best = found
        if best[0].miss < 1e-2:
            break
    return best if best is not None and math.isfinite(best[0].miss) else None


def _first_times(
    pilot: Pilot, constants: Array, known: dict[int, float], coasts: dict[int, float]
) -> FreeTimes | None:
    """Return initial times: each burn ends on the orbit that its place requires.

    A free coast without a length in ``known`` or ``coasts`` is as short as it may be.
    """
    arrays = pilot.arrays
    arcs = arrays.arcs
    mu = float(arrays.environment[0]["mu"])
    lengths = _untried_lengths(pilot)
    wanted = target_energy(arrays)
    last_free = math.isinf(arcs[-1]["duration"])
    last = longest_burn(arrays, len(arcs) - 1) if last_free else float(arcs[-1]["duration"])
    for f, k in enumerate(pilot.free):
        low = max(float(arcs[k]["shortest"]), 1e-3)
        if k in known:
            lengths[f] = known[k]
        elif k in coasts:
            lengths[f] = _coast_for(pilot, lengths, f, constants, coasts[k])
        elif arcs[k]["kind"] == BURN:
            kicks = [coast for coast, part in coasts.items() if part == _REVOLUTION]
            to_come = sum(coast > k for coast in kicks)
            apogee = _raised_apogee(pilot, 1.0 - to_come / (len(kicks) + 1))
            lengths[f] = _burn_until(pilot, lengths, f, constants, apogee)
        lengths[f] = min(max(lengths[f], low), pilot.longest(k))
    times = FreeTimes(lengths, float(pilot.begins(lengths, last)[-1]), _late(pilot, lengths, last))
    if not last_free:
        return times
    track = pilot.fly(times, constants)
    if not len(track):
        return None
    burning = track[:, rollout.ARC] == len(arcs) - 1
    v = track[:, rollout.VELOCITY : rollout.VELOCITY + 3]
    r = track[:, rollout.POSITION : rollout.POSITION + 3]
    energy = 0.5 * (v * v).sum(axis=1) - mu / np.linalg.norm(r, axis=1)
    begin = float(pilot.begins(lengths, 0.0)[-1])
    end = _first_crossing(track[burning], energy[burning] - wanted, begin + 0.95 * last)
    end = min(max(end, begin + 0.01 * last), begin + 0.98 * last)
    times = times._replace(cutoff=end)
    return pilot.with_drops(times, track)


def _untried_lengths(pilot: Pilot) -> Array:
    """Return lengths of the free arcs before any flight, s."""
    arcs = pilot.arrays.arcs
    return np.array(
        [
            0.5 * pilot.longest(k) if arcs[k]["kind"] == BURN else float(arcs[k]["shortest"])
            for k in pilot.free
        ]
    )


def _late(pilot: Pilot, lengths: Array, last: float) -> Array:
    """Return drops just before the cut-off, s."""
    return np.full(len(pilot._waiting), float(pilot.begins(lengths, last)[-1]) - 1.0)


def _raised_apogee(pilot: Pilot, share: float) -> float:
    """Return the apogee radius after a share of the burns to the target's apogee, m."""
    apogee = target_apogee(pilot.arrays)
    mu, perigee = float(pilot.arrays.environment[0]["mu"]), pilot.parking_m
    if share == 1.0 or apogee <= perigee:
        return apogee
    low = math.sqrt(mu / perigee)
    high = math.sqrt(2.0 * mu * (1.0 / perigee - 1.0 / (perigee + apogee)))
    speed = low + share * (high - low)
    return 1.0 / (1.0 / perigee - 0.5 * speed * speed / mu) - perigee


def _track_to(pilot: Pilot, lengths: Array, f: int, length: float, constants: Array) -> Array:
    """Fly up to the end of a free arc of given length."""
    last = pilot.free[f]
    arcs = pilot.arrays.arcs[: last + 1].copy()
    burns = np.flatnonzero(arcs["kind"] == BURN)
    if not burns.size or burns[-1] < int(pilot.start["arc"][0]):
        return np.zeros((0, rollout.TRACK_COLUMNS))
    if arcs[last]["kind"] == COAST:
        arcs = arcs[: int(burns[-1]) + 1]
    part = Pilot(pilot.arrays._replace(arcs=arcs), pilot.start, ())
    known = lengths[: len(part.free)]
    end = len(arcs) - 1
    if arcs[end]["kind"] == BURN and end in pilot.free:
        length = lengths[pilot.free.index(end)] if end != last else length
    else:
        length = float(arcs[end]["duration"])
    times = FreeTimes(known, float(part.begins(known, length)[-1]), _late(part, known, length))
    track = part.fly(times, constants)
    if len(track):
        track = part.fly(part.with_drops(times, track), constants)
    return track.copy()


def _coast_for(pilot: Pilot, lengths: Array, f: int, constants: Array, part: float) -> float:
    """Return the length of a coast, s, from a fraction of a revolution.

    On an eccentric orbit _TO_APOGEE means the next apogee. _TO_PERIGEE means the argument of
    perigee of the target.
    """
    track = _track_to(pilot, lengths, f, 0.0, constants)
    mu = float(pilot.arrays.environment[0]["mu"])
    end = track[-1] if len(track) else None
    r = pilot.start["position"][0] if end is None else end[rollout.POSITION : rollout.VELOCITY]
    v = pilot.start["velocity"][0] if end is None else end[rollout.VELOCITY : rollout.DIRECTION]
    distance = float(np.linalg.norm(r))
    energy = 0.5 * float(v @ v) - mu / distance
    a = -0.5 * mu / energy if energy != 0.0 else math.inf
    if not 0.5 * pilot.parking_m < a < math.inf:
        return abs(part) * pilot.period
    period = math.tau * math.sqrt(a**3 / mu)
    if part == _TO_PERIGEE:
        orbit = Elements.from_state(r, v, mu)
        ahead = float(pilot.arrays.target[0]["argument_of_perigee"])
        ahead -= orbit.argument_of_perigee + orbit.true_anomaly
        return ((ahead / math.tau - _BEFORE_PERIGEE) % 1.0) * period
    if part != _TO_APOGEE or a < _HIGH * pilot.parking_m:
        return part * max(period, pilot.period)
    along = float(r @ v) / math.sqrt(mu * a)
    anomaly = math.atan2(along, 1.0 - distance / a)
    to_apogee = (_TO_APOGEE - (anomaly - along) / math.tau) * period
    return min(to_apogee, _LONGEST_TO_APOGEE * pilot.period)


def _burn_until(pilot: Pilot, lengths: Array, f: int, constants: Array, apogee: float) -> float:
    """Return the length of a free burn, s: to a circular orbit, later to the apogee."""
    k = pilot.free[f]
    most = pilot.longest(k)
    track = _track_to(pilot, lengths, f, most, constants)
    burning = track[track[:, rollout.ARC] == k]
    if not len(burning):
        return 0.5 * most
    mu = float(pilot.arrays.environment[0]["mu"])
    r = burning[:, rollout.POSITION : rollout.POSITION + 3]
    v = burning[:, rollout.VELOCITY : rollout.VELOCITY + 3]
    distance, square = np.linalg.norm(r, axis=1), (v * v).sum(axis=1)
    if pilot.groups[k] == 0 and pilot.ascends:
        above = square * distance / mu - 1.0
    else:
        energy = 0.5 * square - mu / distance
        h = np.linalg.norm(np.cross(r, v), axis=1)
        e = np.sqrt(np.maximum(0.0, 1.0 + 2.0 * energy * h * h / mu**2))
        # the inverse of the apogee radius stays continuous at escape
        above = 1.0 / (_APOGEE * apogee) + 2.0 * energy / (mu * (1.0 + e))
    begin = float(burning[0, rollout.TIME])
    return _first_crossing(burning, above, begin + 0.7 * most) - begin
