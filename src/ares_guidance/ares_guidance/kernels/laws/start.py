# SPDX-License-Identifier: Apache-2.0
"""Initial guess of an iteration."""

import math

from ares_guidance.arrays import Onboard
from ares_guidance.kernels.prediction.segments import (
    burn_time_to_go,
    plan_segments,
    thrust_integrals,
)
from ares_models.arrays import MissionRecords
from ares_models.jit import kernel
from ares_models.kernels.targets import desired_state, plane_normal, project_to_plane, target_speed
from ares_models.kernels.vectors import add, axpy, cross, load, norm, scale, store, sub, unit

#: Least cosine of half the turn of a guess.
HALF_TURN = 0.3


@kernel
def guess_by_plan(onboard: Onboard) -> None:
    """Set the velocity-to-go to the planned thrust until the end of the leg.

    Args:
        onboard: state of guidance, with planned segments. Its solution is changed.
    """
    state = onboard.state
    leg = state.leg
    solution = state.solution
    mean = add(load(leg.first_direction), load(leg.last_direction))
    if norm(mean) < HALF_TURN:
        mean = load(solution.velocity_to_go)
    gain, _, _, _, _, _ = thrust_integrals(state, leg.time_to_go, leg.time_to_go)
    if gain > 0.0:
        store(solution.velocity_to_go, scale(gain, unit(mean)))
    if leg.jettison_time > onboard.navigation.time:
        for j in range(solution.jettison_time.shape[0]):
            solution.jettison_time[j] = leg.jettison_time


@kernel
def turn_by_plan(onboard: Onboard, t_go: float) -> None:
    """Set the steering to the planned primer, or to a turn from first to last direction.

    Args:
        onboard: state of guidance. Its solution is changed.
        t_go: s.
    """
    leg = onboard.state.leg
    solution = onboard.state.solution
    nav = onboard.navigation
    primer = onboard.state.plan.primer[nav.arc]
    if math.isfinite(norm(load(primer[0])) + norm(load(primer[1]))):
        store(solution.direction, load(primer[0]))
        store(solution.direction_rate, load(primer[1]))
        solution.reference_time = onboard.state.plan.ignition[nav.arc]
        return
    first, last = load(leg.first_direction), load(leg.last_direction)
    half = max(HALF_TURN, 0.5 * norm(add(first, last)))
    store(solution.direction_rate, scale(1.0 / (half * t_go), sub(last, first)))
    solution.reference_time = nav.time + 0.5 * t_go


@kernel
def start_guess(mission: MissionRecords, onboard: Onboard) -> None:
    """Set the first velocity-to-go: a scalar impulse along the velocity, Eqs. 5.29 and 5.35.

    A ``seeded`` state keeps its own velocity-to-go and jettison times instead, once. In a flight
    by a plan the guess is the planned thrust until the end of the leg.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.
    """
    mu = mission.environment.mu
    target = mission.target
    nav = onboard.navigation
    state = onboard.state
    solution = state.solution
    solution.primer.gradient = 0.0
    r = load(nav.position)
    v = load(nav.velocity)
    if state.seeded == 1:
        state.seeded = 0
    else:
        speed = norm(v)
        wanted = target_speed(target, mu, norm(r)) - speed
        course = scale(1.0 / speed, v) if speed > 1.0 else unit(r)
        # a smaller impulse would leave no burn to steer
        store(solution.velocity_to_go, scale(max(wanted, 0.05 * speed + 10.0), course))
        for j in range(solution.jettison_time.shape[0]):
            solution.jettison_time[j] = math.inf
    plan_segments(mission, onboard)
    if state.leg.time_to_go > 0.0:
        guess_by_plan(onboard)
    v_go = load(solution.velocity_to_go)
    t_go, _ = burn_time_to_go(state, norm(v_go))
    solution.time_to_go = t_go
    solution.gravity_time = t_go
    radius = norm(r)
    store(solution.gravity_displacement, scale(-0.5 * mu * t_go * t_go / radius**3, r))
    store(solution.displacement_bias, (0.0, 0.0, 0.0))
    ahead = axpy(0.5 * t_go, axpy(1.0, v, axpy(1.0, v_go, v)), r)
    normal, _ = plane_normal(target, ahead, cross(ahead, axpy(1.0, v_go, v)))
    position, _, _ = desired_state(target, mu, project_to_plane(ahead, normal), normal)
    if state.leg.time_to_go > 0.0 and norm(load(state.leg.end_position)) > 0.0:
        position = load(state.leg.end_position)
    store(solution.desired_position, position)
    store(solution.plane_normal, normal)
    store(solution.direction, unit(v_go))
    store(solution.direction_rate, (0.0, 0.0, 0.0))
    solution.reference_time = nav.time
    if state.leg.time_to_go > 0.0:
        turn_by_plan(onboard, t_go)
