"""A flight judged: figures, and constraint by constraint what holds."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    HEATING_LIMIT,
    MissionArrays,
    Record,
)
from ares_optimizer.proof.flight import Flight
from ares_optimizer.proof.physics import elements, surface_radius
from ares_optimizer.request import Heating
from ares_optimizer.solution import Check, ConstraintCheck, Verification
from ares_optimizer.targets import half_turn, target_rows

Array = NDArray[np.float64]


#: What a constraint may be off, per unit, and still count as met.
TOLERANCES = {
    "m": 1.0,
    "m/s": 1e-2,
    "deg": 1e-4,
    "W/m2": 0.2,
    "kg": 0.1,
    "s": 1e-3,
    "1": 1e-6,
    "m2/s2": 100.0,
}

_ACTIVE = 1e-3  # an inequality this close to its limit, relatively, is active


def constraint_table(
    arrays: MissionArrays, start: Record, flight: Flight, heating: Heating
) -> tuple[ConstraintCheck, ...]:
    """Constraint by constraint: value, limit, active, met.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        flight: from :func:`fly`.
        heating: where the heating limit holds.
    """
    judged = heating is not Heating.IGNORED
    target = arrays.target[0]
    figures = elements(flight.final[:3], flight.final[3:6], float(arrays.environment[0]["mu"]))
    table = []
    for key, name, unit, turn in target_rows(target):
        limit = float(target[key])
        if unit == "deg":
            limit = math.degrees(limit)
        value = figures[key]
        off = value - limit
        if turn:
            limit %= 360.0
            off = half_turn(value - limit)
            value = limit + off
        # an argument means less the rounder the orbit, a node the flatter its plane
        scale = 1.0
        if key in (Check.ARGUMENT_OF_PERIGEE, Check.TRUE_ANOMALY):
            scale = max(figures["eccentricity"], 1e-3)
        table.append(
            ConstraintCheck(
                key, name, value, limit, True, unit, abs(off) * scale <= TOLERANCES[unit]
            )
        )
    for j, jettison in enumerate(arrays.jettisons):
        if jettison["criterion"] != HEATING_LIMIT or (int(start["jettisoned"]) >> j) & 1:
            continue
        limit = float(jettison["value"])
        at = flight.at_jettison[j]
        if at is None:
            table.append(
                ConstraintCheck(
                    Check.JETTISON_BEFORE_CUTOFF,
                    f"jettison {j} before cut-off",
                    0.0,
                    1.0,
                    False,
                    "1",
                    not judged,
                    jettison=j,
                )
            )
            continue
        if judged:
            check = _at_most(
                Check.HEATING_AT_JETTISON, f"heating at jettison {j}", at[0], limit, "W/m2"
            )
            table.append(replace(check, jettison=j))
    if heating is Heating.FROM_JETTISON and math.isfinite(flight.peak_w_m2):
        limits = [
            float(arrays.jettisons[j]["value"])
            for j, at in enumerate(flight.at_jettison)
            if at is not None and arrays.jettisons[j]["criterion"] == HEATING_LIMIT
        ]
        table.append(
            _at_most(
                Check.HEATING_FROM_JETTISON,
                "heating from the jettison on",
                flight.peak_w_m2,
                min(limits),
                "W/m2",
            )
        )
    lowest = min(
        float(np.linalg.norm(r)) - surface_radius(r, arrays.environment[0])
        for r in flight.trajectory.position
    )
    table.append(
        ConstraintCheck(
            Check.LOWEST_ALTITUDE, "lowest altitude", lowest, 0.0, False, "m", lowest >= 0.0
        )
    )
    usable = float(arrays.arcs[-1]["propellant"])
    table.append(
        _at_most(Check.PROPELLANT, "propellant of the last stage", flight.used_kg, usable, "kg")
    )
    return tuple(table)


def _at_most(key: Check, name: str, value: float, limit: float, unit: str) -> ConstraintCheck:
    return ConstraintCheck(
        key,
        name,
        value,
        limit,
        value > limit * (1.0 - _ACTIVE),
        unit,
        value <= limit + TOLERANCES[unit],
    )


def verification(arrays: MissionArrays, flight: Flight, nodes: Array | None) -> Verification:
    """Figures of a flight, with the distance of a solver's own nodes from it.

    Args:
        arrays: the mission.
        flight: from :func:`fly`.
        nodes: shape (k, 8), see :meth:`Flight.defects`; None: not compared (nan).
    """
    figures = elements(flight.final[:3], flight.final[3:6], float(arrays.environment[0]["mu"]))
    limited = [
        at
        for j, at in enumerate(flight.at_jettison)
        if at is not None and arrays.jettisons[j]["criterion"] == HEATING_LIMIT
    ]
    defects = (math.nan,) * 3 if nodes is None else flight.defects(nodes)
    return Verification(
        radius_m=figures["radius"],
        speed_m_s=figures["speed"],
        flight_path_angle_deg=figures["flight_path_angle"],
        inclination_deg=figures["inclination"],
        ascending_node_deg=figures["ascending_node"],
        m_f_kg=float(flight.final[6]),
        fmhr_w_m2=limited[-1][0] if limited else math.nan,
        peak_fmhr_after_jettison_w_m2=flight.peak_w_m2,
        position_defect_m=defects[0],
        velocity_defect_m_s=defects[1],
        mass_defect_kg=defects[2],
    )
