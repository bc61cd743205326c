# SPDX-License-Identifier: Apache-2.0
"""Close to the end, after a failure: the target but for its radius.

Engines that give less there come to the target's speed later and, in a climb, higher. To mend the
radius in the seconds that are left the thrust must turn far aside, or the burn go on for a minute:
that costs up to 15 % of the mass. Speed and angle are met for nothing.
"""

import math

from ares_guidance.arrays import AIM_NEAR, AIM_TARGET, Onboard
from ares_guidance.kernels.prediction import LinearTangent, gravity_effect, steered_thrust
from ares_guidance.kernels.segments import burn_time_to_go, plan_segments, thrust_integrals
from ares_models.arrays import (
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    MissionRecords,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.targets import leaves_place_free
from ares_models.kernels.vectors import add, axpy, load, norm, scale, store, unit

#: Part of the mass that the radius is worth.
DEAREST = 5e-3
#: rad; the target is dear where the thrust turns more.
CHEAP_TURN = 0.2
#: How often the radius follows the steering, which follows it.
NEAR_ROUNDS = 3


@kernel
def may_let_go(mission: MissionRecords, onboard: Onboard, cold: bool) -> bool:
    """Whether the radius may be let go: something has failed, and it is too late to begin again.

    Args:
        mission: as in :func:`ares_guidance.kernels.cycle.guidance_step`; so the next.
        onboard: what is on board.
        cold: there is no solution to go on from.
    """
    state = onboard.state
    kind = mission.target.kind
    return (
        state.found.count > 0
        and not cold
        and (state.aim == AIM_NEAR or (state.aim == AIM_TARGET and state.lowered == 0.0))
        and state.saved.time_to_go <= onboard.settings.restart_time
        and kind in (TARGET_RADIUS_SPEED_ANGLE_INCLINATION, TARGET_RADIUS_SPEED_ANGLE_PLANE)
    )


@kernel
def lets_place_go(mission: MissionRecords, onboard: Onboard, turn: float) -> bool:
    """Tell whether a burn may meet its orbit anywhere: it is too short to mend the place.

    Args:
        mission: as of :func:`may_let_go`; so the next.
        onboard: what is on board.
        turn: that the place on the target's orbit asks for, rad.
    """
    late = onboard.state.solution.time_to_go <= onboard.settings.restart_time
    return late and turn > CHEAP_TURN and leaves_place_free(mission.target)


@kernel
def end_radius(mission: MissionRecords, onboard: Onboard) -> float:
    """Distance from the centre to which the solution on board leads, m.

    Args: as in :func:`may_let_go`.
    """
    nav = onboard.navigation
    state = onboard.state
    solution = state.solution
    plan_segments(mission, onboard)
    t_go, _ = burn_time_to_go(state, norm(load(solution.velocity_to_go)))
    horizon = t_go + solution.tail_drift
    steering = LinearTangent(
        unit(load(solution.direction)),
        load(solution.direction_rate),
        solution.reference_time - nav.time,
    )
    integrals = thrust_integrals(state, horizon, t_go)
    r, v = load(nav.position), load(nav.velocity)
    thrust_v, thrust_r = steered_thrust(integrals, steering)
    _, gravity_r = gravity_effect(r, v, thrust_v, thrust_r, horizon, mission.environment)
    return norm(add(axpy(horizon, v, r), add(gravity_r, thrust_r)))


@kernel
def move_radius(target: Record, wanted: Record, mu: float, radius: float) -> None:
    """Make a target another at a radius, m: its energy and its angle stay."""
    target.radius = radius
    square = wanted.speed**2 + 2.0 * mu * (1.0 / radius - 1.0 / wanted.radius)
    target.speed = math.sqrt(max(0.0, square))


@kernel
def begin_near(mission: MissionRecords, onboard: Onboard) -> None:
    """Aim at the radius to which the solution before this cycle leads.

    Args: as in :func:`may_let_go`.
    """
    state = onboard.state
    solution = state.solution
    state.aim = AIM_NEAR
    state.target = mission.target
    state.solution = state.saved
    solution.primer.gradient = 0.0
    radius = end_radius(mission, onboard)
    move_radius(state.target, mission.target, mission.environment.mu, radius)
    position = unit(load(solution.desired_position))
    store(solution.desired_position, scale(radius, position))


@kernel
def is_dear(state: Record) -> bool:
    """Whether the target, in ``state.exact``, costs more than it is worth over the end near it."""
    tau = state.segments[state.segment_count - 1].tau
    return not state.exact.time_to_go - state.solution.time_to_go <= DEAREST * tau
