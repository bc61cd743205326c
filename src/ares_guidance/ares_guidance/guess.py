# SPDX-License-Identifier: Apache-2.0
"""What a trajectory found off line tells a guidance law before it starts."""

import math
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from ares_guidance.arrays import PLAN
from ares_guidance.floor import burns_before_floors, check_floor
from ares_models.arrays import (
    BURN,
    NAMES_ARGUMENT_OF_PERIGEE,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    MissionArrays,
)
from ares_models.mission_target import leaves_end_free
from ares_models.orbits import Elements, Insertion

Array = NDArray[np.float64]

#: How far a sample may be from the time that is asked for, s.
SAME_TIME = 0.01
#: How far the mass that a trajectory begins with may be from the measured one, as a part of it.
SAME_MASS = 1e-3
#: How far the length of a direction may be from 1, and how fast it may turn, 1/s.
ABOUT_UNIT = 1e-3
FASTEST_TURN = 1.0
#: Eccentricity from which a leg holds its perigee's direction: what comes after turns that of a
#: rounder orbit at little cost.
ELONGATED = 0.5
#: What staging drops at least, as a part of the mass. Rounding is less, a stage is more.
LEAST_DROP = 1e-6


def leaves_arcs_free(arrays: MissionArrays) -> bool:
    """Return whether arcs before the mission's last are free."""
    return bool(np.any(np.isinf(arrays.arcs["duration"][:-1])))


def true_anomaly_of(state: Insertion, mu: float) -> float:
    """Return the angle from perigee, rad, of a state; mu in m3/s2."""
    momentum = state.radius * state.speed * math.cos(state.flight_path_angle)
    towards = momentum**2 / (mu * state.radius) - 1.0
    ahead = momentum * state.speed * math.sin(state.flight_path_angle) / mu
    return math.atan2(ahead, towards)


def names_perigee_direction(target: np.void) -> bool:
    """Return whether a target names in which direction its perigee lies."""
    named = bool(int(target["named"]) & NAMES_ARGUMENT_OF_PERIGEE)
    return named or bool(target["kind"] == TARGET_KEPLERIAN)


def _expect(sound: NDArray[np.bool_], name: str, expected: str) -> None:
    """Raise ValueError unless all of a list's values are sound."""
    if not np.all(sound):
        raise ValueError(f"{name}: expected {expected}")


@dataclass(frozen=True)
class JettisonPlan:
    """The jettison as an interior target, and the scalar delta-V of each piece (Table 6.6).

    Attributes:
        radius_m, speed_m_s, flight_path_angle_rad: state at the jettison.
        jettison_time_s, cutoff_time_s: mission elapsed time.
        delta_v_m_s: start to staging, staging to jettison, jettison to cut-off; 0 for a
            piece that is flown already.
    """

    radius_m: float
    speed_m_s: float
    flight_path_angle_rad: float
    jettison_time_s: float
    cutoff_time_s: float
    delta_v_m_s: tuple[float, float, float]

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            ValueError: naming the field, its value and what was expected.
        """
        for item in fields(self):
            value = getattr(self, item.name)
            if not np.all(np.isfinite(value)):
                raise ValueError(f"{item.name} is {value}; expected finite")
        for name in ("radius_m", "speed_m_s"):
            if getattr(self, name) <= 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; expected more than 0")
        first, second, third = self.delta_v_m_s
        if first < 0.0 or second <= 0.0 or third <= 0.0:
            raise ValueError(
                f"delta_v_m_s is {self.delta_v_m_s}; expected a burn before and after the jettison"
            )
        if self.cutoff_time_s <= self.jettison_time_s:
            raise ValueError(
                f"cutoff_time_s is {self.cutoff_time_s}; expected more than jettison_time_s, "
                f"{self.jettison_time_s}"
            )


@dataclass(frozen=True)
class ArcPlan:
    """How a mission is flown that leaves more free than the end of its last arc.

    Attributes:
        lengths_s: of the free arcs and of burns that are held, by index into the mission's arcs.
        ends: state at the end of each free burn and of each that is held, and of the last arc
            where the target leaves the place on its orbit free, by the same index.
        directions: of the first and the last thrust since the end before, up to there and
            up to the end of the last arc, shape (2, 3), where they are known.
        positions: at the end of each of these, m, shape (3,), where they are known.
        primers: at the begin of each burn's thrust, a unit vector, and its rate, 1/s, shape
            (2, 3); nan: not known.
        ignitions: when that is, mission elapsed time, s.
        jettison_time_s: mission elapsed time; nan: not known, or no jettison waits for heating.
        first_arc: index of the arc that it begins in: those before are over.
        by_legs: every law flies it leg by leg, `optimal` too, which elsewhere plans the whole
            flight anew: the plan keeps what the two-point problem on board does not know of.
        orbits: that each of these burns before the last ends on, where they are known.
        held: burns of which a coast that touches its floor decides how they end. Each ends a leg,
            of fixed length too.
    """

    lengths_s: dict[int, float]
    ends: dict[int, Insertion]
    directions: dict[int, Array] = field(default_factory=dict)
    positions: dict[int, Array] = field(default_factory=dict)
    primers: dict[int, Array] = field(default_factory=dict)
    ignitions: dict[int, float] = field(default_factory=dict)
    jettison_time_s: float = math.nan
    first_arc: int = 0
    by_legs: bool = False
    orbits: dict[int, Elements] = field(default_factory=dict)
    held: frozenset[int] = frozenset()

    def record(self, arrays: MissionArrays) -> NDArray[np.void]:
        """The plan as the kernel reads it, shape (1,), dtype PLAN.

        Args:
            arrays: the mission.

        Raises:
            ValueError: something of it is missing or cannot be flown.
        """
        arcs = arrays.arcs
        mu = float(arrays.environment["mu"][0])
        record = np.zeros(1, PLAN)
        record["made"] = leaves_arcs_free(arrays)
        record["by_legs"] = self.by_legs
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
            # of an equatorial plane any
            target["ascending_node"] = np.nan_to_num(end.ascending_node)
            if self.by_legs and names_perigee_direction(arrays.target[0]):
                self._hold_perigee(target, int(k))
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

    def _hold_perigee(self, target: np.void, k: int) -> None:
        """Aim a leg at its plan's orbit, any place on it, where that is bound and elongated.

        A short burn after it turns no orbit back.

        Args:
            target: record TARGET, with the plane. Changed.
            k: index of the burn that ends the leg.
        """
        orbit = self.orbits.get(k)
        if orbit is None or not ELONGATED < orbit.eccentricity < 1.0:
            return
        target["kind"] = TARGET_KEPLERIAN
        target["semi_major_axis"] = orbit.semi_major_axis
        target["eccentricity"] = orbit.eccentricity
        target["argument_of_perigee"] = orbit.argument_of_perigee

    def _end(self, k: int) -> Insertion:
        """The state at the end of a burn, by its index.

        Raises:
            ValueError: there is none.
        """
        if k not in self.ends:
            raise ValueError(f"end of burn {k} is missing; expected the state there")
        return self.ends[k]


@dataclass(frozen=True)
class OfflineTrajectory:
    """A trajectory found off line: its burn arc by arc, and its samples.

    An arc ends at least where a stage or a part is dropped. Times are mission elapsed time in
    s, vectors stand in the frame ``ares_eci``; lists of vectors have shape (n, 3).

    Attributes:
        jettison_time: s; nan: none.
        cutoff_time: s.
        arc_start_time, arc_end_time: s.
        arc_start_mass, arc_end_mass: kg, drops at the start done, at the end not.
        arc_delta_v: m/s.
        steering_reference_time: s.
        steering_direction, steering_direction_rate: shape (n, 3), unit and 1/s.
        primer_rate: of the primer that is steering_direction at the arc's start, shape (n, 3),
            1/s; nan: not known.
        sample_time: s; the jettison is one of them.
        sample_position: shape (n, 3), m.
        sample_velocity: shape (n, 3), m/s.
        flown_arc: index of each of the mission's arcs from the one that runs on,
        flown_start_time, flown_end_time: and when it begins and ends, s; a begin in the past for
            one that runs.
        by_legs: as of `ArcPlan`.
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
    flown_arc: NDArray[np.int64]
    flown_start_time: Array
    flown_end_time: Array
    by_legs: bool = False

    def __post_init__(self) -> None:
        """Check the lists.

        Raises:
            ValueError: one line; lists that belong together differ in length.
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
        """See that the numbers can be those of a burn.

        Raises:
            ValueError: naming the list, and what was expected.
        """
        for name in ("arc_start_time", "arc_end_time", "arc_start_mass", "arc_end_mass"):
            _expect(np.isfinite(getattr(self, name)), name, "finite numbers")
        last = self.arc_end_time >= self.arc_start_time - SAME_TIME
        _expect(last, "arc_end_time", "no end before its begin")
        _expect(self.arc_end_mass > 0.0, "arc_end_mass", "more than 0 kg")
        lighter = self.arc_start_mass >= self.arc_end_mass
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

    def check_begin(self, time_s: float, mass_kg: float) -> None:
        """See that it begins where the vehicle is.

        Args:
            time_s: of the state that was asked from, mission elapsed time.
            mass_kg: in it.

        Raises:
            ValueError: it is the trajectory of another flight, or of another vehicle.
        """
        if not len(self.arc_start_time):
            raise ValueError("no arcs")
        begin, mass = float(self.arc_start_time[0]), float(self.arc_start_mass[0])
        if abs(begin - time_s) > SAME_TIME:
            raise ValueError(f"it begins at {begin:.3f} s; expected {time_s:.3f} s")
        if abs(mass - mass_kg) > SAME_MASS * mass_kg:
            raise ValueError(f"it begins with {mass:.1f} kg; expected {mass_kg:.1f} kg")
        if not self.cutoff_time > time_s:
            raise ValueError(
                f"cutoff_time is {self.cutoff_time}; expected more than {time_s:.3f} s"
            )

    def velocity_to_go(self) -> Array:
        """The burn as one vector, m/s, shape (3,): each arc along its mean direction."""
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
        """The state at a time, s.

        Raises:
            ValueError: there is no sample; ``what`` is there.
        """
        k = self._sample(t, what)
        return Insertion.from_state(self.sample_position[k], self.sample_velocity[k])

    def _sample(self, t: float, what: str) -> int:
        """Index of the sample at a time, s."""
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
        """The plan of what a mission leaves free.

        Args:
            arrays: the mission.

        Raises:
            ValueError: the trajectory is not one of this mission, or goes through the ground.
        """
        arcs = arrays.arcs
        self._check_arcs(arcs)
        check_floor(self, arrays)
        lengths, states, directions, positions = {}, {}, {}, {}
        primers, ignitions, orbits = {}, {}, {}
        begin = -math.inf
        lifts = burns_before_floors(self, arrays)
        for k, start, end in zip(
            self.flown_arc, self.flown_start_time, self.flown_end_time, strict=True
        ):
            burns = arcs["kind"][k] == BURN
            last = k + 1 == len(arcs)
            free = np.isinf(arcs["duration"][k])
            if free or k in lifts:
                lengths[int(k)] = float(end - start)
            first = self._first_piece(start, end)
            if burns and first is not None:
                primers[int(k)] = np.array(
                    [self.steering_direction[first], self.primer_rate[first]]
                )
                ignitions[int(k)] = float(self.arc_start_time[first])
            if last or (free and burns) or k in lifts:
                if self._first_piece(begin, end) is not None:
                    directions[int(k)] = self._directions(begin, end)
                at = self._sample(end, f"the end of burn {k}")
                position, velocity = self.sample_position[at], self.sample_velocity[at]
                position = position * (1.0 + lifts.get(int(k), 0.0) / np.linalg.norm(position))
                positions[int(k)] = position
                begin = end
                if last:
                    # its tail-off included, where the target holds
                    reached = float(self.sample_time[-1])
                    states[int(k)] = self.sample_at(reached, f"the end of burn {k}")
                else:
                    states[int(k)] = Insertion.from_state(position, velocity)
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
            self.by_legs,
            orbits,
            frozenset(lifts),
        )

    def _check_arcs(self, arcs: NDArray[np.void]) -> None:
        """See that the arcs are those of a mission, from some arc to the last.

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

    def _first_piece(self, start: float, end: float) -> int | None:
        """The first piece with thrust between two times, s; None: there is none."""
        middle = 0.5 * (self.arc_start_time + self.arc_end_time)
        inside = (middle > start) & (middle < end) & (self.arc_delta_v > 0.0)
        return int(np.argmax(inside)) if inside.any() else None

    def _directions(self, begin: float, end: float) -> Array:
        """First and last direction of the thrust between two times, s; shape (2, 3)."""
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

    def jettison_plan(self) -> JettisonPlan:
        """State at the jettison and the scalar delta-V of each piece.

        Raises:
            ValueError: there is no jettison, or the lists do not hold it.
        """
        t = self.jettison_time
        if not math.isfinite(t) or len(self.sample_time) == 0:
            raise ValueError(f"jettison_time is {t}; expected a sampled one")
        there = self.sample_at(t, "the jettison")
        before = self.arc_end_time <= t + SAME_TIME
        drops = self.arc_start_mass[1:] < self.arc_end_mass[:-1] * (1.0 - LEAST_DROP)
        # the only drop before the jettison is that of the first stage
        staging = np.flatnonzero(drops & before[1:])
        staged = np.arange(len(before)) > (staging[0] if len(staging) else -1)
        pieces = (before & ~staged, before & staged, ~before)
        first, second, third = (float(np.sum(self.arc_delta_v[piece])) for piece in pieces)
        return JettisonPlan(
            there.radius,
            there.speed,
            there.flight_path_angle,
            t,
            self.cutoff_time,
            (first, second, third),
        )
