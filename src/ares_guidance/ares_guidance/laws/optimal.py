"""Law `optimal`: the two-point problem solved on board, in the shared cycle."""

from ares_guidance.arrays import LAW_OPTIMAL
from ares_guidance.kernels.optimal import seek
from ares_guidance.law import law_of_seek

LAW = law_of_seek("optimal", LAW_OPTIMAL, seek)
