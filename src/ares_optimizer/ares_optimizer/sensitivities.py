# SPDX-License-Identifier: Apache-2.0
"""Compute sensitivities to the elements of a target from the costates at cut-off."""

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_optimizer.targets import figures_of, half_turn, target_rows

Array = NDArray[np.float64]

#: Steps of the differences, m and m/s.
_STEPS = np.array([10.0] * 3 + [1e-2] * 3)


def target_sensitivities(target: Record, mu: float, state: Array, costate: Array) -> Array:
    """Write the costates at cut-off as a combination of the elements' gradients.

    Args:
        target: record TARGET.
        mu: m3/s2.
        state: position m and velocity m/s at cut-off, shape (6,).
        costate: by these, shape (6,).

    Returns:
        coefficient per unit of each row of :func:`targets.target_rows`.
    """
    rows = target_rows(target)
    gradient = np.zeros((len(rows), 6))
    for k in range(6):
        move = np.zeros(6)
        move[k] = _STEPS[k]
        sides = [figures_of(target, x[:3], x[3:], mu) for x in (state + move, state - move)]
        for i, row in enumerate(rows):
            change = sides[0][i] - sides[1][i]
            if row.turn:
                change = half_turn(change)
            gradient[i, k] = change / (2.0 * _STEPS[k])
    # scaled to give position and velocity equal weight
    return np.asarray(np.linalg.lstsq((gradient * _STEPS).T, costate * _STEPS, rcond=None)[0])
