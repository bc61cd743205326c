# SPDX-License-Identifier: Apache-2.0
"""Make the compiled flight loops: a specialized copy for each law flown."""

from collections.abc import Callable
from functools import cache
from types import ModuleType

from ares_guidance.law import LawKind, guarded
from ares_models.jit import specialised


@cache
def _flight(kind: LawKind) -> ModuleType:
    return specialised("ares_studies.kernels", f"of_{kind.name}", guarded_step=guarded(kind))


@cache
def flight_loop(kind: LawKind) -> Callable[..., None]:
    """Return `ares_studies.kernels.fly` for a law."""
    loop: Callable[..., None] = _flight(kind).fly
    return loop


@cache
def campaign_loop(kind: LawKind) -> Callable[..., None]:
    """Return `ares_studies.montecarlo.kernels.fly_many` for a law."""
    loop: Callable[..., None] = specialised(
        "ares_studies.montecarlo.kernels", f"of_{kind.name}", run=_flight(kind).run
    ).fly_many
    return loop
