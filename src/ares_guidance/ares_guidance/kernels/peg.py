"""Powered Explicit Guidance for any number of stages: one pass of predictor and corrector.

The multi-stage form of Brand, Brown and Higgins (NTRS 19740004402) and Jaggers (1977):
one linear-tangent law to main-engine cut-off, every staging and jettison a segment
boundary, gravity from a conic coast. The thesis (section 6.4, Appendix A) flew it with a
full target at staging and jettison as well; here only the cut-off is targeted.
"""

from typing import Any

from numpy.typing import NDArray

from ares_guidance.kernels.jettison import predict_jettisons
from ares_guidance.kernels.prediction import gravity_effect, steered_thrust
from ares_guidance.kernels.segments import (
    burn_time_to_go,
    note_tail_off,
    thrust_integrals,
)
from ares_guidance.kernels.targets import (
    desired_state,
    plane_normal,
    project_to_plane,
)
from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import (
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

    t_go, last = burn_time_to_go(state, norm(v_go))
    state.time_to_go = t_go
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
