# SPDX-License-Identifier: Apache-2.0
"""Make flights for tests: a mission with one jettison, and events at will."""

import math
from typing import Any

import numpy as np

from ares_bringup.facts import MissionFacts
from ares_bringup.observed import Event, GuidanceSample
from ares_bringup.summary import FlightSummary
from ares_guidance.arrays import LAW_PEG
from ares_models.arrays import TARGET, TARGET_RADIUS_SPEED_ANGLE_INCLINATION
from ares_vehicle_sim.arrays import CUTOFF, FLIGHT_COMPLETE, FLIGHT_STARTED, JETTISON_DONE

MU = 3.986004418e14
RADIUS = 6.6e6
SPEED = 7700.0
INCLINATION = math.radians(28.5)
#: Equatorial radius, m; the perigee of the target is 213 km above it.
GROUND = 6.15e6


def made_up_mission() -> MissionFacts:
    """Make a mission: one burn, one jettison, target RADIUS, SPEED, level flight, INCLINATION."""
    target = np.zeros(1, TARGET)
    target["kind"] = TARGET_RADIUS_SPEED_ANGLE_INCLINATION
    target["radius"] = RADIUS
    target["speed"] = SPEED
    target["inclination"] = INCLINATION
    return MissionFacts(
        name="made_up",
        title="Made-up flight",
        mu=MU,
        target=target[0],
        arcs=["burn"],
        stages=["only stage"],
        jettisons=["fairing"],
        fairing=0,
        equatorial_radius=GROUND,
    )


def short_burn(missing_m_s: float = 184.3, **changes: Any) -> dict[str, Any]:
    """Return the content of a mission file: one burn, 1 s per 3 m/s, and a cover to jettison.

    Args:
        missing_m_s: speed to be gained by the burn.
        changes: single values to replace, `target.radius_m=...`.
    """
    speed = 7784.3 - missing_m_s
    content: dict[str, Any] = {
        "name": "short_burn",
        "title": "Kick stage to a circular orbit",
        "source": "made up",
        "environment": {
            "mu_m3_s2": 3.986004418e14,
            "g0_m_s2": 9.80665,
            "earth": {
                "equatorial_radius_m": 6378137.0,
                "polar_radius_m": 6356752.3,
                "rotation_rate_rad_s": 7.292115e-5,
            },
            "altitude": "ellipsoid",
            "atmosphere": {"model": "us76"},
        },
        "initial_state": {
            "time_s": 1000.0,
            "position_m": [6578137.0, 0.0, 0.0],
            "velocity_m_s": [0.0, speed * math.cos(INCLINATION), speed * math.sin(INCLINATION)],
        },
        "stages": [
            {
                "name": "kick stage",
                "ignition_mass_kg": 10000.0,
                "propellant_kg": 2000.0,
                "thrust_n": 30000.0,
                "isp_s": 320.0,
                "burn_time_s": "free",
            }
        ],
        "jettisons": [
            {
                "name": "cover",
                "mass_kg": 100.0,
                "stage": "kick stage",
                "heating_limit_w_m2": 1135.0,
            }
        ],
        "target": {
            "radius_m": 6578137.0,
            "speed_m_s": 7784.3,
            "flight_path_angle_deg": 0.0,
            "inclination_deg": 28.5,
        },
    }
    for path, value in changes.items():
        *folders, name = path.split(".")
        place: Any = content
        for folder in folders:
            place = place[int(folder) if folder.isdigit() else folder]
        place[name] = value
    return content


def state(
    radius: float = RADIUS, speed: float = SPEED
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return position (m) and velocity (m/s) in level flight at INCLINATION."""
    velocity = (0.0, speed * math.cos(INCLINATION), speed * math.sin(INCLINATION))
    return (radius, 0.0, 0.0), velocity


def made_up_event(
    kind: int, time: float, index: int = 0, mass: float = 500.0, **where: float
) -> Event:
    """Make an event at a `state`."""
    return Event(kind, index, time, *state(**where), mass)


def made_up_status(
    cycle: int, converged: bool = True, iterations: int = 8, stale: int = 0
) -> GuidanceSample:
    """Make a guidance status that predicts the target."""
    return GuidanceSample(
        float(cycle), cycle, converged, iterations, stale, LAW_PEG, 400.0, *state()
    )


def flown(facts: MissionFacts, *events: Event) -> FlightSummary:
    """Make a flight that has begun, with these events."""
    summary = FlightSummary(facts, "peg", bag="/bags/one", wall_s=5.0)
    summary.add_event(made_up_event(FLIGHT_STARTED, 100.0))
    for event in events:
        summary.add_event(event)
    return summary


def good_flight(facts: MissionFacts, **end: Any) -> FlightSummary:
    """Make a flight to the target, or to another `end` (radius, speed, mass)."""
    return flown(
        facts,
        made_up_event(JETTISON_DONE, 200.0),
        made_up_event(CUTOFF, 400.0),
        made_up_event(FLIGHT_COMPLETE, 401.0, **end),
    )
