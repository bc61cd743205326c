"""Powered Explicit Guidance for any number of stages, one compiled step per cycle.

The multi-stage form of Brand, Brown and Higgins (NTRS 19740004402) and Jaggers (1977):
one linear-tangent law to main-engine cut-off, every staging and jettison a segment
boundary, gravity from a conic coast. The thesis (section 6.4, Appendix A) flew it with a
full target at staging and jettison as well; here only the cut-off is targeted.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import (
    ERROR_NAVIGATION_INVALID,
    ERROR_NONE,
    ERROR_NOT_CONVERGED,
    ERROR_PROPELLANT_SHORT,
    ERROR_STEERING_JUMP,
    ERROR_TARGET_UNREACHABLE,
    ERROR_TIME_TO_GO_JUMP,
    HEATING_MEASURED,
    PHASE_CONVERGING,
    PHASE_CUTOFF,
    PHASE_HOLD,
    PHASE_TRACKING,
)
from ares_guidance.kernels.segments import (
    Integrals,
    burn_time_to_go,
    plan_segments,
    thrust_integrals,
)
from ares_guidance.kernels.targets import (
    desired_state,
    plane_normal,
    project_to_plane,
    target_speed,
)
from ares_models.arrays import BURN, HEATING_LIMIT, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import gravity, heating_rate, log_heating
from ares_models.kernels.kepler import kepler
from ares_models.kernels.vectors import (
    Vector,
    add,
    angle_between,
    axpy,
    cross,
    dot,
    is_finite,
    load,
    norm,
    scale,
    store,
    sub,
    unit,
)

JETTISON_SEARCH_STEPS = 12
CUTOFF_SEARCH_STEPS = 4


@kernel
def steered_thrust(
    integrals: Integrals, direction: Vector, rate: Vector, reference: float
) -> tuple[Vector, Vector]:
    """Velocity and displacement that the thrust behind the integrals gives.

    Linear-tangent steering expanded to second order in the turn from ``direction``, to
    which ``rate`` is normal.

    Args:
        integrals: (L, J, S, Q, P, H) of :func:`thrust_integrals`.
        direction: unit vector at ``reference``.
        rate: 1/s.
        reference: s from now.

    Returns:
        velocity m/s, displacement m.
    """
    l_sum, j_sum, s_sum, q_sum, p_sum, h_sum = integrals
    square = 0.5 * dot(rate, rate)
    k = reference
    along_v = l_sum - square * (h_sum - 2.0 * k * j_sum + k * k * l_sum)
    along_r = s_sum - square * (p_sum - 2.0 * k * q_sum + k * k * s_sum)
    across_v = j_sum - k * l_sum
    across_r = q_sum - k * s_sum
    return (
        add(scale(along_v, direction), scale(across_v, rate)),
        add(scale(along_r, direction), scale(across_r, rate)),
    )


@kernel
def gravity_effect(
    r: Vector, v: Vector, thrust_v: Vector, thrust_r: Vector, until: float, mu: float
) -> tuple[Vector, Vector]:
    """Velocity and displacement due to gravity, from a coast that shadows the burn.

    The coast starts so that it runs through the mean of the thrusted path; gravity is
    what it adds to a straight line.

    Args:
        r: position now, m.
        v: velocity now, m/s.
        thrust_v: velocity gained by thrust, m/s.
        thrust_r: displacement by thrust, m.
        until: s from now.
        mu: m3/s2.

    Returns:
        velocity m/s, displacement m.
    """
    if until <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    r_c1 = axpy(-until / 30.0, thrust_v, axpy(-0.1, thrust_r, r))
    v_c1 = axpy(-0.1, thrust_v, axpy(1.2 / until, thrust_r, v))
    r_c2, v_c2 = kepler(r_c1, v_c1, until, mu)
    return sub(v_c2, v_c1), axpy(-until, v_c1, sub(r_c2, r_c1))


@kernel
def predicted_log_heating(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    state: Record,
    direction: Vector,
    rate: Vector,
    reference: float,
    t: float,
) -> tuple[float, float]:
    """Log of the modelled heating on the predicted path, and its slope.

    Args:
        nav: record NAVIGATION.
        environment: record ENVIRONMENT.
        atmosphere: log-density table.
        state: record PEG_STATE with planned segments.
        direction: unit vector at ``reference``.
        rate: 1/s.
        reference: s from now.
        t: s from now.

    Returns:
        ln(q / (W/m2)) and its rate in 1/s.
    """
    r = load(nav.position)
    v = load(nav.velocity)
    thrust_v, thrust_r = steered_thrust(
        thrust_integrals(state, t, math.inf), direction, rate, reference
    )
    gravity_v, gravity_r = gravity_effect(r, v, thrust_v, thrust_r, t, environment.mu)
    r_t = add(axpy(t, v, r), add(gravity_r, thrust_r))
    v_t = add(v, add(gravity_v, thrust_v))
    acceleration = gravity(r_t, environment)
    for i in range(state.segment_count):
        segment = state.segments[i]
        into = t - segment.start
        if 0.0 <= into <= segment.duration:
            thrust = segment.exhaust_velocity / (segment.tau - into)
            acceleration = axpy(thrust, unit(axpy(t - reference, rate, direction)), acceleration)
            break
    return log_heating(r_t, v_t, environment, atmosphere, acceleration)


@kernel
def heating_crossing(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    state: Record,
    direction: Vector,
    rate: Vector,
    reference: float,
    log_limit: float,
    earliest: float,
    guess: float,
    tolerance: float,
) -> float:
    """Time at which the predicted heating falls to a limit.

    Newton on the log of the heating: it is convex up to the apex, so from the left the
    iteration runs to the first crossing without overshoot.

    Args:
        log_limit: ln of the limit, in the units of the on-board model.
        earliest: s from now.
        guess: s from now.
        tolerance: s.
        Others as in :func:`predicted_log_heating`.

    Returns:
        s from now; inf when the limit is not met before cut-off.
    """
    horizon = state.time_to_go
    falling = earliest
    t = min(max(guess, earliest), horizon)
    for _ in range(JETTISON_SEARCH_STEPS):
        value, slope = predicted_log_heating(
            nav, environment, atmosphere, state, direction, rate, reference, t
        )
        excess = value - log_limit
        if slope < 0.0:
            if excess > 0.0:
                falling = max(falling, t)
                if t >= horizon:
                    return math.inf
            following = min(max(t - excess / slope, earliest), horizon)
        else:
            # past the apex: the crossing, if any, is earlier
            following = 0.5 * (falling + t)
            if t <= earliest:
                return earliest if excess <= 0.0 else math.inf
        if abs(following - t) <= tolerance:
            return following if slope < 0.0 or excess <= 0.0 else math.inf
        t = following
    return math.inf


@kernel
def first_ignition(stage: int, nav: Record, arcs: NDArray[Any]) -> float:
    """Time from now to the first ignition of a stage, s; 0 if it is past."""
    if arcs[nav.arc].stage > stage:
        return 0.0
    for k in range(nav.arc):
        if arcs[k].stage == stage and arcs[k].kind == BURN:
            return 0.0
    begin = nav.arc_start_time
    for k in range(nav.arc, arcs.shape[0]):
        if arcs[k].stage == stage and arcs[k].kind == BURN:
            return max(0.0, begin - nav.time)
        begin += arcs[k].duration
    return math.inf


@kernel
def predict_jettisons(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    settings: Record,
    state: Record,
    direction: Vector,
    rate: Vector,
    reference: float,
) -> float:
    """Move each heating jettison to where the predicted path meets its limit.

    Args:
        reference: s from now; the rest as in :func:`guidance_step`.

    Returns:
        largest change of a predicted time, s; inf when a jettison came into or fell
        out of the plan.
    """
    largest = 0.0
    ratio = 1.0
    if settings.heating_source == HEATING_MEASURED and math.isfinite(state.density_ratio):
        ratio = state.density_ratio
    for j in range(jettisons.shape[0]):
        if (nav.jettisoned >> j) & 1 == 1 or jettisons[j].criterion != HEATING_LIMIT:
            continue
        earliest = first_ignition(jettisons[j].stage, nav, arcs)
        before = state.jettison_time[j] - nav.time
        guess = before if math.isfinite(before) else earliest
        log_limit = math.log(jettisons[j].value * (1.0 - settings.heating_margin) / ratio)
        after = heating_crossing(
            nav,
            environment,
            atmosphere,
            state,
            direction,
            rate,
            reference,
            log_limit,
            earliest,
            guess,
            settings.jettison_time_tolerance,
        )
        if math.isfinite(after) != math.isfinite(before):
            largest = math.inf
        elif math.isfinite(after):
            largest = max(largest, abs(after - before))
        state.jettison_time[j] = nav.time + after
    return largest


@kernel
def start_guess(
    nav: Record,
    environment: Record,
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    state: Record,
) -> None:
    """First velocity-to-go: the scalar impulse along the velocity, Eqs. 5.29 and 5.35.

    A state that is ``seeded`` keeps its velocity-to-go and jettison times instead, once.

    Args: as in :func:`guidance_step`.
    """
    r = load(nav.position)
    v = load(nav.velocity)
    if state.seeded == 1:
        state.seeded = 0
    else:
        speed = norm(v)
        wanted = target_speed(target, environment.mu, norm(r)) - speed
        course = scale(1.0 / speed, v) if speed > 1.0 else unit(r)
        # an impulse below what a second of flight gives would leave no burn to steer
        store(state.velocity_to_go, scale(max(wanted, 0.05 * speed + 10.0), course))
        for j in range(state.jettison_time.shape[0]):
            state.jettison_time[j] = math.inf
    plan_segments(nav, arcs, jettisons, state)
    t_go, _, _ = burn_time_to_go(state, norm(load(state.velocity_to_go)))
    state.time_to_go = t_go
    state.gravity_time = t_go
    radius = norm(r)
    store(state.gravity_displacement, scale(-0.5 * environment.mu * t_go * t_go / radius**3, r))
    store(state.displacement_bias, (0.0, 0.0, 0.0))
    ahead = axpy(0.5 * t_go, axpy(1.0, v, axpy(1.0, load(state.velocity_to_go), v)), r)
    normal, _ = plane_normal(target, ahead, axpy(1.0, load(state.velocity_to_go), v))
    position, _, _ = desired_state(target, environment.mu, project_to_plane(ahead, normal), normal)
    store(state.desired_position, position)
    store(state.plane_normal, normal)
    store(state.direction, unit(load(state.velocity_to_go)))
    store(state.direction_rate, (0.0, 0.0, 0.0))
    state.reference_time = nav.time


@kernel
def note_tail_off(arc: Record, state: Record) -> None:
    """What follows the cut-off command: an impulse, and a drift until the thrust is gone.

    The target holds at the end of the thrust; until then the vehicle moves on.
    """
    state.tail_gain = arc.tail_gain
    state.tail_drift = 0.0
    if arc.tail_knots > 0:
        state.tail_drift = arc.tail_time[arc.tail_knots - 1] - arc.tail_gain


@kernel
def iterate(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    settings: Record,
    state: Record,
) -> tuple[float, float, bool]:
    """One predictor-corrector pass over the planned segments.

    Args: as in :func:`guidance_step`.

    Returns:
        change of velocity-to-go m/s, change of the jettison time s, whether the
        target plane passes through the predicted point.
    """
    r = load(nav.position)
    v = load(nav.velocity)
    v_go = load(state.velocity_to_go)

    t_go, last, short = burn_time_to_go(state, norm(v_go))
    state.time_to_go = t_go
    state.propellant_short = 1 if short else 0
    note_tail_off(arcs[state.segments[last].arc], state)
    horizon = t_go + state.tail_drift
    integrals = thrust_integrals(state, horizon, t_go)
    l_sum, j_sum, s_sum, q_sum, _, _ = integrals

    # steering
    direction = unit(v_go)
    k = j_sum / l_sum
    gravity_r = scale((horizon / state.gravity_time) ** 2, load(state.gravity_displacement))
    normal = load(state.plane_normal)
    wanted_r = load(state.desired_position)
    downrange = cross(normal, unit(wanted_r))
    r_go = sub(wanted_r, add(axpy(horizon, v, r), gravity_r))
    r_go = add(r_go, load(state.displacement_bias))
    r_go = axpy(-dot(downrange, r_go), downrange, r_go)
    # downrange is free: the part along the thrust is what the burn gives
    r_go = axpy((s_sum - dot(direction, r_go)) / dot(direction, downrange), downrange, r_go)
    rate = scale(1.0 / (q_sum - s_sum * k), axpy(-s_sum, direction, r_go))
    # a turn of more than a radian over the burn is no small-angle solution
    steepest = 1.0 / max(k, t_go - k)
    if norm(rate) > steepest:
        rate = scale(steepest / norm(rate), rate)

    # prediction
    thrust_v, thrust_r = steered_thrust(integrals, direction, rate, k)
    gravity_v, gravity_r = gravity_effect(r, v, thrust_v, thrust_r, horizon, environment.mu)
    r_p = add(axpy(horizon, v, r), add(gravity_r, thrust_r))
    v_p = add(v, add(gravity_v, thrust_v))
    moved = predict_jettisons(
        nav, environment, atmosphere, arcs, jettisons, settings, state, direction, rate, k
    )

    # correction
    normal, reachable = plane_normal(target, r_p, v_p)
    wanted_r, wanted_v, _ = desired_state(
        target, environment.mu, project_to_plane(r_p, normal), normal
    )
    miss = sub(wanted_v, v_p)
    store(state.velocity_to_go, add(v_go, miss))
    store(state.gravity_displacement, gravity_r)
    state.gravity_time = horizon
    store(state.displacement_bias, sub(r_go, thrust_r))
    store(state.desired_position, wanted_r)
    store(state.plane_normal, normal)
    store(state.predicted_position, r_p)
    store(state.predicted_velocity, v_p)
    store(state.direction, direction)
    store(state.direction_rate, rate)
    state.reference_time = nav.time + k
    return norm(miss), moved, reachable


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
    tau = nav.mass / arc.mass_flow
    ve = arc.exhaust_velocity
    # thrust that comes after the command is counted with the burn
    t = max(state.time_to_go, 0.0)
    for _ in range(CUTOFF_SEARCH_STEPS):
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
    error = ERROR_NOT_CONVERGED
    state.iterations = 0
    reachable = True
    moved = math.inf
    for _ in range(settings.max_iterations):
        if moved > 0.0:
            plan_segments(nav, arcs, jettisons, state)
        miss, moved, reachable = iterate(
            nav, environment, atmosphere, arcs, jettisons, target, settings, state
        )
        state.iterations += 1
        state.miss_speed = miss
        if not (math.isfinite(miss) and math.isfinite(state.time_to_go)):
            break
        if miss < settings.velocity_to_go_tolerance and moved < settings.jettison_time_tolerance:
            error = ERROR_NONE
            break
    state.total_iterations += state.iterations
    if error == ERROR_NONE and not reachable:
        error = ERROR_TARGET_UNREACHABLE
    if error == ERROR_NONE and not cold and state.stale_cycles < settings.max_stale_cycles:
        # a good solution moves little from one cycle to the next
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
        if error == ERROR_NONE and state.propellant_short == 1:
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
        settings: record PEG_SETTINGS.
        state: record PEG_STATE; all zero before the first call. Changed.
        saved: record PEG_STATE, room for the last good solution. Changed.
        steering: record STEERING, the answer. Changed.
    """
    r = load(nav.position)
    v = load(nav.velocity)
    if not (
        is_finite(r)
        and is_finite(v)
        and is_finite(load(nav.sensed_delta_v))
        and math.isfinite(nav.time)
        and nav.mass > 0.0
        and math.isfinite(nav.mass)
        and 0 <= nav.arc < arcs.shape[0]
        and dot(r, r) > 0.0
    ):
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
        state.time_to_go = held_cutoff(nav, environment, arcs, target, state)
        steering.cutoff_time = nav.time + state.time_to_go - state.tail_gain
        if steering.cutoff_time <= nav.time:
            state.phase = PHASE_CUTOFF
    due = nav.time >= state.next_cycle_time - 1e-9
    if due:
        state.cycle += 1
        while state.next_cycle_time <= nav.time + 1e-9:
            state.next_cycle_time += settings.cycle_period
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
