"""What a target asks for, figure by figure."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import TARGET_KEPLERIAN, TARGET_RADIUS_SPEED_ANGLE_PLANE
from ares_models.orbits import Elements, Insertion
from ares_optimizer.solution import Check

Array = NDArray[np.float64]


class TargetRow(NamedTuple):
    """One figure that a kind of target asks for.

    Attributes:
        key: field of the record TARGET.
        name: in words.
        unit: m, m/s, deg or 1.
        turn: whether it is an angle of a whole turn.
    """

    key: Check
    name: str
    unit: str
    turn: bool = False


_STATE = (
    TargetRow(Check.RADIUS, "radius at cut-off", "m"),
    TargetRow(Check.SPEED, "speed at cut-off", "m/s"),
    TargetRow(Check.FLIGHT_PATH_ANGLE, "flight-path angle at cut-off", "deg"),
    TargetRow(Check.INCLINATION, "inclination", "deg"),
)
_NODE = TargetRow(Check.ASCENDING_NODE, "ascending node", "deg", turn=True)
_ORBIT = (
    TargetRow(Check.SEMI_MAJOR_AXIS, "semi-major axis", "m"),
    TargetRow(Check.ECCENTRICITY, "eccentricity", "1"),
    TargetRow(Check.INCLINATION, "inclination", "deg"),
    _NODE,
    TargetRow(Check.ARGUMENT_OF_PERIGEE, "argument of perigee", "deg", turn=True),
)


def target_rows(kind: int) -> tuple[TargetRow, ...]:
    """The figures of a kind of target."""
    if kind == TARGET_KEPLERIAN:
        return _ORBIT
    return (*_STATE, _NODE) if kind == TARGET_RADIUS_SPEED_ANGLE_PLANE else _STATE


def half_turn(angle_deg: float) -> float:
    """The same angle within half a turn of zero, deg."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def figures_of(kind: int, position: Array, velocity: Array, mu: float) -> tuple[float, ...]:
    """What a state comes to, figure by figure of :func:`target_rows`.

    Args:
        kind: of the target.
        position: m, shape (3,).
        velocity: m/s, shape (3,).
        mu: m3/s2.

    Returns:
        in the unit of each row; nan for what a state on no orbit does not have.
    """
    found: Elements | Insertion = Insertion.from_state(position, velocity)
    if kind == TARGET_KEPLERIAN:
        try:
            found = Elements.from_state(position, velocity, mu)
        except ValueError:
            return (math.nan,) * len(_ORBIT)
    values = [(float(getattr(found, row.key)), row.unit) for row in target_rows(kind)]
    return tuple(math.degrees(value) if unit == "deg" else value for value, unit in values)
