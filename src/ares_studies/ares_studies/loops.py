"""The compiled loops over flights, by law: a copy of each for each law that is flown."""

from collections.abc import Callable
from functools import cache

from ares_guidance.law import LawKind
from ares_models.jit import specialised


@cache
def flight_loop(kind: LawKind) -> Callable[..., None]:
    """`ares_studies.kernels.fly` by a law."""
    loop: Callable[..., None] = specialised(
        "ares_studies.kernels", f"of_{kind.name}", guidance_step=kind.step
    ).fly
    return loop


@cache
def campaign_loop(kind: LawKind) -> Callable[..., None]:
    """`ares_studies.montecarlo.kernels.fly_many` by a law."""
    loop: Callable[..., None] = specialised(
        "ares_studies.montecarlo.kernels", f"of_{kind.name}", fly=flight_loop(kind)
    ).fly_many
    return loop
