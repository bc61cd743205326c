# SPDX-License-Identifier: Apache-2.0
"""Fly by a plan, leg by leg where arcs before the last are free.

A leg is the arcs up to and including the next burn that the plan ends one with, its coasts and
other free arcs as long as planned. The law sees it as a mission: its last burn is cut off where
the leg's target is met, at the end of the flight the mission's own. In a coast the law steers from
the next ignition, where the orbit of the present state leads: however long the coast, nothing is
approximated.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import (
    ERROR_TIME_TO_GO_JUMP,
    PHASE_CONVERGING,
    PHASE_IDLE,
    PHASE_TRACKING,
    Onboard,
)
from ares_guidance.kernels.cycle import guidance_step
from ares_guidance.kernels.start import start_guess
from ares_models.arrays import COAST, MissionRecords, Record
from ares_models.jit import inlined, kernel
from ares_models.kernels.coast import coast
from ares_models.kernels.environment import heating_rate
from ares_models.kernels.sequence import mass_at_staging
from ares_models.kernels.vectors import add, load, norm, scale, store, sub, unit

#: How far the first solution of a leg may be from the plan's end, as a part of the leg.
ALLOWED_SHARE = 0.1
#: Length of the mean of two directions below which it says nothing.
LEAST_MEAN = 0.15


@kernel
def last_of_leg(k: int, arcs: NDArray[Any], plan: Record) -> int:
    """Return the arc with which the leg of arc ``k`` ends: as the plan has it, or the last arc."""
    last = k
    while last + 1 < arcs.shape[0] and plan.ends_leg[last] == 0:
        last += 1
    return last


@inlined
def mission_of_leg(mission: MissionRecords, leg: Record) -> MissionRecords:
    """The leg as a mission."""
    return MissionRecords(
        mission.environment,
        mission.atmosphere,
        leg.arcs[: leg.count],
        mission.jettisons,
        leg.target,
    )


@inlined
def aimed_by_plan(mission: MissionRecords, state: Record) -> MissionRecords:
    """Return the mission with the target that :func:`set_aim` has written."""
    return MissionRecords(
        mission.environment, mission.atmosphere, mission.arcs, mission.jettisons, state.leg.target
    )


@inlined
def onboard_of_leg(onboard: Onboard, leg: Record) -> Onboard:
    """What is on board, as the law sees it in a leg."""
    return Onboard(leg.navigation, onboard.settings, onboard.state, leg.steering)


@kernel
def set_aim(mission: MissionRecords, state: Record) -> None:
    """Write the target of the last leg: the mission's, met where the plan meets it.

    Args:
        mission: as guidance believes it.
        state: record GUIDANCE_STATE. Its leg is changed.
    """
    if state.plan.aims == 1:
        state.leg.target = state.plan.target[mission.arcs.shape[0] - 1]
    else:
        state.leg.target = mission.target


@kernel
def set_guess(plan: Record, leg: Record, last: int) -> None:
    """Write what the plan says of the leg that ends with arc ``last``, to begin a search with.

    Args:
        plan: record PLAN.
        leg: record LEG. Changed.
        last: index of the arc.
    """
    store(leg.first_direction, load(plan.direction[last, 0]))
    store(leg.last_direction, load(plan.direction[last, 1]))
    store(leg.end_position, load(plan.position[last]))
    leg.jettison_time = plan.jettison_time


@kernel
def lay_out(mission: MissionRecords, state: Record, last: int) -> None:
    """Write the leg that ends with arc ``last``.

    The last burn is free for the law, also one of fixed length, which the clock ends.

    Args:
        mission: as guidance believes it.
        state: record GUIDANCE_STATE. Its leg is changed.
        last: index of the arc.
    """
    plan = state.plan
    leg = state.leg
    leg.count = last + 1
    for k in range(leg.count):
        leg.arcs[k] = mission.arcs[k]
        if math.isinf(leg.arcs[k].duration):
            leg.arcs[k].duration = plan.length[k]
    leg.arcs[last].duration = math.inf
    if leg.count < mission.arcs.shape[0]:
        leg.target = plan.target[last]
    else:
        set_aim(mission, state)
    set_guess(plan, leg, last)


@kernel
def look_ahead(mission: MissionRecords, nav: Record, leg: Record) -> None:
    """Write the navigation state that the law steers from: in a coast that at its end.

    Args:
        mission: as guidance believes it.
        nav: record NAVIGATION, the present one.
        leg: record LEG. Changed.
    """
    ahead = leg.navigation
    ahead.time = nav.time
    ahead.mass = nav.mass
    ahead.heating_rate = nav.heating_rate
    ahead.arc = nav.arc
    ahead.arc_start_time = nav.arc_start_time
    ahead.jettisoned = nav.jettisoned
    store(ahead.position, load(nav.position))
    store(ahead.velocity, load(nav.velocity))
    store(ahead.sensed_delta_v, load(nav.sensed_delta_v))
    leg.coasting = 1 if leg.arcs[nav.arc].kind == COAST else 0
    if leg.coasting == 0:
        return
    while leg.arcs[ahead.arc].kind == COAST:
        ahead.arc_start_time += leg.arcs[ahead.arc].duration
        ahead.arc += 1
        arc = leg.arcs[ahead.arc]
        if arc.begins_stage == 1:
            ahead.mass = mass_at_staging(arc, mission.jettisons, nav.jettisoned)
    ahead.arc_start_time = max(ahead.arc_start_time, nav.time)
    ahead.time = ahead.arc_start_time
    environment = mission.environment
    r, v = coast(load(nav.position), load(nav.velocity), ahead.time - nav.time, environment)
    # the density is taken to differ there by as much as here
    here = heating_rate(load(nav.position), load(nav.velocity), environment, mission.atmosphere)
    there = heating_rate(r, v, environment, mission.atmosphere)
    ahead.heating_rate *= there / here
    store(ahead.position, r)
    store(ahead.velocity, v)


@kernel
def guess_end(arcs: NDArray[Any], nav: Record, state: Record) -> None:
    """Write how far off the end of the leg is by the plan.

    Args:
        arcs: of the leg, dtype ARC, the free ones of no known length.
        nav: record NAVIGATION that the law steers from.
        state: record GUIDANCE_STATE. Its leg is changed.
    """
    end = nav.arc_start_time
    for k in range(nav.arc, arcs.shape[0]):
        fixed = arcs[k].duration
        end += fixed if math.isfinite(fixed) else state.plan.length[k]
    state.leg.time_to_go = max(0.0, end - nav.time)


@kernel
def time_cycle(onboard: Onboard, was_coasting: int) -> None:
    """Keep the cycles of a coast at their period: the clock of its end does not move.

    Args:
        onboard: what is on board, the present navigation state. Changed.
        was_coasting: the navigation state before was in a coast.
    """
    now = onboard.navigation.time
    state = onboard.state
    leg = state.leg
    if leg.coasting == 1:
        if was_coasting == 0:
            leg.cycle_time = now
        state.next_cycle_time = math.inf
        if now >= leg.cycle_time - 1e-9:
            state.next_cycle_time = leg.navigation.time
            period = onboard.settings.cycle_period
            leg.cycle_time += (math.floor((now + 1e-9 - leg.cycle_time) / period) + 1.0) * period
    elif was_coasting == 1:
        state.next_cycle_time = now


@kernel
def begin_leg(mission: MissionRecords, onboard: Onboard) -> None:
    """Forget the solution of the leg before and start anew.

    Args:
        mission: the leg's.
        onboard: as the law sees it in the leg. Changed.
    """
    nav = onboard.navigation
    state = onboard.state
    steering = onboard.steering
    steering.cutoff_time = math.nan
    steering.jettison = -1
    steering.jettison_time = math.nan
    if state.phase == PHASE_IDLE:
        # the cycle begins the flight
        return
    state.phase = PHASE_CONVERGING
    state.stale_cycles = 0
    state.lowered = 0.0
    state.optimal.solved = 0
    state.optimal.arcs_from = 0
    state.next_cycle_time = nav.time
    state.time = nav.time
    store(state.sensed_delta_v, load(nav.sensed_delta_v))
    start_guess(mission, onboard)


@kernel
def check_first(mission: MissionRecords, onboard: Onboard, last: int) -> None:
    """Do not fly the first solution of a leg that would end it far from the plan.

    Over a long burn there is more than one way to the same end. Of the last leg, which nothing
    follows, any is good.

    Args:
        mission: the leg's.
        onboard: as the law sees it in the leg. Changed.
        last: index of the mission's last arc.
    """
    state = onboard.state
    leg = state.leg
    planned = leg.navigation.time + leg.time_to_go
    allowed = max(ALLOWED_SHARE * (planned - leg.begin), onboard.settings.time_to_go_jump_limit)
    if leg.count <= last and abs(onboard.steering.cutoff_time - planned) > allowed:
        state.error = ERROR_TIME_TO_GO_JUMP
        state.phase = PHASE_CONVERGING
        state.optimal.solved = 0
        onboard.steering.cutoff_time = math.nan
        start_guess(mission, onboard)


@kernel
def steer_by_plan(leg: Record) -> None:
    """Until there is a solution: turn from the plan's first direction to its last.

    Args:
        leg: record LEG. Its steering is changed.
    """
    first, last = load(leg.first_direction), load(leg.last_direction)
    mean = scale(0.5, add(first, last))
    length = leg.navigation.time + leg.time_to_go - leg.begin
    if norm(mean) < LEAST_MEAN or not length > 0.0:
        return
    steering = leg.steering
    steering.reference_time = leg.begin + 0.5 * length
    store(steering.direction, unit(mean))
    store(steering.direction_rate, scale(1.0 / (length * norm(mean)), sub(last, first)))


@kernel
def command_flight(mission: MissionRecords, onboard: Onboard) -> None:
    """Command the leg's steering, and from its cut-off on what is planned to the end.

    Args:
        mission: as guidance believes it.
        onboard: what is on board. Its steering is changed.
    """
    nav = onboard.navigation
    state = onboard.state
    plan = state.plan
    leg = state.leg
    arcs = mission.arcs
    steering = onboard.steering
    steering.reference_time = leg.steering.reference_time
    store(steering.direction, load(leg.steering.direction))
    store(steering.direction_rate, load(leg.steering.direction_rate))
    steering.jettison = leg.steering.jettison
    steering.jettison_time = leg.steering.jettison_time
    end = nav.arc_start_time
    for k in range(arcs.shape[0]):
        steering.arc_end_times[k] = math.nan
    for k in range(nav.arc, arcs.shape[0]):
        free = math.isinf(arcs[k].duration)
        if free and k == leg.count - 1 and math.isfinite(leg.steering.cutoff_time):
            end = leg.steering.cutoff_time
        else:
            end += plan.length[k] if free else arcs[k].duration
        if free and k + 1 < arcs.shape[0]:
            steering.arc_end_times[k] = end
    steering.cutoff_time = end if math.isfinite(leg.steering.cutoff_time) else math.nan


@kernel
def step_as_one(mission: MissionRecords, onboard: Onboard) -> None:
    """Answer one navigation state of a flight without free arcs before its last.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.
    """
    state = onboard.state
    leg = state.leg
    set_aim(mission, state)
    leg.time_to_go = 0.0
    if state.plan.aims == 1 and state.phase <= PHASE_CONVERGING:
        # until there is a solution
        set_guess(state.plan, leg, mission.arcs.shape[0] - 1)
        guess_end(mission.arcs, onboard.navigation, state)
    guidance_step(aimed_by_plan(mission, state), onboard)


@kernel
def step_by_legs(mission: MissionRecords, onboard: Onboard) -> None:
    """Answer one navigation state, leg by leg where the plan has legs.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.
    """
    nav = onboard.navigation
    state = onboard.state
    leg = state.leg
    if state.plan.made == 0:
        step_as_one(mission, onboard)
        return
    last = last_of_leg(nav.arc, mission.arcs, state.plan)
    begins = last + 1 != leg.count
    if begins:
        lay_out(mission, state, last)
    was_coasting = leg.coasting
    look_ahead(mission, nav, leg)
    guess_end(mission.arcs[: leg.count], leg.navigation, state)
    if begins:
        leg.begin = leg.navigation.time
        begin_leg(mission_of_leg(mission, leg), onboard_of_leg(onboard, leg))
    time_cycle(onboard, was_coasting)
    searching = state.phase <= PHASE_CONVERGING
    guidance_step(mission_of_leg(mission, leg), onboard_of_leg(onboard, leg))
    if searching and state.phase == PHASE_TRACKING:
        check_first(
            mission_of_leg(mission, leg), onboard_of_leg(onboard, leg), mission.arcs.shape[0] - 1
        )
    if state.phase == PHASE_CONVERGING and math.isnan(leg.steering.cutoff_time):
        steer_by_plan(leg)
    command_flight(mission, onboard)
