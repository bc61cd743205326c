"""What only the whole mission can show: masses that close, times in order, a target in reach."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ares_models.arrays import MAX_JETTISONS
from ares_models.mission_parts import BurnArc, CoastArc, fail
from ares_models.mission_physics import check_body, check_engines, check_flight_time
from ares_models.mission_target import check_target

if TYPE_CHECKING:
    from ares_models.mission import Mission

MAX_STAGES = 8
MAX_ARCS = 24

#: An ascent begins below this many Earth radii.
MAX_INITIAL_RADII = 10.0

# file values are rounded; masses may miss each other by this much of themselves
_MASS_ROUNDING = 1e-6


def check_mission(mission: "Mission") -> None:
    """Run every check; the first problem is raised with its key path.

    Raises:
        PydanticCustomError: a problem; turned into a MissionError by the loader.
    """
    _check_names(mission)
    check_body(mission)
    _check_free_burn(mission)
    _check_curves_fit(mission)
    _check_masses(mission)
    check_engines(mission)
    _check_jettison_times(mission)
    check_flight_time(mission)
    _check_heating_limits(mission)
    _check_initial_state(mission)
    check_target(mission)


def _check_names(mission: "Mission") -> None:
    for key, names in (("stages", mission.stage_names), ("jettisons", mission.jettison_names)):
        for k, name in enumerate(names):
            if name in names[:k]:
                fail((key, k, "name"), name, f"a name that {key}[{names.index(name)}] has not")
    for k, jettison in enumerate(mission.jettisons):
        if jettison.stage not in mission.stage_names:
            fail(
                ("jettisons", k, "stage"),
                jettison.stage,
                "the name of a stage: " + ", ".join(mission.stage_names),
            )
    if len(mission.jettisons) > MAX_JETTISONS:
        fail(("jettisons",), list(mission.jettisons), f"at most {MAX_JETTISONS} jettisons")
    arcs = len(mission.arc_names)
    if arcs > MAX_ARCS:
        fail(("stages",), arcs, f"at most {MAX_ARCS} arcs in all stages together")
    if mission.environment.atmosphere.model == "nrlmsis" and mission.epoch is None:
        fail(("epoch",), None, "a date and time, because the atmosphere is nrlmsis")


def _check_free_burn(mission: "Mission") -> None:
    last_stage = len(mission.stages) - 1
    for i, stage in enumerate(mission.stages):
        arcs = stage.flight_arcs
        if not stage.burns:
            fail(("stages", i, "arcs"), list(arcs), "at least one burn")
        for k, arc in enumerate(arcs):
            last = i == last_stage and k == len(arcs) - 1
            path = ("stages", i, *stage.arc_path(k, "burn_time_s"))
            if isinstance(arc, BurnArc) and arc.free and not last:
                fail(path, "free", "a time in s; only the last arc of the last stage is free")
            if last and isinstance(arc, CoastArc):
                fail(
                    ("stages", i, *stage.arc_path(k, "coast_s")),
                    arc.coast_s,
                    "a burn with burn_time_s: free as the last arc of the last stage",
                )
            if last and isinstance(arc, BurnArc) and not arc.free:
                fail(path, arc.burn_time_s, "free, for the last arc of the last stage")


def _check_curves_fit(mission: "Mission") -> None:
    for i, stage in enumerate(mission.stages):
        arcs = stage.flight_arcs
        for k, arc in enumerate(arcs):
            if not isinstance(arc, BurnArc) or arc.free or arc.tail_off is None:
                continue
            room = _coast_after(arcs, k)
            if arc.tail_s > room:
                fail(
                    ("stages", i, *stage.arc_path(k, "tail_off")),
                    list(arc.tail_off),
                    f"a tail-off of {arc.tail_s:g} s followed by a coast of at least that in "
                    f"the same stage, which has {room:g} s",
                )


def _coast_after(arcs: Sequence[BurnArc | CoastArc], k: int) -> float:
    room = 0.0
    for arc in arcs[k + 1 :]:
        if isinstance(arc, BurnArc):
            break
        room += arc.coast_s
    return room


def _check_masses(mission: "Mission") -> None:
    g0 = mission.environment.g0_m_s2
    stages = mission.stages
    for i, stage in enumerate(stages):
        own = mission.jettison_mass(i)
        aboard = sum(mission.jettison_mass(k) for k in range(i, len(stages)))
        if aboard >= stage.ignition_mass_kg:
            fail(
                ("stages", i, "ignition_mass_kg"),
                stage.ignition_mass_kg,
                f"more than the {aboard:,.6g} kg of jettisons that it contains",
            )
        after = stages[i + 1].ignition_mass_kg if i + 1 < len(stages) else 0.0
        room = stage.ignition_mass_kg - own - after
        slack = _MASS_ROUNDING * stage.ignition_mass_kg
        if after and room <= 0.0:
            fail(
                ("stages", i + 1, "ignition_mass_kg"),
                after,
                f"less than the {stage.ignition_mass_kg - own:,.9g} kg of stage "
                f"{stage.name} without its jettisons",
            )
        if stage.propellant_kg is not None and stage.propellant_kg >= room + slack:
            fail(
                ("stages", i, "propellant_kg"),
                stage.propellant_kg,
                f"at most the {room:,.9g} kg that the stage can lose",
            )
        used = sum(arc.propellant(g0) for arc in stage.burns if not arc.free)
        usable = room if stage.propellant_kg is None else stage.propellant_kg
        if used > usable + slack:
            k = max(
                (k for k, arc in enumerate(stage.flight_arcs) if isinstance(arc, BurnArc)),
                key=lambda k: k if not _is_free(stage.flight_arcs[k]) else -1,
            )
            arc = stage.flight_arcs[k]
            fail(
                ("stages", i, *stage.arc_path(k, "burn_time_s")),
                arc.duration_s,
                f"burns that take at most {usable:,.9g} kg; the fixed burns of stage "
                f"{stage.name} take {used:,.9g} kg",
            )


def _is_free(arc: BurnArc | CoastArc) -> bool:
    return isinstance(arc, BurnArc) and arc.free


def _check_jettison_times(mission: "Mission") -> None:
    ignition = mission.ignition_times()
    for k, jettison in enumerate(mission.jettisons):
        earliest = ignition[mission.stage_names.index(jettison.stage)]
        if jettison.time_s is not None and jettison.time_s < earliest:
            fail(
                ("jettisons", k, "time_s"),
                jettison.time_s,
                f"at least {earliest:g} s, when stage {jettison.stage} ignites",
            )


def _check_heating_limits(mission: "Mission") -> None:
    limits = [
        jettison.heating_limit_w_m2
        for jettison in mission.jettisons
        if jettison.heating_limit_w_m2 is not None
    ]
    for k, jettison in enumerate(mission.jettisons):
        # the lowest limit is met last: it governs the rest of the flight
        lowest = jettison.heating_limit_w_m2 == min(limits, default=None)
        if jettison.heating_limit_holds == "from_jettison" and not lowest:
            fail(
                ("jettisons", k, "heating_limit_holds"),
                jettison.heating_limit_holds,
                f"at_jettison, for all but the lowest limit, {min(limits):g} W/m2",
            )


def _check_initial_state(mission: "Mission") -> None:
    start = mission.start()
    earth = mission.environment.earth.earth()
    radius = math.hypot(*start.position)
    surface = earth.equatorial_radius
    farthest = MAX_INITIAL_RADII * surface
    if mission.environment.altitude == "ellipsoid" and radius > 0.0:
        latitude, _ = earth.latitude_longitude(start.position, 0.0)
        surface = earth.surface_radius(latitude)
    key = {"position_m", "radius_m", "semi_major_axis_m"} & set(
        type(mission.initial_state).model_fields
    )
    path = ("initial_state", *key)
    if not surface < radius < farthest:
        fail(
            path,
            round(radius, 3),
            f"a distance from the Earth's centre above its surface, {surface:,.0f} m, "
            f"and below {farthest:,.0f} m",
        )
    speed = math.hypot(*start.velocity)
    escape = math.sqrt(2.0 * mission.environment.mu_m3_s2 / radius)
    if speed >= 2.0 * escape:
        key = {"velocity_m_s", "speed_m_s", "semi_major_axis_m"} & set(
            type(mission.initial_state).model_fields
        )
        fail(
            ("initial_state", *key),
            round(speed, 3),
            f"a speed below twice the escape speed, {2.0 * escape:,.0f} m/s",
        )
    momentum = float(np.linalg.norm(np.cross(start.position, start.velocity)))
    if not momentum > 0.0:
        fail(
            ("initial_state",),
            start.velocity.tolist(),
            "a velocity that is not straight up, so that it spans a plane",
        )
