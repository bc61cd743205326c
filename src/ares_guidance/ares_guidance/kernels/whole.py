# SPDX-License-Identifier: Apache-2.0
"""Law `optimal` on missions with free arcs before the last: the whole flight in every cycle.

What the cycle shares with the other laws sees a mission whose arcs are as long as the last
solution has them; the law itself solves for them anew. A plan that keeps what the two-point
problem does not know of is flown leg by leg, and so is any once no optimum is found from where the
flight is.
"""

import math

from ares_guidance.arrays import PHASE_TRACKING, Onboard
from ares_guidance.kernels.cycle import guidance_step
from ares_guidance.kernels.legs import lay_out, mission_of_leg, step_by_legs
from ares_models.arrays import MissionRecords
from ares_models.jit import kernel


@kernel
def command_ends(mission: MissionRecords, onboard: Onboard) -> None:
    """Command the ends of the free arcs ahead, as planned."""
    nav = onboard.navigation
    plan = onboard.state.plan
    steering = onboard.steering
    arcs = mission.arcs
    end = nav.arc_start_time
    for k in range(arcs.shape[0]):
        steering.arc_end_times[k] = math.nan
        if k < nav.arc:
            continue
        free = math.isinf(arcs[k].duration)
        end += plan.length[k] if free else arcs[k].duration
        if free and k + 1 < arcs.shape[0]:
            steering.arc_end_times[k] = end


@kernel
def step_whole(mission: MissionRecords, onboard: Onboard) -> None:
    """Answer one navigation state.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.
    """
    state = onboard.state
    if state.plan.made == 0 or state.plan.by_legs == 1:
        step_by_legs(mission, onboard)
        return
    for k in range(mission.arcs.shape[0]):
        state.optimal.duration[k] = mission.arcs[k].duration
    lay_out(mission, state, mission.arcs.shape[0] - 1)
    guidance_step(mission_of_leg(mission, state.leg), onboard)
    command_ends(mission, onboard)
    lost = state.optimal.solved == 0 and state.phase <= PHASE_TRACKING
    if lost and state.stale_cycles >= onboard.settings.max_stale_cycles:
        # from here the best is not found: what was planned is flown
        state.plan.by_legs = 1
        state.leg.count = 0
