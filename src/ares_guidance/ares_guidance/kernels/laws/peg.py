# SPDX-License-Identifier: Apache-2.0
"""One predictor-corrector pass of Powered Explicit Guidance for any number of stages.

The multi-stage form of Brand, Brown and Higgins (NTRS 19740004402) and Jaggers (1977):
one linear-tangent law to main-engine cut-off, every staging and jettison a segment
boundary, gravity from a conic coast. The thesis (section 6.4, Appendix A) flew it with
full targets at staging and jettison too; here only the cut-off has a target.
"""

from ares_guidance.arrays import STEEPEST, Onboard
from ares_guidance.kernels.laws.near import may_release_place
from ares_guidance.kernels.prediction.burn import LinearTangent, gravity_effect, steered_thrust
from ares_guidance.kernels.prediction.jettison import predict_jettisons
from ares_guidance.kernels.prediction.segments import (
    Integrals,
    burn_time_to_go,
    note_tail_off,
    thrust_integrals,
)
from ares_models.arrays import MissionRecords
from ares_models.jit import kernel
from ares_models.kernels.targets import (
    aim_at_radius,
    desired_state,
    leaves_place_free,
    plane_normal,
    project_to_plane,
)
from ares_models.kernels.vectors import (
    Vector,
    add,
    axpy,
    cross,
    dot,
    load,
    norm,
    scale,
    store,
    sub,
    unit,
)

#: Least lever arm of a turn, as a fraction of the displacement by thrust.
LEAST_LEVER = 1e-9


@kernel
def steer(
    mission: MissionRecords, onboard: Onboard, integrals: Integrals, horizon: float
) -> tuple[LinearTangent, Vector, bool]:
    """Find the law that leads to the desired position.

    Args:
        mission, onboard: as in :func:`iterate`, with the time to go.
        integrals: of :func:`thrust_integrals`.
        horizon: time to the end of thrust, s.

    Returns:
        the law; the displacement by thrust that is wanted, m; whether the place is released.
    """
    nav = onboard.navigation
    solution = onboard.state.solution
    t_go = solution.time_to_go
    r = load(nav.position)
    v = load(nav.velocity)
    l_sum, j_sum, s_sum, q_sum, _, _ = integrals
    direction = unit(load(solution.velocity_to_go))
    k = j_sum / l_sum
    gravity_r = scale((horizon / solution.gravity_time) ** 2, load(solution.gravity_displacement))
    normal = load(solution.plane_normal)
    wanted_r = load(solution.desired_position)
    downrange = cross(normal, unit(wanted_r))
    r_go = sub(wanted_r, add(axpy(horizon, v, r), gravity_r))
    r_go = add(r_go, load(solution.displacement_bias))
    r_go = axpy(-dot(downrange, r_go), downrange, r_go)
    # downrange is free: choose it so that the part along the thrust equals the burn's displacement
    r_go = axpy((s_sum - dot(direction, r_go)) / dot(direction, downrange), downrange, r_go)
    lever = q_sum - s_sum * k
    rate = scale(1.0 / lever, axpy(-s_sum, direction, r_go))
    if not abs(lever) > LEAST_LEVER * abs(s_sum) * t_go:
        # a turn has no effect, such as in held attitude
        rate = (0.0, 0.0, 0.0)
    solution.turn = norm(rate) * max(k, t_go - k)
    if solution.turn > STEEPEST:
        rate = scale(STEEPEST / solution.turn, rate)
    ended = norm(axpy(s_sum, direction, add(axpy(horizon, v, r), gravity_r)))
    let_go = may_release_place(mission, onboard, solution.turn, ended)
    solution.released = 1 if let_go else 0
    if let_go:
        rate = (0.0, 0.0, 0.0)
        r_go = scale(s_sum, direction)
    return LinearTangent(direction, rate, k), r_go, let_go


@kernel
def iterate(mission: MissionRecords, onboard: Onboard) -> tuple[float, float, bool]:
    """Run one predictor-corrector pass over the planned segments.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.

    Returns:
        change of velocity-to-go m/s, change of the jettison time s, whether the
        target plane passes through the predicted point.
    """
    mu = mission.environment.mu
    target = mission.target
    nav = onboard.navigation
    state = onboard.state
    solution = state.solution
    r = load(nav.position)
    v = load(nav.velocity)
    v_go = load(solution.velocity_to_go)

    t_go, last = burn_time_to_go(state, norm(v_go))
    solution.time_to_go = t_go
    note_tail_off(mission.arcs[state.segments[last].arc], state)
    horizon = t_go + solution.tail_drift
    integrals = thrust_integrals(state, horizon, t_go)
    steering, r_go, let_go = steer(mission, onboard, integrals, horizon)

    # prediction
    thrust_v, thrust_r = steered_thrust(integrals, steering)
    gravity_v, gravity_r = gravity_effect(r, v, thrust_v, thrust_r, horizon, mission.environment)
    r_p = add(axpy(horizon, v, r), add(gravity_r, thrust_r))
    v_p = add(v, add(gravity_v, thrust_v))
    moved = predict_jettisons(mission, onboard, steering)

    # correction
    if let_go and leaves_place_free(target):
        aim_at_radius(target, norm(r_p))
    normal, reachable = plane_normal(target, r_p, cross(r_p, v_p))
    wanted_r, wanted_v, _ = desired_state(target, mu, project_to_plane(r_p, normal), normal)
    miss = sub(wanted_v, v_p)
    store(solution.velocity_to_go, add(v_go, miss))
    store(solution.gravity_displacement, gravity_r)
    solution.gravity_time = horizon
    store(solution.displacement_bias, sub(r_go, thrust_r))
    store(solution.desired_position, wanted_r)
    store(solution.plane_normal, normal)
    store(state.predicted_position, r_p)
    store(state.predicted_velocity, v_p)
    store(solution.direction, steering.direction)
    store(solution.direction_rate, steering.rate)
    solution.reference_time = nav.time + steering.reference
    return norm(miss), moved, reachable
