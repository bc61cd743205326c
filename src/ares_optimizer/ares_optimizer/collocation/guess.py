# SPDX-License-Identifier: Apache-2.0
"""Fly trial flights by a few steering constants, as first guesses near the target.

A group is the burns between two free coasts. Its pitch and yaw are linear in time, relative to the
horizon in the first group of an ascent and to the velocity otherwise. Least squares on these and on
the lengths of the free burns bring the end near the target.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ares_models.arrays import (
    BURN,
    COAST,
    HEATING_LIMIT,
    NAMES_FLIGHT_PATH_ANGLE,
    NAMES_INCLINATION,
    NAMES_RADIUS,
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    MissionArrays,
    Record,
)
from ares_models.floors import Floor, orbits_of
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.transcription import Times, Transcription
from ares_optimizer.kernels import timetable
from ares_optimizer.kernels.terminal import MAX_ROWS, terminal_rows
from ares_optimizer.plan import free_arcs, last_begin, longest_burn

Array = NDArray[np.float64]

_STEP_S = 8.0
_MOST_ROWS = 30_000
#: Steering constants of a group: pitch and yaw at its begin and at its end.
_CONSTANTS = 4
#: Trial pitch and yaw at begin and end of an ascent, deg.
_ASCENTS = (
    (25.0, 0.0, 0.0, 0.0),
    (40.0, 0.0, -10.0, 0.0),
    (10.0, 0.0, 0.0, 0.0),
    (60.0, 0.0, -20.0, 0.0),
    (-10.0, 0.0, 10.0, 0.0),
)
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
#: End of a coast after the first, as fraction of a revolution from perigee: the apogee.
_TO_APOGEE = 0.5
#: Another trial length of such a coast, fraction of a revolution.
_SOON = 0.12
#: Altitude of a first parking orbit, m.
_PARKING_M = 185e3
#: Least altitude of that orbit above the floor of a coast, m.
_CLEAR_M = 2e4
#: Weights of the least squares in addition to the target: change of the constants and lengths, and
#: depth below the floor in radii.
_KEEP = 3e-3
_DEEP = 3.0
_MOST_ANGLE = 3.0  # rad
#: Most evaluations of the Jacobian.
_EFFORT = 25
#: Miss beyond which the lengths of coasts are varied too.
_FAR = 1e-2
#: Number of steering constants that are kept of several.
_LIKELY = 2
_LONGEST_S = 1e5
#: Length of a burn, relative to the longest, below which it is not needed.
_NEEDLESS = 0.01
#: Fraction of the target's apogee at which a burn towards it ends.
_APOGEE = 0.98
#: Ratio of apogee to perigee from which a coast to apogee is tried.
_HIGH = 1.05


@dataclass(frozen=True)
class Trial:
    """Hold a trial flight.

    Attributes:
        times: its free times.
        track: shape (n, TRACK_COLUMNS), of :mod:`rollout`.
        miss: norm of the errors against target and floors, without unit.
    """

    times: Times
    track: Array
    miss: float


class Pilot:
    """Fly one mission by steering constants.

    Attributes:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        groups: group of each arc.
        count: number of groups.
    """

    def __init__(
        self, arrays: MissionArrays, start: NDArray[np.void], floors: tuple[Floor, ...]
    ) -> None:
        """Group the arcs and choose a first parking orbit.

        Args:
            arrays: the mission.
            start: shape (1,), dtype NAVIGATION.
            floors: of the arcs.
        """
        self.arrays = arrays
        self.start = start
        self.floors = floors
        self._mission = arrays.records()
        self.free = free_arcs(arrays, start[0])
        first = int(start["arc"][0])
        self.groups = np.zeros(len(arrays.arcs), np.int64)
        group, burnt = 0, False
        for k in range(first, len(arrays.arcs)):
            arc = arrays.arcs[k]
            if arc["kind"] == COAST and math.isinf(arc["duration"]) and burnt:
                group += 1
                burnt = False
            burnt = burnt or arc["kind"] == BURN
            self.groups[k] = group
        self.count = group + 1
        self._orbits = orbits_of(arrays, start)
        mu = float(arrays.environment[0]["mu"])
        r, v = start["position"][0], start["velocity"][0]
        h = np.cross(r, v)
        energy = 0.5 * float(v @ v) - mu / float(np.linalg.norm(r))
        e = math.sqrt(max(0.0, 1.0 + 2.0 * energy * float(h @ h) / mu**2))
        #: Perigee and apogee radius, m, and period, s, of a first parking orbit.
        highest = max((f.altitude_m for f in floors if math.isfinite(f.altitude_m)), default=0.0)
        self.parking_m = float(arrays.environment[0]["equatorial_radius"])
        self.parking_m += max(_PARKING_M, highest + _CLEAR_M)
        self.apogee_m = self.parking_m
        for k, orbit in self._orbits.items():
            if self.groups[k] == 1:
                self.parking_m = float(orbit["perigee_radius"][0])
                self.apogee_m = float(orbit["apogee_radius"][0])
                break
        self.period = math.tau * math.sqrt(self.parking_m**3 / mu)
        self.ascends = float(h @ h) / mu / (1.0 + e) < float(arrays.environment[0]["polar_radius"])
        self._segments = np.zeros(timetable.MAX_SEGMENTS, timetable.SEGMENT)
        self._layout = np.zeros(1, timetable.LAYOUT)
        self._track = np.zeros((_MOST_ROWS, rollout.TRACK_COLUMNS))
        self._waiting = [
            j
            for j, jettison in enumerate(arrays.jettisons)
            if jettison["criterion"] == HEATING_LIMIT and not (int(start["jettisoned"][0]) >> j) & 1
        ]

    # ---- lengths and times

    def longest(self, k: int) -> float:
        """Return the longest length of a free arc, s."""
        arc = self.arrays.arcs[k]
        most = float(arc["longest"])
        if arc["kind"] == BURN:
            most = min(most, longest_burn(self.arrays, k))
        return most

    def begins(self, lengths: Array, last: float) -> Array:
        """Return the begin of each arc, and the end of the last, s, shape (arcs + 1,)."""
        arcs = self.arrays.arcs
        times = np.full(len(arcs) + 1, float(self.start["arc_start_time"][0]))
        for k in range(int(self.start["arc"][0]), len(arcs)):
            length = float(arcs[k]["duration"])
            if k == len(arcs) - 1:
                length = last
            elif k in self.free:
                length = float(lengths[self.free.index(k)])
            times[k + 1] = times[k] + length
        return times

    def fly(self, times: Times, constants: Array) -> Array:
        """Fly by four constants per group: pitch and yaw at begin and end, rad.

        Returns:
            track, shape (n, TRACK_COLUMNS), a view; empty if the times are not possible.
        """
        begins = self.begins(times.lengths, 0.0)
        begins[-1] = times.cutoff
        laws = np.zeros((len(self.arrays.arcs), rollout.LAW_COLUMNS))
        first = int(self.start["arc"][0])
        for group in range(self.count):
            members = [k for k in range(first, len(laws)) if self.groups[k] == group]
            burns = [k for k in members if self.arrays.arcs[k]["kind"] == BURN]
            begin = max(begins[burns[0]], float(self.start["time"][0]))
            laws[members, rollout.FROM_VELOCITY] = float(group > 0 or not self.ascends)
            laws[members, rollout.REFERENCE] = begin
            laws[members, rollout.SPAN] = max(1.0, begins[burns[-1] + 1] - begin)
            laws[members, rollout.PITCH : rollout.LAW_COLUMNS] = constants[
                _CONSTANTS * group : _CONSTANTS * (group + 1)
            ]
        ends = begins[1:][self.free] if self.free else np.zeros(1)
        drops = np.concatenate((times.drops, [0.0]))
        rows = rollout.fly_track(
            self.start[0],
            self._mission,
            timetable.Times(timetable.HEATING_PASSIVE, drops, ends, times.cutoff),
            laws,
            _STEP_S,
            self._segments,
            self._layout,
            self._track,
        )
        return self._track[:rows]

    def with_drops(self, times: Times, track: Array) -> Times:
        """Return the times with drops where the heating on a track first meets its limit."""
        arcs = self.arrays.arcs
        drops = []
        for j in self._waiting:
            jettison = self.arrays.jettisons[j]
            index = track[:, rollout.ARC].astype(np.int64)
            lit = (arcs["stage"][index] == jettison["stage"]) & (arcs["kind"][index] == BURN)
            later = arcs["stage"][index] > jettison["stage"]
            allowed = (np.maximum.accumulate(lit | later)) & (
                track[:, rollout.LOG_HEATING] < math.log(float(jettison["value"]))
            )
            at = int(np.argmax(allowed)) if allowed.any() else len(track) - 1
            drops.append(float(track[at, rollout.TIME]))
        return times._replace(drops=self._inside(times, np.array(drops)))

    def _inside(self, times: Times, drops: Array) -> Array:
        """Move drops a little off the begins of arcs, and before the cut-off."""
        begins = self.begins(times.lengths, 0.0)[:-1]
        for i, drop in enumerate(drops):
            near = np.abs(begins - drop) < 0.5
            moved = drop + 0.5 if near.any() else drop
            drops[i] = min(moved, times.cutoff - 1.0)
        return drops

    # ---- least squares

    def miss_of(self, track: Array) -> Array:
        """Return the errors of a track against the target, orbits of coasts, floors and ground."""
        missed = [self._miss(self._mission.target, track[-1])]
        for k, orbit in self._orbits.items():
            # the coast begins at the last row of the burn before it
            before = np.flatnonzero(track[:, rollout.ARC] < k)
            missed.append(self._miss(orbit[0], track[before[-1] if before.size else 0]))
        radius = float(self.arrays.environment[0]["equatorial_radius"])
        deep = [
            _DEEP * max(0.0, floor.altitude_m - self._lowest(track, floor)) / radius
            for floor in self.floors
            if math.isfinite(floor.altitude_m)
        ]
        ground = min(0.0, float(track[:, rollout.ALTITUDE].min())) / radius
        return np.concatenate((*missed, deep, [_DEEP * ground]))

    def _miss(self, target: Record, row: Array) -> Array:
        """Return the errors of a row of a track against a target, record TARGET."""
        c, gradient = np.zeros(MAX_ROWS), np.zeros((MAX_ROWS, 6))
        rows = terminal_rows(
            target,
            float(self.arrays.environment[0]["mu"]),
            tuple(row[rollout.POSITION : rollout.POSITION + 3].tolist()),
            tuple(row[rollout.VELOCITY : rollout.VELOCITY + 3].tolist()),
            c,
            gradient,
        )
        return 0.01 * c[:rows]

    @staticmethod
    def _lowest(track: Array, floor: Floor) -> float:
        there = track[track[:, rollout.ARC] == floor.arc, rollout.ALTITUDE]
        if not floor.said and len(there) and there[0] < floor.altitude_m:
            return math.inf
        return float(there.min(initial=math.inf))

    def aim(self, times: Times, constants: Array, coasts: bool = False) -> tuple[Trial, Array]:
        """Fit constants and lengths by least squares, so that a flight ends near the target.

        Args:
            times: initial times.
            constants: initial constants, shape (4 groups,).
            coasts: vary the lengths of coasts too.

        Returns:
            the flight, and its constants.
        """
        arcs = self.arrays.arcs
        moved = [f for f, k in enumerate(self.free) if coasts or arcs[k]["kind"] == BURN]
        last_free = math.isinf(arcs[-1]["duration"])
        begins = self.begins(times.lengths, 0.0)
        last = times.cutoff - float(begins[-1])
        sizes = [min(self.longest(self.free[f]), _LONGEST_S) for f in moved]
        sizes += [longest_burn(self.arrays, len(arcs) - 1)] if last_free else []
        shares = [times.lengths[f] for f in moved] + ([last] if last_free else [])
        least = [float(arcs[self.free[f]]["shortest"]) for f in moved] + [0.0] * last_free
        n = constants.size
        x0 = np.concatenate((constants, np.array(shares) / np.array(sizes) if sizes else []))
        low = np.full(x0.size, -_MOST_ANGLE)
        low[n:] = [
            min(max(1e-3, shortest / size), 1.0 - 1e-5)
            for shortest, size in zip(least, sizes, strict=True)
        ]
        high = np.concatenate((np.full(n, _MOST_ANGLE), np.ones(len(sizes))))
        x0 = np.clip(x0, low + 1e-6, high - 1e-6)

        def times_of(x: Array) -> Times:
            lengths = times.lengths.copy()
            lengths[moved] = x[n : n + len(moved)] * sizes[: len(moved)]
            end = x[-1] * sizes[-1] if last_free else last
            return times._replace(
                lengths=lengths, cutoff=float(self.begins(lengths, 0.0)[-1] + end)
            )

        def residual(x: Array) -> Array:
            track = self.fly(times_of(x), x[:n])
            if not len(track):
                return np.full(count, 1e3)
            return np.concatenate((self.miss_of(track), _KEEP * (x - x0)))

        track = self.fly(times_of(x0), x0[:n])
        if not len(track):
            return Trial(times, track.copy(), math.inf), constants
        count = self.miss_of(track).size + x0.size
        found = least_squares(
            residual,
            x0,
            bounds=(low, high),
            max_nfev=_EFFORT,
            x_scale=0.3,
            diff_step=np.full(x0.size, 1e-6),
        )
        there = times_of(found.x)
        track = self.fly(there, found.x[:n])
        if not len(track):
            return Trial(times, track.copy(), math.inf), constants
        there = self.with_drops(there, track)
        again = self.fly(there, found.x[:n])
        if len(again):
            track = again
        miss = float(np.linalg.norm(self.miss_of(track)))
        return Trial(there, track.copy(), miss), found.x[:n]


def target_energy(arrays: MissionArrays) -> float:
    """Return the specific energy of the target orbit, m2/s2."""
    target = arrays.target[0]
    mu = float(arrays.environment[0]["mu"])
    if target["kind"] in (TARGET_ELEMENTS,):
        return 0.5 * float(target["c3"])
    if target["kind"] == TARGET_KEPLERIAN:
        return -0.5 * mu / float(target["semi_major_axis"])
    return 0.5 * float(target["speed"]) ** 2 - mu / float(target["radius"])


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
    arrays: MissionArrays, start: NDArray[np.void], floors: tuple[Floor, ...]
) -> Iterator[Trial]:
    """Fly first guesses of a search, the likeliest first.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        floors: of the arcs.
    """
    pilot = Pilot(arrays, start, floors)
    coasts = [k for k in pilot.free if arrays.arcs[k]["kind"] == COAST]
    tried: set[tuple[float, ...]] = set()
    likely: list[_Begin] = []
    for begins, parts in _choices(pilot, coasts):
        found = []
        for begin in likely if coasts and len(begins) > _LIKELY and likely else begins:
            constants, known = begin
            times = _first_times(pilot, constants, known, dict(zip(coasts, parts, strict=True)))
            key = () if times is None else (*constants, *np.round(times.lengths, 0))
            if times is None or key in tried:
                continue
            tried.add(key)
            trial, there = pilot.aim(times, constants)
            if math.isfinite(trial.miss):
                found.append((trial, there, begin))
        found.sort(key=lambda one: one[0].miss)
        if len(found) > _LIKELY:
            likely = [begin for _, _, begin in found[:_LIKELY]]
        if not coasts:
            yield from (trial for trial, _, _ in found)
        elif found:
            # with coasts the choice is their length, without them the steering
            trial, constants, _ = found[0]
            if trial.miss > _FAR:
                again, _ = pilot.aim(trial.times, constants, coasts=True)
                trial = min(trial, again, key=lambda one: one.miss)
            yield trial


#: Initial steering constants, and the known lengths of free arcs, s, by arc.
_Begin = tuple[Array, dict[int, float]]


def _choices(pilot: Pilot, coasts: list[int]) -> Iterator[tuple[list[_Begin], tuple[float, ...]]]:
    """Yield initial steering, with lengths of the free coasts as fractions of a revolution."""
    if not coasts:
        yield list(_start_constants(pilot)), ()
        return
    parking = _ascent_alone(pilot, pilot.apogee_m)
    ascents = [parking] if parking is not None else list(_start_constants(pilot))
    longest = pilot.longest(coasts[0]) / pilot.period
    firsts = [*COASTS, *(part for part in _LATER_COASTS if part < longest)]
    later = len(coasts) - 1
    yield ascents, (firsts[0], *([_TO_APOGEE] * later))
    apogee = _target_apogee(pilot.arrays)
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


def _start_constants(pilot: Pilot) -> Iterator[tuple[Array, dict[int, float]]]:
    """Yield initial steering constants, without known lengths."""
    for angles in _ASCENTS if pilot.ascends else _BURNS:
        constants = np.zeros(_CONSTANTS * pilot.count)
        constants[:_CONSTANTS] = np.radians(angles)
        yield constants, {}


def _ascent_alone(pilot: Pilot, apogee: float) -> _Begin | None:
    """Fit the first group to a low orbit, if a free burn ends it and a group follows.

    Args:
        pilot: of the mission.
        apogee: apogee radius of that orbit, m; inf: with the energy of the target.
    """
    arrays, start = pilot.arrays, pilot.start
    arcs = arrays.arcs
    first = int(start["arc"][0])
    members = [k for k in range(first, len(arcs)) if pilot.groups[k] == 0]
    last = max(k for k in members if arcs[k]["kind"] == BURN)
    if pilot.count == 1 or not pilot.ascends or not math.isinf(arcs[last]["duration"]):
        return None
    environment = arrays.environment[0]
    radius, mu = pilot.parking_m, float(environment["mu"])
    r, v = start["position"][0], start["velocity"][0]
    h = np.cross(r, v)
    target = arrays.target.copy()
    target["kind"] = TARGET_RADIUS_SPEED_ANGLE_INCLINATION
    target["radius"] = radius
    energy = -mu / (radius + apogee) if apogee < math.inf else target_energy(arrays)
    target["speed"] = math.sqrt(max(2.0 * (energy + mu / radius), mu / radius))
    target["flight_path_angle"] = 0.0
    target["inclination"] = math.acos(float(h[2] / np.linalg.norm(h)))
    alone = arrays._replace(arcs=arcs[: last + 1].copy(), target=target)
    best = _aimed(alone, start)
    needless = _NEEDLESS * pilot.longest(last)
    if best is not None and best[0].times.cutoff < needless + _last_begin(alone, start, best[0]):
        # the burns of fixed length suffice: leave the speed free
        target["kind"] = TARGET_ELEMENTS
        target["named"] = NAMES_RADIUS | NAMES_FLIGHT_PATH_ANGLE | NAMES_INCLINATION
        best = _aimed(alone, start, needless) or best
    if best is None:
        return None
    trial, constants = best
    whole = np.zeros(_CONSTANTS * pilot.count)
    whole[: constants.size] = constants
    lengths = dict(zip(free_arcs(alone, start[0]), trial.times.lengths, strict=True))
    lengths[last] = trial.times.cutoff - _last_begin(alone, start, trial)
    return whole, lengths


def _last_begin(arrays: MissionArrays, start: NDArray[np.void], trial: Trial) -> float:
    """Return the begin of the last arc of a flight, s."""
    return last_begin(arrays, start[0], trial.times.lengths)


def _aimed(
    alone: MissionArrays, start: NDArray[np.void], last: float | None = None
) -> tuple[Trial, Array] | None:
    """Return the best fit of a mission of one group, and its constants.

    Args:
        alone: the mission.
        start: shape (1,), dtype NAVIGATION.
        last: initial length of its last burn, s; None: until the energy is reached.
    """
    part = Pilot(alone, start, ())
    best: tuple[Trial, Array] | None = None
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
) -> Times | None:
    """Return initial times: each burn ends on the orbit that its place requires."""
    arrays = pilot.arrays
    arcs = arrays.arcs
    mu = float(arrays.environment[0]["mu"])
    lengths = np.array(
        [
            0.5 * pilot.longest(k) if arcs[k]["kind"] == BURN else float(arcs[k]["shortest"])
            for k in pilot.free
        ]
    )
    wanted = target_energy(arrays)
    apogee = _target_apogee(arrays)
    last_free = math.isinf(arcs[-1]["duration"])
    last = longest_burn(arrays, len(arcs) - 1) if last_free else float(arcs[-1]["duration"])
    for f, k in enumerate(pilot.free):
        low = max(float(arcs[k]["shortest"]), 1e-3)
        if k in known:
            lengths[f] = known[k]
        elif arcs[k]["kind"] == COAST:
            lengths[f] = _coast_for(pilot, lengths, f, constants, coasts[k])
        else:
            lengths[f] = _burn_until(pilot, lengths, f, constants, apogee)
        lengths[f] = min(max(lengths[f], low), pilot.longest(k))
    times = Times(lengths, float(pilot.begins(lengths, last)[-1]), _late(pilot, lengths, last))
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


def _late(pilot: Pilot, lengths: Array, last: float) -> Array:
    """Return drops just before the cut-off, s."""
    return np.full(len(pilot._waiting), float(pilot.begins(lengths, last)[-1]) - 1.0)


def _target_apogee(arrays: MissionArrays) -> float:
    """Return the apogee radius of the target, m; inf: escape, or not named."""
    target = arrays.target[0]
    mu = float(arrays.environment[0]["mu"])
    if target["kind"] == TARGET_ELEMENTS:
        return float(target["apogee_radius"])
    energy = target_energy(arrays)
    return -mu / energy if energy < 0.0 else math.inf


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
    times = Times(known, float(part.begins(known, length)[-1]), _late(part, known, length))
    track = part.fly(times, constants)
    if len(track):
        track = part.fly(part.with_drops(times, track), constants)
    return track.copy()


def _coast_for(pilot: Pilot, lengths: Array, f: int, constants: Array, part: float) -> float:
    """Return the length of a coast, s, from a fraction of a revolution.

    On an eccentric orbit _TO_APOGEE means the next apogee.
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
        return part * pilot.period
    period = math.tau * math.sqrt(a**3 / mu)
    if part != _TO_APOGEE or a < _HIGH * pilot.parking_m:
        return part * max(period, pilot.period)
    along = float(r @ v) / math.sqrt(mu * a)
    anomaly = math.atan2(along, 1.0 - distance / a)
    return (_TO_APOGEE - (anomaly - along) / math.tau) * period


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


def guess_of(program: Transcription, trial: Trial) -> Array:
    """Convert a trial flight to variables of a program.

    Args:
        program: transcribed for the times of the flight.
        trial: the flight.
    """
    x = np.zeros(program.size)
    pieces = program.segments
    for p, piece in enumerate(pieces):
        length = float(piece["end"] - piece["start"])
        x[program.lengths[p]] = length / program.time
        x[program.masses[p]] = float(piece["mass"]) / program.mass
        x[program.ends[p]] = timetable.segment_mass(piece, piece["end"]) / program.mass
    times = node_times(program)
    track = trial.track
    _, rows = np.unique(track[:, rollout.TIME], return_index=True)
    track = track[rows]
    states = np.column_stack(
        [np.interp(times, track[:, rollout.TIME], track[:, rollout.POSITION + c]) for c in range(6)]
    )
    states[:, :3] /= program.radius
    states[:, 3:] /= program.speed
    x[: 6 * program.nodes] = states.ravel()
    directions = np.column_stack(
        [
            np.interp(times, track[:, rollout.TIME], track[:, rollout.DIRECTION + c])
            for c in range(3)
        ]
    )
    directions /= np.maximum(np.linalg.norm(directions, axis=1), 1e-9)[:, None]
    for point in program.points:
        if point["control"] >= 0:
            at = int(point["control"])
            x[at : at + 3] = directions[int(point["node"] + point["number"])]
    return x


def node_times(program: Transcription, lengths: Array | None = None) -> Array:
    """Return the mission elapsed time of each state, s, shape (nodes,).

    Args:
        program: the program.
        lengths: of the phases, s; None: those of the trial flight.
    """
    pieces = program.segments
    if lengths is None:
        lengths = pieces["end"] - pieces["start"]
    begins = float(program.start["time"][0]) + np.concatenate(([0.0], np.cumsum(lengths)))
    times = np.empty(program.nodes)
    times[0] = begins[0]
    for point in program.points:
        p = int(point["phase"])
        times[int(point["node"] + point["number"])] = begins[p] + point["fraction"] * lengths[p]
    return times
