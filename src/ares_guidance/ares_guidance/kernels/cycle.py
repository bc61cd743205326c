# SPDX-License-Identifier: Apache-2.0
"""Guidance cycle shared by all laws: start, solve, gates, hold, cut-off, jettison.

`seek` is PEG's. Each other law gets a copy of this module with its own `seek`
(`ares_models.jit.specialised`), so that a flight compiles only the law that it flies.
"""

import math

from ares_guidance.arrays import (
    AIM_BELOW,
    AIM_NEAR,
    AIM_SAFE,
    AIM_TARGET,
    ERROR_NONE,
    ERROR_PROPELLANT_SHORT,
    ERROR_STEERING_JUMP,
    ERROR_TARGET_UNREACHABLE,
    ERROR_TIME_TO_GO_JUMP,
    JUST_FOUND,
    PHASE_CONVERGING,
    PHASE_CUTOFF,
    PHASE_HOLD,
    PHASE_TRACKING,
    SOLVED,
    STEEPEST,
    UNSOLVED,
    Onboard,
)
from ares_guidance.kernels.laws.convergence import begin_again, seek
from ares_guidance.kernels.laws.convergence import seek as seek_by_peg
from ares_guidance.kernels.laws.near import (
    CHEAP_TURN,
    NEAR_ROUNDS,
    begin_near,
    costs_too_much,
    may_release_radius,
    move_radius,
)
from ares_guidance.kernels.laws.start import start_guess
from ares_guidance.kernels.monitors.engines import present_engine, watch_engines
from ares_guidance.kernels.monitors.failures import detect_failures, vehicle_left
from ares_guidance.kernels.monitors.shortfall import (
    MOST_DOWN,
    ROUNDS,
    SETTLED,
    STEP_DOWN,
    aim_at_safe_orbit,
    has_safe_orbit,
    lacking_speed,
    lower_target,
)
from ares_guidance.kernels.prediction.burn import LinearTangent
from ares_guidance.kernels.prediction.jettison import (
    measure_density,
    next_answer,
    predict_jettisons,
)
from ares_guidance.kernels.prediction.segments import (
    acceleration_at,
    least_time_to_go,
    plan_segments,
    thrust_integrals,
)
from ares_models.arrays import MAX_ARCS, MissionRecords, Record
from ares_models.jit import inlined, kernel
from ares_models.kernels.environment import gravity
from ares_models.kernels.sequence import SAME_TIME, awaits_heating
from ares_models.kernels.targets import perigee_radius, target_speed
from ares_models.kernels.vectors import (
    axpy,
    dot,
    load,
    norm,
    store,
    sub,
    turned_beyond,
    unit,
)

CUTOFF_SEARCH_STEPS = 4
#: Largest change of the cut-off in the last of these steps, s; a larger one means divergence.
CUTOFF_SETTLED = 0.1
#: Length of a burn that is next to none, s, and the largest rate of its direction vector, 1/s.
SHORT_BURN, FASTEST = 1.0, 1.0
#: Step of the finite difference of the target speed along the flight, s.
DIFFERENCE = 0.1


@kernel
def throttled_thrust(state: Record, t: float) -> tuple[float, float, float]:
    """Return delta-V m/s, its mean time s and final acceleration m/s2 of ``t`` s of the plan."""
    gain, moment, _, _, _, _ = thrust_integrals(state, t, t)
    i = 0
    while i + 1 < state.segment_count and state.segments[i + 1].start < t:
        i += 1
    at_end = acceleration_at(state.segments[i], t - state.segments[i].start)
    return gain, moment / gain if gain > 0.0 else t, at_end


@kernel
def held_cutoff(mission: MissionRecords, onboard: Onboard) -> float:
    """Return the time to go to the target speed under held steering.

    Newton's method on the speed. Before the last arc the time to go is left as it is.

    Args: as in :func:`guidance_step`.

    Returns:
        s from now, counted at full thrust; the planned value if the iteration fails.
    """
    environment = mission.environment
    nav = onboard.navigation
    state = onboard.state
    solution = state.solution
    arc = mission.arcs[nav.arc]
    if nav.arc + 1 < mission.arcs.shape[0]:
        # only the last arc is cut off: the arcs before it are flown in full
        return solution.time_to_go
    r = load(nav.position)
    v = load(nav.velocity)
    direction = load(solution.direction)
    rate = load(solution.direction_rate)
    reference = solution.reference_time - nav.time
    ve, mass_flow = present_engine(arc, arc.stage, state)
    tau = nav.mass / mass_flow
    throttled = math.isfinite(arc.max_acceleration)
    if throttled:
        plan_segments(mission, onboard)
    # thrust that comes after the command is counted with the burn
    t = max(solution.time_to_go, 0.0)
    step = 0.0
    for _ in range(CUTOFF_SEARCH_STEPS):
        # stay below the time at which the mass would reach zero
        t = min(t, 0.98 * tau)
        l_t = -ve * math.log1p(-t / tau)
        middle = t
        if t != 0.0:
            middle = (tau * l_t - ve * t) / l_t
        acceleration = ve / (tau - t)
        if throttled:
            l_t, middle, acceleration = throttled_thrust(state, t)
        u = unit(axpy(middle - reference, rate, direction))
        horizon = t + solution.tail_drift
        g = gravity(axpy(0.5 * horizon, v, r), environment)
        v_t = axpy(horizon, g, axpy(l_t, u, v))
        speed = norm(v_t)
        wanted = target_speed(mission.target, environment.mu, norm(axpy(horizon, v, r)))
        after = target_speed(mission.target, environment.mu, norm(axpy(horizon + DIFFERENCE, v, r)))
        # the speed of an orbit decreases with the radius
        gain = dot(v_t, axpy(acceleration, u, g)) / speed - (after - wanted) / DIFFERENCE
        if gain <= 0.0:
            return float(solution.time_to_go)
        step = (wanted - speed) / gain
        t += step
    if not abs(step) <= CUTOFF_SETTLED:
        return float(solution.time_to_go)
    return max(t, least_time_to_go(mission.arcs, nav, state))


@kernel
def accept(onboard: Onboard) -> None:
    """Copy the solution under iteration to the steering that is commanded."""
    solution = onboard.state.solution
    steering = onboard.steering
    if solution.time_to_go < SHORT_BURN and norm(load(solution.direction_rate)) > FASTEST:
        store(solution.direction_rate, (0.0, 0.0, 0.0))
    steering.reference_time = solution.reference_time
    store(steering.direction, load(solution.direction))
    store(steering.direction_rate, load(solution.direction_rate))
    steering.cutoff_time = onboard.navigation.time + solution.time_to_go - solution.tail_gain
    for k in range(MAX_ARCS):
        steering.arc_end_times[k] = solution.arc_end_times[k]


@kernel
def adopt_steering(onboard: Onboard) -> None:
    """Copy the steering in force back into the solution, to hold it."""
    solution = onboard.state.solution
    steering = onboard.steering
    solution.reference_time = steering.reference_time
    store(solution.direction, load(steering.direction))
    store(solution.direction_rate, load(steering.direction_rate))
    solution.time_to_go = steering.cutoff_time + solution.tail_gain - onboard.navigation.time


@inlined
def aimed_lower(mission: MissionRecords, state: Record) -> MissionRecords:
    """Return the mission with the target that guidance aims at."""
    return MissionRecords(
        mission.environment, mission.atmosphere, mission.arcs, mission.jettisons, state.target
    )


@kernel
def aim_anew(mission: MissionRecords, state: Record, aim: int) -> None:
    """Set the aim to the mission's target or to the safe orbit, not lowered."""
    state.aim = aim
    state.lowered = 0.0
    state.target = mission.target
    if aim == AIM_SAFE:
        aim_at_safe_orbit(state.target, mission.environment.mu)


@kernel
def seek_steering(mission: MissionRecords, onboard: Onboard, cold: bool) -> tuple[int, bool]:
    """Solve by the law, or by PEG up to the last burn in held attitude: other laws aim none.

    Args: as in :func:`seek_lowered`.

    Returns: as in :func:`seek_lowered`.
    """
    for k in range(onboard.navigation.arc, mission.arcs.shape[0]):
        if mission.arcs[k].held == 1:
            return seek_by_peg(mission, onboard, cold)
    return seek(mission, onboard, cold)


@kernel
def seek_lowered(mission: MissionRecords, onboard: Onboard, cold: bool) -> tuple[int, bool]:
    """Solve for the present aim, lowered by the delta-V that the propellant lacks.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Changed.
        cold: there is no solution to continue from.

    Returns:
        ERROR_NONE or ERROR_NOT_CONVERGED, and whether the target plane can be reached.
    """
    state = onboard.state
    aimed = aimed_lower(mission, state)
    error, reachable = seek_steering(aimed, onboard, cold)
    for _ in range(ROUNDS):
        lacking = lacking_speed(state)
        if error != ERROR_NONE or not abs(lacking) > SETTLED:
            break
        if lacking < 0.0 and state.lowered == 0.0:
            break
        if lacking < -state.lowered:
            # the full target is within reach again
            aim_anew(mission, state, state.aim)
        else:
            state.lowered += lower_target(state.target, mission.environment.mu, lacking)
        error, reachable = seek_steering(aimed, onboard, cold)
    return error, reachable


@kernel
def seek_near(mission: MissionRecords, onboard: Onboard) -> tuple[int, bool]:
    """Solve for the target with its radius released.

    Args: as in :func:`seek_lowered`.

    Returns: as in :func:`seek_lowered`.
    """
    state = onboard.state
    aimed = aimed_lower(mission, state)
    begin_near(mission, onboard)
    error, reachable = seek_steering(aimed, onboard, False)
    for _ in range(NEAR_ROUNDS):
        if error != ERROR_NONE:
            break
        radius = norm(load(state.predicted_position))
        move_radius(state.target, mission.target, mission.environment.mu, radius)
        error, reachable = seek_steering(aimed, onboard, False)
    return error, reachable


@kernel
def seek_late(mission: MissionRecords, onboard: Onboard) -> tuple[int, bool]:
    """Solve near cut-off: for the exact target if it costs little, else with radius released.

    Args: as in :func:`seek_lowered`.

    Returns: as in :func:`seek_lowered`.
    """
    state = onboard.state
    error, reachable = ERROR_NONE, True
    sought = state.aim == AIM_TARGET
    if sought:
        error, reachable = seek_lowered(mission, onboard, False)
        if state.lowered > 0.0:
            return error, reachable
        small = state.solution.primer.gradient == 0.0
        # a turn that is clipped to the steepest misses the position
        missed = small and state.solution.turn >= STEEPEST
        sought = error == ERROR_NONE and reachable and not missed
        cheap = state.found.fresh == SOLVED or (small and state.solution.turn <= CHEAP_TURN)
        if sought and cheap:
            return error, reachable
    state.exact = state.solution
    near_error, near_reachable = seek_near(mission, onboard)
    if state.found.fresh == JUST_FOUND:
        state.found.fresh = UNSOLVED
    if sought and (near_error != ERROR_NONE or not costs_too_much(state)):
        state.solution = state.exact
        aim_anew(mission, state, AIM_TARGET)
        return error, reachable
    return near_error, near_reachable


@kernel
def seek_within_reach(mission: MissionRecords, onboard: Onboard, cold: bool) -> tuple[int, bool]:
    """Solve for the best aim within reach.

    In this order: the target; the lowered target, if its perigee is safe; a safe orbit; the
    lowered target all the same.

    Args: as in :func:`seek_lowered`.

    Returns: as in :func:`seek_lowered`.
    """
    state = onboard.state
    mu = mission.environment.mu
    if state.cycle == 1 or state.found.fresh == JUST_FOUND:
        aim_anew(mission, state, AIM_TARGET)
    elif state.lowered == 0.0 and state.aim != AIM_NEAR:
        aim_anew(mission, state, state.aim)
    if may_release_radius(mission, onboard, cold):
        return seek_late(mission, onboard)
    error, reachable = seek_lowered(mission, onboard, cold)
    unsolved = error != ERROR_NONE and state.found.fresh != SOLVED
    to_gain = norm(load(state.saved.velocity_to_go)) if unsolved else 0.0
    if unsolved and state.lowered < MOST_DOWN * to_gain:
        # too far out of reach to converge: lower the target by one step in each cycle
        begin_again(mission, onboard, cold)
        state.lowered += lower_target(state.target, mu, STEP_DOWN * to_gain)
        error, reachable = seek_lowered(mission, onboard, cold)
    if state.found.fresh == JUST_FOUND:
        state.found.fresh = UNSOLVED
    short = error == ERROR_NONE and state.lowered > SETTLED and state.aim == AIM_TARGET
    if not (short and has_safe_orbit(mission.target)):
        return error, reachable
    if perigee_radius(state.target, mu) >= mission.target.safe_radius:
        return error, reachable
    aim_anew(mission, state, AIM_SAFE)
    error, reachable = seek_lowered(mission, onboard, False)
    if error == ERROR_NONE and state.lowered <= SETTLED:
        state.found.fresh = UNSOLVED
        return error, reachable
    aim_anew(mission, state, AIM_BELOW)
    begin_again(mission, onboard, cold)
    return seek_lowered(mission, onboard, cold)


@kernel
def gate(onboard: Onboard) -> int:
    """Compare a new solution with the steering in force; return ERROR_NONE or the jump's error."""
    nav = onboard.navigation
    settings = onboard.settings
    solution = onboard.state.solution
    steering = onboard.steering
    ahead = nav.time + settings.cycle_period
    jumped = turned_beyond(
        settings.steering_jump_limit,
        axpy(
            ahead - solution.reference_time,
            load(solution.direction_rate),
            load(solution.direction),
        ),
        axpy(
            ahead - steering.reference_time,
            load(steering.direction_rate),
            load(steering.direction),
        ),
    )
    if jumped:
        return ERROR_STEERING_JUMP
    moved = nav.time + solution.time_to_go - solution.tail_gain - steering.cutoff_time
    if abs(moved) > settings.time_to_go_jump_limit:
        return ERROR_TIME_TO_GO_JUMP
    return ERROR_NONE


@kernel
def aims_ahead(state: Record) -> bool:
    """Return whether a burn is aimed anew in the coast before it, however short it is.

    A coast after a flight from the pad may pass through thin air.
    """
    return bool(state.programme.cycle > 0 and state.leg.coasting == 1)


@kernel
def solve(mission: MissionRecords, onboard: Onboard) -> None:
    """Iterate to convergence and apply the gates, or keep the last good solution.

    Args: as in :func:`guidance_step`.
    """
    settings = onboard.settings
    state = onboard.state
    cold = state.phase != PHASE_TRACKING
    state.saved = state.solution
    state.iterations = 0
    error, reachable = seek_within_reach(mission, onboard, cold)
    state.total_iterations += state.iterations
    if error == ERROR_NONE and not reachable:
        error = ERROR_TARGET_UNREACHABLE
    # after a failure the solution may jump
    first = cold or state.engines.jumped == 1 or state.found.fresh != SOLVED
    if error == ERROR_NONE and not first and state.stale_cycles < settings.max_stale_cycles:
        error = gate(onboard)
    state.error = error
    if error == ERROR_NONE or (error == ERROR_TARGET_UNREACHABLE and cold):
        state.phase = PHASE_TRACKING
        state.stale_cycles = 0
        state.found.fresh = SOLVED
        accept(onboard)
        if error == ERROR_NONE and (state.lowered > 0.0 or state.aim == AIM_SAFE):
            state.error = ERROR_PROPELLANT_SHORT
        return
    state.stale_cycles += 1
    restart = state.stale_cycles > settings.max_stale_cycles
    late = state.saved.time_to_go < settings.restart_time and not aims_ahead(state)
    if not cold and restart and late:
        # too late to restart: hold the last good solution, which is nearly exact
        state.solution = state.saved
        adopt_steering(onboard)
        state.phase = PHASE_HOLD
    elif cold and not restart and math.isfinite(state.solution.miss_speed):
        # slow convergence: continue in the next cycle
        state.phase = PHASE_CONVERGING
    elif cold or restart:
        # restart from the navigation state
        state.phase = PHASE_CONVERGING
        state.stale_cycles = 0
        start_guess(mission, onboard)
        if state.lowered > norm(load(state.solution.velocity_to_go)):
            # by more than is left to gain: of a solution that was none
            aim_anew(mission, state, AIM_TARGET)
    else:
        state.solution = state.saved


@kernel
def point_along_velocity(onboard: Onboard) -> None:
    """Steer along the velocity while there is no solution."""
    nav = onboard.navigation
    steering = onboard.steering
    steering.reference_time = nav.time
    store(steering.direction, unit(load(nav.velocity)))


@kernel
def catch_up(mission: MissionRecords, onboard: Onboard) -> None:
    """Begin the flight, or update the last solution to the present navigation state.

    Args: as in :func:`guidance_step`.
    """
    nav = onboard.navigation
    state = onboard.state
    steering = onboard.steering
    measure_density(mission, onboard)
    if state.cycle == 0 and state.phase == 0:
        state.phase = PHASE_CONVERGING
        state.next_cycle_time = nav.time
        start_guess(mission, onboard)
        point_along_velocity(onboard)
        store(steering.direction_rate, (0.0, 0.0, 0.0))
        steering.cutoff_time = math.nan
        for k in range(MAX_ARCS):
            state.solution.arc_end_times[k] = math.nan
    else:
        gained = sub(load(nav.sensed_delta_v), load(state.sensed_delta_v))
        store(state.solution.velocity_to_go, sub(load(state.solution.velocity_to_go), gained))
        state.solution.time_to_go -= nav.time - state.time
    state.time = nav.time
    store(state.sensed_delta_v, load(nav.sensed_delta_v))


@kernel
def hold(mission: MissionRecords, onboard: Onboard, before: float) -> None:
    """Hold the steering near the end, refine the cut-off time, and command the cut-off.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Changed.
        before: time of the previous navigation state, s; the vehicle refuses an earlier cut-off.
    """
    nav = onboard.navigation
    state = onboard.state
    solution = state.solution
    steering = onboard.steering
    near = solution.time_to_go <= onboard.settings.hold_time and not aims_ahead(state)
    if state.phase == PHASE_TRACKING and near:
        adopt_steering(onboard)
        state.phase = PHASE_HOLD
    if state.phase == PHASE_HOLD:
        solution.time_to_go = held_cutoff(aimed_lower(mission, state), onboard)
        cutoff = nav.time + solution.time_to_go - solution.tail_gain
        steering.cutoff_time = cutoff if cutoff >= before else nav.time
        if cutoff <= nav.time:
            state.phase = PHASE_CUTOFF


@kernel
def run_cycle(mission: MissionRecords, onboard: Onboard) -> None:
    """Run the guidance cycle that is due.

    Args: as in :func:`guidance_step`.
    """
    nav = onboard.navigation
    state = onboard.state
    period = onboard.settings.cycle_period
    state.cycle += 1
    watch_engines(mission.arcs, onboard)
    # advance by whole periods, even if several were missed
    behind = (nav.time + 1e-9 - state.next_cycle_time) / period
    state.next_cycle_time += (math.floor(behind) + 1.0) * period
    held = mission.arcs[nav.arc].held == 1 and nav.time > nav.arc_start_time + SAME_TIME
    if state.phase == PHASE_CONVERGING or (state.phase == PHASE_TRACKING and not held):
        solve(mission, onboard)
    else:
        # held steering, or a burn in held attitude
        state.iterations = 0


@kernel
def time_jettison(mission: MissionRecords, onboard: Onboard) -> None:
    """Command the next heating jettison; near its time, predict it anew on every state.

    Args: as in :func:`guidance_step`.
    """
    nav = onboard.navigation
    state = onboard.state
    steering = onboard.steering
    jettison_time = state.solution.jettison_time
    soonest = math.inf
    for j in range(mission.jettisons.shape[0]):
        if awaits_heating(mission.jettisons, nav.jettisoned, j):
            soonest = min(soonest, jettison_time[j])
    near = soonest - nav.time <= next_answer(onboard)
    if state.phase != PHASE_CONVERGING and near:
        plan_segments(mission, onboard)
        ahead = LinearTangent(
            load(steering.direction),
            load(steering.direction_rate),
            steering.reference_time - nav.time,
        )
        predict_jettisons(mission, onboard, ahead)
    steering.jettison = -1
    steering.jettison_time = math.nan
    for j in range(mission.jettisons.shape[0]):
        at = jettison_time[j]
        if (
            awaits_heating(mission.jettisons, nav.jettisoned, j)
            and math.isfinite(at)
            and (steering.jettison < 0 or at < steering.jettison_time)
        ):
            steering.jettison = j
            steering.jettison_time = at


@kernel
def answer_state(mission: MissionRecords, onboard: Onboard) -> None:
    """Answer a valid navigation state for the remaining vehicle; arguments of `guidance_step`."""
    nav = onboard.navigation
    state = onboard.state
    before = state.time
    catch_up(mission, onboard)
    hold(mission, onboard, before)
    if nav.time >= state.next_cycle_time - 1e-9:
        run_cycle(mission, onboard)
    if state.phase == PHASE_CONVERGING and math.isnan(onboard.steering.cutoff_time):
        point_along_velocity(onboard)
    time_jettison(mission, onboard)


@kernel
def guidance_step(mission: MissionRecords, onboard: Onboard) -> None:
    """Answer one valid navigation state: run a cycle if due, else repeat the last answer.

    Before the first converged solution the thrust points along the velocity.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance: the navigation state, and ``steering``, the answer. Changed.
    """
    state = onboard.state
    if state.phase == PHASE_CUTOFF:
        return
    detect_failures(mission, onboard)
    if state.left.count == 0:
        answer_state(mission, onboard)
    else:
        answer_state(vehicle_left(mission, state), onboard)
