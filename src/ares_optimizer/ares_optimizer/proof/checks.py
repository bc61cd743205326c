# SPDX-License-Identifier: Apache-2.0
"""Check a flight constraint by constraint, and compute its figures.

:mod:`ares_models.judge`, the judge of every flight, decides if the target is met.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    BURN,
    HEATING_LIMIT,
    MissionArrays,
    Record,
)
from ares_models.judge import Judgement, judge
from ares_models.tolerances import (
    HEATING_W_M2,
    PRESSURE_SHARE,
    PROPELLANT_KG,
    ROUNDING_M,
    WIDER_IN_AIR,
)
from ares_optimizer.proof.flight import Piece, ProofFlight, flies_in_air
from ares_optimizer.proof.physics import dynamic_pressure, elements, q_alpha, surface_radius
from ares_optimizer.request import Heating
from ares_optimizer.solution import Check, ConstraintCheck, Verification
from ares_optimizer.targets import half_turn, in_unit, rows_of, target_rows

Array = NDArray[np.float64]

_PER_S = 10.0  # samples of the pressures
#: Tolerance of a heating limit in a flight through the air, relative to it: the proof flies the
#: planned attitude without correction and may be tens of metres lower, where the density is up to
#: 1 % higher (scale height 6 km at 110 km).
HEATING_SHARE_IN_AIR = 1e-2
#: Tolerance of the length of the last burn, s.
_SAME_LENGTH_S = 1e-3
_ACTIVE = 1e-3  # relative distance to its limit within which an inequality is active


def judged_end(arrays: MissionArrays, flight: ProofFlight) -> Judgement:
    """Return the judgement on the end of a flight.

    Args:
        arrays: the mission.
        flight: from :func:`fly`.
    """
    environment = arrays.environment[0]
    return judge(
        flight.final[:3],
        flight.final[3:6],
        arrays.target[0],
        float(environment["mu"]),
        float(environment["equatorial_radius"]),
        grounded=lowest_altitude(arrays, flight) < -ROUNDING_M,
    )


def lowest_altitude(arrays: MissionArrays, flight: ProofFlight, arc: int | None = None) -> float:
    """Return the lowest altitude of a flight, or in one of its arcs, m."""
    track = flight.trajectory
    r = track.position
    if arc is not None:
        _, begin, end = next(times for times in flight.plan.arcs if times[0] == arc)
        r = r[(track.time_s >= begin) & (track.time_s <= end)]
    ground = surface_radius(r, arrays.environment[0])
    return float(np.min(np.linalg.norm(r, axis=-1) - ground))


def constraint_table(
    arrays: MissionArrays, start: Record, flight: ProofFlight, heating: Heating
) -> tuple[ConstraintCheck, ...]:
    """Check all constraints: value, limit, active, satisfied.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        flight: from :func:`fly`.
        heating: where the heating limit holds.
    """
    lowest = lowest_altitude(arrays, flight)
    usable = float(arrays.arcs[-1]["propellant"])
    return (
        *_target_checks(arrays, flight),
        *_jettison_checks(arrays, start, flight, heating),
        ConstraintCheck(
            Check.LOWEST_ALTITUDE, "lowest altitude", lowest, 0.0, False, "m", lowest >= -ROUNDING_M
        ),
        _at_most(
            Check.PROPELLANT,
            "propellant of the last stage",
            flight.used_kg,
            usable,
            "kg",
            PROPELLANT_KG,
        ),
        *_saved_propellant_checks(arrays, start, flight),
        *_pressure_checks(arrays, flight),
        *last_burn_checks(arrays, start, flight.plan.arcs[-1]),
    )


def _saved_propellant_checks(
    arrays: MissionArrays, start: Record, flight: ProofFlight
) -> tuple[ConstraintCheck, ...]:
    """Check the propellant of the stage that saves it, if a stage of fixed burns follows."""
    arcs, track = arrays.arcs, flight.trajectory
    ahead = arcs[int(start["arc"]) :]
    # as planned, free burns have their lengths
    free = (ahead["kind"] == BURN) & (ahead["shortest"] < ahead["longest"])
    stage = int(ahead["stage"][free].max(initial=-1))
    if stage in (-1, arcs[-1]["stage"]):
        return ()
    burnt = 0.0
    for k, begin, end in flight.plan.arcs:
        if arcs[k]["stage"] == stage and arcs[k]["kind"] == BURN:
            rows = (track.time_s >= begin) & (track.time_s <= end)
            # drops take no time
            passing = np.diff(track.time_s[rows]) > 0.0
            burnt -= float(np.diff(track.mass[rows])[passing].sum())
    usable = float(arcs["propellant"][arcs["stage"] == stage][-1])
    name = f"propellant of stage {stage}"
    return (_at_most(Check.SAVED_PROPELLANT, name, burnt, usable, "kg", PROPELLANT_KG),)


def bounds_last_burn(arrays: MissionArrays) -> bool:
    """Return true if the last burn is free within bounds."""
    arc = arrays.arcs[-1]
    bounded = arc["shortest"] > 0.0 or math.isfinite(arc["longest"])
    return bool(math.isinf(arc["duration"]) and bounded)


def last_burn_checks(
    arrays: MissionArrays, start: Record, flown: tuple[int, float, float]
) -> tuple[ConstraintCheck, ...]:
    """Return the check of the length of the last burn, if it is free within bounds.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        flown: last arc of the flight, its begin, s, and its end, s.
    """
    last, begin, end = flown
    if last + 1 < len(arrays.arcs) or not bounds_last_burn(arrays):
        return ()
    low, high = float(arrays.arcs[last]["shortest"]), float(arrays.arcs[last]["longest"])
    length = end - (float(start["arc_start_time"]) if last == start["arc"] else begin)
    short = length < low + _SAME_LENGTH_S
    return (
        ConstraintCheck(
            Check.ARC_LENGTH,
            f"length of arc {last}",
            length,
            low if short or math.isinf(high) else high,
            short or length > high - _SAME_LENGTH_S,
            "s",
            low - _SAME_LENGTH_S <= length <= high + _SAME_LENGTH_S,
        ),
    )


def _pressure_checks(arrays: MissionArrays, flight: ProofFlight) -> list[ConstraintCheck]:
    """Return the checks of the dynamic pressure and of q alpha, one per stage that limits it."""
    return _limit_checks(lambda key: pressure_peaks(arrays, flight, key))


def _limit_checks(
    peaks: Callable[[Check], dict[int, tuple[float, float]]],
) -> list[ConstraintCheck]:
    """Return the checks of the pressure limits from peaks and limits of the stages."""
    return [
        replace(
            _at_most(key, f"{name} of stage {stage}", most, limit, unit, PRESSURE_SHARE * limit),
            number=stage,
        )
        for key, name, unit in _PRESSURES
        for stage, (most, limit) in peaks(key).items()
    ]


def pressure_peaks(
    arrays: MissionArrays, flight: ProofFlight, key: Check
) -> dict[int, tuple[float, float]]:
    """Return the greatest pressure and its limit for each stage that has a limit.

    Args:
        arrays: the mission.
        flight: from :func:`fly`.
        key: DYNAMIC_PRESSURE, Pa, or Q_ALPHA, Pa rad.
    """
    return {
        stage: (float(pressures_in(arrays, flight, key, stage)[1].max(initial=0.0)), limit)
        for stage, limit in limits_of(arrays, key).items()
    }


def pressures_in(
    arrays: MissionArrays, flight: ProofFlight, key: Check, stage: int
) -> tuple[Array, Array]:
    """Return the pressures along a stage: times, s, and values, Pa or Pa rad.

    Args: as in :func:`pressure_peaks`;
        stage: by number.
    """
    own = np.flatnonzero(arrays.arcs["stage"] == stage)
    tracks = [
        _pressure_track(arrays, piece, key)
        for piece in flight.pieces
        if flight.plan.arc_at(0.5 * (piece.begin + piece.end)) in own
    ]
    times, values = zip(*tracks, strict=True) if tracks else ((), ())
    return np.concatenate((*times, [])), np.concatenate((*values, []))


def limits_of(arrays: MissionArrays, key: Check) -> dict[int, float]:
    """Return the limit of each stage that has one."""
    stages, first = np.unique(arrays.arcs["stage"], return_index=True)
    limits = arrays.arcs[_LIMITS[key]][first]
    return {int(s): float(m) for s, m in zip(stages, limits, strict=True) if math.isfinite(m)}


#: Kinds of pressure limits: check, name, unit.
_PRESSURES = (
    (Check.DYNAMIC_PRESSURE, "dynamic pressure", "Pa"),
    (Check.Q_ALPHA, "q alpha", "Pa rad"),
)


#: Their limits, as fields of an arc.
_LIMITS = {Check.DYNAMIC_PRESSURE: "max_dynamic_pressure", Check.Q_ALPHA: "max_q_alpha"}


def _pressure_track(arrays: MissionArrays, piece: Piece, key: Check) -> tuple[Array, Array]:
    """Return times, s, and dynamic pressures, Pa, or q alpha, Pa rad, along a piece."""
    count = max(2, math.ceil(_PER_S * (piece.end - piece.begin)))
    times = np.linspace(piece.begin, piece.end, count)
    states = piece.state(times).T
    u = np.array([piece.direction(t) for t in times]) if key is Check.Q_ALPHA else np.empty(0)
    return times, _pressures(arrays, key, (states[:, :3], states[:, 3:6], u))


def _pressures(arrays: MissionArrays, key: Check, states: tuple[Array, Array, Array]) -> Array:
    """Return the pressures of some positions, velocities and thrust directions, shape (n,)."""
    r, v, u = states
    if key is Check.DYNAMIC_PRESSURE:
        return dynamic_pressure(r, v, arrays)
    return q_alpha(r, v, u, arrays)


def programme_checks(
    arrays: MissionArrays, states: tuple[Array, Array, Array], arcs: NDArray[np.int64]
) -> tuple[ConstraintCheck, ...]:
    """Return the checks of the pressure limits in what a boost programme has flown.

    Args:
        arrays: the mission.
        states: positions, m, velocities, m/s, and thrust directions, shape (n, 3) each.
        arcs: arc of each state, shape (n,).
    """
    r, v, u = states
    stages = arrays.arcs["stage"][arcs]

    def peaks(key: Check) -> dict[int, tuple[float, float]]:
        return {
            stage: (float(_pressures(arrays, key, (r[own], v[own], u[own])).max()), limit)
            for stage, limit in limits_of(arrays, key).items()
            if (own := stages == stage).any()
        }

    return tuple(_limit_checks(peaks))


def _target_checks(arrays: MissionArrays, flight: ProofFlight) -> list[ConstraintCheck]:
    """Return the checks of the target elements, with values computed by the proof."""
    target = arrays.target[0]
    figures = elements(flight.final[:3], flight.final[3:6], float(arrays.environment[0]["mu"]))
    judged = judged_end(arrays, flight)
    named = target_rows(target)
    wider = WIDER_IN_AIR if flies_in_air(arrays) else 1.0
    checks = []
    for row in rows_of(judged.names):
        error, allowed = judged.error_of(row.key)
        value = figures[row.key]
        limit = in_unit(target, row) if row in named else value - error
        if row.turn:
            limit %= 360.0
            value = limit + half_turn(value - limit)
        met = abs(error) <= wider * allowed
        checks.append(ConstraintCheck(row.key, row.name, value, limit, True, row.unit, met))
    return checks


def _jettison_checks(
    arrays: MissionArrays, start: Record, flight: ProofFlight, heating: Heating
) -> list[ConstraintCheck]:
    """Return the checks of the jettisons.

    A jettison that never happens by the mission has none.
    """
    checks = []
    limits = []
    for j, jettison in enumerate(arrays.jettisons):
        limit = float(jettison["value"])
        heated = jettison["criterion"] == HEATING_LIMIT
        if int(start["jettisoned"]) >> j & 1:
            continue
        at = flight.at_jettison[j]
        if at is None:
            if math.isfinite(limit):
                # an ignored limit does not require the drop
                checks.append(_left_on(j, heated and heating is Heating.IGNORED))
        elif heated:
            limits.append(limit)
            if heating is not Heating.IGNORED:
                name = f"heating at jettison {j}"
                check = _heating_check(arrays, Check.HEATING_AT_JETTISON, name, at[0], limit)
                checks.append(replace(check, number=j))
    if heating is Heating.FROM_JETTISON and limits and math.isfinite(flight.peak_w_m2):
        checks.append(heating_from_jettison(arrays, flight.peak_w_m2, min(limits)))
    return checks


def heating_from_jettison(
    arrays: MissionArrays, peak_w_m2: float, limit_w_m2: float
) -> ConstraintCheck:
    """Return the check of a heating limit that holds from the jettison on.

    Args:
        arrays: the mission.
        peak_w_m2: greatest heating after the jettison.
        limit_w_m2: limit.
    """
    name = "heating from the jettison on"
    return _heating_check(arrays, Check.HEATING_FROM_JETTISON, name, peak_w_m2, limit_w_m2)


def _left_on(jettison: int, forgiven: bool) -> ConstraintCheck:
    """Return the failed check of a jettison that did not happen before cut-off.

    The check is satisfied if ``forgiven``.
    """
    return ConstraintCheck(
        Check.JETTISON_BEFORE_CUTOFF,
        f"jettison {jettison} before cut-off",
        0.0,
        1.0,
        False,
        "1",
        forgiven,
        number=jettison,
    )


def _heating_check(
    arrays: MissionArrays, key: Check, name: str, rate: float, limit: float
) -> ConstraintCheck:
    share = HEATING_SHARE_IN_AIR if flies_in_air(arrays) else 0.0
    return _at_most(key, name, rate, limit, "W/m2", max(HEATING_W_M2, share * limit))


def _at_most(
    key: Check, name: str, value: float, limit: float, unit: str, allowed: float
) -> ConstraintCheck:
    return ConstraintCheck(
        key,
        name,
        value,
        limit,
        value > limit * (1.0 - _ACTIVE),
        unit,
        value <= limit + allowed,
    )


def verification(arrays: MissionArrays, flight: ProofFlight, nodes: Array | None) -> Verification:
    """Return the figures of a flight, and the distances of a solver's nodes from it.

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
        end=judged_end(arrays, flight).end,
    )
