# SPDX-License-Identifier: Apache-2.0
"""Where a flight after a failure comes to: what the judge says, the mass, and where it falls."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_models.geodesy import geodetic
from ares_models.impacts import find_impact
from ares_models.judge import End, judge, left_on
from ares_models.mission import Mission
from ares_models.tolerances import SAFE_PERIGEE_M

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Reached:
    """The end of a flight.

    Attributes:
        end: which.
        m_f_kg: mass there; nan: no flight.
        time_s: end of the thrust.
        lacking_m_s: speed that its energy is short of, where the target is lowest; less than 0:
            more than was asked for.
        perigee_altitude_m: over the equatorial radius.
        apogee_altitude_m: the same; inf for an escape.
        impact_deg: latitude and longitude where it would fall without air; nan: it would not.
        area: that it falls in; empty: outside of all, or it does not fall.
        left_on: names of what should have been jettisoned and was not.
    """

    end: End
    m_f_kg: float
    time_s: float
    lacking_m_s: float
    perigee_altitude_m: float
    apogee_altitude_m: float
    impact_deg: tuple[float, float] = (math.nan, math.nan)
    area: str = ""
    left_on: tuple[str, ...] = ()

    @property
    def falls(self) -> bool:
        """Whether there is a place where it falls."""
        return math.isfinite(self.impact_deg[0])


#: No flight was found.
NOWHERE = Reached(End.SUBORBITAL, math.nan, math.nan, math.nan, math.nan, math.nan)


def better(one: Reached, other: Reached) -> Reached:
    """The better of two ends, by kind and then by mass."""
    if one.end is not other.end:
        return min(one, other, key=lambda reached: reached.end.rank)
    return other if other.m_f_kg > one.m_f_kg else one


class Judge:
    """Tells ends for one mission.

    Attributes:
        safe_perigee_altitude_m: of an orbit that lasts.
        areas: names of those that impacts are kept out of.
    """

    def __init__(self, mission: Mission):
        """Take what the mission asks for."""
        arrays = mission.arrays()
        self.safe_perigee_altitude_m = SAFE_PERIGEE_M
        if mission.abort is not None:
            self.safe_perigee_altitude_m = mission.abort.safe_perigee_altitude_m
        self.areas = mission.area_names
        self._jettisons = mission.jettison_names
        self._target = arrays.target[0]
        self._environment = arrays.environment[0]
        self._earth = mission.earth()

    def judge(
        self,
        position: Array,
        velocity: Array,
        m_f_kg: float,
        time_s: float,
        jettisoned: int,
        *,
        grounded: bool = False,
    ) -> Reached:
        """The end that a state is.

        Args:
            position: m, shape (3,), where the thrust is over.
            velocity: m/s, shape (3,).
            m_f_kg: mass there.
            time_s: when.
            jettisoned: bit k: jettison k is done.
            grounded: whether the vehicle met the ground.
        """
        judged = judge(
            position.tolist(),
            velocity.tolist(),
            self._target,
            float(self._environment["mu"]),
            float(self._environment["equatorial_radius"]),
            grounded=grounded,
        )
        impact, area = NOWHERE.impact_deg, ""
        if judged.end is End.SUBORBITAL:
            impact, area = self._impact(position, velocity, time_s)
        return Reached(
            judged.end,
            m_f_kg,
            time_s,
            judged.lacking_m_s,
            judged.perigee_altitude_m,
            judged.apogee_altitude_m,
            impact,
            area,
            left_on(jettisoned, self._jettisons),
        )

    def meets_ground(self, time_s: Array, position: Array) -> bool:
        """Whether a way, shape (n,) and (n, 3), goes below the ground: the plant ends there."""
        return bool(geodetic(time_s, position, self._earth).height_m.min() < 0.0)

    def _impact(
        self, position: Array, velocity: Array, time_s: float
    ) -> tuple[tuple[float, float], str]:
        found = find_impact(
            position.tolist(), velocity.tolist(), time_s, self._environment, self.areas
        )
        if found is None:
            return NOWHERE.impact_deg, ""
        return (found.latitude_deg, found.longitude_deg), found.area or ""
