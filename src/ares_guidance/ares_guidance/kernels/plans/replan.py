# SPDX-License-Identifier: Apache-2.0
"""Solve the flight through the air anew in each cycle, in place of the planned programme.

The two-point problem of law `optimal` begins in the air, with the forces of the air in motion and
costates, and ends at the target (Dukeman, AIAA 2002-4559; Lu and Pan, J. Guidance 33, 2010). It
starts from the plan's costates, later from those of the last cycle. Where it finds nothing, or
passes a limit of the dynamic pressure, the programme is flown on.
"""

import math

from ares_guidance.arrays import BOOST_REPLAN, ERROR_NONE, Onboard
from ares_guidance.kernels.laws.costate_guess import BY_PLAN
from ares_guidance.kernels.laws.onboard_problem import REFRESH
from ares_guidance.kernels.laws.optimal import solve_optimal
from ares_guidance.kernels.monitors.engines import (
    SHORTEST,
    STEP,
    begin_stage,
    filter_ratio,
    measures_one_burn,
    note_engines,
)
from ares_guidance.kernels.plans.legs import last_of_leg, lay_out, mission_of_leg
from ares_guidance.kernels.plans.programme import flies_programme
from ares_guidance.kernels.prediction.jettison import measure_density
from ares_models.arrays import BURN, MissionRecords
from ares_models.jit import kernel
from ares_models.kernels.aerodynamics import pressure_loss
from ares_models.kernels.sequence import empty_mass
from ares_models.kernels.vectors import add, axpy, dot, load, scale, store, sub
from ares_optimizer.two_point.contract import (
    MAX_UNKNOWNS,
    Extremal,
    field_of,
    moved,
    rates,
    steering_in_air,
)

#: Greatest dynamic pressure over its limit that is accepted.
WITHIN = 1.002
#: Least cosine between the new direction and the programme's.
NEAR = math.cos(math.radians(20.0))
#: Cycles without a solution after which the search starts from the plan again.
MOST_LOST = 10
#: Time over which the rate of the direction is taken, s.
RATE_STEP = 1.0


@kernel
def watch_flow(mission: MissionRecords, onboard: Onboard) -> None:
    """Measure the mass flow of the present burn; the thrust is taken to change with it.

    Drag is sensed with the thrust, so the thrust itself is not measured in the air.

    Args: as in :func:`flies_boost`.
    """
    nav = onboard.navigation
    state = onboard.state
    engines = state.engines
    span = nav.time - engines.time
    if engines.mass > 0.0 and 0.0 <= span < SHORTEST:
        return
    begin_stage(mission.arcs, onboard)
    if measures_one_burn(mission.arcs, onboard):
        flow = (engines.mass - nav.mass) / span
        ratio = flow / mission.arcs[nav.arc].mass_flow
        state.flow_ratio = filter_ratio(state.flow_ratio, ratio)
        state.thrust_ratio = state.flow_ratio
    note_engines(mission.arcs, onboard)


@kernel
def lengthen_weak_burn(mission: MissionRecords, onboard: Onboard) -> None:
    """Let the present burn of the leg last until its propellant is spent, if an engine is out.

    Only where the burn is the last of its stage: what burns beside or after it would change too.

    Args: as in :func:`flies_boost`; the leg is changed.
    """
    nav = onboard.navigation
    state = onboard.state
    arcs = mission.arcs
    arc = arcs[nav.arc]
    more = nav.arc + 1 < arcs.shape[0] and arcs[nav.arc + 1].stage == arc.stage
    if state.flow_ratio > 1.0 - STEP or math.isinf(arc.duration) or more:
        return
    left = nav.mass - empty_mass(arc, arcs, mission.jettisons, nav.jettisoned)
    span = left / (state.flow_ratio * arc.mass_flow)
    state.leg.arcs[nav.arc].duration = nav.time - nav.arc_start_time + span


@kernel
def present_extremal(onboard: Onboard) -> Extremal:
    """Return the present state with the costates of the solution."""
    nav = onboard.navigation
    u = onboard.state.optimal.unknowns
    p, q = (u[0], u[1], u[2]), (-u[3], -u[4], -u[5])
    return Extremal(load(nav.position), load(nav.velocity), p, q)


@kernel
def carry_costates(mission: MissionRecords, onboard: Onboard) -> None:
    """Carry the costates of the last cycle to now, by Heun's method.

    Args: as in :func:`flies_boost`.
    """
    nav = onboard.navigation
    programme = onboard.state.programme
    memory = onboard.state.optimal
    arc = mission.arcs[nav.arc]
    span = nav.time - memory.time
    last = present_extremal(onboard)
    p = axpy(span, load(programme.new_p_rate), last.p)
    q = axpy(span, load(programme.new_q_rate), last.q)
    thrust = onboard.state.thrust_ratio * arc.thrust
    field = field_of(mission.environment)
    now = rates(arc, Extremal(last.r, last.v, p, q), thrust, nav.mass, field, mission)
    p = axpy(0.5 * span, add(load(programme.new_p_rate), now.p), last.p)
    q = axpy(0.5 * span, add(load(programme.new_q_rate), now.q), last.q)
    store(memory.unknowns[0:3], p)
    store(memory.unknowns[3:6], scale(-1.0, q))
    memory.time = nav.time


@kernel
def write_steering(mission: MissionRecords, onboard: Onboard) -> bool:
    """Write direction and rate of the solution; return False if they are far from the programme's.

    Args: as in :func:`flies_boost`.
    """
    nav = onboard.navigation
    state = onboard.state
    programme = state.programme
    arc = mission.arcs[nav.arc]
    thrust = state.thrust_ratio * arc.thrust
    now = present_extremal(onboard)
    net = thrust - pressure_loss(arc, now.r, mission.environment, mission.atmosphere)
    begin = steering_in_air(arc, now.r, now.v, now.p, net, mission).u
    change = rates(arc, now, thrust, nav.mass, field_of(mission.environment), mission)
    then = moved(now, RATE_STEP, change)
    end = steering_in_air(arc, then.r, then.v, then.p, net, mission).u
    store(programme.new_p_rate, change.p)
    store(programme.new_q_rate, change.q)
    programme.new_time = nav.time
    store(programme.new_direction, begin)
    store(programme.new_rate, scale(1.0 / RATE_STEP, sub(end, begin)))
    return bool(dot(begin, load(onboard.steering.direction)) > NEAR)


@kernel
def plan_anew(mission: MissionRecords, onboard: Onboard) -> None:
    """Solve from the present state to the target.

    Args: as in :func:`flies_boost`, with the answer of the programme.
    """
    nav = onboard.navigation
    state = onboard.state
    programme = state.programme
    memory = state.optimal
    arc = mission.arcs[nav.arc]
    programme.replanned = 0
    if arc.kind != BURN or arc.vertical == 1:
        return
    watch_flow(mission, onboard)
    measure_density(mission, onboard)
    last = mission.arcs.shape[0] - 1
    if state.plan.made == 1 and state.plan.by_legs == 1:
        last = last_of_leg(nav.arc, mission.arcs, state.plan)
    for k in range(mission.arcs.shape[0]):
        memory.duration[k] = mission.arcs[k].duration
    lay_out(mission, state, last)
    lengthen_weak_burn(mission, onboard)
    if last + 1 == mission.arcs.shape[0] and state.plan.ends_round == 1:
        state.leg.target = state.plan.round_end
    # cycles of the law are not counted in the boost: each has its own steps here
    memory.searched_in = -1
    memory.options.in_air = 1
    memory.options.air_end = programme.time[programme.count - 1]
    solved = memory.solved == 1
    if solved:
        carry_costates(mission, onboard)
    error = solve_optimal(mission_of_leg(mission, state.leg), onboard, BY_PLAN, False)
    memory.options.in_air = 0
    if error != ERROR_NONE:
        programme.lost += 1
        if solved and programme.lost < MOST_LOST:
            # carry the last solution on, to start from it in the next cycle
            for i in range(MAX_UNKNOWNS):
                memory.unknowns[i] = memory.kept[i]
            memory.solved = 1
            memory.age = REFRESH
        return
    programme.lost = 0
    if memory.work.pressure_share > WITHIN:
        return
    if write_steering(mission, onboard):
        programme.replanned = 1
        programme.replans += 1


@kernel
def flies_boost(mission: MissionRecords, onboard: Onboard) -> bool:
    """Answer one navigation state in the air; return False if the law is to answer.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance: its programme and its steering are changed.
    """
    programme = onboard.state.programme
    cycle = programme.cycle
    if not flies_programme(mission, onboard):
        return False
    if onboard.settings.boost_steering != BOOST_REPLAN or programme.given_over == 0:
        return True
    if programme.cycle != cycle:
        plan_anew(mission, onboard)
    if programme.replanned == 1:
        steering = onboard.steering
        steering.reference_time = programme.new_time
        store(steering.direction, load(programme.new_direction))
        store(steering.direction_rate, load(programme.new_rate))
    return True
