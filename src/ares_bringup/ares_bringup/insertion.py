# SPDX-License-Identifier: Apache-2.0
"""Judge a state against the target of its mission."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from ares_bringup.facts import MissionFacts
from ares_models import arrays as layout

if TYPE_CHECKING:
    from ares_models.judge import Judgement
    from ares_models.orbits import Elements


@dataclass(frozen=True)
class OrbitState:
    """Hold the quantities by which an insertion is judged: m, m/s, degrees."""

    radius_m: float
    speed_m_s: float
    flight_path_angle_deg: float
    inclination_deg: float
    ascending_node_deg: float


def orbit_state(position: Sequence[float], velocity: Sequence[float]) -> OrbitState:
    """Compute the judged quantities of a state.

    Args:
        position: m, shape (3,).
        velocity: inertial, m/s, shape (3,).
    """
    from ares_models.orbits import Insertion

    state = Insertion.from_state(position, velocity)
    return OrbitState(
        state.radius,
        state.speed,
        math.degrees(state.flight_path_angle),
        math.degrees(state.inclination),
        math.degrees(state.ascending_node),
    )


def target_state(facts: MissionFacts, position: Sequence[float]) -> OrbitState:
    """Compute the target's quantities at a flown position; NaN where they are free.

    A Keplerian target leaves the position on the orbit free. It is evaluated at the point of the
    target orbit that is nearest in direction to the flown position.

    Args:
        facts: the mission.
        position: flown, m, shape (3,).
    """
    target = facts.target
    if int(target["kind"]) == layout.TARGET_ELEMENTS:
        return _named_state(target)
    if int(target["kind"]) != layout.TARGET_KEPLERIAN:
        plane = int(target["kind"]) == layout.TARGET_RADIUS_SPEED_ANGLE_PLANE
        return OrbitState(
            float(target["radius"]),
            float(target["speed"]),
            math.degrees(float(target["flight_path_angle"])),
            math.degrees(float(target["inclination"])),
            math.degrees(float(target["ascending_node"])) if plane else math.nan,
        )
    from ares_models.orbits import Elements

    orbit = Elements(
        float(target["semi_major_axis"]),
        float(target["eccentricity"]),
        float(target["inclination"]),
        float(target["ascending_node"]),
        float(target["argument_of_perigee"]),
        true_anomaly=0.0,
    )
    perigee, forward = (vector.tolist() for vector in orbit.state(facts.mu))
    try:
        anomaly = math.atan2(_along(position, forward), _along(position, perigee))
    except (OverflowError, ValueError):
        anomaly = math.nan
    if math.isnan(anomaly):
        # overflow: no nearest point exists
        return OrbitState(*[math.nan] * len(fields(OrbitState)))
    there = replace(orbit, true_anomaly=anomaly).state(facts.mu)
    return orbit_state(there[0].tolist(), there[1].tolist())


def _named_state(target: Any) -> OrbitState:
    """Return the quantities that a target by elements fixes; NaN for the others."""
    named = int(target["named"])
    return OrbitState(
        float(target["radius"]) if named & layout.NAMES_RADIUS else math.nan,
        float(target["speed"]) if named & layout.NAMES_SPEED else math.nan,
        math.degrees(target["flight_path_angle"])
        if named & layout.NAMES_FLIGHT_PATH_ANGLE
        else math.nan,
        math.degrees(target["inclination"]) if named & layout.NAMES_INCLINATION else math.nan,
        math.degrees(target["ascending_node"]) if named & layout.NAMES_ASCENDING_NODE else math.nan,
    )


def _along(x: Sequence[float], axis: Sequence[float]) -> float:
    return math.fsum(a * b for a, b in zip(x, axis, strict=True)) / math.hypot(*axis)


def judgement(
    facts: MissionFacts,
    position: Sequence[float],
    velocity: Sequence[float],
    *,
    grounded: bool = False,
) -> "Judgement":
    """Judge a state.

    Args:
        facts: the mission.
        position: m, shape (3,).
        velocity: m/s, shape (3,).
        grounded: whether the vehicle has hit the ground.
    """
    from ares_models.judge import judge

    return judge(
        position, velocity, facts.target, facts.mu, facts.equatorial_radius, grounded=grounded
    )


def orbit_of(
    facts: MissionFacts, position: Sequence[float], velocity: Sequence[float]
) -> "Elements":
    """Compute the orbital elements of a state; all NaN if there is no orbit.

    Args: see :func:`judgement`.
    """
    from ares_models.orbits import Elements

    try:
        return Elements.from_state(position, velocity, facts.mu)
    except ValueError:
        return Elements(*[math.nan] * len(fields(Elements)))
