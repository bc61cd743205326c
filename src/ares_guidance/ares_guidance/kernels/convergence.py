"""A law that repeats a pass until it settles.

`iterate` and `LAW` are PEG's. A law with another pass has a copy of this module
(`ares_models.jit.specialised`).
"""

import math

from ares_guidance.arrays import ERROR_NONE, ERROR_NOT_CONVERGED, LAW_PEG, Onboard
from ares_guidance.kernels.peg import iterate
from ares_guidance.kernels.segments import plan_segments
from ares_models.arrays import MissionArrays
from ares_models.jit import kernel

#: What `state.law` becomes.
LAW = LAW_PEG


@kernel
def converge(mission: MissionArrays, onboard: Onboard) -> tuple[int, bool]:
    """Repeat the pass until it settles.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.

    Returns:
        ERROR_NONE or ERROR_NOT_CONVERGED, and whether the target plane can be reached.
    """
    settings = onboard.settings[0]
    state = onboard.state[0]
    reachable = True
    moved = math.inf
    for _ in range(settings.max_iterations):
        if moved > 0.0:
            plan_segments(mission, onboard)
        miss, moved, reachable = iterate(mission, onboard)
        state.iterations += 1
        state.solution.miss_speed = miss
        if not (math.isfinite(miss) and math.isfinite(state.solution.time_to_go)):
            break
        if miss < settings.velocity_to_go_tolerance and moved < settings.jettison_time_tolerance:
            return ERROR_NONE, reachable
    return ERROR_NOT_CONVERGED, reachable


@kernel
def seek(
    mission: MissionArrays,
    onboard: Onboard,
    cold: bool,  # noqa: ARG001  other laws begin in another way
) -> tuple[int, bool]:
    """A solution by the law.

    Args:
        mission: as in :func:`ares_guidance.kernels.cycle.guidance_step`; so the next.
        onboard: what is on board. Changed.
        cold: there is no solution to go on from.

    Returns: as :func:`converge`.
    """
    onboard.state[0].law = LAW
    return converge(mission, onboard)
