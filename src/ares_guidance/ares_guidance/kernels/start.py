"""Where an iteration begins."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.kernels.segments import (
    burn_time_to_go,
    plan_segments,
)
from ares_guidance.kernels.targets import (
    desired_state,
    plane_normal,
    project_to_plane,
    target_speed,
)
from ares_models.arrays import Record
from ares_models.jit import kernel
from ares_models.kernels.vectors import (
    axpy,
    load,
    norm,
    scale,
    store,
    unit,
)


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
    t_go, _ = burn_time_to_go(state, norm(load(state.velocity_to_go)))
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
