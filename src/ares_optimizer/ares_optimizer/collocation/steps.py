# SPDX-License-Identifier: Apache-2.0
"""Steps that change the free lengths of a flight with a free coast a little.

The best length of a coast is a flat optimum: without steps the solver moves it by a revolution, far
from any flight. Each step begins with what follows the coast turned on.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ares_optimizer.collocation.arrays import COASTING
from ares_optimizer.collocation.carry import carried_along_coasts
from ares_optimizer.collocation.solver import StoppingPoint
from ares_optimizer.collocation.transcription import CollocationProgram

Array = NDArray[np.float64]

#: Most change of a coast, rad of a low circular orbit, and of a burn, as a share and s. Beyond that
#: the linear model of the solver is far off.
_STEP_COAST = 0.2
_STEP_BURN = 0.2
_STEP_BURN_S = 10.0
#: Most such steps that fail one after the other, factor on the step after a failure and after one
#: of few iterations, greatest factor, and the share of a step from which a length is held by it.
_MOST_FAILED = 2
_SHRUNK = 0.35
_GROWN = 2.0
_FEW = 18
_MOST_SCALE = 4.0
_HELD = 0.98
#: First step from a solution on other intervals, and the next, as factors.
_NARROW = 0.01
_AFTER_NARROW = 0.25


def _variables(begin: Array | StoppingPoint) -> Array:
    """Return the variables with which a step begins."""
    return begin.x if isinstance(begin, StoppingPoint) else begin


class LengthSteps:
    """Bound the free lengths of a program to a step from where they are, and adapt the step.

    Attributes:
        known: solution of the last step that was solved; None: none was.
        gain: of the next step after it, relative to the mass.
    """

    def __init__(self, program: CollocationProgram, narrow: bool = False) -> None:
        """Begin with the widest step.

        Args:
            program: its bounds are changed in each step.
            narrow: the first step holds the lengths nearly: they are those of a solution on other
                intervals.
        """
        self.known: StoppingPoint | None = None
        self.gain = math.inf
        self._program = program
        self._lower, self._upper = program.lower.copy(), program.upper.copy()
        self._free = np.flatnonzero(self._lower[program.lengths] < self._upper[program.lengths])
        self._at = program.lengths[self._free]
        self._coasts = program.steering[self._free] == COASTING
        self._scale, self._failures = _NARROW if narrow else 1.0, 0
        #: Side, -1 or 1, on which the last step held each length; 0: it did not.
        self._held = np.zeros(len(self._free))

    @property
    def needed(self) -> bool:
        """Return true if the length of a coast is free."""
        return bool(self._coasts.any())

    @property
    def gave_up(self) -> bool:
        """Return true if too many steps failed, one after the other."""
        return self._failures > _MOST_FAILED

    @property
    def begins_anew(self) -> bool:
        """Return true if the next step shall begin without the multipliers of the last."""
        return self._failures > 1 or not self._held.any()

    def _most(self, x: Array) -> Array:
        """Return the greatest change of each free length from a point, scaled."""
        burns = _STEP_BURN * x[self._at] + _STEP_BURN_S / self._program.time
        coasts = _STEP_COAST / self._program.pace[self._free]
        most: Array = self._scale * np.where(self._coasts, coasts, burns)
        return most

    @contextmanager
    def bounded(self, begin: Array | StoppingPoint) -> Iterator[Array | StoppingPoint]:
        """Bound the program to one step; yield the point to begin with.

        Args:
            begin: first guess, shape (n,), or the solution of the last step.
        """
        program, first = self._program, begin
        x = _variables(begin)
        most = self._most(x)
        low, high = self._lower[self._at], self._upper[self._at]
        if isinstance(begin, StoppingPoint) and self._held.any():
            wanted = begin.x[program.lengths]
            wanted[self._free] = np.clip(x[self._at] + self._held * most, low, high)
            first = carried_along_coasts(program, begin, wanted)
        program.lower[self._at] = np.maximum(low, x[self._at] - most)
        program.upper[self._at] = np.minimum(high, x[self._at] + most)
        try:
            yield first
        finally:
            program.lower[:], program.upper[:] = self._lower, self._upper

    def arrived(self, point: StoppingPoint, begin: Array | StoppingPoint) -> bool:
        """Adapt the step to what it led to; return true if it held no length.

        Args:
            point: where the solver stopped.
            begin: where the step began.
        """
        if not point.solved:
            self._failures += 1
            self._scale = 1.0 if self._scale <= _NARROW else _SHRUNK * self._scale
            return False
        x = _variables(begin)
        most = self._most(x)
        moved = point.x[self._at] - x[self._at]
        self._held = np.sign(moved) * (np.abs(moved) >= _HELD * most)
        if not self._held.any():
            return True
        prices = np.abs(point.at_upper - point.at_lower)[self._at] * most / self._scale
        mass = point.x[self._program.ends[self._program.saving]]
        self.gain = float(prices[self._held != 0.0].max() / mass)
        self.known, self._failures = point, 0
        if self._scale <= _NARROW:
            self._scale = _AFTER_NARROW
        elif point.iterations < _FEW:
            self._scale = min(_GROWN * self._scale, _MOST_SCALE)
        return False

    def released(self, point: StoppingPoint) -> StoppingPoint:
        """Return the solution of a step, unsettled, without multipliers of its free lengths."""
        lower, upper = point.at_lower.copy(), point.at_upper.copy()
        lower[self._at] = upper[self._at] = 0.0
        return replace(point, at_lower=lower, at_upper=upper, unsettled=self.gain)
