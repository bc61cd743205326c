# SPDX-License-Identifier: Apache-2.0
"""Proposed dispersions of a vehicle, from its mission alone.

``docs/montecarlo.md`` explains the rules and their results.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ares_models.input_file import read_input
from ares_models.mission import Mission
from ares_models.orbits import Elements
from ares_models.plans import flies_in_air
from ares_models.sidereal import turns_as_earth
from ares_vehicle_sim.dispersions import DISPERSIONS, STANDARD_PAD

#: One sigma as a fraction of the speed over the ground, after an open-loop ascent.
SPEED_SHARE = 0.005
#: One sigma as a fraction of the initial altitude.
ALTITUDE_SHARE = 0.01
#: One sigma as a fraction of speed and radius, for a start in orbit after guided flight.
ORBIT_SHARE = 1e-4
THRUST = 0.005
SPECIFIC_IMPULSE = 0.001
#: One sigma as a fraction of a stage's dry mass; the last stage includes the payload.
DRY_MASS = 0.0025
PROPELLANT = 0.001
JETTISON_MASS = 0.01
BALLISTIC_COEFFICIENT = 0.2
#: One sigma of the logarithm of a factor on the density: where a fairing goes, and below 30 km.
LOG_DENSITY = 0.3
LOG_DENSITY_LOW = 0.03
#: One sigma of what a wind that was measured changes by within hours: m, m/s.
WIND_CHANGE = [[0.0, 1.5, 1.5], [6000.0, 4.0, 4.0], [20000.0, 4.0, 4.0]]


@dataclass(frozen=True)
class Proposed:
    """Hold the proposed dispersion of a quantity.

    Attributes:
        key: of the dispersions file.
        value: of the key.
        reason: for the value, a comment in the file.
    """

    key: str
    value: float | list[float] | dict[str, Any]
    reason: str


def propose(mission: Mission) -> Iterator[Proposed]:
    """Propose dispersions by the rules, in the order of the file.

    Args:
        mission: the mission.
    """
    yield from _start(mission)
    yield Proposed("thrust", THRUST, "one sigma per stage: 1.5 % is three")
    yield Proposed("specific_impulse", SPECIFIC_IMPULSE, "one sigma per stage: 0.3 % is three")
    dry = [_two_digits(DRY_MASS * share) for share in _dry_shares(mission)]
    reason = f"{100 * DRY_MASS:g} % of what each stage weighs without propellant, payload included"
    yield Proposed("stage_mass", dry[0] if len(dry) == 1 else dry, reason)
    yield Proposed("propellant", PROPELLANT, "of what is loaded: 0.3 % is three sigma")
    if mission.jettisons:
        yield Proposed("jettison_mass", JETTISON_MASS, "of each part that is dropped")
    if flies_in_air(mission.arrays().arcs):
        reason = "the air below 30 km, where drag and loads are, is 3 % denser or thinner"
        yield Proposed("log_density", LOG_DENSITY_LOW, reason)
        if mission.pieces:
            reason = "of what is dropped, as it falls: how it tumbles is not known"
            yield Proposed("ballistic_coefficient", BALLISTIC_COEFFICIENT, reason)
        if turns_as_earth(mission.environment.earth.rotation_rate_rad_s):
            yield from _winds(mission)
    elif any(part.heating_limit_w_m2 is not None for part in mission.jettisons):
        reason = "the air where a fairing goes is a third denser or thinner than the model's"
        yield Proposed("log_density", LOG_DENSITY, reason)


def _winds(mission: Mission) -> Iterator[Proposed]:
    """Propose what is not known of the wind, and the gust of the standard dispersions."""
    standard, _ = read_input(DISPERSIONS.find(STANDARD_PAD), DISPERSIONS)
    if mission.environment.atmosphere.wind_table is None:
        yield Proposed("wind", standard["wind"], "of any day, as in standard_pad")
    else:
        reason = "what the wind of the mission changes by within hours"
        yield Proposed("wind", {"table": WIND_CHANGE}, reason)
    yield Proposed("gust", standard["gust"], "as in standard_pad; three sigma are 9 m/s")


def _dry_shares(mission: Mission) -> Iterator[float]:
    """Return the dry fraction of each stage's own mass without its jettisons."""
    for i in range(len(mission.stages)):
        after = mission.ignition_mass(i + 1) if i + 1 < len(mission.stages) else 0.0
        own = mission.ignition_mass(i) - mission.jettison_mass(i) - after
        yield max(0.0, 1.0 - mission.propellant(i) / own)


def _start(mission: Mission) -> Iterator[Proposed]:
    """Propose the errors of the initial state, small in orbit, larger after open-loop flight.

    A pad is surveyed: a start at rest on it has none.
    """
    if mission.initial_state.is_launch:
        return
    start = mission.start()
    earth = mission.earth()
    radius = float(np.linalg.norm(start.position))
    if _in_orbit(mission):
        share = f"{100 * ORBIT_SHARE:g} % of"
        speed = float(np.linalg.norm(start.velocity))
        position = (ORBIT_SHARE * radius, f"m per axis: {share} the radius, in orbit already")
        velocity = (ORBIT_SHARE * speed, f"m/s per axis: {share} the speed, {speed:,.0f} m/s")
    else:
        over_ground = start.velocity - np.cross([0.0, 0.0, earth.rotation_rate], start.position)
        speed = float(np.linalg.norm(over_ground))
        latitude, _ = earth.latitude_longitude(start.position, start.time_s)
        on_sphere = mission.environment.altitude == "spherical"
        ground = earth.equatorial_radius if on_sphere else earth.surface_radius(latitude)
        altitude = radius - ground
        position = (
            ALTITUDE_SHARE * altitude,
            f"m per axis: {100 * ALTITUDE_SHARE:g} % of the altitude, {altitude:,.0f} m",
        )
        velocity = (
            SPEED_SHARE * speed,
            f"m/s per axis: {100 * SPEED_SHARE:g} % of the speed over the ground, {speed:,.0f} m/s",
        )
    for key, (value, reason) in (
        ("initial_position_m", position),
        ("initial_velocity_m_s", velocity),
    ):
        yield Proposed(key, _two_digits(value), reason)


def _in_orbit(mission: Mission) -> bool:
    """Return whether the initial orbit stays above the ground, or escapes."""
    start = mission.start()
    orbit = Elements.from_state(start.position, start.velocity, mission.environment.mu_m3_s2)
    perigee = orbit.semi_major_axis * (1.0 - orbit.eccentricity)
    return perigee > mission.environment.earth.equatorial_radius_m


def _two_digits(value: float) -> float:
    """Round to two significant digits."""
    return float(f"{value:.2g}")
