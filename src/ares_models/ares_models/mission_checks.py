# SPDX-License-Identifier: Apache-2.0
"""Checks across a whole mission: masses that close, times in order, a target in reach."""

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ares_models.arrays import MAX_ARCS, MAX_JETTISONS
from ares_models.mission_arcs import BurnArc, CoastArc, shortest
from ares_models.mission_areas import check_areas
from ares_models.mission_boosters import check_boosters
from ares_models.mission_keys import fail
from ares_models.mission_masses import check_mass_forms, check_masses
from ares_models.mission_parts import Stage
from ares_models.mission_physics import check_body, check_engines, check_flight_time, check_lift_off
from ares_models.mission_programme import check_programme, flown_whole
from ares_models.mission_start import check_initial_state
from ares_models.mission_target import check_heading

if TYPE_CHECKING:
    from ares_models.mission import Mission

MAX_STAGES = 8
#: What to do with a vehicle none of whose burns can be free.
_INSTEAD = "; where all burns are of fixed length a programme without until flies them"


def check_mission(mission: "Mission") -> None:
    """Run every check and raise the first problem with its key path.

    Raises:
        PydanticCustomError: a problem; the loader converts it to a MissionError.
    """
    _check_names(mission)
    check_mass_forms(mission)
    check_body(mission)
    _check_free_arcs(mission)
    _check_throttle_buckets(mission)
    _check_last_stage_stays(mission)
    check_programme(mission)
    _check_parking_orbits(mission)
    _check_curves_fit(mission)
    for i, stage in enumerate(mission.stages):
        check_boosters(("stages", i), stage, mission.environment.g0_m_s2)
    check_masses(mission)
    check_engines(mission)
    check_lift_off(mission)
    _check_jettison_times(mission)
    check_flight_time(mission)
    _check_heating_limits(mission)
    check_initial_state(mission)
    mission.target.check(mission)
    # reports a node that cannot be placed, such as one without an epoch
    mission.target.node_deg(mission)
    check_heading(mission)
    check_areas(mission)


def _check_names(mission: "Mission") -> None:
    for key, names in (("stages", mission.stage_names), ("jettisons", mission.jettison_names)):
        for k, name in enumerate(names):
            if name in names[:k]:
                at = names.index(name)
                fail((key, k, "name"), name, f"a name other than that of {key}[{at}]")
    for k, jettison in enumerate(mission.jettisons):
        if jettison.stage not in mission.stage_names:
            expected = "the name of a stage: " + ", ".join(mission.stage_names)
            fail(("jettisons", k, "stage"), jettison.stage, expected)
    if len(mission.drops) > MAX_JETTISONS:
        expected = f"at most {MAX_JETTISONS} jettisons and kinds of boosters"
        fail(("jettisons",), list(mission.jettison_names), expected)
    arcs = len(mission.arc_names)
    if arcs > MAX_ARCS:
        fail(("stages",), arcs, f"at most {MAX_ARCS} arcs in all stages together")
    if mission.environment.atmosphere.model == "nrlmsis" and mission.epoch is None:
        fail(("epoch",), None, "a date and time, because the atmosphere is nrlmsis")


def _check_free_arcs(mission: "Mission") -> None:
    """Check that every stage burns, the last arc is a burn, and some burn is free and guided."""
    for place in mission.walk:
        i, stage, k, arc = place
        if k == 0 and not stage.burns:
            fail(("stages", i, "arcs"), list(stage.flight_arcs), "at least one burn")
        if not isinstance(arc, BurnArc) or not arc.free:
            continue
        if arc.attitude == "held":
            fail(place.path("attitude"), "held", "guided, for a burn with burn_time_s: free")
        if stage.propellant_kg is None and i < len(mission.stages) - 1:
            expected = f"a number, because burn {arc.name or stage.name} is free"
            fail(("stages", i, "propellant_kg"), None, expected)
    place = mission.walk[-1]
    last = place.arc
    if isinstance(last, CoastArc):
        fail(place.path("coast_s"), last.coast_s, "a burn as the last arc of the last stage")
    steered = not flown_whole(mission)
    if steered and not any(burn.free for stage in mission.stages for burn in stage.burns):
        if last.thrust_table is None:
            expected = f"free, for at least one burn{_INSTEAD}"
            fail(place.path("burn_time_s"), last.burn_time_s, expected)
        instead = (
            "at least one burn of the mission that guidance can end, with thrust_n and "
            f"burn_time_s: free, such as a small one after this motor{_INSTEAD}"
        )
        fail(place.path("thrust_table"), last.thrust_table, instead)


def _check_throttle_buckets(mission: "Mission") -> None:
    """Report a throttle bucket that has no limit to keep, or that is not planned as it stands."""
    for place in mission.walk:
        arc = place.arc
        if not isinstance(arc, BurnArc) or arc.throttle_bucket is None:
            continue
        path, stage = place.path("throttle_bucket"), place.stage.name
        if place.stage.max_dynamic_pressure_pa is None:
            fail(path, arc.throttle_bucket, "max_dynamic_pressure_pa of the stage beside it")
        if place == mission.walk[-1]:
            fail(path, arc.throttle_bucket, "no such key in the last burn of the flight")
        expected = f"no such key: stage {stage} has a throttle_bucket, whose time is not known"
        for j, jettison in enumerate(mission.jettisons):
            if jettison.stage == stage:
                jettison.refuse(("time_after_ignition_s",), expected, ("jettisons", j))


def _check_last_stage_stays(mission: "Mission") -> None:
    """Report a ballistic coefficient of the last stage, which is never dropped."""
    expected = "no such key in the last stage, which is not dropped"
    path = ("stages", len(mission.stages) - 1)
    mission.stages[-1].refuse(("ballistic_coefficient_kg_m2",), expected, path)


def _check_parking_orbits(mission: "Mission") -> None:
    """Report a coast that prescribes its orbit without a burn before it."""
    burnt = False
    for place in mission.walk:
        burnt = burnt or isinstance(place.arc, BurnArc)
        if isinstance(place.arc, CoastArc) and not burnt:
            expected = "no such key in a coast before the first burn"
            place.arc.refuse(("perigee_altitude_m",), expected, place.path())


def _check_curves_fit(mission: "Mission") -> None:
    for place in mission.walk:
        arc = place.arc
        if not isinstance(arc, BurnArc) or arc.tail_off is None:
            continue
        if arc.free and place == mission.walk[-1]:
            continue
        room = _coast_after(place.stage.flight_arcs, place.k)
        if arc.tail_s > room:
            fail(
                place.path("tail_off"),
                list(arc.tail_off),
                f"a tail-off of {arc.tail_s:g} s followed by a coast of at least that in "
                f"the same stage, which has {room:g} s",
            )


def _coast_after(arcs: Sequence[BurnArc | CoastArc], k: int) -> float:
    room = 0.0
    for arc in arcs[k + 1 :]:
        if isinstance(arc, BurnArc):
            break
        room += shortest(arc)
    return room


def _check_jettison_times(mission: "Mission") -> None:
    ignition = mission.ignition_times()
    for k, jettison in enumerate(mission.jettisons):
        earliest = ignition[mission.stage_names.index(jettison.stage)]
        if jettison.time_s is not None and jettison.time_s < earliest:
            expected = f"at least {earliest:g} s, when stage {jettison.stage} ignites"
            fail(("jettisons", k, "time_s"), jettison.time_s, expected)
    _check_jettison_before_next_stage(mission)
    if mission.plans_arcs:
        _check_jettison_before_free_arcs(mission)


def _check_jettison_before_next_stage(mission: "Mission") -> None:
    """Report a drop by the clock that comes after the next stage ignites, if that is known."""
    ignition = mission.ignition_times()
    for k, jettison in enumerate(mission.jettisons):
        i = mission.stage_names.index(jettison.stage)
        after = jettison.time_after_ignition_s
        if after is None or i + 1 == len(mission.stages):
            continue
        following = mission.stages[i + 1]
        coasts = itertools.takewhile(lambda arc: isinstance(arc, CoastArc), following.flight_arcs)
        room = ignition[i + 1] - ignition[i]
        known = not any(arc.free for arc in (*mission.stages[i].flight_arcs, *coasts))
        if known and after > room:
            fail(
                ("jettisons", k, "time_after_ignition_s"),
                after,
                f"at most {room:g} s, when stage {following.name} ignites; for a later drop name "
                "that stage",
            )


def _check_jettison_before_free_arcs(mission: "Mission") -> None:
    """Report a drop by the clock that comes after the longest of its stage's first free arc."""
    for k, jettison in enumerate(mission.jettisons):
        path = ("jettisons", k)
        expected = "no such key in a mission with free arcs before its last"
        jettison.refuse(("time_s",), expected, path)
        after = jettison.time_after_ignition_s
        if after is None:
            continue
        stage = mission.stages[mission.stage_names.index(jettison.stage)]
        room = _time_to_end_of_free_arc(stage)
        if after > room:
            expected = f"at most {room:g} s, before an arc of stage {stage.name} ends that is free"
            fail((*path, "time_after_ignition_s"), after, expected)


def _time_to_end_of_free_arc(stage: Stage) -> float:
    """Return the longest time from a stage's ignition to the end of its first free arc, s."""
    before, k = stage.first_free_arc
    longest = None if k is None else stage.flight_arcs[k].max_s
    return math.inf if longest is None else before + longest


def _check_heating_limits(mission: "Mission") -> None:
    limits = [
        jettison.heating_limit_w_m2
        for jettison in mission.jettisons
        if jettison.heating_limit_w_m2 is not None
    ]
    for k, jettison in enumerate(mission.jettisons):
        if mission.environment.atmosphere.model == "none":
            instead = "time_s or time_after_ignition_s in its place"
            expected = f"{instead}, because atmosphere.model is none"
            jettison.refuse(("heating_limit_w_m2",), expected, ("jettisons", k))
        # heating falls: the lowest limit is reached last and governs the rest of the flight
        lowest = jettison.heating_limit_w_m2 == min(limits, default=None)
        if jettison.heating_limit_holds == "from_jettison" and not lowest:
            expected = f"at_jettison, for all but the lowest limit, {min(limits):g} W/m2"
            jettison.refuse(("heating_limit_holds",), expected, ("jettisons", k))
