"""Law `optimal`: the two-point problem solved on board, in the shared cycle."""

from ares_guidance.arrays import LAW_OPTIMAL
from ares_guidance.kernels.optimal import seek
from ares_guidance.law import LawKind
from ares_models.jit import specialised

_cycle = specialised("ares_guidance.kernels.cycle", "of_optimal", seek=seek)

LAW = LawKind("optimal", LAW_OPTIMAL, _cycle.guidance_step)
