# SPDX-License-Identifier: Apache-2.0
"""List the elements of a target, with values and units."""

import math
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    NAMES_APOGEE,
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_ASCENDING_NODE,
    NAMES_C3,
    NAMES_ECCENTRICITY,
    NAMES_FLIGHT_PATH_ANGLE,
    NAMES_INCLINATION,
    NAMES_PERIGEE,
    NAMES_RADIUS,
    NAMES_SEMI_MAJOR_AXIS,
    NAMES_SPEED,
    NAMES_TRUE_ANOMALY,
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    Record,
)
from ares_models.kernels.judging import judged_by
from ares_models.orbits import Elements, Insertion
from ares_optimizer.solution import Check

Array = NDArray[np.float64]


class TargetRow(NamedTuple):
    """Describe one element of a target.

    Attributes:
        key: field of the record TARGET.
        name: in words.
        unit: m, m/s, m2/s2, deg or 1.
        turn: true for an angle modulo 360 deg.
    """

    key: Check
    name: str
    unit: str
    turn: bool = False


_ROWS = {
    NAMES_RADIUS: TargetRow(Check.RADIUS, "radius at cut-off", "m"),
    NAMES_SPEED: TargetRow(Check.SPEED, "speed at cut-off", "m/s"),
    NAMES_FLIGHT_PATH_ANGLE: TargetRow(
        Check.FLIGHT_PATH_ANGLE, "flight-path angle at cut-off", "deg"
    ),
    NAMES_PERIGEE: TargetRow(Check.PERIGEE_RADIUS, "perigee radius", "m"),
    NAMES_APOGEE: TargetRow(Check.APOGEE_RADIUS, "apogee radius", "m"),
    NAMES_SEMI_MAJOR_AXIS: TargetRow(Check.SEMI_MAJOR_AXIS, "semi-major axis", "m"),
    NAMES_ECCENTRICITY: TargetRow(Check.ECCENTRICITY, "eccentricity", "1"),
    NAMES_C3: TargetRow(Check.C3, "C3", "m2/s2"),
    NAMES_INCLINATION: TargetRow(Check.INCLINATION, "inclination", "deg"),
    NAMES_ASCENDING_NODE: TargetRow(Check.ASCENDING_NODE, "ascending node", "deg", turn=True),
    NAMES_ARGUMENT_OF_PERIGEE: TargetRow(
        Check.ARGUMENT_OF_PERIGEE, "argument of perigee", "deg", turn=True
    ),
    NAMES_TRUE_ANOMALY: TargetRow(Check.TRUE_ANOMALY, "true anomaly", "deg", turn=True),
}
_PLACE = NAMES_RADIUS | NAMES_SPEED | NAMES_FLIGHT_PATH_ANGLE


def rows_of(names: int) -> tuple[TargetRow, ...]:
    """Return the rows of a set of NAMES_*."""
    return tuple(row for name, row in _ROWS.items() if names & name)


def target_rows(target: Record) -> tuple[TargetRow, ...]:
    """Return the rows of a target, record TARGET."""
    named = int(judged_by(target))
    if target["kind"] == TARGET_KEPLERIAN:
        # the position in the orbit is free
        named &= ~_PLACE
    return rows_of(named)


def in_unit(target: Record, row: TargetRow) -> float:
    """Return the wanted value of an element, in the unit of its row."""
    value = float(target[row.key])
    return math.degrees(value) if row.unit == "deg" else value


def half_turn(angle_deg: float) -> float:
    """Return an angle modulo 360 deg in [-180, 180)."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def figures_of(target: Record, position: Array, velocity: Array, mu: float) -> tuple[float, ...]:
    """Return the elements of a state, in the order of :func:`target_rows`.

    Args:
        target: record TARGET.
        position: m, shape (3,).
        velocity: m/s, shape (3,).
        mu: m3/s2.

    Returns:
        values in the unit of each row; nan for elements that are not defined.
    """
    found: dict[str, float] = dict(vars(Insertion.from_state(position, velocity)))
    if target["kind"] in (TARGET_KEPLERIAN, TARGET_ELEMENTS):
        with suppress(ValueError):
            found |= vars(Elements.from_state(position, velocity, mu))
    h = np.cross(position, velocity)
    parameter = float(h @ h) / mu
    e = found.get("eccentricity", math.nan)
    found["perigee_radius"] = parameter / (1.0 + e)
    found["apogee_radius"] = parameter / (1.0 - e) if e != 1.0 else math.inf
    found["c3"] = float(velocity @ velocity) - 2.0 * mu / float(np.linalg.norm(position))
    values = [(float(found.get(row.key, math.nan)), row.unit) for row in target_rows(target)]
    return tuple(math.degrees(value) if unit == "deg" else value for value, unit in values)


def miss_line(target: Record, position: Array, velocity: Array, mu: float) -> str:
    """Describe the errors of a state against a target, the two largest.

    Args:
        target: record TARGET.
        position: m, shape (3,).
        velocity: m/s, shape (3,).
        mu: m3/s2.
    """
    parts = []
    figures = figures_of(target, position, velocity, mu)
    for figure, row in zip(figures, target_rows(target), strict=True):
        wanted = in_unit(target, row)
        off = figure - wanted
        if row.turn:
            off = half_turn(off)
        size = 1.0 if row.unit in ("deg", "1") else max(abs(wanted), 1.0)
        parts.append((abs(off) / size, f"{row.name} off by {off:,.4g} {row.unit}"))
    parts.sort(key=lambda part: -part[0])
    return "; ".join(line for _, line in parts[:2])
