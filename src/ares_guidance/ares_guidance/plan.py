# SPDX-License-Identifier: Apache-2.0
"""Plans of missions that leave more free than the end of their last arc."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ares_guidance.arrays import PLAN
from ares_guidance.floor import check_floor, held_burns, lifted
from ares_guidance.kernels.cycle import SHORT_BURN
from ares_guidance.programme import Programme, programmes_of
from ares_guidance.trajectory import SAME_TIME, OfflineTrajectory
from ares_models import arrays as layout
from ares_models.kernels.boost import is_over
from ares_models.kernels.judging import judged_by
from ares_models.mission_target import leaves_end_free
from ares_models.orbits import Elements, Insertion
from ares_models.plans import coasts_long, flies_in_air, leaves_arcs_free, needs_plan

Array = NDArray[np.float64]

#: Eccentricity above which a leg constrains the argument of perigee. Later burns rotate the apsides
#: of a rounder orbit at little cost.
ELONGATED = 0.5
#: Eccentricity above which a leg before a coast that touches its floor constrains the perigee: a
#: burn that lacks energy lowers the apogee then.
OVAL = 0.1
#: Eccentricity below which an orbit is nearly a circle.
ROUND = 0.02
#: Propellant left in a stage that counts as depleted, of what it had.
DEPLETED_SHARE = 1e-3


def true_anomaly_of(state: Insertion, mu: float) -> float:
    """Return the true anomaly of a state, rad; mu in m3/s2."""
    momentum = state.radius * state.speed * math.cos(state.flight_path_angle)
    towards = momentum**2 / (mu * state.radius) - 1.0
    ahead = momentum * state.speed * math.sin(state.flight_path_angle) / mu
    return math.atan2(ahead, towards)


def names_perigee_direction(target: np.void) -> bool:
    """Return whether a target constrains the direction of its perigee."""
    named = bool(int(target["named"]) & layout.NAMES_ARGUMENT_OF_PERIGEE)
    return named or bool(target["kind"] == layout.TARGET_KEPLERIAN)


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
        depleted: free burns that take all propellant of their stage. They end no leg.
        programmes: attitude in the air, and from the second on beyond it, from which a law takes
            the first that leaves it a way to the planned end; none: the law begins at once.
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
    depleted: frozenset[int] = frozenset()
    programmes: tuple[Programme, ...] = ()
    arc_ends_s: dict[int, float] = field(default_factory=dict)
    arc_ends_kg: dict[int, float] = field(default_factory=dict)

    def record(self, arrays: layout.MissionArrays, holds_plane: bool = False) -> NDArray[np.void]:
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
        record["by_legs"] = (self.by_legs and needed) or np.any(arcs["held"])
        ends = (arcs["kind"] == layout.BURN) & np.isinf(arcs["duration"])
        ends[list(self.depleted)] = False
        ends[list(self.held)] = True
        ends[-1] = False
        for k in np.flatnonzero(ends & np.append(arcs["held"][1:] == 1, False)):
            # a burn of next to no length gives no attitude to hold: the held burn is aimed itself
            ends[k] = not self.lengths_s.get(int(k), math.inf) < SHORT_BURN
        record["ends_leg"][0, : len(arcs)] = ends
        if leaves_end_free(arrays.target[0]):
            record["aims"] = 1
            last = len(arcs) - 1
            end = self._end(last)
            record["target"][0, last] = arrays.target[0]
            record["target"]["true_anomaly"][0, last] = true_anomaly_of(end, mu)
        self._write_round_end(record[0], arrays)
        in_air = flies_in_air(arcs) and self.programmes
        if holds_plane and (in_air or arrays.environment["boost"]["knots"][0]):
            self._aim_at_plane(record[0], arrays)
        for k in np.flatnonzero(np.isinf(arcs["duration"]) | ends):
            if k < self.first_arc:
                continue
            length = self.lengths_s.get(int(k), math.nan)
            if not 0.0 <= length < math.inf:
                raise ValueError(f"length of arc {k} is {length}; expected 0 s or more")
            record["length"][0, k] = length
            if ends[k]:
                self._write_leg_end(record["target"][0, k], int(k), arrays)
        record["primer"] = math.nan
        for name, known in (
            ("direction", self.directions),
            ("position", self.positions),
            ("primer", self.primers),
            ("ignition", self.ignitions),
        ):
            for index, value in known.items():
                record[name][0, index] = value
        record["jettison_time"] = self.jettison_time_s
        return record

    def _write_leg_end(self, target: np.void, k: int, arrays: layout.MissionArrays) -> None:
        """Write the target of the leg that ends with burn ``k``.

        Args:
            target: record TARGET. Changed.
            k: index of the burn.
            arrays: the mission.

        Raises:
            ValueError: the state there is missing.
        """
        end = self._end(k)
        target["kind"] = layout.TARGET_RADIUS_SPEED_ANGLE_PLANE
        for name in ("radius", "speed", "flight_path_angle", "inclination"):
            target[name] = getattr(end, name)
        # undefined for an equatorial plane: any node will do
        target["ascending_node"] = np.nan_to_num(end.ascending_node)
        if self.by_legs and names_perigee_direction(arrays.target[0]):
            self._hold_perigee(target, k, ELONGATED)
        if k in self.floored:
            self._hold_perigee(target, k, OVAL)

    def _write_round_end(self, record: np.void, arrays: layout.MissionArrays) -> None:
        """Write the planned end of the last arc, if its orbit is nearly a circle.

        There the direction of the perigee, and the place relative to it, are badly conditioned.

        Args:
            record: record PLAN. Changed.
            arrays: the mission.
        """
        end = self.ends.get(len(arrays.arcs) - 1)
        target = arrays.target[0]
        named = int(judged_by(target))
        if end is None or not named & layout.NAMES_INCLINATION:
            return
        mu = float(arrays.environment["mu"][0])
        square = end.radius * end.speed**2 / mu
        level = math.cos(end.flight_path_angle)
        eccentricity = math.sqrt((square - 1.0) ** 2 * level**2 + (1.0 - level**2))
        if eccentricity > ROUND:
            return
        record["ends_round"] = 1
        record["round_end"] = target
        plane = bool(named & layout.NAMES_ASCENDING_NODE)
        kinds = layout.TARGET_RADIUS_SPEED_ANGLE_INCLINATION, layout.TARGET_RADIUS_SPEED_ANGLE_PLANE
        record["round_end"]["kind"] = kinds[plane]
        for name in ("radius", "speed", "flight_path_angle"):
            record["round_end"][name] = getattr(end, name)

    def _aim_at_plane(self, record: np.void, arrays: layout.MissionArrays) -> None:
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
        inclined = (
            named & (layout.NAMES_INCLINATION | layout.NAMES_ASCENDING_NODE)
            == layout.NAMES_INCLINATION
        )
        if target["kind"] == layout.TARGET_RADIUS_SPEED_ANGLE_INCLINATION:
            target["kind"] = layout.TARGET_RADIUS_SPEED_ANGLE_PLANE
        elif target["kind"] == layout.TARGET_ELEMENTS and inclined:
            target["named"] = named | layout.NAMES_ASCENDING_NODE
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
        target["kind"] = layout.TARGET_KEPLERIAN
        for name in ("semi_major_axis", "eccentricity", "argument_of_perigee"):
            target[name] = getattr(orbit, name)

    def _end(self, k: int) -> Insertion:
        """Return the state at the end of burn ``k``.

        Raises:
            ValueError: there is none.
        """
        if k not in self.ends:
            raise ValueError(f"end of burn {k} is missing; expected the state there")
        return self.ends[k]


def plan_of(trajectory: OfflineTrajectory, arrays: layout.MissionArrays) -> ArcPlan:
    """Build the plan of a mission's free arcs and free end.

    Args:
        trajectory: of the mission.
        arrays: the mission.

    Raises:
        ValueError: the trajectory is not of this mission, or goes through the ground.
    """
    arcs = arrays.arcs
    _check_arcs(trajectory, arcs)
    check_floor(trajectory, arrays)
    lifts = held_burns(trajectory, arrays)
    settled, depleted = _settled(trajectory, arrays)
    plan = ArcPlan(
        {},
        {},
        jettison_time_s=trajectory.jettison_time,
        first_arc=int(trajectory.flown_arc[0]),
        resumes=_resumes(trajectory, arrays),
        by_legs=trajectory.by_legs,
        held=frozenset(lifts),
        floored=frozenset(k for k, lift in lifts.items() if lift > 0.0),
        depleted=depleted,
        programmes=programmes_of(trajectory, settled),
    )
    begin = -math.inf
    for k, start, end in trajectory.flown():
        burns = arcs["kind"][k] == layout.BURN
        free = np.isinf(settled.arcs["duration"][k])
        plan.arc_ends_s[k] = end
        plan.arc_ends_kg[k] = float(trajectory.sample_mass[trajectory.rows_between(start, end)[-1]])
        if free and not burns and names_perigee_direction(arrays.target[0]):
            at = trajectory.sample_index(end, f"the end of arc {k}")
            plan.positions[k] = trajectory.sample_position[at]
        if np.isinf(arcs["duration"][k]) or k in lifts:
            plan.lengths_s[k] = end - start
        first = trajectory.first_burn(start, end)
        if burns and first is not None:
            primer = [trajectory.steering_direction[first], trajectory.primer_rate[first]]
            plan.primers[k] = np.array(primer)
            plan.ignitions[k] = float(trajectory.arc_start_time[first])
        if k + 1 == len(arcs) or (free and burns) or k in lifts:
            if trajectory.first_burn(begin, end) is not None:
                plan.directions[k] = trajectory.directions_between(begin, end)
            _plan_end(trajectory, arrays, plan, (k, end, lifts.get(k, 0.0)))
            begin = end
    return plan


def _settled(
    trajectory: OfflineTrajectory, arrays: layout.MissionArrays
) -> tuple[layout.MissionArrays, frozenset[int]]:
    """Return a mission with its depleted burns at their planned lengths, and these burns.

    A free burn that takes all propellant of its stage ends as one of fixed length does.
    """
    arcs = arrays.arcs.copy()
    mass = trajectory.sample_mass
    for (k, start, end), (after, *span) in pairwise(trajectory.flown()):
        arc, stage = arrays.arcs[k], int(arrays.arcs[k]["stage"])
        if arc["kind"] != layout.BURN or np.isfinite(arc["duration"]):
            continue
        if arrays.arcs[after]["stage"] == stage:
            continue
        own = arrays.jettisons[arrays.jettisons["stage"] == stage]
        heated = own["criterion"] == layout.HEATING_LIMIT
        dropped = own["mass"][~heated | (trajectory.jettison_time <= end)].sum()
        empty = arc["stack_mass"] - arc["propellant"] - dropped
        above = arrays.arcs[after]["stack_mass"]
        last, first = trajectory.rows_between(start, end)[-1], trajectory.rows_between(*span)[0]
        lost = mass[last] - mass[first]
        if lost - (empty - above) < DEPLETED_SHARE * arc["propellant"]:
            arcs["duration"][k] = end - start
    depleted = np.isinf(arrays.arcs["duration"]) & np.isfinite(arcs["duration"])
    return arrays._replace(arcs=arcs), frozenset(map(int, np.flatnonzero(depleted)))


def _plan_end(
    trajectory: OfflineTrajectory,
    arrays: layout.MissionArrays,
    plan: ArcPlan,
    leg: tuple[int, float, float],
) -> None:
    """Plan position, state and orbit at the end of a leg.

    Args:
        trajectory: of the mission.
        arrays: the mission.
        plan: changed.
        leg: index of its last arc, end, s, and lift of the end above a floor, m.
    """
    k, end, lift = leg
    what = f"the end of burn {k}"
    at = trajectory.sample_index(end, what)
    position, velocity = trajectory.sample_position[at], trajectory.sample_velocity[at]
    if lift > 0.0:
        position, velocity = _lifted(trajectory, at, lift, arrays)
    plan.positions[k] = position
    if k + 1 == len(arrays.arcs):
        # after the tail-off, where the target is to be met
        plan.ends[k] = trajectory.sample_at(float(trajectory.sample_time[-1]), what)
        return
    plan.ends[k] = Insertion.from_state(position, velocity)
    # on a floor the place counts, and not the orbit alone
    if not (plan.ends[k].flight_path_angle > 0.0 and lift > 0.0):
        mu = float(arrays.environment["mu"][0])
        plan.orbits[k] = Elements.from_state(position, velocity, mu)


def _check_arcs(trajectory: OfflineTrajectory, arcs: NDArray[np.void]) -> None:
    """Check that the flown arcs are the last arcs of a mission.

    Raises:
        ValueError: they are not.
    """
    lengths = trajectory.flown_end_time - trajectory.flown_start_time
    wanted = np.arange(len(arcs) - len(trajectory.flown_arc), len(arcs))
    if len(wanted) == 0 or wanted[0] < 0 or not np.array_equal(trajectory.flown_arc, wanted):
        raise ValueError(
            f"the trajectory flies arcs {list(map(int, trajectory.flown_arc))}, which are not "
            f"those of the mission: it has {len(arcs)}"
        )
    fixed = arcs["duration"][wanted]
    for k in np.flatnonzero(np.isfinite(fixed)):
        if lengths[k] > fixed[k] + SAME_TIME:
            raise ValueError(
                f"arc {wanted[k]} lasts {lengths[k]:.3f} s in the trajectory and "
                f"{fixed[k]:.3f} s in the mission: its arcs are not those of the mission"
            )


def _lifted(
    trajectory: OfflineTrajectory, at: int, lift: float, arrays: layout.MissionArrays
) -> tuple[Array, Array]:
    """Lift sample ``at``, the end of a burn, by ``lift`` m; return position, m, and velocity, m/s.

    The coast then ends where it did.
    """
    position, velocity = trajectory.sample_position[at], trajectory.sample_velocity[at]
    first = trajectory.first_burn(float(trajectory.sample_time[at]), math.inf)
    if first is None:
        return position * (1.0 + lift / np.linalg.norm(position)), velocity
    ignition = float(trajectory.arc_start_time[first])
    there = trajectory.sample_position[trajectory.sample_index(ignition, "the end of a coast")]
    mu = float(arrays.environment["mu"][0])
    return lifted(position, velocity, lift, there, mu)


def _resumes(trajectory: OfflineTrajectory, arrays: layout.MissionArrays) -> bool:
    """Return whether the plan begins later than a plan of the whole mission would."""
    environment = arrays.environment[0]
    arc, begin = int(trajectory.flown_arc[0]), float(trajectory.sample_time[0])
    if environment["boost"]["knots"] == 0:
        return arc > 0
    if begin < trajectory.flown_start_time[0] + SAME_TIME:
        arc -= 1
    # a second earlier the programme was not over yet
    gained = trajectory.sample_velocity[1] - trajectory.sample_velocity[0]
    v = trajectory.sample_velocity[0] - gained / (trajectory.sample_time[1] - begin)
    r = trajectory.sample_position[0] - v
    return bool(is_over(begin - 1.0, tuple(r), tuple(v), arc, environment))
