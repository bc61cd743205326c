"""The ends of a flight after a failure, from the best to the worst, and how one is told."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance.kernels.shortfall import perigee_radius
from ares_models.arrays import TARGET_ELEMENTS, TARGET_KEPLERIAN
from ares_models.geodesy import geodetic
from ares_models.impacts import find_impact
from ares_models.mission import Mission
from ares_models.orbits import Elements
from ares_studies.montecarlo.arrays import RESULT
from ares_studies.montecarlo.kernels import judge_insertion, on_target

Array = NDArray[np.float64]

#: Where a mission names none, m: an orbit that lasts a day.
SAFE_PERIGEE_M = 120_000.0
#: m of a perigee below the limit that is still a safe orbit: a cut-off's scatter.
PERIGEE_SLACK_M = 500.0
#: m and rad within which radius and flight-path angle are those of the target that is lowered.
_SAME_RADIUS_M = 5_000.0
_SAME_ANGLE = math.radians(0.1)


class End(StrEnum):
    """What is reached, the best first."""

    #: within the tolerances of every judge
    TARGET = "target"
    #: radius and angle, or perigee, of the target with less speed, and a safe perigee; or one that
    #: is no lower than the target's, where that is below the limit
    LOWERED = "lowered"
    #: another orbit with a perigee above the limit
    SAFE_ORBIT = "safe_orbit"
    #: none that lasts
    SUBORBITAL = "suborbital"

    @property
    def rank(self) -> int:
        """0 for the best."""
        return list(End).index(self)


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
    """

    end: End
    m_f_kg: float
    time_s: float
    lacking_m_s: float
    perigee_altitude_m: float
    apogee_altitude_m: float
    impact_deg: tuple[float, float] = (math.nan, math.nan)
    area: str = ""

    @property
    def falls(self) -> bool:
        """Whether there is a place where it falls."""
        return math.isfinite(self.impact_deg[0])


#: No flight was found.
NOWHERE = Reached(End.SUBORBITAL, math.nan, math.nan, math.nan, math.nan, math.nan)


def energy_and_radius(target: Any, mu: float) -> tuple[float, float]:
    """Energy of a target, m2/s2, and its lowest radius where speeds are compared, m.

    Args:
        target: record TARGET.
        mu: m3/s2.
    """
    if target["kind"] == TARGET_ELEMENTS:
        return 0.5 * float(target["c3"]), float(target["perigee_radius"])
    if target["kind"] == TARGET_KEPLERIAN:
        a = float(target["semi_major_axis"])
        return -0.5 * mu / a, a * (1.0 - float(target["eccentricity"]))
    radius, speed = float(target["radius"]), float(target["speed"])
    return 0.5 * speed**2 - mu / radius, radius


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
        self._target = arrays.target[0]
        self._environment = arrays.environment[0]
        self._earth = mission.earth()
        self._mu = float(self._environment["mu"])
        energy, self._radius = energy_and_radius(self._target, self._mu)
        self._speed = self._speed_of(energy)
        ground = float(self._environment["equatorial_radius"])
        self._lowest = min(
            self.safe_perigee_altitude_m, perigee_radius(self._target, self._mu) - ground
        )

    def _speed_of(self, energy: float) -> float:
        return math.sqrt(max(0.0, 2.0 * (energy + self._mu / self._radius)))

    def judge(self, position: Array, velocity: Array, m_f_kg: float, time_s: float) -> Reached:
        """The end that a state is.

        Args:
            position: m, shape (3,), where the thrust is over.
            velocity: m/s, shape (3,).
            m_f_kg: mass there.
            time_s: when.
        """
        r, v = tuple(position.tolist()), tuple(velocity.tolist())
        radius, speed = math.hypot(*r), math.hypot(*v)
        orbit = Elements.from_state(position, velocity, self._mu)
        ground = float(self._environment["equatorial_radius"])
        perigee = orbit.perigee_radius - ground
        result = np.zeros(1, RESULT)
        judge_insertion(r, v, self._target, self._mu, result[0])
        end = End.SUBORBITAL
        if on_target(self._target, result[0]):
            end = End.TARGET
        elif perigee >= self._lowest - PERIGEE_SLACK_M:
            lowered = self._is_lowered(result[0]) or perigee < self.safe_perigee_altitude_m
            end = End.LOWERED if lowered else End.SAFE_ORBIT
        energy = 0.5 * speed**2 - self._mu / radius
        return Reached(
            end,
            m_f_kg,
            time_s,
            self._speed - self._speed_of(energy),
            perigee,
            orbit.apogee_radius - ground,
            *(self._impact(position, velocity, time_s) if end is End.SUBORBITAL else ()),
        )

    def meets_ground(self, time_s: Array, position: Array) -> bool:
        """Whether a way, shape (n,) and (n, 3), goes below the ground: the plant ends there."""
        return bool(geodetic(time_s, position, self._earth).height_m.min() < 0.0)

    def _is_lowered(self, result: Any) -> bool:
        """Whether radius and angle are the target's; of an orbit by elements, its perigee is."""
        if self._target["kind"] in (TARGET_ELEMENTS, TARGET_KEPLERIAN):
            return abs(float(result["perigee_radius_error"])) <= _SAME_RADIUS_M
        return (
            abs(float(result["radius_error"])) <= _SAME_RADIUS_M
            and abs(float(result["flight_path_angle_error"])) <= _SAME_ANGLE
        )

    def _impact(
        self, position: Array, velocity: Array, time_s: float
    ) -> tuple[tuple[float, float], str]:
        found = find_impact(
            position.tolist(), velocity.tolist(), time_s, self._environment, self.areas
        )
        if found is None:
            return NOWHERE.impact_deg, ""
        return (found.latitude_deg, found.longitude_deg), found.area or ""
