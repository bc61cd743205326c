"""Law `optimal`: the two-point problem solved on board, in the shared cycle."""

from dataclasses import replace

from ares_guidance.arrays import LAW_OPTIMAL
from ares_guidance.kernels.optimal import seek
from ares_guidance.law import law_of_seek

LAW = replace(law_of_seek("optimal", LAW_OPTIMAL, seek), meets_place=True)
