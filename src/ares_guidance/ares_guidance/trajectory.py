# SPDX-License-Identifier: Apache-2.0
"""An optimized trajectory, as guidance gets it from the optimizer."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ares_models.orbits import Insertion

Array = NDArray[np.float64]

#: Largest time difference between a sample and the requested time, s.
SAME_TIME = 0.01
#: Largest difference between initial and measured mass, as a fraction.
SAME_MASS = 1e-3
#: Largest deviation of a direction's length from 1, and largest direction rate, 1/s.
ABOUT_UNIT = 1e-3
FASTEST_TURN = 1.0
#: Length of what has vanished, and time difference that is rounding, s.
VANISHING = 1e-3
TIME_ROUNDING = 1e-6
#: Smallest mass drop that counts as staging, as a fraction of the mass; rounding is smaller.
LEAST_DROP = 1e-6


def _expect(sound: NDArray[np.bool_], name: str, expected: str) -> None:
    """Raise ValueError unless all elements of a mask are true."""
    if not np.all(sound):
        raise ValueError(f"{name}: expected {expected}")


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
        by_legs: see :class:`ares_guidance.plan.ArcPlan`.
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

    def flown(self) -> Iterator[tuple[int, float, float]]:
        """Yield index, start and end, s, of each of the mission's arcs from the present one on."""
        for k, start, end in zip(
            self.flown_arc, self.flown_start_time, self.flown_end_time, strict=True
        ):
            yield int(k), float(start), float(end)

    def sample_at(self, t: float, what: str) -> Insertion:
        """Return the state of the sample at a time, s.

        Raises:
            ValueError: there is no sample; the message names the event ``what``.
        """
        k = self.sample_index(t, what)
        return Insertion.from_state(self.sample_position[k], self.sample_velocity[k])

    def sample_index(self, t: float, what: str) -> int:
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

    def rows_between(self, begin: float, end: float) -> NDArray[np.int64]:
        """Return the samples between two events, s: of the two at each the one inside.

        Between events at the same time that is one. What two events at nearly the same time have
        between them, at an end, is left out: its direction is none.
        """
        time = self.sample_time
        first = int(np.searchsorted(time, begin + TIME_ROUNDING, side="right")) - 1
        last = int(np.searchsorted(time, end - TIME_ROUNDING, side="left"))
        if first > last:
            first = last = (first + last) // 2
        rows = np.arange(max(first, 0), min(last, len(time) - 1) + 1)
        lasting = slice(
            int(np.sum(time[rows] < time[rows[0]] + VANISHING)) - 1,
            int(np.sum(time[rows] <= time[rows[-1]] - VANISHING)) + 1,
        )
        rows = rows[lasting] if lasting.start < lasting.stop else rows
        return rows[np.diff(time[rows], prepend=-math.inf) > TIME_ROUNDING]

    def direction_at(self, t: float) -> Array:
        """Return the thrust direction of the first sample with thrust from a time on, s."""
        known = np.isfinite(self.sample_direction).all(axis=1)
        later = np.flatnonzero(known & (self.sample_time >= t - TIME_ROUNDING))
        row = later[0] if later.size else np.flatnonzero(known)[-1]
        direction: Array = self.sample_direction[row]
        return direction

    def first_burn(self, start: float, end: float) -> int | None:
        """Return the index of the first segment with thrust between two times, s, or None."""
        middle = 0.5 * (self.arc_start_time + self.arc_end_time)
        inside = (middle > start) & (middle < end) & (self.arc_delta_v > 0.0)
        return int(np.argmax(inside)) if inside.any() else None

    def directions_between(self, begin: float, end: float) -> Array:
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
