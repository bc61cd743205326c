# SPDX-License-Identifier: Apache-2.0
"""Fly trial flights by a few steering constants, and fit them so that the end is near the target.

A group is the burns between two free coasts. Its pitch and yaw are linear in time, relative to the
horizon in the first group of an ascent and to the velocity otherwise. From the ground the pitch
falls from the vertical as a power of time, in the plane of the target. Least squares on these and
on the lengths of the free burns bring the end near the target.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import least_squares

from ares_models.arrays import (
    BURN,
    COAST,
    HEADINGS,
    HEADS_SOUTH,
    NAMES_ASCENDING_NODE,
    NAMES_INCLINATION,
    MissionArrays,
    Record,
)
from ares_models.floors import Floor, edge_of_air, orbits_of
from ares_models.kernels.environment import altitude
from ares_models.kernels.judging import judged_by
from ares_models.kernels.targets import named_plane
from ares_models.plans import flies_in_air
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.transcription import FreeTimes, segments_of
from ares_optimizer.kernels import timetable
from ares_optimizer.kernels.terminal import MAX_ROWS, terminal_rows
from ares_optimizer.plan import free_arcs, longest_burn, waiting_for_heating
from ares_optimizer.results import SAME_LENGTH

Array = NDArray[np.float64]
_STEP_S = 8.0
_AIR_STEP_S = 4.0
_MOST_ROWS = 30_000
#: Steering constants of a group: pitch and yaw at its begin and at its end.
CONSTANTS = 4
#: Relative difference of lengths up to which two flights are alike.
_ALIKE = 0.2
#: Altitude of a first parking orbit, m.
_PARKING_M = 185e3
#: Least altitude of that orbit above the floor of a coast, m.
_CLEAR_M = 2e4
#: Weights of the least squares in addition to the target: change of the constants and lengths,
#: depth below the floor in radii, and excess of propellant as a share.
_KEEP = 3e-3
_DEEP = 3.0
_OVERDRAWN = 0.3
_MOST_ANGLE = 3.0  # rad
#: Most evaluations of the Jacobian.
_EFFORT = 25
_LONGEST_S = 1e5
#: Altitude, m, and speed over ground, m/s, below which an ascent begins on the ground.
_LOW_M = 2e4
_SLOW_M_S = 300.0
#: Time between a first guess of a drop and any other event, s.
_OFF_EVENTS_S = 0.5
#: Length of a burn, relative to the longest, below which it has vanished.
_VANISHED = 1e-4
#: Depth below the ground of a track that meets it, m.
_DEEP_M = 1e3
#: Sine of the heading up to which a plane over the pad leads to the east or west.
_EAST = 1e-3


@dataclass(frozen=True)
class TrialFlight:
    """Hold a trial flight.

    Attributes:
        times: its free times.
        track: shape (n, TRACK_COLUMNS), of :mod:`rollout`.
        miss: norm of the errors against target and floors, without unit.
        limited: it keeps the pressure limits, and above the ground.
        turned: it begins with a zero-lift turn, which keeps those of the angle of attack.
        met: number of first guesses that led to it.
        near: it reaches the target but for its transcription.
    """

    times: FreeTimes
    track: Array
    miss: float
    limited: bool = False
    turned: bool = False
    met: int = 1
    near: bool = False


def are_alike(one: Array, other: Array) -> bool:
    """Return true if free lengths differ so little that starts from both are much the same."""
    return bool((np.abs(one - other) < _ALIKE * other + 1.0).all())


def without_repeats(track: Array) -> Array:
    """Return the rows of a track in order of time, one for each instant."""
    _, rows = np.unique(track[:, rollout.TIME], return_index=True)
    return track[rows]


def path_of(track: Array) -> CubicHermiteSpline:
    """Interpolate the positions of a track without repeats; its derivative is the velocity."""
    return CubicHermiteSpline(
        track[:, rollout.TIME],
        track[:, rollout.POSITION : rollout.VELOCITY],
        track[:, rollout.VELOCITY : rollout.DIRECTION],
    )


class Pilot:
    """Fly one mission by steering constants.

    Attributes:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        groups: group of each arc.
        count: number of groups.
        energy: specific, of the orbit at the start, m2/s2.
        eccentricity: of that orbit.
    """

    def __init__(
        self,
        arrays: MissionArrays,
        start: NDArray[np.void],
        floors: tuple[Floor, ...],
        turns: bool = False,
    ) -> None:
        """Group the arcs and choose a first parking orbit.

        Args:
            arrays: the mission.
            start: shape (1,), dtype NAVIGATION.
            floors: of the arcs.
            turns: an ascent from the ground begins with a zero-lift turn.
        """
        self.arrays = arrays
        self.turns = turns
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
        energy = self.energy = 0.5 * float(v @ v) - mu / float(np.linalg.norm(r))
        e = self.eccentricity = math.sqrt(max(0.0, 1.0 + 2.0 * energy * float(h @ h) / mu**2))
        highest = max((f.altitude_m for f in floors if math.isfinite(f.altitude_m)), default=0.0)
        radius = float(arrays.environment[0]["equatorial_radius"])
        self._above_floors_m = highest + _CLEAR_M
        #: Perigee and apogee radius, m, and period, s, of a first parking orbit.
        self.parking_m = self.apogee_m = radius + max(_PARKING_M, self._above_floors_m)
        orbit = next((orbit for k, orbit in self._orbits.items() if self.groups[k] == 1), None)
        #: The mission prescribes that orbit.
        self.parks = orbit is not None
        if orbit is not None:
            self.parking_m = float(orbit["perigee_radius"][0])
            self.apogee_m = float(orbit["apogee_radius"][0])
        self.period = math.tau * math.sqrt(self.parking_m**3 / mu)
        self.ascends = float(h @ h) / mu / (1.0 + e) < float(arrays.environment[0]["polar_radius"])
        #: Plane of an ascent from the ground, a unit vector; None: it begins above the air.
        self.plane = plane_from_ground(arrays, start)
        self._segments = np.zeros(timetable.MAX_SEGMENTS, timetable.SEGMENT)
        self._layout = np.zeros(1, timetable.LAYOUT)
        self._track = np.zeros((_MOST_ROWS, rollout.TRACK_COLUMNS))
        self._waiting = waiting_for_heating(arrays, start[0])
        burns = [k for k in self.free if arrays.arcs[k]["kind"] == BURN]
        stages = arrays.arcs["stage"]
        #: Free burns of each stage before the last that has several.
        self._sharing = [
            members
            for stage in sorted({int(stages[k]) for k in burns} - {int(stages[-1])})
            if len(members := [k for k in burns if stages[k] == stage]) > 1
        ]

    @property
    def clear_m(self) -> float:
        """Return a radius clear of the air and of the floors, m."""
        radius = float(self.arrays.environment[0]["equatorial_radius"])
        return radius + max(edge_of_air(self.arrays) + _CLEAR_M, self._above_floors_m)

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

    def fly(self, times: FreeTimes, constants: Array) -> Array:
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
            frame = rollout.FROM_HORIZON if self.ascends else rollout.FROM_VELOCITY
            if group > 0:
                frame = rollout.FROM_VELOCITY
            elif self.plane is not None:
                frame = rollout.TURN if self.turns else rollout.FROM_PAD
                laws[members, rollout.NORMAL : rollout.LAW_COLUMNS] = self.plane
            laws[members, rollout.FRAME] = frame
            laws[members, rollout.REFERENCE] = begin
            if frame == rollout.TURN:
                upright = [begins[k + 1] for k in members if self.arrays.arcs[k]["vertical"]]
                laws[members, rollout.REFERENCE] = max([begin, *upright])
            laws[members, rollout.SPAN] = max(1.0, begins[burns[-1] + 1] - begin)
            laws[members, rollout.PITCH : rollout.NORMAL] = constants[
                CONSTANTS * group : CONSTANTS * (group + 1)
            ]
        ends = begins[1:][self.free] if self.free else np.zeros(1)
        drops = np.concatenate((times.drops, [0.0]))
        rows = rollout.fly_track(
            self.start[0],
            self._mission,
            timetable.Times(timetable.HEATING_PASSIVE, drops, ends, times.cutoff),
            laws,
            _STEP_S if self.plane is None else _AIR_STEP_S,
            self._segments,
            self._layout,
            self._track,
        )
        return self._track[:rows]

    def angle_in_thin_air(self, track: Array) -> float:
        """Return the flight-path angle at which a track enters thin air, rad; -pi/2: never."""
        thin = track[:, rollout.ALTITUDE] > rollout.THIN_AIR_M
        if not thin.any() or track[: int(np.argmax(thin)) + 1, rollout.ALTITUDE].min() < -_DEEP_M:
            return -0.5 * math.pi
        row = track[int(np.argmax(thin))]
        r, v = (row[at : at + 3] for at in (rollout.POSITION, rollout.VELOCITY))
        rate = float(self.arrays.environment[0]["rotation_rate"])
        air = v - np.cross([0.0, 0.0, rate], r)
        return math.asin(float(r @ air) / float(np.linalg.norm(r) * np.linalg.norm(air)))

    def with_drops(self, times: FreeTimes, track: Array) -> FreeTimes:
        """Return the times with drops where the heating on a track first meets its limit.

        From the pad, where there is none at first, that is after its peak in the ascent.
        """
        arcs = self.arrays.arcs
        drops = []
        past = np.ones(len(track), bool)
        if self.plane is not None:
            heating = track[:, rollout.LOG_HEATING]
            ascent = self.groups[track[:, rollout.ARC].astype(np.int64)] == 0
            past[: int(np.argmax(np.where(ascent, heating, -math.inf)))] = False
        for j in self._waiting:
            jettison = self.arrays.jettisons[j]
            index = track[:, rollout.ARC].astype(np.int64)
            lit = (arcs["stage"][index] == jettison["stage"]) & (arcs["kind"][index] == BURN)
            later = arcs["stage"][index] > jettison["stage"]
            cool = past & (track[:, rollout.LOG_HEATING] < math.log(float(jettison["value"])))
            allowed = np.maximum.accumulate(lit | later) & cool
            at = int(np.argmax(allowed)) if allowed.any() else len(track) - 1
            drops.append(float(track[at, rollout.TIME]))
        return times._replace(drops=self.inside(times, np.array(drops)))

    def has_needless_burn(self, times: FreeTimes) -> bool:
        """Return true if a free burn nearly vanishes: the others have energy to spare."""
        last = len(self.arrays.arcs) - 1
        lengths = dict(zip(self.free, times.lengths, strict=True))
        if math.isinf(self.arrays.arcs[last]["duration"]):
            lengths[last] = times.cutoff - float(self.begins(times.lengths, 0.0)[-1])
        burns = [k for k in lengths if self.arrays.arcs[k]["kind"] == BURN]
        return any(lengths[k] < _VANISHED * self.longest(k) for k in burns)

    def inside(self, times: FreeTimes, drops: Array) -> Array:
        """Move drops a little off all other events, and before the cut-off.

        With another event, a drop would be no event of its own, without its limit of the heating.
        """
        others = times._replace(drops=np.full(len(drops), math.inf))
        events = segments_of(self.arrays, self.start, others)["start"]
        for i, drop in enumerate(drops):
            moved = drop
            while (np.abs(events - moved) < _OFF_EVENTS_S - SAME_LENGTH).any():
                moved += _OFF_EVENTS_S
            drops[i] = min(moved, times.cutoff - 1.0)
        return drops

    # ---- least squares

    def miss_of(self, track: Array, times: FreeTimes) -> Array:
        """Return the errors of a track against target, orbits of coasts, floors and propellant.

        Args:
            track: flown.
            times: its free times.
        """
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
        return np.concatenate((*missed, deep, [_DEEP * ground], self._overdrawn(times.lengths)))

    def _overdrawn(self, lengths: Array) -> Array:
        """Return the excess of propellant of each stage that several free burns share."""
        arcs, excess = self.arrays.arcs, []
        for members in self._sharing:
            burnt = sum(float(arcs[k]["mass_flow"] * lengths[self.free.index(k)]) for k in members)
            excess.append(max(0.0, burnt / float(arcs[members[0]]["propellant"]) - 1.0))
        return _OVERDRAWN * np.array(excess)

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

    def aim(
        self, times: FreeTimes, constants: Array, coasts: bool = False
    ) -> tuple[TrialFlight, Array]:
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
        for i, f in enumerate(moved):
            if arcs[self.free[f]]["kind"] == COAST:
                # not by a revolution
                middle = min(max(x0[n + i], low[n + i]), 1.0)
                near = middle + np.array((-0.5, 0.5)) * self.period / sizes[i]
                low[n + i], high[n + i] = max(low[n + i], near[0]), min(1.0, near[1])
        x0 = np.clip(x0, low + 1e-6, high - 1e-6)

        def times_of(x: Array) -> FreeTimes:
            lengths = times.lengths.copy()
            lengths[moved] = x[n : n + len(moved)] * sizes[: len(moved)]
            end = x[-1] * sizes[-1] if last_free else last
            return times._replace(
                lengths=lengths, cutoff=float(self.begins(lengths, 0.0)[-1] + end)
            )

        def residual(x: Array) -> Array:
            there = times_of(x)
            track = self.fly(there, x[:n])
            missed = self.miss_of(track, there) if len(track) else np.full(1, math.nan)
            if not np.isfinite(missed).all():
                return np.full(count, 1e3)
            return np.concatenate((missed, _KEEP * (x - x0)))

        there = times_of(x0)
        track = self.fly(there, x0[:n])
        missed = self.miss_of(track, there) if len(track) else np.full(1, math.nan)
        if not np.isfinite(missed).all():
            return TrialFlight(times, track.copy(), math.inf), constants
        count = missed.size + x0.size
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
            return TrialFlight(times, track.copy(), math.inf), constants
        there = self.with_drops(there, track)
        again = self.fly(there, found.x[:n])
        if len(again):
            track = again
        miss = float(np.linalg.norm(self.miss_of(track, there)))
        return TrialFlight(there, track.copy(), miss, turned=self.turns), found.x[:n]


def plane_from_ground(arrays: MissionArrays, start: NDArray[np.void]) -> Array | None:
    """Return the normal of the plane in which an ascent from the ground leaves, a unit vector.

    It is the plane of the target if that is named, one of its inclination through the start, or the
    plane of the initial motion.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.

    Returns:
        None if the first burn begins in thin air or fast.
    """
    r, v = start["position"][0], start["velocity"][0]
    environment, target = arrays.environment[0], arrays.target[0]
    ground = float(altitude(tuple(r.tolist()), environment))
    relative = np.linalg.norm(v - np.cross([0.0, 0.0, float(environment["rotation_rate"])], r))
    if not flies_in_air(arrays.arcs) or ground > _LOW_M or relative > _SLOW_M_S:
        return None
    named = int(judged_by(target))
    along = v if np.linalg.norm(v) > 0.0 else np.cross([0.0, 0.0, 1.0], r)
    normal = np.cross(r, along)
    up = r / np.linalg.norm(r)
    if named & NAMES_INCLINATION:
        tilt = float(target["inclination"])
        if named & NAMES_ASCENDING_NODE:
            normal = np.array(named_plane(target))
            normal = normal - (normal @ up) * up
        else:
            east = np.cross([0.0, 0.0, 1.0], up)
            east /= max(float(np.linalg.norm(east)), 1e-9)
            north = np.cross(up, east)
            across = math.hypot(up[0], up[1])
            sine = min(max(math.cos(tilt) / max(across, 1e-9), -1.0), 1.0)
            to_pole = -1.0 if int(target["named"]) & HEADS_SOUTH else 1.0
            heading = sine * east + to_pole * math.sqrt(1.0 - sine * sine) * north
            normal = np.cross(up, heading)
    return np.asarray(normal / np.linalg.norm(normal))


def is_reversed(arrays: MissionArrays, start: NDArray[np.void], end: Array) -> bool:
    """Return true if a flight ends in another plane than asked, or there the other way round.

    The equations of a named plane hold both ways round, and those of an inclination in both planes
    over a pad.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        end: position and velocity at the end, shape (6,).
    """
    target = arrays.target[0]
    normal = np.cross(end[:3], end[3:])
    if names_plane(arrays):
        return bool(normal @ np.array(named_plane(target)) < 0.0)
    heading = int(target["named"]) & HEADINGS
    # in flight the heading changes along the orbit
    if not heading or plane_from_ground(arrays, start) is None:
        return False
    r = start["position"][0]
    northward = np.cross(normal, r)[2] / (np.linalg.norm(normal) * np.linalg.norm(r))
    return bool((-northward if heading == HEADS_SOUTH else northward) < -_EAST)


def names_plane(arrays: MissionArrays) -> bool:
    """Return true if the target names its plane."""
    plane = NAMES_INCLINATION | NAMES_ASCENDING_NODE
    return int(judged_by(arrays.target[0])) & plane == plane


def floors_on(floors: tuple[Floor, ...], start_m: float, trial: TrialFlight) -> tuple[Floor, ...]:
    """Return the active floors: in the ascent a coast may be below the default floor.

    Args:
        floors: of the mission.
        start_m: altitude at the start.
        trial: a flight.
    """
    kept = []
    for floor in floors:
        arcs, heights = trial.track[:, rollout.ARC], trial.track[:, rollout.ALTITUDE]
        before = heights[arcs < floor.arc]
        highest = max(start_m, float(before.max(initial=-math.inf)))
        if floor.said or highest >= floor.altitude_m:
            kept.append(floor)
    return tuple(kept)
