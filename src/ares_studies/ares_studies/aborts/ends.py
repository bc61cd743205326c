# SPDX-License-Identifier: Apache-2.0
"""Judge the end of a flight after a failure: kind, mass, impact point."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_models.geodesy import geodetic
from ares_models.impacts import find_impact
from ares_models.judge import End, judge, left_on
from ares_models.mission import Mission
from ares_models.tolerances import SAFE_PERIGEE_M, SAME_SPEED_M_S

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Reached:
    """Hold the end of a flight.

    Attributes:
        end: its kind.
        m_f_kg: final mass; nan: no flight.
        time_s: end of the thrust.
        lacking_m_s: speed equivalent of the missing energy, at the target's lowest point; negative
            for an excess.
        perigee_altitude_m: above the equatorial radius.
        apogee_altitude_m: above the equatorial radius; inf for an escape.
        impact_deg: latitude and longitude of the impact without drag; nan: no impact.
        area: area of the impact; "": outside all areas, or no impact.
        left_on: names of the parts that should have been jettisoned and were not.
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
        """Return whether there is an impact point."""
        return math.isfinite(self.impact_deg[0])


#: End if no flight was found.
NOWHERE = Reached(End.SUBORBITAL, math.nan, math.nan, math.nan, math.nan, math.nan)


def better(one: Reached, other: Reached) -> Reached:
    """Return the better of two ends, by kind, then by how far a target is lowered, then by mass."""
    if one.end is not other.end:
        return min(one, other, key=lambda reached: reached.end.rank)
    if one.end is End.LOWERED and abs(one.lacking_m_s - other.lacking_m_s) > SAME_SPEED_M_S:
        return min(one, other, key=lambda reached: reached.lacking_m_s)
    return other if other.m_f_kg > one.m_f_kg else one


class Judge:
    """Judge the ends of one mission's flights.

    Attributes:
        safe_perigee_altitude_m: lowest perigee of a lasting orbit.
        areas: names of the areas that impacts must avoid.
    """

    def __init__(self, mission: Mission):
        """Extract the target and the areas of a mission."""
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
        """Judge a state.

        Args:
            position: m, shape (3,), at the end of the thrust.
            velocity: m/s, shape (3,).
            m_f_kg: mass.
            time_s: time.
            jettisoned: bit k: jettison k is done.
            grounded: whether the vehicle has hit the ground.
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

    def heights_m(self, time_s: Array, position: Array) -> Array:
        """Return the heights of a trajectory, shape (n,) and (n, 3), above the ground."""
        heights: Array = geodetic(time_s, position, self._earth).height_m
        return heights

    def _impact(
        self, position: Array, velocity: Array, time_s: float
    ) -> tuple[tuple[float, float], str]:
        found = find_impact(
            position.tolist(), velocity.tolist(), time_s, self._environment, self.areas
        )
        if found is None:
            return NOWHERE.impact_deg, ""
        return (found.latitude_deg, found.longitude_deg), found.area or ""
