# SPDX-License-Identifier: Apache-2.0
"""Convert a mission to the kernels' arrays."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ares_models import arrays as layout
from ares_models.mission_arcs import BurnArc, CoastArc, EngineOut, Table, shortest
from ares_models.mission_areas import write_areas
from ares_models.mission_boosters import part_row
from ares_models.mission_parts import Stage
from ares_models.mission_programme import write_programme
from ares_models.mission_target import orbit_record, parking_orbit
from ares_models.splines import hermite_table, monotone_slopes
from ares_models.wind import wind_profile

if TYPE_CHECKING:
    from ares_models.mission import Mission


def environment_array(mission: "Mission") -> NDArray[np.void]:
    """Compile gravity, figure, rotation and areas, shape (1,), dtype ENVIRONMENT."""
    part = mission.environment
    record = np.zeros(1, layout.ENVIRONMENT)
    record["mu"] = part.mu_m3_s2
    record["g0"] = part.g0_m_s2
    record["equatorial_radius"] = part.earth.equatorial_radius_m
    record["polar_radius"] = part.earth.polar_radius_m
    record["rotation_rate"] = part.earth.rotation_rate_rad_s
    record["j2"] = part.j2
    record["zero_longitude"] = mission.earth().angle_at_zero
    record["density_factor"] = part.atmosphere.density_factor
    record["altitude_model"] = (
        layout.ALTITUDE_ELLIPSOID if part.altitude == "ellipsoid" else layout.ALTITUDE_SPHERICAL
    )
    if part.atmosphere.wind_table is not None:
        wind_profile(part.atmosphere.wind_table).write(record["wind"][0])
    if mission.abort is not None:
        write_areas(mission, record)
    if mission.programme is not None:
        write_programme(mission, record)
    return record


def arc_array(mission: "Mission", foreseen: bool) -> NDArray[np.void]:
    """Compile the arcs, dtype ARC; ``foreseen`` as in :meth:`Mission.arrays`."""
    rows = []
    g0 = mission.environment.g0_m_s2
    for i, stage, k, arc in mission.walk:
        row = np.zeros(1, layout.ARC)
        row["stage"] = i
        row["duration"] = arc.duration_s
        row["shortest"] = max(shortest(arc), _until_drops(mission, i, k))
        row["longest"] = arc.max_s or arc.duration_s
        low = arc.min_altitude_m
        row["min_altitude"] = -math.inf if low is None else low
        row["begins_stage"] = int(k == 0)
        row["stack_mass"] = mission.ignition_mass(i)
        row["propellant"] = mission.propellant(i)
        row["exhaust_velocity"] = 1.0
        row["kind"] = layout.COAST
        _write_air(mission, stage, isinstance(arc, BurnArc), row)
        if isinstance(arc, CoastArc):
            _write_coast(mission, arc, row)
            rows.append(row)
            continue
        _write_burn(arc, g0, row)
        cut = stage.parts_of(k, g0)
        rows += [part_row(row, part, part is cut[-1], g0) for part in cut]
        if arc.engine_out:
            rows.append(_lose_engines(rows[-1], arc.engine_out, foreseen))
    return np.concatenate(rows)


def _until_drops(mission: "Mission", i: int, k: int) -> float:
    """Return how long arc ``k`` of stage ``i`` lasts until the drops within it, s.

    A free arc before the last one of the flight lasts until what is to drop within it by the
    clock has dropped.
    """
    stage = mission.stages[i]
    before, free = stage.first_free_arc
    if k != free or (i, k) == (len(mission.stages) - 1, len(stage.flight_arcs) - 1):
        return 0.0
    after = [
        jettison.time_after_ignition_s or 0.0
        for jettison in mission.jettisons
        if jettison.stage == stage.name
    ]
    return max(after, default=0.0) - before


def _write_air(mission: "Mission", stage: Stage, burns: bool, row: NDArray[np.void]) -> None:
    row["max_dynamic_pressure"] = stage.max_dynamic_pressure_pa or math.inf
    row["max_q_alpha"] = stage.max_q_alpha_pa_rad or math.inf
    air = stage.aerodynamics or mission.aerodynamics
    if air is None:
        return
    row["drag_area"] = air.reference_area_m2
    row["body_axes"] = int(air.axial_table is not None)
    across = air.lift_table or air.normal_table
    for name, table in (("drag", air.along(burns)), ("across", across)):
        if table is None:
            continue
        mach, coefficient = np.array(table).T
        knots = len(mach)
        slopes = np.zeros(knots)
        if knots > 2:
            slopes = monotone_slopes(mach, coefficient)
        elif knots > 1:
            slopes[:] = np.diff(coefficient) / np.diff(mach)
        row[f"{name}_knots"] = knots
        row[f"{name}_mach"][0, :knots] = mach
        row[f"{name}_cubic"][0, :knots] = hermite_table(mach, coefficient, slopes)[:, 1:]


def _write_coast(mission: "Mission", arc: CoastArc, row: NDArray[np.void]) -> None:
    if arc.min_perigee_altitude_m is not None:
        equator = mission.environment.earth.equatorial_radius_m
        row["min_perigee_radius"] = equator + arc.min_perigee_altitude_m
    orbit = parking_orbit(arc)
    if orbit is not None:
        row["orbit"] = orbit_record(orbit, mission)


def _write_burn(arc: BurnArc, g0: float, row: NDArray[np.void]) -> None:
    row["kind"] = layout.BURN
    row["thrust"] = arc.full_thrust_n
    row["exhaust_velocity"] = arc.exhaust_velocity(g0)
    row["mass_flow"] = arc.mass_flow(g0)
    row["engines"] = arc.engines
    row["held"] = int(arc.attitude == "held")
    row["exit_area"] = arc.exit_area_m2 or 0.0
    row["max_acceleration"] = arc.max_acceleration_m_s2 or math.inf
    row["min_throttle"] = arc.least_throttle
    for key, curve in (("start", arc.start), ("tail", arc.tail_off)):
        if curve is None:
            continue
        knots = len(curve)
        row[f"{key}_knots"] = knots
        row[f"{key}_time"][0, :knots] = [t for t, _ in curve]
        row[f"{key}_fraction"][0, :knots] = [fraction for _, fraction in curve]
    row["start_flow"] = row["start_fraction"]
    row["start_loss"] = arc.start_loss_s
    row["tail_gain"] = arc.tail_gain_s
    if arc.thrust_table is not None:
        _write_table(arc.table(g0), row)


def _write_table(table: Table, row: NDArray[np.void]) -> None:
    knots = len(table.time_s)
    row["tabled"] = 1
    row["start_knots"] = knots
    row["start_time"][0, :knots] = table.time_s
    row["start_fraction"][0, :knots] = np.array(table.thrust_n) / row["thrust"]
    row["start_flow"][0, :knots] = np.array(table.flow_kg_s) / row["mass_flow"]
    row["start_loss"] = table.time_s[-1] - table.impulse / row["thrust"]


def jettison_array(mission: "Mission") -> NDArray[np.void]:
    """Compile what is dropped, dtype JETTISON."""
    records = np.zeros(len(mission.drops), layout.JETTISON)
    for record, jettison in zip(records, mission.drops, strict=True):
        record["mass"] = jettison.mass_kg
        record["stage"] = mission.stage_names.index(jettison.stage)
        if jettison.heating_limit_w_m2 is not None:
            record["criterion"] = layout.HEATING_LIMIT
            record["value"] = jettison.heating_limit_w_m2
        elif jettison.time_s is not None:
            record["criterion"] = layout.MISSION_TIME
            record["value"] = jettison.time_s
        elif jettison.time_after_ignition_s is not None:
            record["criterion"] = layout.TIME_AFTER_IGNITION
            record["value"] = jettison.time_after_ignition_s
    return records


def _lose_engines(before: NDArray[np.void], failure: EngineOut, foreseen: bool) -> NDArray[np.void]:
    """Build the arc after an engine failure and, unless foreseen, shorten the burn before it."""
    after = before.copy()
    after["begins_stage"] = 0
    after["thrust"] *= failure.left
    after["mass_flow"] *= failure.left
    after["exit_area"] *= failure.left
    after["engines"] = failure.engines - failure.lost
    for name in ("start_knots", "start_loss"):
        after[name] = 0
    if foreseen:
        after["duration"] = 0.0
        return after
    after["duration"] -= failure.time_after_ignition_s
    after["duration"] /= failure.left
    before["duration"] = failure.time_after_ignition_s
    for name in ("tail_knots", "tail_gain"):
        before[name] = 0
    return after
