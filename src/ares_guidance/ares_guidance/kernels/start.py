"""Where an iteration begins."""

import math

from ares_guidance.arrays import Onboard
from ares_guidance.kernels.segments import burn_time_to_go, plan_segments
from ares_models.arrays import MissionRecords
from ares_models.jit import kernel
from ares_models.kernels.targets import desired_state, plane_normal, project_to_plane, target_speed
from ares_models.kernels.vectors import axpy, cross, load, norm, scale, store, unit


@kernel
def start_guess(mission: MissionRecords, onboard: Onboard) -> None:
    """First velocity-to-go: the scalar impulse along the velocity, Eqs. 5.29 and 5.35.

    A state that is ``seeded`` keeps its velocity-to-go and jettison times instead, once.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.
    """
    mu = mission.environment.mu
    target = mission.target
    nav = onboard.navigation
    state = onboard.state
    solution = state.solution
    solution.primer_rate = 0.0
    r = load(nav.position)
    v = load(nav.velocity)
    if state.seeded == 1:
        state.seeded = 0
    else:
        speed = norm(v)
        wanted = target_speed(target, mu, norm(r)) - speed
        course = scale(1.0 / speed, v) if speed > 1.0 else unit(r)
        # an impulse below what a second of flight gives would leave no burn to steer
        store(solution.velocity_to_go, scale(max(wanted, 0.05 * speed + 10.0), course))
        for j in range(solution.jettison_time.shape[0]):
            solution.jettison_time[j] = math.inf
    plan_segments(mission, onboard)
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
    store(solution.desired_position, position)
    store(solution.plane_normal, normal)
    store(solution.direction, unit(v_go))
    store(solution.direction_rate, (0.0, 0.0, 0.0))
    solution.reference_time = nav.time
