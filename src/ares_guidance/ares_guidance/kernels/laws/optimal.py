# SPDX-License-Identifier: Apache-2.0
"""Optimal guidance: the two-point problem with its jettison, solved in every cycle.

The costates of the last cycle are propagated to the new navigation state and corrected: by one
integration and the old Jacobian if that suffices, else by Newton's method.
"""

import math

from ares_guidance.arrays import (
    ERROR_NONE,
    ERROR_NOT_CONVERGED,
    FLIP_NEAR,
    FLIP_NONE,
    FLIP_PAST,
    LAW_OPTIMAL,
    Onboard,
)
from ares_guidance.kernels.laws.convergence import SAME_LENGTH, begin_again, ends_by_clock
from ares_guidance.kernels.laws.convergence import seek as seek_by_peg
from ares_guidance.kernels.laws.costate_guess import (
    BY_NOTHING,
    BY_PLAN,
    BY_STEERING,
    begins_by_plan,
    guess_by_plan,
    guess_by_steering,
    propagate_costates,
)
from ares_guidance.kernels.laws.onboard_problem import (
    REFRESH,
    believed_mission,
    plans_whole,
    set_options,
)
from ares_guidance.kernels.prediction.segments import (
    least_time_to_go,
    note_tail_off,
    plan_segments,
    thrust_integrals,
)
from ares_models.arrays import BURN, MissionRecords
from ares_models.jit import kernel
from ares_models.kernels.linear import back_substitute
from ares_models.kernels.sequence import awaits_heating
from ares_models.kernels.vectors import axpy, load, norm, scale, store, unit
from ares_optimizer.two_point.arrays import (
    Effort,
)
from ares_optimizer.two_point.contract import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    CONVERGED,
    MAX_UNKNOWNS,
    find_optimum,
    free_column,
    lengths_inside,
    scaled_length,
    shoot,
    unknown_count,
)

#: Largest scaled correction by an old Jacobian.
SMALL = 3e-3
#: Time to go, s, below which each cycle computes its own Jacobian: no later cycle corrects it.
LAST = 20.0
#: Time within which the direction of the primer is analytic, s, that tells of a flip.
NEAR_FLIP = 5.0
_ROUNDING = 1e-6
#: An extremal that burns longer than PEG's solution by this factor plus 1 s is not the optimum.
LONGER = 1.02
#: Largest number of integrator steps in one cycle. Successful searches take 60 in the median and
#: 260 at most.
MOST_STEPS = 1_500
#: The same in the air, where steps are short and the Jacobian is of differences.
MOST_STEPS_IN_AIR = 6_000
#: Largest number of integrator steps in failed searches during one arc; then the law flies PEG
#: until the next arc. It bounds the time spent on a hopeless mission to seconds.
MOST_WASTED = 1_000_000


@kernel
def correct(believed: MissionRecords, onboard: Onboard) -> bool:
    """Correct once with the Jacobian of an earlier cycle; return False if that does not suffice."""
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
        # a limit has become inactive: leave it to the search
        if u[i + 1] > _ROUNDING or u[i] < work.floor[i] or u[i] > u[COLUMN_CUTOFF]:
            return False
    return True


@kernel
def search(
    believed: MissionRecords, onboard: Onboard, guessed: bool, restart: bool
) -> tuple[int, bool]:
    """Search the optimum by Newton's method; return iterations and whether it was found."""
    nav = onboard.navigation
    jettisons = believed.jettisons
    memory = onboard.state.optimal
    work = memory.work
    if memory.wasted_in != nav.arc + 1:
        memory.wasted_in = nav.arc + 1
        memory.wasted = 0
    if memory.searched_in != onboard.state.cycle:
        memory.searched_in = onboard.state.cycle
        memory.steps_left = MOST_STEPS_IN_AIR if memory.options.in_air == 1 else MOST_STEPS
    memory.options.max_steps = min(memory.steps_left, MOST_WASTED - memory.wasted)
    if memory.options.max_steps <= 0:
        return 0, False
    # pass a slice: the nested array has another type, which would compile the search again
    iterations, _, status, starts = find_optimum(
        nav,
        believed,
        memory.options,
        Effort(guessed, restart, False, memory.first_start),
        memory.unknowns[:],
        work,
    )
    memory.steps_left -= work.spent
    # after a failure the next search starts with the next built-in guess
    memory.first_start = 0 if status == CONVERGED else memory.first_start + starts
    memory.wasted = 0 if status == CONVERGED else memory.wasted + work.spent
    memory.age = 0
    for j in range(jettisons.shape[0]):
        # an inactive limit was solved as a fixed time: the Jacobian is of another problem
        if work.jettisons[j].criterion != jettisons[j].criterion or work.pinned[j] == 1:
            memory.age = REFRESH
    return iterations, status == CONVERGED


@kernel
def write_lengths(mission: MissionRecords, onboard: Onboard) -> None:
    """Write the lengths of the free arcs ahead into the plan.

    The columns of the ends follow from the mission: the last search may have left out a drop that
    is due at once.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance, with the solution. Its plan is changed.
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
def write_solution(mission: MissionRecords, onboard: Onboard) -> None:
    """Convert the unknowns to the solution of the guidance cycle."""
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
        write_lengths(mission, onboard)
    index = COLUMN_JETTISON
    for j in range(mission.jettisons.shape[0]):
        if awaits_heating(mission.jettisons, nav.jettisoned, j):
            solution.jettison_time[j] = u[index]
            index += 2
    plan_segments(mission, onboard)
    burn = solution.time_to_go
    l_sum, j_sum, _, _, _, _ = thrust_integrals(state, burn, burn)
    # delta-V along the mean direction: the initial guess if PEG takes over
    mean = unit(axpy(j_sum / l_sum, load(solution.direction_rate), load(solution.direction)))
    store(solution.velocity_to_go, scale(l_sum, mean))
    end = memory.work.state
    store(state.predicted_position, (end[0], end[1], end[2]))
    store(state.predicted_velocity, (end[3], end[4], end[5]))


@kernel
def note_flip(mission: MissionRecords, onboard: Onboard) -> None:
    """Note whether the thrust flips in the present burn: the primer nearly vanishes then.

    Args: as in :func:`solve_optimal`, with the primer of now. Its memory is changed.
    """
    nav = onboard.navigation
    memory = onboard.state.optimal
    if mission.arcs[nav.arc].kind == BURN and norm(load(memory.unknowns[3:6])) * NEAR_FLIP > 1.0:
        memory.flip = FLIP_NEAR
        memory.age = REFRESH
    elif memory.flip == FLIP_NEAR:
        memory.flip = FLIP_PAST


@kernel
def search_anew(
    believed: MissionRecords, onboard: Onboard, guessed: bool, restart: bool
) -> tuple[int, bool]:
    """Search from the last solution; past a flip keep that where there is no better one.

    There the thrust has nothing to spare, and what it spares grows with the square of its turn: the
    problem is nearly singular.

    Args and returns: as in :func:`search`.
    """
    memory = onboard.state.optimal
    for i in range(MAX_UNKNOWNS):
        memory.kept[i] = memory.unknowns[i]
    iterations, found = search(believed, onboard, guessed, restart)
    if not found and memory.flip == FLIP_PAST:
        for i in range(MAX_UNKNOWNS):
            memory.unknowns[i] = memory.kept[i]
        memory.age = REFRESH
        return iterations, True
    return iterations, found


@kernel
def solve_optimal(mission: MissionRecords, onboard: Onboard, start: int, restart: bool) -> int:
    """Solve for the optimum from the navigation state.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Changed.
        start: initial guess if the last cycle left no solution: BY_PLAN, BY_STEERING (the
            steering in force) or BY_NOTHING.
        restart: try the built-in guesses too if the first one fails.

    Returns:
        ERROR_NONE, or ERROR_NOT_CONVERGED with the steering unchanged.
    """
    nav = onboard.navigation
    state = onboard.state
    memory = state.optimal
    set_options(mission, onboard)
    believed = believed_mission(mission, onboard)
    iterations = 1
    found = False
    if memory.solved == 0 or memory.solved_in != nav.arc:
        memory.flip = FLIP_NONE
    if memory.solved == 1:
        propagate_costates(believed, onboard)
        memory.age += 1
        remaining = memory.unknowns[COLUMN_CUTOFF] - nav.time
        note_flip(believed, onboard)
        if memory.flip == FLIP_NEAR:
            # of length 1 the primer has no scale: keep the last solution
            found = True
        elif memory.age < REFRESH and remaining > LAST:
            found = correct(believed, onboard)
        if not found:
            iterations, found = search_anew(believed, onboard, start != BY_NOTHING, restart)
    else:
        if start == BY_PLAN:
            guess_by_plan(believed, onboard)
        elif start == BY_STEERING:
            guess_by_steering(mission.jettisons, onboard)
        memory.solved_in = nav.arc
        memory.time = nav.time
        memory.jettisoned = nav.jettisoned
        iterations, found = search(believed, onboard, start != BY_NOTHING, restart)
    memory.solved = 1 if found else 0
    state.iterations += iterations
    if not found:
        return ERROR_NOT_CONVERGED
    state.law = LAW_OPTIMAL
    state.solution.miss_speed = 0.0
    write_solution(mission, onboard)
    return ERROR_NONE


@kernel
def ends_early(mission: MissionRecords, onboard: Onboard) -> bool:
    """Return whether the optimum would cut off before the shortest length of the last arc.

    Where the ends of arcs are unknowns, bounds prevent that.
    """
    state = onboard.state
    if plans_whole(state):
        return False
    least = least_time_to_go(mission.arcs, onboard.navigation, state)
    if ends_by_clock(mission, state):
        least *= 1.0 - SAME_LENGTH
    return least > onboard.settings.hold_time and state.solution.time_to_go < least


@kernel
def seek(mission: MissionRecords, onboard: Onboard, cold: bool) -> tuple[int, bool]:
    """Solve for the optimum, or by PEG if none is found.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Changed.
        cold: there is no solution to continue from.

    Returns: as in :func:`ares_guidance.kernels.laws.convergence.converge`.
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
        # the time to go is prescribed: there is nothing to minimize
        state.optimal.solved = 0
        return error, reachable
    if not plans_whole(state) and (cold or error == ERROR_NONE):
        guessed = error == ERROR_NONE
        longest = LONGER * state.solution.time_to_go + 1.0 if guessed else math.inf
        found = solve_optimal(mission, onboard, BY_STEERING if guessed else BY_NOTHING, cold)
        if found == ERROR_NONE:
            if state.solution.time_to_go <= longest:
                return found, True
            # an extremal that is not the optimum
            state.optimal.solved = 0
            state.optimal.wasted += state.optimal.work.spent
            begin_again(mission, onboard, cold)
            return seek_by_peg(mission, onboard, cold)
    return error, reachable
