# SPDX-License-Identifier: Apache-2.0
"""Describe a flight as the object that `ares fly --json` prints."""

from typing import TYPE_CHECKING, Any

from ares_bringup.plain_json import finite

if TYPE_CHECKING:
    from ares_bringup.summary import FlightSummary
    from ares_models.impacts import Impact
    from ares_models.passage import AirState
    from ares_vehicle_sim.falls import Fall


def to_json(summary: "FlightSummary") -> dict[str, Any]:
    """Return the object that `ares fly --json` prints; unknown numbers are None."""
    judged, passage = summary.judgement, summary.passage
    errors = judged.errors if judged else {}
    keys = dict.fromkeys(("radius_m", "speed_m_s", "flight_path_angle_deg", "inclination_deg"))
    result = {
        "mission": summary.facts.name,
        "guidance": summary.guidance,
        "t_plf_s": summary.t_plf_s,
        "t_meco_s": summary.t_meco_s,
        "mach_1": _in_air(passage.mach_1) if passage else None,
        "max_q": _in_air(passage.max_q) if passage else None,
        "m_f_kg": summary.m_f_kg,
        "planned_m_f_kg": summary.planned_m_f_kg,
        "insertion_error": {**keys, **errors},
        "guidance_cycles": summary.guidance_cycles,
        "longest_cycle_ms": summary.longest_cycle_ms,
        "wall_s": summary.wall_s,
        "realtime_factor": summary.realtime_factor,
        "bag": summary.bag,
        "flight_id": f"{summary.flight_id:016x}",
        "domain_id": summary.domain_id,
        "namespace": summary.namespace,
        "foreign_messages": summary.foreign_messages,
        "unguided_s": summary.unguided_s,
        "outcome": summary.outcome.value,
        "end": str(judged.end) if judged else None,
        "reached": judged.reached() if judged else None,
        "exit_status": summary.exit_code,
        "impact": _impact(summary.impact),
        "falls": [_fall(fall) for fall in summary.falls],
        "shortcomings": summary.shortcomings(),
        "first_convergence_iterations": summary.first_convergence_iterations,
        "max_stale_cycles": summary.max_stale_cycles,
        "lost_messages": summary.lost_messages,
        "events": [
            {
                "t_s": event.time,
                "type": event.type,
                "index": event.index,
                "name": summary.event_name(event),
                "mass_kg": event.mass,
            }
            for event in summary.events
        ],
        "diagnostic_count": summary.diagnostic_count,
        "diagnostics": [
            {"t_s": line.time, "node": line.node, "level": line.level, "message": line.message}
            for line in summary.diagnostics
        ],
    }
    return {key: finite(value) for key, value in result.items()}


def _in_air(state: "AirState | None") -> dict[str, float] | None:
    if state is None:
        return None
    return {
        "t_s": state.time_s,
        "altitude_m": state.altitude_m,
        "mass_kg": state.mass_kg,
        "dynamic_pressure_pa": state.dynamic_pressure_pa,
        "mach": state.mach,
    }


def _impact(impact: "Impact | None") -> dict[str, Any] | None:
    if impact is None:
        return None
    return {
        "t_s": impact.time_s,
        "latitude_deg": impact.latitude_deg,
        "longitude_deg": impact.longitude_deg,
        "area": impact.area,
        "outside_m": impact.outside_m,
    }


def _fall(fall: "Fall") -> dict[str, Any]:
    return {
        "name": fall.name,
        "count": fall.count,
        "separation_s": fall.time_s,
        "mass_kg": fall.mass_kg,
        "ballistic_coefficient_kg_m2": fall.coefficient_kg_m2,
        "impact": _impact(fall.impact),
        "downrange_m": fall.downrange_m,
        "speed_m_s": fall.speed_m_s,
    }
