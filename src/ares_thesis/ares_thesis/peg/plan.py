# SPDX-License-Identifier: Apache-2.0
"""Plan of the jettison, which law `peg_thesis` takes from an optimized trajectory."""

import math
from dataclasses import dataclass, fields

import numpy as np

from ares_guidance.trajectory import LEAST_DROP, SAME_TIME, OfflineTrajectory


@dataclass(frozen=True)
class JettisonPlan:
    """Hold the jettison as an interior target and the scalar delta-V of each burn (Table 6.6).

    Attributes:
        radius_m, speed_m_s, flight_path_angle_rad: state at the jettison.
        jettison_time_s, cutoff_time_s: mission elapsed time.
        delta_v_m_s: start to staging, staging to jettison, jettison to cut-off; 0 for a
            part already flown.
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

    @classmethod
    def from_trajectory(cls, trajectory: OfflineTrajectory) -> "JettisonPlan":
        """Take the state at the jettison and the delta-V of each part from a trajectory.

        Raises:
            ValueError: there is no jettison, or no sample of it.
        """
        t = trajectory.jettison_time
        if not math.isfinite(t) or len(trajectory.sample_time) == 0:
            raise ValueError(f"jettison_time is {t}; expected a sampled one")
        there = trajectory.sample_at(t, "the jettison")
        before = trajectory.arc_end_time <= t + SAME_TIME
        drops = trajectory.arc_start_mass[1:] < trajectory.arc_end_mass[:-1] * (1.0 - LEAST_DROP)
        # staging is the only drop before the jettison
        staging = np.flatnonzero(drops & before[1:])
        staged = np.arange(len(before)) > (staging[0] if len(staging) else -1)
        pieces = (before & ~staged, before & staged, ~before)
        first, second, third = (float(np.sum(trajectory.arc_delta_v[piece])) for piece in pieces)
        return cls(
            there.radius,
            there.speed,
            there.flight_path_angle,
            t,
            trajectory.cutoff_time,
            (first, second, third),
        )
