# SPDX-License-Identifier: Apache-2.0
"""Write out what a mission file may say in short: the Earth, a sun-synchronous inclination."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

from ares_models.mission_keys import SUN_SYNCHRONOUS, fail
from ares_models.mission_target import TargetOrbit
from ares_models.sidereal import EARTH_RATE, turns_as_earth

if TYPE_CHECKING:
    from ares_models.mission import Mission

#: The Earth where a file names no body: WGS 84 with its oblateness term, and the U.S. Standard
#: Atmosphere 1976.
EARTH: dict[str, Any] = {
    "mu_m3_s2": 3.986004418e14,
    "j2": 1.08262982e-3,
    "earth": {
        "equatorial_radius_m": 6378137.0,
        "polar_radius_m": 6356752.3142,
        "rotation_rate_rad_s": EARTH_RATE,
    },
    "atmosphere": {"model": "us76"},
}
#: Mean motion of the sun in right ascension, rad/s: a turn in a tropical year.
_SUN_RATE = 2.0 * math.pi / (365.2421897 * 86_400.0)


def on_earth(data: Any) -> Any:
    """Return the content of a mission file with the Earth as its body if it names none.

    What the file does say of its environment stays. Without an epoch the inertial x axis points to
    longitude zero at mission time 0.

    Args:
        data: content of the file.
    """
    if not isinstance(data, dict):
        return data
    given = data.get("environment", {})
    if not isinstance(given, dict) or given.keys() & {"mu_m3_s2", "earth"}:
        return data
    body = EARTH | given
    if data.get("epoch") is None:
        body["earth"] = EARTH["earth"] | {"zero_longitude_deg": 0.0}
    return data | {"environment": body}


def with_inclination(data: Any, check: Callable[[Any], "Mission"]) -> Any:
    """Return the content of a mission file with a number for ``inclination_deg: sun_synchronous``.

    By J2 the node of that orbit turns as fast as the mean sun. Vallado, Fundamentals of
    Astrodynamics, ch. 9.

    Args:
        data: content of the file.
        check: check of such a content.

    Raises:
        PydanticCustomError: no inclination of the target makes it sun-synchronous.
    """
    target = data.get("target") if isinstance(data, dict) else None
    if not isinstance(target, dict) or target.get("inclination_deg") != SUN_SYNCHRONOUS:
        return data

    def inclined(degrees: float) -> Any:
        return data | {"target": target | {"inclination_deg": degrees}}

    def refuse(because: str) -> NoReturn:
        fail(("target", "inclination_deg"), SUN_SYNCHRONOUS, f"a number in deg, because {because}")

    # first with one from which no other key depends
    mission = check(inclined(98.0))
    environment, orbit = mission.environment, mission.target
    if not isinstance(orbit, TargetOrbit) or len(orbit.sizes(mission)) < 2:
        refuse("size and shape of the orbit are not both named")
    conic = orbit.conic(mission)
    if conic.c3 >= 0.0:
        refuse("the orbit is an escape")
    if environment.j2 == 0.0 or not turns_as_earth(environment.earth.rotation_rate_rad_s):
        refuse("j2 is 0" if environment.j2 == 0.0 else "the body does not turn as the Earth")
    mu, radius = environment.mu_m3_s2, environment.earth.equatorial_radius_m
    semi_major_axis = -mu / conic.c3
    parameter = conic.perigee * (1.0 + conic.eccentricity)
    mean_motion = math.sqrt(mu / semi_major_axis**3)
    cosine = -_SUN_RATE / (1.5 * mean_motion * environment.j2 * (radius / parameter) ** 2)
    if cosine < -1.0:
        refuse("the node of so high an orbit turns more slowly than the sun")
    return inclined(math.degrees(math.acos(cosine)))
