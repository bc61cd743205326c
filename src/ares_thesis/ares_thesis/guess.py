# SPDX-License-Identifier: Apache-2.0
"""The guess with which the thesis begins its direct optimization."""

import numpy as np

from ares_models.arrays import Record
from ares_optimizer.direct.search import Guess


def thesis_guess(start: Record) -> Guess:
    """Return the guess of section 3.4.2: thrust along V0, rates of 1e-4 1/s (Eq. 3.41)."""
    velocity = np.asarray(start["velocity"], dtype=np.float64)
    unit = velocity / np.linalg.norm(velocity)
    return Guess(unit.tolist(), (1e-4,) * 3, 420.0, 330.0)
