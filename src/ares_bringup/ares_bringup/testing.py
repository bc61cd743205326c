"""Flights made up for tests: a mission with one jettison, and events as one likes them."""

import math
from typing import Any

import numpy as np

from ares_bringup.summary import Event, FlightSummary, MissionFacts, Status
from ares_models.arrays import TARGET, TARGET_RADIUS_SPEED_ANGLE_INCLINATION
from ares_vehicle_sim.arrays import CUTOFF, FLIGHT_COMPLETE, FLIGHT_STARTED, JETTISON_DONE

MU = 3.986004418e14
RADIUS = 6.6e6
SPEED = 7700.0
INCLINATION = math.radians(28.5)


def made_up_mission() -> MissionFacts:
    """One burn, one jettison, a target of RADIUS, SPEED, level flight and INCLINATION."""
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
    )


def state(
    radius: float = RADIUS, speed: float = SPEED
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Position (m) and velocity (m/s) in level flight at INCLINATION."""
    velocity = (0.0, speed * math.cos(INCLINATION), speed * math.sin(INCLINATION))
    return (radius, 0.0, 0.0), velocity


def made_up_event(
    kind: int, time: float, index: int = 0, mass: float = 500.0, **where: float
) -> Event:
    """An event at a `state`."""
    return Event(kind, index, time, *state(**where), mass)


def made_up_status(
    cycle: int, converged: bool = True, iterations: int = 8, stale: int = 0
) -> Status:
    """A guidance status that predicts the target."""
    return Status(float(cycle), cycle, converged, iterations, stale, 400.0, *state())


def flown(facts: MissionFacts, *events: Event) -> FlightSummary:
    """A flight that began, with these events."""
    summary = FlightSummary(facts, "peg", bag="/bags/one", wall_s=5.0)
    summary.add_event(made_up_event(FLIGHT_STARTED, 100.0))
    for event in events:
        summary.add_event(event)
    return summary


def good_flight(facts: MissionFacts, **end: Any) -> FlightSummary:
    """A flight to the target, or to another `end` (radius, speed, mass)."""
    return flown(
        facts,
        made_up_event(JETTISON_DONE, 200.0),
        made_up_event(CUTOFF, 400.0),
        made_up_event(FLIGHT_COMPLETE, 401.0, **end),
    )
