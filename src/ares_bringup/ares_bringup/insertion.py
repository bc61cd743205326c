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
    from ares_models.judge import FIGURES
    from ares_models.orbits import Insertion

    state = vars(Insertion.from_state(position, velocity))
    return _in_degrees(state, sum(figure.bit for figure in FIGURES))


def target_state(facts: MissionFacts, position: Sequence[float]) -> OrbitState:
    """Compute the target's quantities at a flown position; NaN where they are free.

    A Keplerian target leaves the position on the orbit free. It is evaluated at the point of the
    target orbit that is nearest in direction to the flown position.

    Args:
        facts: the mission.
        position: flown, m, shape (3,).
    """
    target = facts.target
    if int(target["kind"]) != layout.TARGET_KEPLERIAN:
        named = layout.NAMES_RADIUS | layout.NAMES_SPEED | layout.NAMES_FLIGHT_PATH_ANGLE
        named |= layout.NAMES_INCLINATION
        if int(target["kind"]) == layout.TARGET_RADIUS_SPEED_ANGLE_PLANE:
            named |= layout.NAMES_ASCENDING_NODE
        elements = int(target["kind"]) == layout.TARGET_ELEMENTS
        return _in_degrees(target, int(target["named"]) if elements else named)
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


def _in_degrees(state: Any, named: int) -> OrbitState:
    """Return the quantities of a state in SI and rad, by name; NaN for those not named."""
    from ares_models.judge import FIGURES

    count = len(fields(OrbitState))
    return OrbitState(
        *(
            figure.in_unit(state[figure.name]) if named & figure.bit else math.nan
            for figure in FIGURES[:count]
        )
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
