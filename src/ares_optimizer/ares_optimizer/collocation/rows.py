# SPDX-License-Identifier: Apache-2.0
"""Collect the rows of a program with their bounds."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_optimizer.kernels.terminal import MAX_ROWS, terminal_rows


@dataclass
class ConstraintRows:
    """Hold the bounds of all rows, and the entries of linear rows."""

    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    linear: list[tuple[int, int, float]] = field(default_factory=list)

    def add(self, name: str, lower: float, upper: float) -> int:
        """Add a row; return its index."""
        self.lower.append(lower)
        self.upper.append(upper)
        self.names.append(name)
        return len(self.lower) - 1


def count_rows(target: Record, start: NDArray[np.void]) -> int:
    """Return the number of equations of a target, record TARGET.

    Args:
        target: of kind TARGET_*.
        start: any state, shape (1,), dtype NAVIGATION.
    """
    room = np.zeros(MAX_ROWS), np.zeros((MAX_ROWS, 6))
    r, v = (tuple(start[name][0].tolist()) for name in ("position", "velocity"))
    return int(terminal_rows(target, 1.0, r, v, *room))
