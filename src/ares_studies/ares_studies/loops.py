# SPDX-License-Identifier: Apache-2.0
"""Make the compiled flight loops: a specialized copy for each law flown."""

from collections.abc import Callable
from functools import cache

from ares_guidance.law import LawKind, guarded
from ares_models.jit import specialised
from ares_studies.arrays import LoopArrays


@cache
def flight_loop(kind: LawKind) -> Callable[[LoopArrays], int]:
    """Return `ares_studies.kernels.fly` for a law."""
    loop: Callable[[LoopArrays], int] = specialised(
        "ares_studies.kernels", f"of_{kind.name}", guarded_step=guarded(kind)
    ).fly
    return loop
