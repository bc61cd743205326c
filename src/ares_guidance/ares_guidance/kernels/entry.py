# SPDX-License-Identifier: Apache-2.0
"""Entry from Python into a law: convert the arrays of a flight to records.

`guarded_step` is PEG's; each law gets a copy of this module with its own.
"""

from ares_guidance.arrays import Onboard, OnboardArrays
from ares_guidance.kernels.guarded import guarded_step
from ares_models.arrays import MissionArrays
from ares_models.jit import inlined, kernel
from ares_models.kernels.records import mission_records


@inlined
def onboard_records(onboard: OnboardArrays) -> Onboard:
    """Return the records of the state of guidance, without the law's own memory."""
    return Onboard(
        onboard.navigation[0], onboard.settings[0], onboard.state[0], onboard.steering[0]
    )


@kernel
def answer(mission: MissionArrays, onboard: OnboardArrays) -> None:
    """Step the law; arguments as in :func:`ares_guidance.kernels.cycle.guidance_step`."""
    guarded_step(mission_records(mission), onboard_records(onboard), onboard.memory[0])
