# SPDX-License-Identifier: Apache-2.0
"""Optimal guidance: the two-point problem with its jettison, solved anew in every cycle.

The costates of the last cycle are carried to the new navigation state and corrected: by one
flight and the old Jacobian when that is enough, by Newton's method when it is not.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import ERROR_NONE, ERROR_NOT_CONVERGED, LAW_OPTIMAL, Onboard
from ares_guidance.kernels.convergence import begin_again
from ares_guidance.kernels.convergence import seek as seek_by_peg
from ares_guidance.kernels.jettison import on_board_heating
from ares_guidance.kernels.segments import (
    least_time_to_go,
    note_tail_off,
    plan_segments,
    thrust_integrals,
)
from ares_models.arrays import BURN, HEATING_LIMIT, MissionRecords, Record
from ares_models.jit import inlined, kernel
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.linear import back_substitute
from ares_models.kernels.sequence import aboard, awaits_heating, empty_mass
from ares_models.kernels.vectors import Vector, axpy, load, norm, scale, store, unit
from ares_optimizer.two_point.arrays import (
    AT_ONCE,
    HELD,
    INVERSE_SQUARE,
    RUNGE_KUTTA,
    Effort,
)
from ares_optimizer.two_point.contract import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    CONVERGED,
    HEATING_OPTIMAL,
    MAX_UNKNOWNS,
    carried_back,
    field_of,
    find_optimum,
    free_column,
    gravity_terms,
    lengths_inside,
    next_ignition,
    scaled_length,
    shoot,
    tangential_primer,
    unknown_count,
)

#: Longest step of the on-board flight, s: the cut-off is off by 0.1 ms at most.
STEP = 40.0
#: The same as a share of the time in which the last burn would use up all the mass.
STEP_SHARE = 0.07
#: Last Newton step in scaled unknowns: 1e-4 s of cut-off.
TOLERANCE = 1e-6
#: Cycles on one Jacobian, and the scaled correction up to which it is trusted.
REFRESH = 20
SMALL = 3e-3
#: s to go below which each cycle has a Jacobian of its own: what it leaves is not made up for.
LAST = 20.0
#: Change of an engine up to which that Jacobian is kept.
SAME_ENGINE = 0.01
#: s before the planned end of an arc from which that end stands.
NEAR_END = 1.0
_ROUNDING = 1e-6

#: What a search starts from.
BY_NOTHING = 0
BY_STEERING = 1
BY_PLAN = 2
#: An extremal that burns longer than PEG's plan by this factor, and a second, is no optimum.
LONGER = 1.02
#: Steps of the integrator in one cycle. What is found at all takes 60 in the median, 260 at most.
MOST_STEPS = 1_500
#: Steps of the integrator that may go into searches without a result while an arc lasts; then
#: the law flies PEG until the next arc. It bounds what a hopeless mission costs, to seconds.
MOST_WASTED = 1_000_000


@kernel
def plans_whole(state: Record) -> bool:
    """Return whether the ends of free arcs before the last are unknowns too."""
    return state.plan.made == 1 and state.plan.by_legs == 0


@kernel
def begins_by_plan(arcs: NDArray[Any], onboard: Onboard) -> bool:
    """Return whether the plan has the costates to begin the search with.

    Without free arcs before the last they are those of the first cycle alone.
    """
    nav = onboard.navigation
    state = onboard.state
    if plans_whole(state):
        return True
    if state.plan.made == 1 or state.plan.aims == 0 or state.cycle != 1:
        return False
    k = nav.arc
    while arcs[k].kind != BURN:
        k += 1
    primer = state.plan.primer[k]
    return math.isfinite(norm(load(primer[0])) + norm(load(primer[1])))


@kernel
def believed_limits(jettisons: NDArray[Any], onboard: Onboard) -> None:
    """Heating limits in the units of the on-board density, margin taken off."""
    settings = onboard.settings
    state = onboard.state
    memory = state.optimal
    below = (1.0 - settings.heating_margin) / on_board_heating(settings, state)
    for j in range(jettisons.shape[0]):
        memory.jettisons[j] = jettisons[j]
        if jettisons[j].criterion == HEATING_LIMIT:
            memory.jettisons[j].value *= below


@kernel
def believed_arcs(mission: MissionRecords, onboard: Onboard) -> None:
    """The mission's arcs, those of the present stage with its engines as measured."""
    nav = onboard.navigation
    state = onboard.state
    arcs = mission.arcs
    memory = state.optimal
    stage = arcs[nav.arc].stage
    if (
        memory.arcs_from == nav.arc + 1
        and memory.thrust_ratio == state.thrust_ratio
        and memory.flow_ratio == state.flow_ratio
    ):
        return
    for k in range(arcs.shape[0]):
        memory.arcs[k] = arcs[k]
        if plans_whole(state):
            memory.arcs[k].duration = memory.duration[k]
        if arcs[k].stage == stage and arcs[k].kind == BURN and state.thrust_ratio > 0.0:
            memory.arcs[k].thrust *= state.thrust_ratio
            memory.arcs[k].mass_flow *= state.flow_ratio
            memory.arcs[k].exhaust_velocity *= state.thrust_ratio / state.flow_ratio
    # another engine, another problem: the old Jacobian is left only for small changes
    if (
        abs(memory.thrust_ratio - state.thrust_ratio) > SAME_ENGINE
        or abs(memory.flow_ratio - state.flow_ratio) > SAME_ENGINE
    ):
        memory.age = REFRESH
    present = memory.arcs[nav.arc]
    if present.duration == 0.0:
        # engines have failed: the others burn what is left
        left = nav.mass - empty_mass(arcs[nav.arc], arcs, mission.jettisons, nav.jettisoned)
        present.duration = nav.time - nav.arc_start_time + left / present.mass_flow
        memory.age = REFRESH
    memory.arcs_from = nav.arc + 1
    memory.thrust_ratio = state.thrust_ratio
    memory.flow_ratio = state.flow_ratio


@inlined
def believed_mission(mission: MissionRecords, onboard: Onboard) -> MissionRecords:
    """The mission with limits and engines as measured, kept in the law's memory."""
    believed_limits(mission.jettisons, onboard)
    believed_arcs(mission, onboard)
    memory = onboard.state.optimal
    return MissionRecords(
        mission.environment,
        mission.atmosphere,
        memory.arcs[: mission.arcs.shape[0]],
        memory.jettisons[: mission.jettisons.shape[0]],
        mission.target,
    )


@kernel
def carry_ends(mission: MissionRecords, onboard: Onboard, first: int) -> None:
    """Take out the ends of arcs that are over; hold that of an arc which is about to end.

    Args:
        mission: as believed.
        onboard: what is on board. Its memory is changed.
        first: column of the first end.
    """
    nav = onboard.navigation
    memory = onboard.state.optimal
    u = memory.unknowns
    switches = memory.work.switches
    for k in range(memory.solved_in, nav.arc):
        if not math.isinf(mission.arcs[k].duration):
            continue
        memory.age = REFRESH
        for i in range(first, MAX_UNKNOWNS - 1):
            u[i] = u[i + 1]
        for f in range(switches.shape[0] - 1):
            switches[f].hold = switches[f + 1].hold
            switches[f].length = switches[f + 1].length
    memory.solved_in = nav.arc
    last = mission.arcs.shape[0] - 1
    if nav.arc == last or not math.isinf(mission.arcs[nav.arc].duration):
        return
    if u[first] - nav.time < NEAR_END:
        if switches[0].hold != HELD:
            memory.age = REFRESH
        u[first] = max(u[first], nav.time + AT_ONCE)
        switches[0].hold = HELD
        switches[0].length = u[first] - nav.arc_start_time


@kernel
def primer_later(
    environment: Record, r: Vector, costates: tuple[Vector, Vector], dt: float
) -> tuple[Vector, Vector]:
    """Primer and its rate after ``dt`` s, few enough for the gravity gradient to stay."""
    p, q = costates
    _, bend = gravity_terms(r, field_of(environment), p)
    return axpy(dt, axpy(0.5 * dt, bend, q), p), axpy(dt, bend, q)


@kernel
def planned_primer(
    believed: MissionRecords, onboard: Onboard, ignition: float
) -> tuple[Vector, Vector]:
    """Primer now, and its rate, from the plan's at an ignition; if it has none, along the velocity.

    Args:
        believed: the mission as believed.
        onboard: what is on board.
        ignition: s; that of the burn that runs, or of the next.
    """
    nav = onboard.navigation
    plan = onboard.state.plan
    k = nav.arc
    while believed.arcs[k].kind != BURN:
        k += 1
    p, q = load(plan.primer[k, 0]), load(plan.primer[k, 1])
    if not math.isfinite(norm(p) + norm(q)):
        p, q = tangential_primer(nav, believed, ignition)
    elif k == nav.arc:
        later = nav.time - plan.ignition[k]
        return primer_later(believed.environment, load(nav.position), (p, q), later)
    return carried_back(nav, believed, ignition, (p, q))


@kernel
def planned_guess(believed: MissionRecords, onboard: Onboard) -> None:
    """Unknowns from the plan."""
    nav = onboard.navigation
    state = onboard.state
    memory = state.optimal
    u = memory.unknowns
    first_end = free_column(nav, believed.jettisons, memory.options)
    first = first_end
    end = nav.arc_start_time
    last = believed.arcs.shape[0] - 1
    for k in range(nav.arc, last + 1):
        free = math.isinf(believed.arcs[k].duration)
        end += state.plan.length[k] if free else believed.arcs[k].duration
        if free and k < last:
            u[first] = end
            first += 1
    u[COLUMN_CUTOFF] = end
    ignition = next_ignition(nav, believed, u[first_end:])
    p, q = planned_primer(believed, onboard, ignition)
    for i in range(3):
        u[i] = p[i]
        u[3 + i] = -q[i]
    index = COLUMN_JETTISON
    for j in range(believed.jettisons.shape[0]):
        if awaits_heating(believed.jettisons, nav.jettisoned, j):
            planned = state.plan.jettison_time
            u[index] = planned if math.isfinite(planned) else u[COLUMN_CUTOFF]
            u[index + 1] = 0.0
            index += 2


@kernel
def carry(mission: MissionRecords, onboard: Onboard) -> None:
    """Bring the costates of the last solution to the present state, jettisons included."""
    nav = onboard.navigation
    environment = mission.environment
    memory = onboard.state.optimal
    u = memory.unknowns
    r = load(nav.position)
    p = (u[0], u[1], u[2])
    q = (-u[3], -u[4], -u[5])
    p, q = primer_later(environment, r, (p, q), nav.time - memory.time)
    # what has gone since: its jump, and its unknowns
    index = 0
    for j in range(mission.jettisons.shape[0]):
        if not awaits_heating(mission.jettisons, memory.jettisoned, j):
            continue
        if aboard(nav.jettisoned, j):
            index += 1
            continue
        pi = u[COLUMN_JETTISON + 2 * index + 1]
        _, by_r, by_v = log_heating_gradient(r, load(nav.velocity), environment, mission.atmosphere)
        p = axpy(-pi, by_v, p)
        q = axpy(pi, by_r, q)
        for i in range(COLUMN_JETTISON + 2 * index, MAX_UNKNOWNS - 2):
            u[i] = u[i + 2]
    size = 1.0 / norm(p)
    for i in range(3):
        u[i] = size * p[i]
        u[3 + i] = -size * q[i]
    first = free_column(nav, mission.jettisons, memory.options)
    for i in range(COLUMN_JETTISON + 1, first, 2):
        u[i] *= size
    carry_ends(mission, onboard, first)
    if memory.jettisoned != nav.jettisoned:
        memory.age = REFRESH
    memory.jettisoned = nav.jettisoned
    memory.time = nav.time


@kernel
def first_guess(jettisons: NDArray[Any], onboard: Onboard) -> None:
    """Unknowns from the steering in force: lambda_v = direction, lambda_r = -rate."""
    nav = onboard.navigation
    solution = onboard.state.solution
    u = onboard.state.optimal.unknowns
    ahead = nav.time - solution.reference_time
    p = axpy(ahead, load(solution.direction_rate), load(solution.direction))
    size = 1.0 / norm(p)
    for i in range(3):
        u[i] = size * p[i]
        u[3 + i] = -size * solution.direction_rate[i]
    u[COLUMN_CUTOFF] = nav.time + solution.time_to_go - solution.tail_gain
    index = COLUMN_JETTISON
    for j in range(jettisons.shape[0]):
        if awaits_heating(jettisons, nav.jettisoned, j):
            planned = solution.jettison_time[j]
            u[index] = planned if math.isfinite(planned) else u[COLUMN_CUTOFF]
            u[index + 1] = 0.0
            index += 2


@kernel
def correct(believed: MissionRecords, onboard: Onboard) -> bool:
    """One correction with the Jacobian of an earlier cycle; False if that is not enough."""
    nav = onboard.navigation
    memory = onboard.state.optimal
    work = memory.work
    u = memory.unknowns[:]
    if not shoot(nav, believed, memory.options, u, work):
        return False
    n = unknown_count(nav, believed, memory.options)
    for i in range(n):
        work.correction[i] = -work.residual[i]
    back_substitute(n, work.factors, work.pivots, work.correction)
    if not scaled_length(n, work.correction, work.unit) <= SMALL:
        return False
    for i in range(n):
        u[i] += work.correction[i]
    if not lengths_inside(nav, believed.arcs, u, work):
        return False
    for i in range(COLUMN_JETTISON, work.first_free, 2):
        # a limit that has stopped to bind is a matter for the search
        if u[i + 1] > _ROUNDING or u[i] < work.floor[i] or u[i] > u[COLUMN_CUTOFF]:
            return False
    return True


@kernel
def search(
    believed: MissionRecords, onboard: Onboard, guessed: bool, restart: bool
) -> tuple[int, bool]:
    """The optimum by Newton's method; iterations, and whether it was found."""
    nav = onboard.navigation
    jettisons = believed.jettisons
    memory = onboard.state.optimal
    work = memory.work
    if memory.wasted_in != nav.arc + 1:
        memory.wasted_in = nav.arc + 1
        memory.wasted = 0
    if memory.searched_in != onboard.state.cycle:
        memory.searched_in = onboard.state.cycle
        memory.steps_left = MOST_STEPS
    memory.options.max_steps = min(memory.steps_left, MOST_WASTED - memory.wasted)
    if memory.options.max_steps <= 0:
        return 0, False
    # a slice: for the nested array itself the search would be compiled once more
    iterations, _, status, starts = find_optimum(
        nav,
        believed,
        memory.options,
        Effort(guessed, restart, False, memory.first_start),
        memory.unknowns[:],
        work,
    )
    memory.steps_left -= work.spent
    # the next search in vain begins where this one has stopped
    memory.first_start = 0 if status == CONVERGED else memory.first_start + starts
    memory.wasted = 0 if status == CONVERGED else memory.wasted + work.spent
    memory.age = 0
    for j in range(jettisons.shape[0]):
        # a limit that does not bind was flown as a time: the Jacobian is of another problem
        if work.jettisons[j].criterion != jettisons[j].criterion or work.pinned[j] == 1:
            memory.age = REFRESH
    return iterations, status == CONVERGED


@kernel
def tell_lengths(mission: MissionRecords, onboard: Onboard) -> None:
    """Write the lengths of the free arcs ahead into the plan, and into the arcs of the leg.

    The search may have solved without a drop that is due at once: where the ends stand follows
    from the mission, not from its last problem.

    Args:
        mission: as in :func:`solve_optimal`; so the next.
        onboard: what is on board, with the solution. Its plan is changed.
    """
    state = onboard.state
    memory = state.optimal
    work = memory.work
    arcs = mission.arcs
    first = free_column(onboard.navigation, mission.jettisons, memory.options)
    for k in range(memory.solved_in, arcs.shape[0]):
        if not math.isinf(memory.duration[k]):
            continue
        end = memory.unknowns[COLUMN_CUTOFF]
        if k < arcs.shape[0] - 1:
            f = 0
            while work.switches[f].arc < k:
                f += 1
            end = memory.unknowns[first + f]
        state.plan.length[k] = end - work.layout.begins[k].time


@kernel
def tell(mission: MissionRecords, onboard: Onboard) -> None:
    """Write the solution where the guidance cycle looks for it."""
    nav = onboard.navigation
    state = onboard.state
    solution = state.solution
    memory = state.optimal
    u = memory.unknowns
    lambda_v = (u[0], u[1], u[2])
    size = 1.0 / norm(lambda_v)
    store(solution.direction, scale(size, lambda_v))
    store(solution.direction_rate, (-size * u[3], -size * u[4], -size * u[5]))
    solution.reference_time = nav.time
    solution.turn = 0.0
    note_tail_off(mission.arcs[mission.arcs.shape[0] - 1], state)
    solution.time_to_go = u[COLUMN_CUTOFF] - nav.time + solution.tail_gain
    if plans_whole(state):
        tell_lengths(mission, onboard)
    index = COLUMN_JETTISON
    for j in range(mission.jettisons.shape[0]):
        if awaits_heating(mission.jettisons, nav.jettisoned, j):
            solution.jettison_time[j] = u[index]
            index += 2
    plan_segments(mission, onboard)
    burn = solution.time_to_go
    l_sum, j_sum, _, _, _, _ = thrust_integrals(state, burn, burn)
    # the burn as one vector, along its mean direction: where PEG would take over
    mean = unit(axpy(j_sum / l_sum, load(solution.direction_rate), load(solution.direction)))
    store(solution.velocity_to_go, scale(l_sum, mean))
    end = memory.work.state
    store(state.predicted_position, (end[0], end[1], end[2]))
    store(state.predicted_velocity, (end[3], end[4], end[5]))


@kernel
def set_options(mission: MissionRecords, onboard: Onboard) -> None:
    """The on-board problem: inverse-square gravity, coarse steps."""
    options = onboard.state.optimal.options
    last = mission.arcs[mission.arcs.shape[0] - 1]
    options.gravity = INVERSE_SQUARE
    options.propagator = RUNGE_KUTTA
    options.heating = HEATING_OPTIMAL
    options.step = min(STEP, STEP_SHARE * onboard.navigation.mass / last.mass_flow)
    options.max_iterations = onboard.settings.max_solve_iterations
    options.tolerance = TOLERANCE


@kernel
def solve_optimal(mission: MissionRecords, onboard: Onboard, start: int, restart: bool) -> int:
    """The optimum from a navigation state into the state on board.

    Args:
        mission: as in :func:`ares_guidance.kernels.cycle.guidance_step`; so the next.
        onboard: what is on board. Changed.
        start: what to start from if the last cycle left no solution: the plan, the steering on
            board, or nothing (BY_PLAN, BY_STEERING, BY_NOTHING).
        restart: seek from other guesses too when the first leads nowhere.

    Returns:
        ERROR_NONE, or ERROR_NOT_CONVERGED with the steering on board untouched.
    """
    nav = onboard.navigation
    state = onboard.state
    memory = state.optimal
    set_options(mission, onboard)
    believed = believed_mission(mission, onboard)
    iterations = 1
    found = False
    if memory.solved == 1:
        carry(believed, onboard)
        memory.age += 1
        remaining = memory.unknowns[COLUMN_CUTOFF] - nav.time
        if memory.age < REFRESH and remaining > LAST:
            found = correct(believed, onboard)
    else:
        if start == BY_PLAN:
            planned_guess(believed, onboard)
        elif start == BY_STEERING:
            first_guess(mission.jettisons, onboard)
        memory.solved_in = nav.arc
        memory.time = nav.time
        memory.jettisoned = nav.jettisoned
    if not found:
        iterations, found = search(believed, onboard, start != BY_NOTHING, restart)
    memory.solved = 1 if found else 0
    state.iterations += iterations
    if not found:
        return ERROR_NOT_CONVERGED
    state.law = LAW_OPTIMAL
    state.solution.miss_speed = 0.0
    tell(mission, onboard)
    return ERROR_NONE


@kernel
def ends_early(mission: MissionRecords, onboard: Onboard) -> bool:
    """Return whether the optimum on board would cut off before the last arc.

    Where the ends of arcs are unknowns they have bounds.
    """
    state = onboard.state
    if plans_whole(state):
        return False
    least = least_time_to_go(mission.arcs, onboard.navigation, state)
    return least > onboard.settings.hold_time and state.solution.time_to_go < least


@kernel
def seek(mission: MissionRecords, onboard: Onboard, cold: bool) -> tuple[int, bool]:
    """The optimum; a solution by PEG where there is none.

    Args:
        mission: as in :func:`ares_guidance.kernels.cycle.guidance_step`; so the next.
        onboard: what is on board. Changed.
        cold: there is no solution to go on from.

    Returns: as :func:`ares_guidance.kernels.convergence.converge`.
    """
    error = ERROR_NOT_CONVERGED
    state = onboard.state
    solved = state.optimal.solved == 1
    by_plan = begins_by_plan(mission.arcs, onboard)
    if solved or by_plan:
        start = BY_PLAN if by_plan else BY_STEERING
        error = solve_optimal(mission, onboard, start, cold and not solved)
    if error == ERROR_NONE and not ends_early(mission, onboard):
        return error, True
    error, reachable = seek_by_peg(mission, onboard, cold)
    if state.turn.held > 0.0:
        # every flight that ends with the last arc's begin takes the same: there is no best
        state.optimal.solved = 0
        return error, reachable
    if not plans_whole(state) and (cold or error == ERROR_NONE):
        guessed = error == ERROR_NONE
        longest = LONGER * state.solution.time_to_go + 1.0 if guessed else math.inf
        found = solve_optimal(mission, onboard, BY_STEERING if guessed else BY_NOTHING, cold)
        if found == ERROR_NONE:
            if state.solution.time_to_go <= longest:
                return found, True
            # an extremal, and no optimum
            state.optimal.solved = 0
            state.optimal.wasted += state.optimal.work.spent
            begin_again(mission, onboard, cold)
            return seek_by_peg(mission, onboard, cold)
    return error, reachable
