# SPDX-License-Identifier: Apache-2.0
"""Plans and initial guesses that a guidance law takes from an optimized trajectory."""

import math
from dataclasses import dataclass, field, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_guidance.arrays import PLAN, PROGRAMME
from ares_guidance.floor import check_floor, held_burns, lifted
from ares_models.arrays import (
    BURN,
    COAST,
    MAX_PROGRAMME,
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_ASCENDING_NODE,
    NAMES_INCLINATION,
    NAVIGATION,
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    MissionArrays,
    Record,
)
from ares_models.kernels.aerodynamics import body_force, pressure_loss
from ares_models.kernels.boost import is_over
from ares_models.kernels.environment import relative_velocity
from ares_models.kernels.judging import judged_by
from ares_models.kernels.sequence import drop_time, last_ignition
from ares_models.kernels.vectors import norm
from ares_models.mission_target import leaves_end_free
from ares_models.orbits import Elements, Insertion
from ares_models.plans import LONG_COAST_S, coasts_long, flies_in_air, leaves_arcs_free, needs_plan

Array = NDArray[np.float64]

#: Largest time difference between a sample and the requested time, s.
SAME_TIME = 0.01
#: Largest difference between initial and measured mass, as a fraction.
SAME_MASS = 1e-3
#: Largest deviation of a direction's length from 1, and largest direction rate, 1/s.
ABOUT_UNIT = 1e-3
FASTEST_TURN = 1.0
#: Eccentricity above which a leg constrains the argument of perigee. Later burns rotate the apsides
#: of a rounder orbit at little cost.
ELONGATED = 0.5
#: Eccentricity above which a leg before a coast that touches its floor constrains the perigee: a
#: burn that lacks energy lowers the apogee then.
OVAL = 0.1
#: Eccentricity below which an orbit is nearly a circle.
ROUND = 0.02
#: Acceleration by the forces of the air below which a law takes over from the programme, m/s2.
HANDED_OVER_M_S2 = 0.01
#: Later hand-overs in each burn, and the share of a burn that is not fixed up to which they go.
LATER = 8
LATEST_SHARE = 0.75
#: Time difference that is rounding, s.
TIME_ROUNDING = 1e-6
#: Smallest mass drop that counts as staging, as a fraction of the mass; rounding is smaller.
LEAST_DROP = 1e-6


def true_anomaly_of(state: Insertion, mu: float) -> float:
    """Return the true anomaly of a state, rad; mu in m3/s2."""
    momentum = state.radius * state.speed * math.cos(state.flight_path_angle)
    towards = momentum**2 / (mu * state.radius) - 1.0
    ahead = momentum * state.speed * math.sin(state.flight_path_angle) / mu
    return math.atan2(ahead, towards)


def names_perigee_direction(target: np.void) -> bool:
    """Return whether a target constrains the direction of its perigee."""
    named = bool(int(target["named"]) & NAMES_ARGUMENT_OF_PERIGEE)
    return named or bool(target["kind"] == TARGET_KEPLERIAN)


def _expect(sound: NDArray[np.bool_], name: str, expected: str) -> None:
    """Raise ValueError unless all elements of a mask are true."""
    if not np.all(sound):
        raise ValueError(f"{name}: expected {expected}")


class Programme(NamedTuple):
    """Hold an attitude programme, one entry per knot.

    Attributes:
        arc: index into the mission's arcs.
        time: mission elapsed time as planned, s.
        speed: in the air, m/s.
        direction: of the thrust, unit vectors, shape (n, 3).
        state: planned navigation state at the hand-over, shape (1,), dtype NAVIGATION.
    """

    arc: NDArray[np.int64]
    time: Array
    speed: Array
    direction: Array
    state: NDArray[np.void]

    def record(self) -> NDArray[np.void]:
        """Return the programme for the kernels, shape (1,), dtype PROGRAMME."""
        record = np.zeros(1, PROGRAMME)
        count = len(self.time)
        record["count"] = count
        for name in ("arc", "time", "speed", "direction"):
            record[name][0, :count] = getattr(self, name)
        return record

    def thinned(self, most: int) -> "Programme":
        """Return the programme with at most so many knots; the ends of arcs are kept."""
        stride = math.ceil(len(self.time) / (most - 2 * len(np.unique(self.arc))))
        inside = np.arange(len(self.time)) % max(1, stride) == 0
        ends = np.append(np.diff(self.arc) != 0, True)
        keep = inside | ends | np.append(True, ends[:-1])
        return self._replace(
            arc=self.arc[keep],
            time=self.time[keep],
            speed=self.speed[keep],
            direction=self.direction[keep],
        )


@dataclass(frozen=True)
class ArcPlan:
    """Plan a mission that leaves more free than the end of its last arc.

    All dictionaries have the index into the mission's arcs as key.

    Attributes:
        lengths_s: length of each free arc and each held burn.
        ends: state at the end of each burn that ends a leg, and of the last arc if the target
            leaves the place on its orbit free.
        directions: first and last thrust direction of the leg that ends with the arc, shape
            (2, 3), where known.
        positions: position at the end of that leg, m, shape (3,), where known; and at the end of
            each free coast, if the target constrains the direction of its perigee.
        primers: primer at the start of each burn's thrust, a unit vector, and its rate, 1/s,
            shape (2, 3); nan: not known.
        ignitions: start of each burn's thrust, mission elapsed time, s.
        jettison_time_s: mission elapsed time; nan: not known, or no heating jettison.
        first_arc: index of the arc in which the plan begins; earlier arcs are over.
        resumes: it begins with neither the first arc nor the end of the mission's boost programme.
        by_legs: law `optimal` flies leg by leg too, instead of solving for the whole flight in
            each cycle: the plan satisfies constraints that the on-board problem lacks.
        orbits: orbit at the end of each burn that ends a leg, where known.
        held: burns before a coast that is long or touches its floor, or before a burn that dips.
            Each ends a leg, even if its length is fixed.
        floored: those before a coast that touches its floor.
        programmes: attitude in the air, and from the second on beyond it, from which a law takes
            the first that leaves it a way to the planned end; none: the flight is above the air.
        arc_ends_s: planned end of each arc, mission elapsed time.
        arc_ends_kg: planned mass there, before anything is dropped.
    """

    lengths_s: dict[int, float]
    ends: dict[int, Insertion]
    directions: dict[int, Array] = field(default_factory=dict)
    positions: dict[int, Array] = field(default_factory=dict)
    primers: dict[int, Array] = field(default_factory=dict)
    ignitions: dict[int, float] = field(default_factory=dict)
    jettison_time_s: float = math.nan
    first_arc: int = 0
    resumes: bool = False
    by_legs: bool = False
    orbits: dict[int, Elements] = field(default_factory=dict)
    held: frozenset[int] = frozenset()
    floored: frozenset[int] = frozenset()
    programmes: tuple[Programme, ...] = ()
    arc_ends_s: dict[int, float] = field(default_factory=dict)
    arc_ends_kg: dict[int, float] = field(default_factory=dict)

    def record(self, arrays: MissionArrays, holds_plane: bool = False) -> NDArray[np.void]:
        """Return the plan for the kernels, shape (1,), dtype PLAN.

        Args:
            arrays: the mission.
            holds_plane: the law meets any plane of the target's inclination at a cost: from the
                ground it aims at the planned one.

        Raises:
            ValueError: a length or an end state is missing, or a length is negative.
        """
        arcs = arrays.arcs
        mu = float(arrays.environment["mu"][0])
        record = np.zeros(1, PLAN)
        free = leaves_arcs_free(arrays.arcs) or coasts_long(arrays.arcs)
        needed = needs_plan(arcs, arrays.target[0], arrays.environment[0])
        record["made"] = free or bool(self.held) or not needed
        # a law that asked for it may solve for the whole burn
        record["by_legs"] = self.by_legs and needed
        ends = (arcs["kind"] == BURN) & np.isinf(arcs["duration"])
        ends[list(self.held)] = True
        ends[-1] = False
        record["ends_leg"][0, : len(arcs)] = ends
        if leaves_end_free(arrays.target[0]):
            record["aims"] = 1
            last = len(arcs) - 1
            end = self._end(last)
            record["target"][0, last] = arrays.target[0]
            record["target"]["true_anomaly"][0, last] = true_anomaly_of(end, mu)
        self._write_round_end(record[0], arrays)
        if holds_plane and (self.programmes or arrays.environment["boost"]["knots"][0]):
            self._aim_at_plane(record[0], arrays)
        for k in np.flatnonzero(np.isinf(arcs["duration"]) | ends):
            if k < self.first_arc:
                continue
            length = self.lengths_s.get(int(k), math.nan)
            if not 0.0 <= length < math.inf:
                raise ValueError(f"length of arc {k} is {length}; expected 0 s or more")
            record["length"][0, k] = length
            if not ends[k]:
                continue
            end = self._end(int(k))
            target = record["target"][0, k]
            target["kind"] = TARGET_RADIUS_SPEED_ANGLE_PLANE
            target["radius"] = end.radius
            target["speed"] = end.speed
            target["flight_path_angle"] = end.flight_path_angle
            target["inclination"] = end.inclination
            # undefined for an equatorial plane: any node will do
            target["ascending_node"] = np.nan_to_num(end.ascending_node)
            if self.by_legs and names_perigee_direction(arrays.target[0]):
                self._hold_perigee(target, int(k), ELONGATED)
            if k in self.floored:
                self._hold_perigee(target, int(k), OVAL)
        for index, directions in self.directions.items():
            record["direction"][0, index] = directions
        for index, position in self.positions.items():
            record["position"][0, index] = position
        record["primer"] = math.nan
        for index, primer in self.primers.items():
            record["primer"][0, index] = primer
            record["ignition"][0, index] = self.ignitions[index]
        record["jettison_time"] = self.jettison_time_s
        return record

    def _write_round_end(self, record: np.void, arrays: MissionArrays) -> None:
        """Write the planned end of the last arc, if its orbit is nearly a circle.

        There the direction of the perigee, and the place relative to it, are badly conditioned.

        Args:
            record: record PLAN. Changed.
            arrays: the mission.
        """
        end = self.ends.get(len(arrays.arcs) - 1)
        target = arrays.target[0]
        named = int(judged_by(target))
        if end is None or not named & NAMES_INCLINATION:
            return
        mu = float(arrays.environment["mu"][0])
        square = end.radius * end.speed**2 / mu
        level = math.cos(end.flight_path_angle)
        eccentricity = math.sqrt((square - 1.0) ** 2 * level**2 + (1.0 - level**2))
        if eccentricity > ROUND:
            return
        record["ends_round"] = 1
        record["round_end"] = target
        plane = bool(named & NAMES_ASCENDING_NODE)
        kinds = TARGET_RADIUS_SPEED_ANGLE_INCLINATION, TARGET_RADIUS_SPEED_ANGLE_PLANE
        record["round_end"]["kind"] = kinds[plane]
        for name in ("radius", "speed", "flight_path_angle"):
            record["round_end"][name] = getattr(end, name)

    def _aim_at_plane(self, record: np.void, arrays: MissionArrays) -> None:
        """Aim at the planned ascending node if the target leaves it free.

        Args:
            record: record PLAN. Changed.
            arrays: the mission.
        """
        last = len(arrays.arcs) - 1
        if not record["aims"]:
            record["target"][last] = arrays.target[0]
        target = record["target"][last]
        named = int(target["named"])
        inclined = named & (NAMES_INCLINATION | NAMES_ASCENDING_NODE) == NAMES_INCLINATION
        if target["kind"] == TARGET_RADIUS_SPEED_ANGLE_INCLINATION:
            target["kind"] = TARGET_RADIUS_SPEED_ANGLE_PLANE
        elif target["kind"] == TARGET_ELEMENTS and inclined:
            target["named"] = named | NAMES_ASCENDING_NODE
        else:
            return
        record["aims"] = 1
        target["ascending_node"] = np.nan_to_num(self._end(last).ascending_node)

    def _hold_perigee(self, target: np.void, k: int, least: float) -> None:
        """Aim a leg at its planned orbit, place free, if that is bound and elongated.

        A short later burn cannot rotate the apsides of such an orbit back.

        Args:
            target: record TARGET, with the plane. Changed.
            k: index of the burn that ends the leg.
            least: eccentricity.
        """
        orbit = self.orbits.get(k)
        if orbit is None or not least < orbit.eccentricity < 1.0:
            return
        target["kind"] = TARGET_KEPLERIAN
        target["semi_major_axis"] = orbit.semi_major_axis
        target["eccentricity"] = orbit.eccentricity
        target["argument_of_perigee"] = orbit.argument_of_perigee

    def _end(self, k: int) -> Insertion:
        """Return the state at the end of burn ``k``.

        Raises:
            ValueError: there is none.
        """
        if k not in self.ends:
            raise ValueError(f"end of burn {k} is missing; expected the state there")
        return self.ends[k]


@dataclass(frozen=True)
class OfflineTrajectory:
    """Hold an optimized trajectory: its segments with their steering, and its samples.

    A segment (``arc_*``) ends at every drop of mass, if not earlier. Times are mission elapsed
    time in s, vectors are in the frame ``ares_eci``; lists of vectors have shape (n, 3).

    Attributes:
        jettison_time: s; nan: none.
        cutoff_time: s.
        arc_start_time, arc_end_time: s.
        arc_start_mass, arc_end_mass: kg, after drops at the start, before drops at the end.
        arc_delta_v: m/s.
        steering_reference_time: s.
        steering_direction, steering_direction_rate: shape (n, 3), unit and 1/s.
        primer_rate: rate of the primer, which equals steering_direction at the segment's start,
            shape (n, 3), 1/s; nan: not known.
        sample_time: s; the jettison is one of them.
        sample_position: shape (n, 3), m.
        sample_velocity: shape (n, 3), m/s.
        sample_mass: kg.
        sample_direction: of the thrust, shape (n, 3), unit; nan in a coast.
        flown_arc: indices of the mission's arcs from the present one on.
        flown_start_time, flown_end_time: start and end of each of these, s; the present arc
            starts in the past.
        by_legs: see `ArcPlan`.
    """

    jettison_time: float
    cutoff_time: float
    arc_start_time: Array
    arc_end_time: Array
    arc_start_mass: Array
    arc_end_mass: Array
    arc_delta_v: Array
    steering_reference_time: Array
    steering_direction: Array
    steering_direction_rate: Array
    primer_rate: Array
    sample_time: Array
    sample_position: Array
    sample_velocity: Array
    sample_mass: Array
    sample_direction: Array
    flown_arc: NDArray[np.int64]
    flown_start_time: Array
    flown_end_time: Array
    by_legs: bool = False

    def __post_init__(self) -> None:
        """Check the lengths of the lists, then their values.

        Raises:
            ValueError: lists that belong together differ in length, or a value is wrong; one line.
        """
        for kind in ("arc", "sample", "flown"):
            lengths = {
                item.name: len(getattr(self, item.name))
                for item in fields(self)
                if item.name.startswith((kind, "steering", "primer") if kind == "arc" else kind)
            }
            if len(set(lengths.values())) > 1:
                found = ", ".join(f"{name} {length}" for name, length in lengths.items())
                raise ValueError(f"{kind}s: expected lists of one length, found {found}")
        self._check_values()

    def _check_values(self) -> None:
        """Check that the numbers describe burns.

        Raises:
            ValueError: naming the list and its expected values.
        """
        for name in ("arc_start_time", "arc_end_time", "arc_start_mass", "arc_end_mass"):
            _expect(np.isfinite(getattr(self, name)), name, "finite numbers")
        last = self.arc_end_time >= self.arc_start_time - SAME_TIME
        _expect(last, "arc_end_time", "no end before its begin")
        _expect(self.arc_end_mass > 0.0, "arc_end_mass", "more than 0 kg")
        lighter = self.arc_start_mass >= self.arc_end_mass * (1.0 - LEAST_DROP)
        _expect(lighter, "arc_start_mass", "no arc that makes heavier")
        _expect(self.arc_delta_v >= 0.0, "arc_delta_v", "0 m/s or more")
        burns = self.arc_delta_v > 0.0
        length = np.linalg.norm(self.steering_direction, axis=1)
        _expect(np.abs(length - 1.0)[burns] < ABOUT_UNIT, "steering_direction", "unit vectors")
        rate = np.linalg.norm(self.steering_direction_rate, axis=1)
        _expect(rate[burns] < FASTEST_TURN, "steering_direction_rate", f"below {FASTEST_TURN} 1/s")
        after = self.steering_reference_time >= np.min(self.arc_start_time, initial=math.inf)
        before = self.steering_reference_time <= np.max(self.arc_end_time, initial=-math.inf)
        _expect((after & before)[burns], "steering_reference_time", "times of the trajectory")
        _expect(np.isfinite(self.sample_position), "sample_position", "finite numbers")
        _expect(np.isfinite(self.sample_velocity), "sample_velocity", "finite numbers")

    def check_begin(self, time_s: float, mass_kg: float, later: bool = False) -> None:
        """Check that the trajectory begins at the requested state.

        Args:
            time_s: of the requested state, mission elapsed time.
            mass_kg: of the requested state.
            later: it may begin later, where the mission's boost programme ends.

        Raises:
            ValueError: it begins at another time or mass, or its cut-off is past.
        """
        if not len(self.arc_start_time):
            raise ValueError("no arcs")
        begin, mass = float(self.arc_start_time[0]), float(self.arc_start_mass[0])
        later = later and begin > time_s
        if abs(begin - time_s) > SAME_TIME and not later:
            raise ValueError(f"it begins at {begin:.3f} s; expected {time_s:.3f} s")
        if abs(mass - mass_kg) > SAME_MASS * mass_kg and not later:
            raise ValueError(f"it begins with {mass:.1f} kg; expected {mass_kg:.1f} kg")
        if not self.cutoff_time > time_s:
            raise ValueError(
                f"cutoff_time is {self.cutoff_time}; expected more than {time_s:.3f} s"
            )

    def velocity_to_go(self) -> Array:
        """Sum the delta-V of all segments along their mean directions, m/s, shape (3,)."""
        burns = self.arc_delta_v > 0.0
        middle = 0.5 * (self.arc_start_time + self.arc_end_time)
        ahead = (middle - self.steering_reference_time)[burns]
        directions = (
            self.steering_direction[burns] + ahead[:, None] * self.steering_direction_rate[burns]
        )
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        velocity: Array = self.arc_delta_v[burns] @ directions
        return velocity

    def sample_at(self, t: float, what: str) -> Insertion:
        """Return the state of the sample at a time, s.

        Raises:
            ValueError: there is no sample; the message names the event ``what``.
        """
        k = self._sample(t, what)
        return Insertion.from_state(self.sample_position[k], self.sample_velocity[k])

    def _sample(self, t: float, what: str) -> int:
        """Return the index of the sample at a time, s; errors as in :meth:`sample_at`."""
        if len(self.sample_time) == 0:
            raise ValueError(f"no sample at {what}: there are none")
        nearest = int(np.argmin(np.abs(self.sample_time - t)))
        if abs(self.sample_time[nearest] - t) > SAME_TIME:
            raise ValueError(
                f"no sample at {what}: the nearest to {t:.3f} s is at "
                f"{self.sample_time[nearest]:.3f} s"
            )
        return nearest

    def arc_plan(self, arrays: MissionArrays) -> ArcPlan:
        """Build the plan of a mission's free arcs and free end.

        Args:
            arrays: the mission.

        Raises:
            ValueError: the trajectory is not of this mission, or goes through the ground.
        """
        arcs = arrays.arcs
        self._check_arcs(arcs)
        check_floor(self, arrays)
        lengths, states, directions, positions = {}, {}, {}, {}
        primers, ignitions, orbits = {}, {}, {}
        begin = -math.inf
        lifts = held_burns(self, arrays)
        for k, start, end in zip(
            self.flown_arc, self.flown_start_time, self.flown_end_time, strict=True
        ):
            burns = arcs["kind"][k] == BURN
            last = k + 1 == len(arcs)
            free = np.isinf(arcs["duration"][k])
            if free and not burns and names_perigee_direction(arrays.target[0]):
                positions[int(k)] = self.sample_position[self._sample(end, f"the end of arc {k}")]
            if free or k in lifts:
                lengths[int(k)] = float(end - start)
            first = self._first_burn(start, end)
            if burns and first is not None:
                primers[int(k)] = np.array(
                    [self.steering_direction[first], self.primer_rate[first]]
                )
                ignitions[int(k)] = float(self.arc_start_time[first])
            if last or (free and burns) or k in lifts:
                if self._first_burn(begin, end) is not None:
                    directions[int(k)] = self._directions(begin, end)
                at = self._sample(end, f"the end of burn {k}")
                position, velocity = self.sample_position[at], self.sample_velocity[at]
                if lifts.get(int(k), 0.0) > 0.0:
                    position, velocity = self._lifted(at, lifts[int(k)], arrays)
                positions[int(k)] = position
                begin = end
                if last:
                    # after the tail-off, where the target is to be met
                    reached = float(self.sample_time[-1])
                    states[int(k)] = self.sample_at(reached, f"the end of burn {k}")
                else:
                    states[int(k)] = Insertion.from_state(position, velocity)
                    # on a floor the place counts, and not the orbit alone
                    rises = states[int(k)].flight_path_angle > 0.0
                    if not (rises and lifts.get(int(k), 0.0) > 0.0):
                        mu = float(arrays.environment["mu"][0])
                        orbits[int(k)] = Elements.from_state(position, velocity, mu)
        return ArcPlan(
            lengths,
            states,
            directions,
            positions,
            primers,
            ignitions,
            self.jettison_time,
            int(self.flown_arc[0]),
            self._resumes(arrays),
            self.by_legs,
            orbits,
            frozenset(lifts),
            frozenset(k for k, lift in lifts.items() if lift > 0.0),
            self.programmes(arrays) if flies_in_air(arcs) else (),
            dict(zip(map(int, self.flown_arc), map(float, self.flown_end_time), strict=True)),
            {
                int(k): float(self.sample_mass[self._rows_between(float(start), float(end))[-1]])
                for k, start, end in zip(
                    self.flown_arc, self.flown_start_time, self.flown_end_time, strict=True
                )
            },
        )

    def programmes(self, arrays: MissionArrays) -> tuple[Programme, ...]:
        """Return attitude programmes up to where the forces of the air are small, and beyond.

        Args:
            arrays: the mission.

        Returns:
            none if the forces are small all along.
        """
        first = self._hand_over(arrays)
        if not self.flown_start_time[0] < first - SAME_TIME:
            return ()
        ends = [first]
        for k, start, stop in zip(
            self.flown_arc, self.flown_start_time, self.flown_end_time, strict=True
        ):
            inside = [float(start)]
            if arrays.arcs["kind"][k] == BURN:
                share = LATEST_SHARE if np.isinf(arrays.arcs["duration"][k]) else 1.0
                inside += list(np.linspace(start, start + share * (stop - start), LATER)[1:-1])
            ends += [t for t in inside if t > first]
        environment = arrays.environment[0]
        speed = np.array([self._ground_speed(i, environment) for i in range(len(self.sample_time))])
        return tuple(self._programme(arrays, speed, end) for end in ends)

    def _programme(self, arrays: MissionArrays, speed: Array, end: float) -> Programme:
        """Return the attitude programme up to a time, s; speed over the ground by sample, m/s."""
        parts = []
        for k, start, stop in zip(
            self.flown_arc, self.flown_start_time, self.flown_end_time, strict=True
        ):
            rows = self._rows_between(float(start), min(float(stop), end))
            if start >= end - SAME_TIME or len(rows) < 2:
                continue
            parts.append(
                (
                    np.full(len(rows), k),
                    self.sample_time[rows],
                    np.maximum.accumulate(speed[rows]),
                    self.sample_direction[rows].copy(),
                )
            )
        # without thrust, turn to the direction of the next; after the last, keep it
        ahead = self._direction_at(end)
        for arc, _, _, direction in reversed(parts):
            coasts = arrays.arcs["kind"][arc[0]] != BURN
            for k in reversed(range(len(direction))):
                if coasts or not np.isfinite(direction[k]).all():
                    direction[k] = ahead
                ahead = direction[k]
        arc, time, rising, direction = (np.concatenate(c) for c in zip(*parts, strict=True))
        state = self._navigation(end, arrays)
        return Programme(arc, time, rising, direction, state).thinned(MAX_PROGRAMME)

    def _navigation(self, t: float, arrays: MissionArrays) -> NDArray[np.void]:
        """Return the planned navigation state of the first sample from a time on, shape (1,).

        Where an arc ends that is the state at the begin of the next.
        """
        later = self.flown_end_time > t + SAME_TIME
        flown = int(np.argmax(later)) if later.any() else len(later) - 1
        k = int(self.flown_arc[flown])
        rows = self._rows_between(
            float(self.flown_start_time[flown]), float(self.flown_end_time[flown])
        )
        after = int(np.searchsorted(self.sample_time[rows], t - TIME_ROUNDING))
        row = rows[min(after, len(rows) - 1)]
        state = np.zeros(1, NAVIGATION)
        for name in ("time", "position", "velocity", "mass"):
            state[name] = getattr(self, f"sample_{name}")[row]
        state["heating_rate"] = math.nan
        state["arc"] = k
        state["arc_start_time"] = self.flown_start_time[flown]
        now = float(self.sample_time[row])
        ignited, ignition = last_ignition(k, float(self.flown_start_time[flown]), arrays.arcs)
        heating = self.jettison_time if math.isfinite(self.jettison_time) else math.inf
        for j, jettison in enumerate(arrays.jettisons):
            over = bool(arrays.arcs["stage"][k] > jettison["stage"])
            if over or now >= drop_time(jettison, ignited, ignition, now, heating):
                state["jettisoned"] |= 1 << j
        return state

    def _hand_over(self, arrays: MissionArrays) -> float:
        """Return the time from which the forces of the air are small, s; -inf: always.

        A long coast ends the ascent: low perigees after it are no part of it.
        """
        environment, atmosphere = arrays.environment[0], arrays.atmosphere
        end = -math.inf
        for k, start, stop in zip(
            self.flown_arc, self.flown_start_time, self.flown_end_time, strict=True
        ):
            arc = arrays.arcs[k]
            if arc["kind"] == COAST and stop - start > LONG_COAST_S:
                break
            for i in self._rows_between(float(start), float(stop)):
                r, v = self.sample_position[i], self.sample_velocity[i]
                u = tuple(self.sample_direction[i])
                force = norm(body_force(arc, tuple(r), tuple(v), u, environment, atmosphere))
                force += pressure_loss(arc, tuple(r), environment, atmosphere)
                if force > HANDED_OVER_M_S2 * self.sample_mass[i]:
                    end = max(end, min(float(self.sample_time[i]) + 1.0, float(stop)))
            if arc["vertical"]:
                end = max(end, float(stop))
        return end

    def _ground_speed(self, i: int, environment: Record) -> float:
        """Return the speed over the ground of a sample, m/s."""
        r, v = tuple(self.sample_position[i]), tuple(self.sample_velocity[i])
        return float(norm(relative_velocity(r, v, environment)))

    def _rows_between(self, begin: float, end: float) -> NDArray[np.int64]:
        """Return the samples between two events, s: of the two at each the one inside."""
        time = self.sample_time
        first = int(np.searchsorted(time, begin + TIME_ROUNDING, side="right")) - 1
        last = int(np.searchsorted(time, end - TIME_ROUNDING, side="left"))
        rows = np.arange(max(first, 0), min(last, len(time) - 1) + 1)
        later = np.diff(time[rows], prepend=-math.inf) > TIME_ROUNDING
        return rows[later]

    def _direction_at(self, t: float) -> Array:
        """Return the thrust direction of the first sample with thrust from a time on, s."""
        known = np.isfinite(self.sample_direction).all(axis=1)
        later = np.flatnonzero(known & (self.sample_time >= t - TIME_ROUNDING))
        row = later[0] if later.size else np.flatnonzero(known)[-1]
        direction: Array = self.sample_direction[row]
        return direction

    def _lifted(self, at: int, lift: float, arrays: MissionArrays) -> tuple[Array, Array]:
        """Return position, m, and velocity, m/s, of sample ``at``, the end of a burn, lifted by m.

        The coast then ends where it did.
        """
        position, velocity = self.sample_position[at], self.sample_velocity[at]
        first = self._first_burn(float(self.sample_time[at]), math.inf)
        if first is None:
            return position * (1.0 + lift / np.linalg.norm(position)), velocity
        ignition = self._sample(float(self.arc_start_time[first]), "the end of a coast")
        mu = float(arrays.environment["mu"][0])
        return lifted(position, velocity, lift, self.sample_position[ignition], mu)

    def _resumes(self, arrays: MissionArrays) -> bool:
        """Return whether the plan begins later than a plan of the whole mission would."""
        environment = arrays.environment[0]
        arc, begin = int(self.flown_arc[0]), float(self.sample_time[0])
        if environment["boost"]["knots"] == 0:
            return arc > 0
        if begin < self.flown_start_time[0] + SAME_TIME:
            arc -= 1
        # a second earlier the programme was not over yet
        gained = self.sample_velocity[1] - self.sample_velocity[0]
        v = self.sample_velocity[0] - gained / (self.sample_time[1] - begin)
        r = self.sample_position[0] - v
        return bool(is_over(begin - 1.0, tuple(r), tuple(v), arc, environment))

    def _check_arcs(self, arcs: NDArray[np.void]) -> None:
        """Check that the flown arcs are the last arcs of a mission.

        Raises:
            ValueError: they are not.
        """
        lengths = self.flown_end_time - self.flown_start_time
        wanted = np.arange(len(arcs) - len(self.flown_arc), len(arcs))
        if len(wanted) == 0 or wanted[0] < 0 or not np.array_equal(self.flown_arc, wanted):
            raise ValueError(
                f"the trajectory flies arcs {list(map(int, self.flown_arc))}, which are not those "
                f"of the mission: it has {len(arcs)}"
            )
        fixed = arcs["duration"][wanted]
        for k in np.flatnonzero(np.isfinite(fixed)):
            if lengths[k] > fixed[k] + SAME_TIME:
                raise ValueError(
                    f"arc {wanted[k]} lasts {lengths[k]:.3f} s in the trajectory and "
                    f"{fixed[k]:.3f} s in the mission: its arcs are not those of the mission"
                )

    def _first_burn(self, start: float, end: float) -> int | None:
        """Return the index of the first segment with thrust between two times, s, or None."""
        middle = 0.5 * (self.arc_start_time + self.arc_end_time)
        inside = (middle > start) & (middle < end) & (self.arc_delta_v > 0.0)
        return int(np.argmax(inside)) if inside.any() else None

    def _directions(self, begin: float, end: float) -> Array:
        """Return the first and last thrust direction between two times, s; shape (2, 3)."""
        burns = np.flatnonzero(
            (self.arc_delta_v > 0.0)
            & (self.arc_start_time > begin - SAME_TIME)
            & (self.arc_end_time < end + SAME_TIME)
        )
        first, last = burns[0], burns[-1]
        found = [
            self.steering_direction[k]
            + (t - self.steering_reference_time[k]) * self.steering_direction_rate[k]
            for k, t in ((first, self.arc_start_time[first]), (last, self.arc_end_time[last]))
        ]
        return np.array(found) / np.linalg.norm(found, axis=1, keepdims=True)
