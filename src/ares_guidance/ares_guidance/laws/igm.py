# SPDX-License-Identifier: Apache-2.0
"""Law `igm`: the iterative guidance mode's pass in the shared cycle."""

from ares_guidance.arrays import LAW_IGM
from ares_guidance.kernels.laws.igm import iterate
from ares_guidance.law import law_of_pass

LAW = law_of_pass("igm", LAW_IGM, iterate)
