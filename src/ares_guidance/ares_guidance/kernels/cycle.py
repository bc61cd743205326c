"""The guidance cycle that every law shares: start, solve, gates, hold, cut-off, jettison.

`seek` is PEG's. Each other law has a copy of this module with a `seek` of its own
(`ares_models.jit.specialised`), so that a flight compiles the law that it flies.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import (
    ERROR_NAVIGATION_INVALID,
    ERROR_NONE,
    ERROR_PROPELLANT_SHORT,
    ERROR_STEERING_JUMP,
    ERROR_TARGET_UNREACHABLE,
    ERROR_TIME_TO_GO_JUMP,
    PHASE_CONVERGING,
    PHASE_CUTOFF,
    PHASE_HOLD,
    PHASE_TRACKING,
)
from ares_guidance.kernels.convergence import seek
from ares_guidance.kernels.engines import present_engine, watch_engines
from ares_guidance.kernels.jettison import predict_jettisons
from ares_guidance.kernels.segments import plan_segments
from ares_guidance.kernels.shortfall import ROUNDS, SETTLED, lacking_speed, lower_target
from ares_guidance.kernels.start import start_guess
from ares_guidance.kernels.targets import target_speed
from ares_models.arrays import BURN, HEATING_LIMIT, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import gravity, heating_rate
from ares_models.kernels.vectors import (
    angle_between,
    axpy,
    dot,
    is_finite,
    load,
    norm,
    store,
    sub,
    unit,
)

CUTOFF_SEARCH_STEPS = 4


@kernel
def held_cutoff(
    nav: Record, environment: Record, arcs: NDArray[Any], target: Record, state: Record
) -> float:
    """Time to go under frozen steering: when the speed will be that of the target.

    Args: as in :func:`guidance_step`.

    Returns:
        s from now, at full thrust.
    """
    arc = arcs[nav.arc]
    if arc.kind != BURN:
        return state.time_to_go
    r = load(nav.position)
    v = load(nav.velocity)
    direction = load(state.direction)
    rate = load(state.direction_rate)
    reference = state.reference_time - nav.time
    ve, mass_flow = present_engine(arc, arc.stage, state)
    tau = nav.mass / mass_flow
    # thrust that comes after the command is counted with the burn
    t = max(state.time_to_go, 0.0)
    for _ in range(CUTOFF_SEARCH_STEPS):
        # no burn lasts longer than the mass
        t = min(t, 0.98 * tau)
        l_t = -ve * math.log1p(-t / tau)
        middle = t
        if t != 0.0:
            middle = (tau * l_t - ve * t) / l_t
        u = unit(axpy(middle - reference, rate, direction))
        horizon = t + state.tail_drift
        g = gravity(axpy(0.5 * horizon, v, r), environment)
        v_t = axpy(horizon, g, axpy(l_t, u, v))
        speed = norm(v_t)
        wanted = target_speed(target, environment.mu, norm(axpy(horizon, v, r)))
        gain = dot(v_t, axpy(ve / (tau - t), u, g)) / speed
        if gain <= 0.0:
            break
        t += (wanted - speed) / gain
    return t


@kernel
def accept(nav: Record, state: Record, steering: Record) -> None:
    """Hand the solution under iteration to the vehicle."""
    steering.reference_time = state.reference_time
    store(steering.direction, load(state.direction))
    store(steering.direction_rate, load(state.direction_rate))
    steering.cutoff_time = nav.time + state.time_to_go - state.tail_gain


@kernel
def adopt_steering(nav: Record, state: Record, steering: Record) -> None:
    """Make the steering in force the one that is held."""
    state.reference_time = steering.reference_time
    store(state.direction, load(steering.direction))
    store(state.direction_rate, load(steering.direction_rate))
    state.time_to_go = steering.cutoff_time + state.tail_gain - nav.time


@kernel
def copy_solution(source: Record, destination: Record) -> None:
    """Copy what an iteration changes, so that a failed cycle leaves no trace."""
    destination.time_to_go = source.time_to_go
    destination.gravity_time = source.gravity_time
    destination.reference_time = source.reference_time
    destination.miss_speed = source.miss_speed
    destination.tail_gain = source.tail_gain
    destination.tail_drift = source.tail_drift
    for i in range(3):
        destination.velocity_to_go[i] = source.velocity_to_go[i]
        destination.gravity_displacement[i] = source.gravity_displacement[i]
        destination.displacement_bias[i] = source.displacement_bias[i]
        destination.desired_position[i] = source.desired_position[i]
        destination.plane_normal[i] = source.plane_normal[i]
        destination.direction[i] = source.direction[i]
        destination.direction_rate[i] = source.direction_rate[i]
    for j in range(source.jettison_time.shape[0]):
        destination.jettison_time[j] = source.jettison_time[j]


@kernel
def seek_within_reach(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    settings: Record,
    cold: bool,
    state: Record,
) -> tuple[int, bool]:
    """As :func:`seek`, for a target lowered as far as the propellant is short.

    Args:
        cold: there is no solution to go on from. The others as in :func:`guidance_step`.

    Returns:
        ERROR_NONE or ERROR_NOT_CONVERGED, and whether the target plane can be reached.
    """
    if state.cycle == 1 or state.lowered == 0.0:
        state.target[0] = target
        state.lowered = 0.0
    aim = state.target[0]
    error, reachable = seek(
        nav, environment, atmosphere, arcs, jettisons, aim, settings, cold, state
    )
    for _ in range(ROUNDS):
        lacking = lacking_speed(state)
        if error != ERROR_NONE or not abs(lacking) > SETTLED:
            break
        if lacking < 0.0 and state.lowered == 0.0:
            break
        if lacking < -state.lowered:
            # the target itself is within reach again
            state.lowered = 0.0
            state.target[0] = target
        else:
            state.lowered += lower_target(aim, environment.mu, lacking)
        error, reachable = seek(
            nav, environment, atmosphere, arcs, jettisons, aim, settings, cold, state
        )
    return error, reachable


@kernel
def solve(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    settings: Record,
    state: Record,
    saved: Record,
    steering: Record,
) -> None:
    """Iterate to convergence and pass the gates, or keep the last good solution.

    Args: as in :func:`guidance_step`.
    """
    cold = state.phase != PHASE_TRACKING
    copy_solution(state, saved)
    state.iterations = 0
    error, reachable = seek_within_reach(
        nav, environment, atmosphere, arcs, jettisons, target, settings, cold, state
    )
    state.total_iterations += state.iterations
    if error == ERROR_NONE and not reachable:
        error = ERROR_TARGET_UNREACHABLE
    first = cold or state.engines.jumped == 1
    if error == ERROR_NONE and not first and state.stale_cycles < settings.max_stale_cycles:
        # a good solution moves little from one cycle to the next, unless an engine fails
        ahead = nav.time + settings.cycle_period
        jump = angle_between(
            axpy(ahead - state.reference_time, load(state.direction_rate), load(state.direction)),
            axpy(
                ahead - steering.reference_time,
                load(steering.direction_rate),
                load(steering.direction),
            ),
        )
        if jump > settings.steering_jump_limit:
            error = ERROR_STEERING_JUMP
        elif (
            abs(nav.time + state.time_to_go - state.tail_gain - steering.cutoff_time)
            > settings.time_to_go_jump_limit
        ):
            error = ERROR_TIME_TO_GO_JUMP
    state.error = error
    if error == ERROR_NONE or (error == ERROR_TARGET_UNREACHABLE and cold):
        state.phase = PHASE_TRACKING
        state.stale_cycles = 0
        accept(nav, state, steering)
        if error == ERROR_NONE and state.lowered > 0.0:
            state.error = ERROR_PROPELLANT_SHORT
        return
    state.stale_cycles += 1
    restart = state.stale_cycles > settings.max_stale_cycles
    if not cold and restart and saved.time_to_go < settings.restart_time:
        # too late to begin again: what was good so far is nearly exact
        copy_solution(saved, state)
        adopt_steering(nav, state, steering)
        state.phase = PHASE_HOLD
    elif cold and not restart and math.isfinite(state.miss_speed):
        # slow but on its way: the next cycle goes on from here
        state.phase = PHASE_CONVERGING
    elif cold or restart:
        # nothing worth keeping: begin again from the navigation state
        state.phase = PHASE_CONVERGING
        state.stale_cycles = 0
        start_guess(nav, environment, arcs, jettisons, target, state)
    else:
        copy_solution(saved, state)


@kernel
def navigation_is_sound(nav: Record, arcs: NDArray[Any]) -> bool:
    """Whether there is anything to steer from: finite numbers, and an arc that there is."""
    r = load(nav.position)
    return (
        is_finite(r)
        and is_finite(load(nav.velocity))
        and is_finite(load(nav.sensed_delta_v))
        and math.isfinite(nav.time)
        and nav.mass > 0.0
        and math.isfinite(nav.mass)
        and 0 <= nav.arc < arcs.shape[0]
        and dot(r, r) > 0.0
    )


@kernel
def guidance_step(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    settings: Record,
    state: Record,
    saved: Record,
    steering: Record,
) -> None:
    """Answer one navigation state: a guidance cycle when it is due, else the last answer.

    Before the first converged solution the thrust points along the velocity.

    Args:
        nav: record NAVIGATION.
        environment: record ENVIRONMENT, as guidance believes it.
        atmosphere: log-density table, as guidance believes it.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        target: record TARGET.
        settings: record GUIDANCE_SETTINGS.
        state: record GUIDANCE_STATE; all zero before the first call. Changed.
        saved: record GUIDANCE_STATE, room for the last good solution. Changed.
        steering: record STEERING, the answer. Changed.
    """
    r = load(nav.position)
    v = load(nav.velocity)
    if not navigation_is_sound(nav, arcs):
        state.error = ERROR_NAVIGATION_INVALID
        return
    if state.phase == PHASE_CUTOFF:
        return

    modelled = heating_rate(r, v, environment, atmosphere)
    state.density_ratio = nav.heating_rate / modelled if modelled > 0.0 else math.nan
    if not (state.density_ratio > 0.0):
        state.density_ratio = math.nan

    if state.cycle == 0 and state.phase == 0:
        state.phase = PHASE_CONVERGING
        state.next_cycle_time = nav.time
        start_guess(nav, environment, arcs, jettisons, target, state)
        steering.reference_time = nav.time
        store(steering.direction, unit(v))
        store(steering.direction_rate, (0.0, 0.0, 0.0))
        steering.cutoff_time = math.nan
    else:
        gained = sub(load(nav.sensed_delta_v), load(state.sensed_delta_v))
        store(state.velocity_to_go, sub(load(state.velocity_to_go), gained))
        state.time_to_go -= nav.time - state.time
    state.time = nav.time
    store(state.sensed_delta_v, load(nav.sensed_delta_v))

    if state.phase == PHASE_TRACKING and state.time_to_go <= settings.hold_time:
        adopt_steering(nav, state, steering)
        state.phase = PHASE_HOLD
    if state.phase == PHASE_HOLD:
        state.time_to_go = held_cutoff(nav, environment, arcs, state.target[0], state)
        steering.cutoff_time = nav.time + state.time_to_go - state.tail_gain
        if steering.cutoff_time <= nav.time:
            state.phase = PHASE_CUTOFF
    due = nav.time >= state.next_cycle_time - 1e-9
    if due:
        state.cycle += 1
        watch_engines(nav, arcs, state)
        # whole periods, however many were missed
        behind = (nav.time + 1e-9 - state.next_cycle_time) / settings.cycle_period
        state.next_cycle_time += (math.floor(behind) + 1.0) * settings.cycle_period
        if state.phase == PHASE_CONVERGING or state.phase == PHASE_TRACKING:
            solve(
                nav,
                environment,
                atmosphere,
                arcs,
                jettisons,
                target,
                settings,
                state,
                saved,
                steering,
            )
        else:
            state.iterations = 0
    if state.phase == PHASE_CONVERGING and math.isnan(steering.cutoff_time):
        steering.reference_time = nav.time
        store(steering.direction, unit(v))

    # the next drop that the heating decides; close to it, refined on every state
    steering.jettison = -1
    steering.jettison_time = math.nan
    soonest = math.inf
    for j in range(jettisons.shape[0]):
        if (nav.jettisoned >> j) & 1 == 0 and jettisons[j].criterion == HEATING_LIMIT:
            soonest = min(soonest, state.jettison_time[j])
    if state.phase != PHASE_CONVERGING and not due and soonest - nav.time <= settings.cycle_period:
        plan_segments(nav, arcs, jettisons, state)
        predict_jettisons(
            nav,
            environment,
            atmosphere,
            arcs,
            jettisons,
            settings,
            state,
            load(steering.direction),
            load(steering.direction_rate),
            steering.reference_time - nav.time,
        )
    for j in range(jettisons.shape[0]):
        due_time = state.jettison_time[j]
        if (
            (nav.jettisoned >> j) & 1 == 0
            and jettisons[j].criterion == HEATING_LIMIT
            and math.isfinite(due_time)
            and (steering.jettison < 0 or due_time < steering.jettison_time)
        ):
            steering.jettison = j
            steering.jettison_time = due_time
