# SPDX-License-Identifier: Apache-2.0
"""Law `optimal`: the two-point problem solved on board, in the shared cycle."""

from ares_guidance.arrays import LAW_OPTIMAL
from ares_guidance.kernels.laws.optimal import seek
from ares_guidance.kernels.plans.replan import flies_boost
from ares_guidance.law import LawKind
from ares_models.jit import specialised

_CYCLE = specialised("ares_guidance.kernels.cycle", "of_optimal", seek=seek)
_LEGS = specialised(
    "ares_guidance.kernels.plans.legs", "of_optimal", guidance_step=_CYCLE.guidance_step
)
_WHOLE = specialised(
    "ares_guidance.kernels.plans.whole",
    "of_optimal",
    guidance_step=_CYCLE.guidance_step,
    step_by_legs=_LEGS.step_by_legs,
)

LAW = LawKind(
    "optimal",
    LAW_OPTIMAL,
    _WHOLE.step_whole,
    holds_attitude=True,
    meets_place=True,
    flies_boost=flies_boost,
)
