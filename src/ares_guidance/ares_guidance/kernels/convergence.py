"""A law that repeats a pass until it settles.

`iterate` and `LAW` are PEG's. A law with another pass has a copy of this module
(`ares_models.jit.specialised`).
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import ERROR_NONE, ERROR_NOT_CONVERGED, LAW_PEG
from ares_guidance.kernels.peg import iterate
from ares_guidance.kernels.segments import plan_segments
from ares_models.arrays import Record
from ares_models.jit import kernel

#: What `state.law` becomes.
LAW = LAW_PEG


@kernel
def converge(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    settings: Record,
    state: Record,
) -> tuple[int, bool]:
    """Repeat the pass until it settles.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.

    Returns:
        ERROR_NONE or ERROR_NOT_CONVERGED, and whether the target plane can be reached.
    """
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
            return ERROR_NONE, reachable
    return ERROR_NOT_CONVERGED, reachable


@kernel
def seek(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    target: Record,
    settings: Record,
    cold: bool,  # noqa: ARG001  other laws begin in another way
    state: Record,
) -> tuple[int, bool]:
    """A solution by the law.

    Args:
        cold: there is no solution to go on from. The others as in
            :func:`ares_guidance.kernels.cycle.guidance_step`.

    Returns: as :func:`converge`.
    """
    state.law = LAW
    return converge(nav, environment, atmosphere, arcs, jettisons, target, settings, state)
