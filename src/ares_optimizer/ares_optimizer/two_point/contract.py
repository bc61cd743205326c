# SPDX-License-Identifier: Apache-2.0
"""Export the two-point problem to flight software, for solution on board.

Law `optimal` imports from here and from `arrays.py`, and from nothing else in this package
(`tests/test_architecture.py`). It finds an optimum once by :func:`find_optimum` and updates it by
:func:`shoot` and one back substitution per cycle.
"""

from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    HEATING_OPTIMAL,
    MAX_UNKNOWNS,
)
from ares_optimizer.two_point.kernels.air import Extremal, moved, rates, steering_in_air
from ares_optimizer.two_point.kernels.free_arcs import lengths_inside
from ares_optimizer.two_point.kernels.gravity import field_of, gravity_terms
from ares_optimizer.two_point.kernels.newton import CONVERGED, scaled_length
from ares_optimizer.two_point.kernels.search import find_optimum
from ares_optimizer.two_point.kernels.shooting import free_column, shoot, unknown_count
from ares_optimizer.two_point.kernels.tangential import (
    next_ignition,
    propagated_back,
    tangential_primer,
)

__all__ = [
    "COLUMN_CUTOFF",
    "COLUMN_JETTISON",
    "CONVERGED",
    "HEATING_OPTIMAL",
    "MAX_UNKNOWNS",
    "Extremal",
    "field_of",
    "find_optimum",
    "free_column",
    "gravity_terms",
    "lengths_inside",
    "moved",
    "next_ignition",
    "propagated_back",
    "rates",
    "scaled_length",
    "shoot",
    "steering_in_air",
    "tangential_primer",
    "unknown_count",
]
