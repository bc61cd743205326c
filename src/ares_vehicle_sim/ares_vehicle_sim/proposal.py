# SPDX-License-Identifier: Apache-2.0
"""Dispersions that fit a vehicle, proposed from its mission alone.

The rules, and what came of them, are in ``docs/montecarlo.md``.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ares_models.mission import Mission
from ares_models.orbits import Elements

#: Of the speed over the ground, flown without guidance so far.
SPEED_SHARE = 0.005
#: Of the altitude at the start.
ALTITUDE_SHARE = 0.01
#: Of speed and radius, where the flight begins in an orbit that guidance has flown to.
ORBIT_SHARE = 1e-4
THRUST = 0.005
SPECIFIC_IMPULSE = 0.001
#: Of what a stage weighs without propellant, with what it carries if it is the last.
DRY_MASS = 0.0025
PROPELLANT = 0.001
JETTISON_MASS = 0.01
LOG_DENSITY = 0.3


@dataclass(frozen=True)
class Proposed:
    """One quantity.

    Attributes:
        key: of the dispersions file.
        value: what it says.
        reason: of the value, for a person.
    """

    key: str
    value: float | list[float]
    reason: str


def propose(mission: Mission) -> Iterator[Proposed]:
    """Dispersions by the rules, in the order of the file.

    Args:
        mission: what is dispersed.
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
    if any(part.heating_limit_w_m2 is not None for part in mission.jettisons):
        reason = "the air where a fairing goes is a third denser or thinner than the model's"
        yield Proposed("log_density", LOG_DENSITY, reason)


def _dry_shares(mission: Mission) -> Iterator[float]:
    """What is no propellant of each stage's own mass, its jettisons left out."""
    for i in range(len(mission.stages)):
        after = mission.ignition_mass(i + 1) if i + 1 < len(mission.stages) else 0.0
        own = mission.ignition_mass(i) - mission.jettison_mass(i) - after
        yield max(0.0, 1.0 - mission.propellant(i) / own)


def _start(mission: Mission) -> Iterator[Proposed]:
    """Where the flight begins: in orbit as well as guidance flies, else as open loop does."""
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
    """Whether the start's own orbit stays above the ground, or escapes."""
    start = mission.start()
    orbit = Elements.from_state(start.position, start.velocity, mission.environment.mu_m3_s2)
    perigee = orbit.semi_major_axis * (1.0 - orbit.eccentricity)
    return perigee > mission.environment.earth.equatorial_radius_m


def _two_digits(value: float) -> float:
    """Rounded to what a proposal is worth."""
    return float(f"{value:.2g}")
