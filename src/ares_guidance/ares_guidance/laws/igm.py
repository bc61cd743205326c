"""Law `igm`: the iterative guidance mode's pass in the shared cycle."""

from ares_guidance.arrays import LAW_IGM
from ares_guidance.kernels.igm import iterate
from ares_guidance.law import LawKind
from ares_models.jit import specialised

_convergence = specialised(
    "ares_guidance.kernels.convergence", "of_igm", iterate=iterate, LAW=LAW_IGM
)
_cycle = specialised("ares_guidance.kernels.cycle", "of_igm", seek=_convergence.seek)

LAW = LawKind("igm", LAW_IGM, _cycle.guidance_step)
