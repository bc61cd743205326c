# SPDX-License-Identifier: Apache-2.0
"""Flight by a plan, leg by leg where arcs before the last are free.

A leg is the arcs up to and including the next burn that ends a leg in the plan; its coasts and
other free arcs have their planned lengths. The law sees the leg as a mission: its last burn is cut
off at the leg's target, and in the last leg at the mission's. In a coast the law starts from the
predicted state at the next ignition, which is exact for a coast of any length.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import (
    ERROR_TIME_TO_GO_JUMP,
    LAW_OPTIMAL,
    PHASE_CONVERGING,
    PHASE_IDLE,
    PHASE_TRACKING,
    Onboard,
)
from ares_guidance.kernels.cycle import SHORT_BURN, aims_ahead, guidance_step
from ares_guidance.kernels.laws.near import names_radius
from ares_guidance.kernels.laws.start import start_guess
from ares_guidance.kernels.monitors.engines import present_engine
from ares_models.arrays import COAST, MissionRecords, Record
from ares_models.jit import inlined, kernel
from ares_models.kernels.coast import coast
from ares_models.kernels.environment import heating_rate
from ares_models.kernels.sequence import mass_at_staging
from ares_models.kernels.targets import (
    desired_state,
    plane_normal,
    project_to_plane,
    target_speed,
)
from ares_models.kernels.vectors import add, cross, dot, load, norm, scale, store, sub, unit

#: Largest difference of a leg's first solution from its planned end, as a fraction of the leg's
#: length, or of the speed that is still to be gained.
ALLOWED_SHARE = 0.1
#: Least length of the mean of two directions that is usable as a direction.
LEAST_MEAN = 0.15
#: Newton steps to the time at which a coast passes a place.
PLACE_STEPS = 6
#: Time before an ignition from which a burn after an ascent through the air is aimed, s.
LATE_IN_COAST = 600.0
#: Time before an ignition from which it is not moved any more, and most by which a navigation state
#: moves it, s.
AIMED = 10.0
MOST_MOVED = 300.0


@kernel
def last_of_leg(k: int, arcs: NDArray[Any], plan: Record) -> int:
    """Return the last arc of the leg of arc ``k``: the planned one, or the mission's last."""
    last = k
    while last + 1 < arcs.shape[0] and plan.ends_leg[last] == 0:
        last += 1
    return last


@inlined
def mission_of_leg(mission: MissionRecords, leg: Record) -> MissionRecords:
    """Return the leg as a mission."""
    return MissionRecords(
        mission.environment,
        mission.atmosphere,
        leg.arcs[: leg.count],
        mission.jettisons,
        leg.target,
    )


@inlined
def aimed_by_plan(mission: MissionRecords, state: Record) -> MissionRecords:
    """Return the mission with the target written by :func:`set_aim`."""
    return MissionRecords(
        mission.environment, mission.atmosphere, mission.arcs, mission.jettisons, state.leg.target
    )


@inlined
def onboard_of_leg(onboard: Onboard, leg: Record) -> Onboard:
    """Return the state of guidance with navigation and steering of the leg."""
    return Onboard(leg.navigation, onboard.settings, onboard.state, leg.steering)


@kernel
def set_aim(mission: MissionRecords, state: Record) -> None:
    """Write the target of the last leg: the mission's, at the planned place on its orbit.

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
    """Write the initial guess of a search from the plan of the leg that ends with arc ``last``.

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

    Its last burn is free for the law, even if of fixed length: there the clock ends it, and the law
    spends the surplus delta-V.

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
    if math.isfinite(mission.arcs[last].duration):
        leg.arcs[last].shortest = mission.arcs[last].duration
        leg.arcs[last].longest = math.inf
    if leg.count < mission.arcs.shape[0]:
        leg.target = plan.target[last]
    else:
        set_aim(mission, state)
    set_guess(plan, leg, last)


@kernel
def time_coast(mission: MissionRecords, nav: Record, plan: Record) -> None:
    """Let a free coast that begins a leg end at its planned place, if the plan has one.

    The burn before it met the planned orbit, but not at the planned place.

    Args:
        mission: as guidance believes it.
        nav: record NAVIGATION.
        plan: record PLAN. The length of the coast is changed.
    """
    arc = mission.arcs[nav.arc]
    place = load(plan.position[nav.arc])
    if arc.kind != COAST or math.isfinite(arc.duration) or norm(place) == 0.0:
        return
    begun = nav.time - nav.arc_start_time
    ahead = plan.length[nav.arc] - begun
    for _ in range(PLACE_STEPS):
        r, v = coast(load(nav.position), load(nav.velocity), ahead, mission.environment)
        momentum = cross(r, v)
        angle = math.atan2(dot(cross(r, place), unit(momentum)), dot(r, place))
        ahead += angle * dot(r, r) / norm(momentum)
    if math.isfinite(ahead):
        plan.length[nav.arc] = begun + max(ahead, 0.0)
        plan.length[nav.arc] = min(max(plan.length[nav.arc], arc.shortest), arc.longest)


@kernel
def meet_radius(mission: MissionRecords, onboard: Onboard) -> None:
    """Let the coast before a short last burn end where it passes the radius of the target.

    An error of 0.05 m/s in the burn before moves the apogee by 180 m, which a burn of seconds
    cannot correct.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. The planned length of the coast is changed.
    """
    nav = onboard.navigation
    state = onboard.state
    plan = state.plan
    k = nav.arc
    arc = mission.arcs[k]
    begun = nav.time - nav.arc_start_time
    ahead = planned = plan.length[k] - begun
    half = 0.5 * state.solution.time_to_go
    if (
        not (names_radius(mission.target) and k + 2 == mission.arcs.shape[0])
        or arc.kind != COAST
        or math.isfinite(arc.duration)
        # after an ascent through the air alone is a short burn aimed until its ignition
        or not aims_ahead(state)
        or state.phase != PHASE_TRACKING
        # its solution is for the planned ignition
        or state.law == LAW_OPTIMAL
        or 2.0 * half > onboard.settings.restart_time
        or not AIMED < planned < LATE_IN_COAST
    ):
        return
    for _ in range(PLACE_STEPS):
        r, v = coast(load(nav.position), load(nav.velocity), ahead, mission.environment)
        size = norm(r)
        climb = dot(r, v) / size
        bend = dot(cross(r, v), cross(r, v)) / size**3 - mission.environment.mu / size**2
        if not bend < 0.0:
            return
        # in the middle of the burn; no root: the apogee is below that radius
        above = size - mission.target.radius - 0.5 * bend * half * half
        root = math.sqrt(max(0.0, climb * climb - 2.0 * bend * above))
        early, late = (root - climb) / bend, (-root - climb) / bend
        ahead += early if abs(early) < abs(late) else late
    if abs(ahead - planned) < MOST_MOVED:
        plan.length[k] = min(max(begun + max(ahead, 0.0), arc.shortest), arc.longest)
        state.leg.arcs[k].duration = plan.length[k]


@kernel
def look_ahead(mission: MissionRecords, nav: Record, leg: Record) -> None:
    """Write the navigation state that the law starts from: in a coast the state at its end.

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
    # the measured density ratio is assumed to hold there too
    here = heating_rate(load(nav.position), load(nav.velocity), environment, mission.atmosphere)
    there = heating_rate(r, v, environment, mission.atmosphere)
    ahead.heating_rate *= there / here
    store(ahead.position, r)
    store(ahead.velocity, v)


@kernel
def guess_end(arcs: NDArray[Any], nav: Record, state: Record) -> None:
    """Write the planned time to the end of the leg.

    Args:
        arcs: of the leg, dtype ARC, free arcs with infinite length.
        nav: record NAVIGATION that the law starts from.
        state: record GUIDANCE_STATE. Its leg is changed.
    """
    end = nav.arc_start_time
    for k in range(nav.arc, arcs.shape[0]):
        fixed = arcs[k].duration
        end += fixed if math.isfinite(fixed) else state.plan.length[k]
    state.leg.time_to_go = max(0.0, end - nav.time)


@kernel
def time_cycle(onboard: Onboard, was_coasting: int) -> None:
    """Schedule the cycles in a coast by the present time, as the leg's own time stands still.

    After an ascent through the air a coast begins in thin air, of which its prediction knows
    nothing: the burn after it is aimed towards its end, and planned until then.

    Args:
        onboard: state of guidance with the present navigation state. Changed.
        was_coasting: 1 if the previous navigation state was in a coast.
    """
    now = onboard.navigation.time
    state = onboard.state
    leg = state.leg
    if leg.coasting == 1:
        if was_coasting == 0:
            late = leg.navigation.time - LATE_IN_COAST if state.programme.cycle > 0 else now
            leg.cycle_time = max(now, late)
        state.next_cycle_time = math.inf
        if now >= leg.cycle_time - 1e-9:
            state.next_cycle_time = leg.navigation.time
            period = onboard.settings.cycle_period
            leg.cycle_time += (math.floor((now + 1e-9 - leg.cycle_time) / period) + 1.0) * period
    elif was_coasting == 1:
        state.next_cycle_time = now


@kernel
def begin_leg(mission: MissionRecords, onboard: Onboard) -> None:
    """Discard the solution of the previous leg and start a search.

    Args:
        mission: the leg as a mission.
        onboard: state of guidance in the leg. Changed.
    """
    nav = onboard.navigation
    state = onboard.state
    steering = onboard.steering
    steering.cutoff_time = math.nan
    steering.jettison = -1
    steering.jettison_time = math.nan
    if state.phase == PHASE_IDLE:
        # the first cycle of the flight starts the search
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
    """Reject the first solution of a leg if it ends far from the planned time.

    A long burn has more than one solution. A last burn of little thrust makes up for what the
    stages before it lack, which takes it long. The last leg accepts any, because nothing follows
    it.

    Args:
        mission: the leg as a mission.
        onboard: state of guidance in the leg. Changed.
        last: index of the mission's last arc.
    """
    state = onboard.state
    leg = state.leg
    nav = leg.navigation
    arc = leg.arcs[leg.count - 1]
    planned = nav.time + leg.time_to_go
    ve, mass_flow = present_engine(arc, arc.stage, state)
    mu, r = mission.environment.mu, norm(load(nav.position))
    to_gain = abs(target_speed(leg.target, mu, r) - norm(load(nav.velocity)))
    burns = to_gain * min(nav.mass, arc.stack_mass) / (ve * mass_flow)
    allowed = ALLOWED_SHARE * max(planned - leg.begin, burns)
    allowed = max(allowed, onboard.settings.time_to_go_jump_limit)
    if leg.count <= last and abs(onboard.steering.cutoff_time - planned) > allowed:
        state.error = ERROR_TIME_TO_GO_JUMP
        state.phase = PHASE_CONVERGING
        state.optimal.solved = 0
        onboard.steering.cutoff_time = math.nan
        start_guess(mission, onboard)


@kernel
def steer_by_plan(leg: Record) -> None:
    """Turn from the planned first direction to the last until there is a solution.

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
    # what ends before the next cycle does not turn
    rate = 1.0 / (length * norm(mean)) if length > SHORT_BURN else 0.0
    store(steering.direction_rate, scale(rate, sub(last, first)))


@kernel
def is_at_target(mission: MissionRecords, onboard: Onboard) -> bool:
    """Return whether a short burn would meet the velocity of the leg's target where it is now.

    Such a burn, planned or left over, may be too short for any solution.

    Args: as in :func:`command_flight`.
    """
    nav = onboard.navigation
    state = onboard.state
    target = state.leg.target
    r, v = load(nav.position), load(nav.velocity)
    normal, _ = plane_normal(target, r, cross(r, v))
    radial = project_to_plane(r, normal)
    _, wanted_v, _ = desired_state(target, mission.environment.mu, radial, normal)
    arc = mission.arcs[nav.arc]
    ve, mass_flow = present_engine(arc, arc.stage, state)
    return norm(sub(wanted_v, v)) * nav.mass < SHORT_BURN * ve * mass_flow


@kernel
def command_flight(mission: MissionRecords, onboard: Onboard) -> None:
    """Command the leg's steering and cut-off, and the planned arcs after it.

    At its target the last burn is cut off without a solution too.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Its steering is changed.
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
    arc = arcs[nav.arc]
    ends = nav.arc + 1 == arcs.shape[0] and math.isinf(arc.duration)
    if ends and math.isnan(steering.cutoff_time) and is_at_target(mission, onboard):
        steering.cutoff_time = max(nav.time, nav.arc_start_time + arc.shortest)


@kernel
def step_as_one(mission: MissionRecords, onboard: Onboard) -> None:
    """Answer one navigation state of a flight without free arcs before the last.

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
        time_coast(mission, nav, state.plan)
        lay_out(mission, state, last)
    elif leg.coasting == 1:
        meet_radius(mission, onboard)
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
