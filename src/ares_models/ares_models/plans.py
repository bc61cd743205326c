# SPDX-License-Identifier: Apache-2.0
"""Decide which missions guidance cannot fly without a plan of the optimizer."""

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, COAST, MAX_ARCS
from ares_models.mission_target import leaves_end_free

#: Length of a coast between burns, s, over which a law predicts poorly: it lost up to 18 % of the
#: mass, or the orbit.
LONG_COAST_S = 60.0


def leaves_arcs_free(arcs: NDArray[np.void]) -> bool:
    """Return whether arcs before the last are free; arcs have dtype ARC."""
    return bool(np.isinf(arcs["duration"][:-1]).any())


def coasts_long(arcs: NDArray[np.void]) -> bool:
    """Return whether a coast of fixed length between two burns is long.

    Args:
        arcs: dtype ARC.
    """
    first = int(np.argmax(arcs["kind"] == BURN))
    lengths = arcs["duration"][first:][arcs["kind"][first:] == COAST]
    return bool((np.isfinite(lengths) & (lengths > LONG_COAST_S)).any())


def flies_in_air(arcs: NDArray[np.void]) -> bool:
    """Return whether forces of the air or a vertical rise are part of a flight.

    Args:
        arcs: dtype ARC.
    """
    forces = (arcs["drag_area"] > 0.0) | (arcs["exit_area"] > 0.0) | (arcs["vertical"] == 1)
    return bool(forces.any())


def flies_open_loop(environment: np.void) -> bool:
    """Return whether the boost programme of a mission flies it to its end; record ENVIRONMENT."""
    boost = environment["boost"]
    whole = boost["last_arc"] >= MAX_ARCS and np.isinf(boost["end"])
    return bool(boost["knots"] > 0 and whole)


def needs_plan(arcs: NDArray[np.void], target: np.void, environment: np.void) -> bool:
    """Return whether a mission cannot be flown without a plan.

    A plan fixes the ends of free arcs before the last, the end of a burn before a long coast, the
    place of insertion on the target orbit if that is free, and the programme of flight in the air.

    Args:
        arcs: dtype ARC.
        target: record TARGET.
        environment: record ENVIRONMENT.
    """
    return not flies_open_loop(environment) and (
        leaves_arcs_free(arcs) or coasts_long(arcs) or leaves_end_free(target) or flies_in_air(arcs)
    )
