# SPDX-License-Identifier: Apache-2.0
"""Law `optimal` on missions with free arcs before the last: solve the whole flight in each cycle.

The shared cycle sees a mission with the arc lengths of the last solution; the law solves for new
lengths. A plan with constraints that the two-point problem lacks is flown leg by leg, and so is
any plan once no optimum is found from the present state.
"""

from ares_guidance.arrays import PHASE_TRACKING, Onboard
from ares_guidance.kernels.cycle import guidance_step
from ares_guidance.kernels.plans.legs import lay_out, mission_of_leg, step_by_legs
from ares_guidance.kernels.plans.programme import command_ends
from ares_models.arrays import MissionRecords
from ares_models.jit import kernel


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
        # no optimum from here: fly the plan leg by leg
        state.plan.by_legs = 1
        state.leg.count = 0
