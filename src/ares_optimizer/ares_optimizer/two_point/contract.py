# SPDX-License-Identifier: Apache-2.0
"""What flight software may call of the optimizer: the two-point problem, solved on board.

Law `optimal` imports from here and from `arrays.py` beside it, and from nothing else in this
package (`tests/test_architecture.py`). It finds an optimum once by :func:`find_optimum` and
keeps it up by :func:`shoot` and one back substitution per cycle.
"""

from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    COLUMN_JETTISON,
    HEATING_OPTIMAL,
    MAX_UNKNOWNS,
)
from ares_optimizer.two_point.kernels.free_arcs import lengths_inside
from ares_optimizer.two_point.kernels.gravity import field_of, gravity_terms
from ares_optimizer.two_point.kernels.newton import CONVERGED, scaled_length
from ares_optimizer.two_point.kernels.search import find_optimum
from ares_optimizer.two_point.kernels.shooting import free_column, shoot, unknown_count
from ares_optimizer.two_point.kernels.tangential import (
    carried_back,
    next_ignition,
    tangential_primer,
)

__all__ = [
    "COLUMN_CUTOFF",
    "COLUMN_JETTISON",
    "CONVERGED",
    "HEATING_OPTIMAL",
    "MAX_UNKNOWNS",
    "carried_back",
    "field_of",
    "find_optimum",
    "free_column",
    "gravity_terms",
    "lengths_inside",
    "next_ignition",
    "scaled_length",
    "shoot",
    "tangential_primer",
    "unknown_count",
]
