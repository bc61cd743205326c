# SPDX-License-Identifier: Apache-2.0
"""Target with its radius released, near the end of a flight with a failure.

Weakened engines reach the target's speed later and, in a climb, higher. To correct the radius in
the seconds left the thrust must turn far, or the burn last a minute longer; that costs up to 15 %
of the mass. Speed and flight-path angle cost nothing extra.
"""

import math

from ares_guidance.arrays import AIM_NEAR, AIM_TARGET, Onboard
from ares_guidance.kernels.prediction.burn import LinearTangent, gravity_effect, steered_thrust
from ares_guidance.kernels.prediction.segments import (
    burn_time_to_go,
    plan_segments,
    thrust_integrals,
)
from ares_models.arrays import (
    NAMES_TRUE_ANOMALY,
    TARGET_ELEMENTS,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    MissionRecords,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.targets import names
from ares_models.kernels.vectors import add, axpy, load, norm, scale, store, unit
from ares_models.tolerances import RADIUS_M

#: Largest cost of the exact radius, as a fraction of the mass.
DEAREST = 5e-3
#: Largest turn, rad, at which the exact target is cheap.
CHEAP_TURN = 0.2
#: Error of a target's radius that a burn leaves as it is if it is too short to correct it, m.
LEFT_RADIUS = 0.8 * RADIUS_M
#: Iterations between radius and steering.
NEAR_ROUNDS = 3


@kernel
def names_radius(target: Record) -> bool:
    """Return whether a target is a radius, a speed and a flight-path angle."""
    return target.kind in (TARGET_RADIUS_SPEED_ANGLE_INCLINATION, TARGET_RADIUS_SPEED_ANGLE_PLANE)


@kernel
def may_release_radius(mission: MissionRecords, onboard: Onboard, cold: bool) -> bool:
    """Return whether the radius may be released: after a failure, within `restart_time` to go.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance.
        cold: there is no solution to continue from.
    """
    state = onboard.state
    return (
        state.found.count > 0
        and not cold
        and (state.aim == AIM_NEAR or (state.aim == AIM_TARGET and state.lowered == 0.0))
        and state.saved.time_to_go <= onboard.settings.restart_time
        and names_radius(mission.target)
    )


@kernel
def may_release_place(
    mission: MissionRecords, onboard: Onboard, turn: float, radius: float
) -> bool:
    """Return whether a burn need not correct its radius: it is too short for that.

    Speed and angle are those of the target's orbit at the place where the burn ends. Where the
    target names a radius, it must be met within LEFT_RADIUS.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance.
        turn: needed to meet the present radius, rad.
        radius: at the end of the burn without that turn, m.
    """
    late = onboard.state.solution.time_to_go <= onboard.settings.restart_time
    target = mission.target
    released = target.kind == TARGET_ELEMENTS and not names(target, NAMES_TRUE_ANOMALY)
    if names_radius(target):
        released = abs(radius - target.radius) <= LEFT_RADIUS
    return late and turn > CHEAP_TURN and released


@kernel
def end_radius(mission: MissionRecords, onboard: Onboard) -> float:
    """Predict the radius at the end of the present solution, m.

    Args: as in :func:`may_release_radius`.
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
    """Move a target to a radius, m, at the energy and flight-path angle of ``wanted``."""
    target.radius = radius
    square = wanted.speed**2 + 2.0 * mu * (1.0 / radius - 1.0 / wanted.radius)
    target.speed = math.sqrt(max(0.0, square))


@kernel
def begin_near(mission: MissionRecords, onboard: Onboard) -> None:
    """Aim at the radius that the solution before this cycle leads to.

    Args: as in :func:`may_release_radius`.
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
def costs_too_much(state: Record) -> bool:
    """Return whether the exact target costs more than DEAREST over one with released radius."""
    tau = state.segments[state.segment_count - 1].tau
    return not state.exact.time_to_go - state.solution.time_to_go <= DEAREST * tau
