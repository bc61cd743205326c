# SPDX-License-Identifier: Apache-2.0
"""Attitude programmes through the air, from an optimized trajectory."""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_guidance.arrays import PROGRAMME
from ares_guidance.load_relief import plan_relief
from ares_guidance.trajectory import SAME_TIME, TIME_ROUNDING, OfflineTrajectory
from ares_models.arrays import BURN, COAST, MAX_PROGRAMME, NAVIGATION, MissionArrays
from ares_models.kernels.aerodynamics import body_force, pressure_loss
from ares_models.kernels.environment import relative_velocity
from ares_models.kernels.sequence import drop_time, last_ignition
from ares_models.kernels.vectors import norm
from ares_models.plans import LONG_COAST_S

Array = NDArray[np.float64]

#: Acceleration by the forces of the air below which a law takes over from the programme, m/s2.
HANDED_OVER_M_S2 = 0.01
#: Later hand-overs in each burn, and the share of a burn that is not fixed up to which they go.
LATER = 8
LATEST_SHARE = 0.75
#: Forces of the air, as a share of the thrust, below which a law takes over in a burn that ends
#: low, where they are not small before that share of it.
HANDED_OVER_SHARE = 0.01
#: Time from which on a burn has a direction that counts, s.
LASTING_S = 1.0
#: Error of the direction between two knots that is next to nothing, rad, and rate of the direction
#: by which an error of the time counts, rad/s.
_STRAIGHT = 1e-5
_TURN_RATE = 1e-3
#: Turn of the velocity in the air by which an error of the relief counts, rad.
_RELIEF = 1e-3
#: Columns of a programme, one entry per knot.
KNOTS = ("arc", "time", "speed", "direction", "air_direction", "relief")


class Programme(NamedTuple):
    """Hold an attitude programme, one entry per knot.

    Attributes:
        arc: index into the mission's arcs; no knots where the law begins at once.
        time: mission elapsed time as planned, s.
        speed: in the air, m/s.
        direction: of the thrust, unit vectors, shape (n, 3).
        air_direction: of the planned velocity in the air, unit vectors, shape (n, 3).
        relief: turn of the thrust per turn of that direction.
        state: planned navigation state at the hand-over, shape (1,), dtype NAVIGATION.
        next_thrust: time from which thrust lasts after it, s, and its planned direction then, a
            unit vector; None: there is none.
    """

    arc: NDArray[np.int64]
    time: Array
    speed: Array
    direction: Array
    air_direction: Array
    relief: Array
    state: NDArray[np.void]
    next_thrust: tuple[float, Array] | None = None

    def record(self) -> NDArray[np.void]:
        """Return the programme for the kernels, shape (1,), dtype PROGRAMME."""
        record = np.zeros(1, PROGRAMME)
        count = len(self.time)
        record["count"] = count
        for name in KNOTS:
            record[name][0, :count] = getattr(self, name)
        return record

    def thinned(self, most: int) -> "Programme":
        """Return the programme with at most so many knots, placed where straight lines fail.

        The law interpolates the time over the speed, then the direction over the time. The ends of
        arcs are kept.
        """
        keep = np.append(np.diff(self.arc) != 0, True)
        keep |= np.append(True, keep[:-1])
        while True:
            knots = np.flatnonzero(keep)
            off = self._off(knots)
            # the worst of each interval between two knots
            worst = [
                begin + 1 + int(np.argmax(off[begin + 1 : end]))
                for begin, end in pairwise(knots)
                if end > begin + 1
            ]
            worst = sorted((k for k in worst if off[k] > _STRAIGHT), key=lambda k: -off[k])
            if not worst or len(knots) == most:
                return self._replace(**{name: getattr(self, name)[keep] for name in KNOTS})
            keep[worst[: most - len(knots)]] = True

    def _off(self, knots: NDArray[np.int64]) -> Array:
        """Return the error of the direction, rad, between some knots, shape (n,)."""
        off = np.zeros(len(self.time))
        columns = [self.direction]
        if self.relief.any():
            columns += [self.air_direction, _RELIEF * self.relief[:, None]]
        followed = np.column_stack(columns)
        for arc in np.unique(self.arc):
            own = np.flatnonzero(self.arc == arc)
            there = knots[self.arc[knots] == arc]
            time, speed = self.time[there], self.speed[there]
            at = self.time[own]
            if (np.diff(speed) > 0.0).all():
                at = np.interp(self.speed[own], speed, time)
            for column in followed.T:
                straight = np.interp(at, time, column[there])
                off[own] += (straight - column[own]) ** 2
            off[own] = np.maximum(np.sqrt(off[own]), _TURN_RATE * np.abs(at - self.time[own]))
        return off


def programmes_of(trajectory: OfflineTrajectory, arrays: MissionArrays) -> tuple[Programme, ...]:
    """Return attitude programmes up to where the forces of the air are small, and beyond.

    Args:
        trajectory: of the mission.
        arrays: the mission.

    Returns:
        none if the forces are small all along, and no burn before the last one is of fixed length:
        such burns may give too much, which not every law wastes.
    """
    first = _hand_over(trajectory, arrays)
    ahead = arrays.arcs[trajectory.flown_arc[:-1]]
    fixed = (ahead["kind"] == BURN) & np.isfinite(ahead["duration"])
    if not (trajectory.flown_start_time[0] < first - SAME_TIME or fixed.any()):
        return ()
    for k, start, stop in trajectory.flown():
        free = arrays.arcs["kind"][k] == BURN and np.isinf(arrays.arcs["duration"][k])
        if free and start + LATEST_SHARE * (stop - start) < first <= stop:
            first = max(start, _hand_over(trajectory, arrays, HANDED_OVER_SHARE))
    ends = [first]
    for k, start, stop in trajectory.flown():
        inside = [start]
        if arrays.arcs["kind"][k] == BURN:
            share = LATEST_SHARE if np.isinf(arrays.arcs["duration"][k]) else 1.0
            inside += list(np.linspace(start, start + share * (stop - start), LATER)[1:-1])
        ends += [t for t in inside if t > first + SAME_TIME]
    environment = arrays.environment[0]
    speed = np.array(
        [
            norm(relative_velocity(tuple(r), tuple(v), environment))
            for r, v in zip(trajectory.sample_position, trajectory.sample_velocity, strict=True)
        ]
    )
    samples = (speed, *plan_relief(trajectory, arrays))
    return tuple(_programme(trajectory, arrays, samples, end) for end in ends)


def _programme(
    trajectory: OfflineTrajectory,
    arrays: MissionArrays,
    samples: tuple[Array, Array, Array],
    end: float,
) -> Programme:
    """Return the attitude programme up to a time.

    Args:
        trajectory: of the mission.
        arrays: the mission.
        samples: speed over the ground, m/s, direction of the velocity in the air and relief, by
            sample.
        end: s.
    """
    speed, air_direction, relief = samples
    parts = []
    for k, start, stop in trajectory.flown():
        rows = trajectory.rows_between(start, min(stop, end))
        if start >= end - SAME_TIME or len(rows) < 2:
            continue
        parts.append(
            (
                np.full(len(rows), k),
                trajectory.sample_time[rows],
                np.maximum.accumulate(speed[rows]),
                trajectory.sample_direction[rows].copy(),
                air_direction[rows],
                relief[rows],
            )
        )
    state = _navigation(trajectory, end, arrays)
    if not parts:
        none, axes = np.zeros(0), np.zeros((0, 3))
        return Programme(np.zeros(0, np.int64), none, none, axes, axes, none, state)
    # without thrust, turn to the direction of the next; after the last, keep it
    ahead = trajectory.direction_at(end)
    for arc, _, _, direction, _, _ in reversed(parts):
        coasts = arrays.arcs["kind"][arc[0]] != BURN
        for k in reversed(range(len(direction))):
            if coasts or not np.isfinite(direction[k]).all():
                direction[k] = ahead
            ahead = direction[k]
    columns = zip(KNOTS, zip(*parts, strict=True), strict=True)
    knots: dict[str, Any] = {name: np.concatenate(column) for name, column in columns}
    thrust = _next_thrust(trajectory, arrays, end)
    return Programme(**knots, state=state, next_thrust=thrust).thinned(MAX_PROGRAMME)


def _next_thrust(
    trajectory: OfflineTrajectory, arrays: MissionArrays, end: float
) -> tuple[float, Array] | None:
    """Return time and direction of the first thrust from a time on that lasts; None: none does."""
    for k, start, stop in trajectory.flown():
        begin = max(start, end)
        if arrays.arcs["kind"][k] == BURN and stop - begin > LASTING_S:
            return begin, trajectory.sample_direction[trajectory.rows_between(begin, stop)[0]]
    return None


def _navigation(trajectory: OfflineTrajectory, t: float, arrays: MissionArrays) -> NDArray[np.void]:
    """Return the planned navigation state of the first sample from a time on, shape (1,).

    Where an arc ends that is the state at the begin of the next.
    """
    later = trajectory.flown_end_time > t + SAME_TIME
    flown = int(np.argmax(later)) if later.any() else len(later) - 1
    k = int(trajectory.flown_arc[flown])
    rows = trajectory.rows_between(
        float(trajectory.flown_start_time[flown]), float(trajectory.flown_end_time[flown])
    )
    after = int(np.searchsorted(trajectory.sample_time[rows], t - TIME_ROUNDING))
    row = rows[min(after, len(rows) - 1)]
    state = np.zeros(1, NAVIGATION)
    for name in ("time", "position", "velocity", "mass"):
        state[name] = getattr(trajectory, f"sample_{name}")[row]
    state["heating_rate"] = math.nan
    state["arc"] = k
    state["arc_start_time"] = trajectory.flown_start_time[flown]
    now = float(trajectory.sample_time[row])
    ignited, ignition = last_ignition(k, float(trajectory.flown_start_time[flown]), arrays.arcs)
    heating = trajectory.jettison_time if math.isfinite(trajectory.jettison_time) else math.inf
    for j, jettison in enumerate(arrays.jettisons):
        over = bool(arrays.arcs["stage"][k] > jettison["stage"])
        if over or now >= drop_time(jettison, ignited, ignition, now, heating):
            state["jettisoned"] |= 1 << j
    return state


def _hand_over(trajectory: OfflineTrajectory, arrays: MissionArrays, share: float = 0.0) -> float:
    """Return the time from which the forces of the air are small, s; -inf: always.

    A long coast ends the ascent: low perigees after it are no part of it.

    Args:
        trajectory: of the mission.
        arrays: the mission.
        share: of the thrust that is small too.
    """
    environment, atmosphere = arrays.environment[0], arrays.atmosphere
    end = -math.inf
    for k, start, stop in trajectory.flown():
        arc = arrays.arcs[k]
        if arc["kind"] == COAST and stop - start > LONG_COAST_S:
            break
        for i in trajectory.rows_between(start, stop):
            r, v = trajectory.sample_position[i], trajectory.sample_velocity[i]
            u = tuple(trajectory.sample_direction[i])
            force = norm(body_force(arc, tuple(r), tuple(v), u, environment, atmosphere))
            force += pressure_loss(arc, tuple(r), environment, atmosphere)
            if force > max(HANDED_OVER_M_S2 * trajectory.sample_mass[i], share * arc["thrust"]):
                end = max(end, min(float(trajectory.sample_time[i]) + 1.0, stop))
        if arc["vertical"]:
            end = max(end, stop)
    return end
