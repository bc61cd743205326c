# SPDX-License-Identifier: Apache-2.0
"""Continue from an easier two-point problem to the mission's, where a direct search fails."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    HEATING_LIMIT,
    TARGET_ELEMENTS,
)
from ares_optimizer.indirect.solver import (
    Root,
    TwoPointSolver,
)
from ares_optimizer.two_point.arrays import (
    INVERSE_SQUARE,
    LINEAR,
)

# continuation: first fraction, most steps, initial factor on the heating limits
_FIRST_PART = 0.1
_MOST_PARTS = 60
_HIGHEST_LIMIT = 1e4
_OPEN = 0.1  # initial eccentricity of the continuation to a nearly circular orbit


def with_work_of(root: Root, before: Root, starts: int) -> Root:
    """Return a root with the iterations and restarts of an earlier one added."""
    return replace(
        root,
        iterations=root.iterations + before.iterations,
        restarts=root.restarts + before.restarts + starts,
    )


def from_linear_gravity(solver: TwoPointSolver, start: NDArray[np.void]) -> Root | None:
    """Solve in the linear field first."""
    if solver.options["gravity"][0] == LINEAR:
        return None
    corrected = int(solver.options["corrected"][0])
    solver.options["gravity"] = LINEAR
    solver.options["corrected"] = 0
    root = solver.solve(start)
    solver.options["gravity"] = INVERSE_SQUARE
    solver.options["corrected"] = corrected
    if not root.converged:
        return None
    return with_work_of(solver.solve(start, root.unknowns, restart=False), root, 0)


def from_light_drops(solver: TwoPointSolver, start: NDArray[np.void]) -> Root | None:
    """Solve by continuation from lighter fairings, whose drop turns the primer less."""
    if solver.drops(start) == 0:
        return None
    whole = solver.arrays.jettisons["mass"].copy()

    def part(fraction: float) -> None:
        solver.arrays.jettisons["mass"] = whole * fraction

    return _continue(solver, start, part)


def from_high_limits(solver: TwoPointSolver, start: NDArray[np.void]) -> Root | None:
    """Solve by continuation from higher heating limits."""
    if solver.drops(start) == 0:
        return None
    heated = solver.arrays.jettisons["criterion"] == HEATING_LIMIT
    whole = solver.arrays.jettisons["value"].copy()

    def part(fraction: float) -> None:
        higher = whole * _HIGHEST_LIMIT ** (1.0 - fraction)
        solver.arrays.jettisons["value"] = np.where(heated, higher, whole)

    return _continue(solver, start, part)


def from_open_orbit(solver: TwoPointSolver, start: NDArray[np.void]) -> Root | None:
    """Solve a nearly circular target by continuation from a more eccentric orbit."""
    target = solver.arrays.target[0]
    e = float(target["eccentricity"])
    if target["kind"] != TARGET_ELEMENTS or not 0.0 < e < _OPEN:
        return None
    mu = float(solver.arrays.environment[0]["mu"])
    perigee = float(target["perigee_radius"])
    whole = target.copy()

    def part(fraction: float) -> None:
        opened = e**fraction * _OPEN ** (1.0 - fraction)
        target["eccentricity"] = opened
        target["apogee_radius"] = perigee * (1.0 + opened) / (1.0 - opened)
        target["semi_major_axis"] = perigee / (1.0 - opened)
        target["c3"] = mu * (opened - 1.0) / perigee
        if fraction == 1.0:
            solver.arrays.target[0] = whole

    return _continue(solver, start, part)


def _continue(
    solver: TwoPointSolver, start: NDArray[np.void], part: Callable[[float], None]
) -> Root | None:
    """Solve by continuation in the fraction of the difficulty, from _FIRST_PART to 1."""
    try:
        done = 0.0
        step = _FIRST_PART
        part(done + step)
        root = solver.solve(start)
        if not root.converged:
            return None
        done = step
        for _ in range(_MOST_PARTS):
            if solver.deadline.passed:
                return None
            trial = min(1.0, done + step)
            part(trial)
            further = with_work_of(solver.solve(start, root.unknowns, restart=False), root, 0)
            if not further.converged:
                step *= 0.25
                continue
            root = further
            if trial == 1.0:
                return root
            done = trial
            step *= 2.0
    finally:
        part(1.0)
    return None
