"""What a trajectory found off line tells a guidance law before it starts."""

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ares_models.orbits import Insertion

Array = NDArray[np.float64]

#: How far the sample of the jettison may be from its time, s.
SAME_TIME = 0.01
#: What staging drops at least, as a part of the mass. Rounding is less, a stage is more.
LEAST_DROP = 1e-6


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
        sample_time: s; the jettison is one of them.
        sample_position: shape (n, 3), m.
        sample_velocity: shape (n, 3), m/s.
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
    sample_time: Array
    sample_position: Array
    sample_velocity: Array

    def __post_init__(self) -> None:
        """Check the lists.

        Raises:
            ValueError: one line; lists that belong together differ in length.
        """
        for kind in ("arc", "sample"):
            lengths = {
                item.name: len(getattr(self, item.name))
                for item in fields(self)
                if item.name.startswith((kind, "steering") if kind == "arc" else kind)
            }
            if len(set(lengths.values())) > 1:
                found = ", ".join(f"{name} {length}" for name, length in lengths.items())
                raise ValueError(f"{kind}s: expected lists of one length, found {found}")

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

    def jettison_plan(self) -> JettisonPlan:
        """State at the jettison and the scalar delta-V of each piece.

        Raises:
            ValueError: there is no jettison, or the lists do not hold it.
        """
        t = self.jettison_time
        if not math.isfinite(t) or len(self.sample_time) == 0:
            raise ValueError(f"jettison_time is {t}; expected a sampled one")
        nearest = int(np.argmin(np.abs(self.sample_time - t)))
        if abs(self.sample_time[nearest] - t) > SAME_TIME:
            raise ValueError(
                f"no sample at the jettison: the nearest to {t:.3f} s is at "
                f"{self.sample_time[nearest]:.3f} s"
            )
        there = Insertion.from_state(self.sample_position[nearest], self.sample_velocity[nearest])
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
