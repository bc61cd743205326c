# SPDX-License-Identifier: Apache-2.0
"""Step of a law between its guards: navigation gate, impact-point avoidance, monitors.

In the air the attitude programme answers in place of the law.

`guidance_step` is PEG's; each law gets a copy of this module with its own step, a law
with a memory of its own in place of `step_law`.
"""

from ares_guidance.arrays import (
    ERROR_NAVIGATION_INVALID,
    ERROR_NONE,
    PHASE_IDLE,
    Onboard,
)
from ares_guidance.kernels.monitors.answers import watch_answer
from ares_guidance.kernels.monitors.failures import detect_failures, vehicle_left
from ares_guidance.kernels.monitors.impact import hand_back, keep_out
from ares_guidance.kernels.monitors.navigation_gate import ACCEPTED, REFUSED, admit
from ares_guidance.kernels.plans.legs import step_by_legs as guidance_step
from ares_guidance.kernels.plans.load_relief import remember
from ares_guidance.kernels.plans.programme import flies_programme
from ares_models.arrays import MissionRecords, Record
from ares_models.jit import kernel


@kernel
def begin_anew(state: Record) -> None:
    """Reset the law to start from the present state.

    Args:
        state: record GUIDANCE_STATE. Changed.
    """
    state.phase = PHASE_IDLE
    state.cycle = 0
    state.stale_cycles = 0
    state.engines.mass = 0.0
    state.thrust_ratio = 0.0
    state.optimal.solved = 0
    state.leg.count = 0
    state.avoid.mode = 0
    state.avoid.next_time = 0.0


@kernel
def step_law(mission: MissionRecords, onboard: Onboard, memory: Record) -> None:  # noqa: ARG001
    """Step a law without a memory of its own; arguments as in :func:`guarded_step`."""
    guidance_step(mission, onboard)


@kernel
def boost_step(mission: MissionRecords, onboard: Onboard) -> bool:
    """Answer by the attitude programme, and check for failures; return False if the law is next."""
    state = onboard.state
    if state.left.count == 0:
        flies = flies_programme(mission, onboard)
    else:
        flies = flies_programme(vehicle_left(mission, state), onboard)
    if flies:
        remember(onboard)
        # a solution in the air is continued with the vehicle that is left
        solved = state.optimal.solved
        detect_failures(mission, onboard)
        state.optimal.solved = solved
    return flies


@kernel
def guarded_step(mission: MissionRecords, onboard: Onboard, memory: Record) -> None:
    """Answer one navigation state; a refused one gets the last answer, continued in time.

    Args:
        mission: the mission as guidance believes it.
        onboard: state of guidance. Changed.
        memory: the law's own. Changed.
    """
    state = onboard.state
    watch = state.navigation
    acquired = watch.acquired
    verdict = admit(mission, onboard)
    if verdict == REFUSED:
        state.error = ERROR_NAVIGATION_INVALID
    if verdict != ACCEPTED:
        return
    if state.error == ERROR_NAVIGATION_INVALID:
        state.error = ERROR_NONE
    if watch.acquired != acquired and watch.accepted == 1:
        begin_anew(state)
    if boost_step(mission, onboard):
        return
    if mission.environment.area_count > 0:
        hand_back(onboard)
    step_law(mission, onboard, memory)
    guarded = mission.environment.area_count > 0
    if state.left.count == 0:
        if guarded:
            keep_out(mission, onboard)
        watch_answer(mission, onboard)
    else:
        if guarded:
            keep_out(vehicle_left(mission, state), onboard)
        # depletion depends on the weakened engines
        watch_answer(vehicle_left(mission, state), onboard)
