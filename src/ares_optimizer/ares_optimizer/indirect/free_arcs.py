# SPDX-License-Identifier: Apache-2.0
"""Solve the two-point problem with free arcs, from the mission alone.

With the free arcs held at given lengths, the built-in guesses find a root; from there the arcs are
released. In orbit, where those guesses fail after long coasts, a primer along the velocity is the
guess. Several lengths are tried, and the best extremal that is a minimum is returned.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, COAST
from ares_optimizer.indirect.solver import Root, TwoPointSolver
from ares_optimizer.kernels.timetable import COLUMN_CUTOFF, COLUMN_JETTISON
from ares_optimizer.plan import free_arcs, length_bounds, longest_burn, trial_lengths
from ares_optimizer.two_point.arrays import HELD, LAMBDA_R, NOT_HELD, PRIMER
from ares_optimizer.two_point.kernels.tangential import (
    next_ignition,
    propagated_back,
    tangential_primer,
)

Array = NDArray[np.float64]

_MOST_TRIALS = 25
#: The search ends when the best root was found again so often, after so many trials.
_ENOUGH = 4
_LEAST_TRIALS = 8
#: Iterations of one start, with lengths free and with all held.
_ITERATIONS = 30
_ITERATIONS_HELD = 50
#: Initial lengths of the last burn, fractions of its longest.
_BURNT = 0.5
_NEARLY_BURNT = 0.85
#: Perturbation of a length in the test for a minimum, s, and relative.
_MOVE_S = 1.0
_MOVE_PART = 0.01
_SAME_KG = 1e-4
#: Fraction of the last stage's propellant, below which a flight without free burns exists.
_NEXT_TO_NOTHING = 1e-2
#: Negligible propellant, as a time of the last burn, s; shorter burns are not solved for.
_NOTHING_S = 0.05
_DESCENTS = 40  # most flights of one descent
#: Steps of a descent, s, and least ratio of gain to expected gain.
_FIRST_STEP = 50.0
_LONGEST_STEP = 400.0
_LAST_STEP = 1e-2
_ARMIJO = 1e-3
_TINY = 1e-300


@dataclass
class _RootSearch:
    """Hold the best root so far, and the work of all searches.

    Attributes:
        solver, start: of the mission.
        best: the root with the least propellant that is a minimum.
        last: the last root tried.
        vanishes: true if a flight with negligible propellant was found.
        again: number of times that the best was found again.
        iterations, restarts: of all starts.
    """

    solver: TwoPointSolver
    start: NDArray[np.void]
    best: Root | None = None
    last: Root | None = None
    vanishes: bool = False
    again: int = 0
    iterations: int = 0
    restarts: int = 0

    def count_work(self, root: Root) -> Root:
        """Add the work of a root to the totals; return the root."""
        self.iterations += root.iterations
        self.restarts += root.restarts + 1
        return root

    def release(self, root: Root) -> None:
        """Release the arcs of a root, solve again, and keep the result if it is the best."""
        self.solver.hold(self.start, {})
        self.solver.hold_at_bounds(self.start, root.lengths)
        self.keep_if_best(
            self.count_work(self.solver.solve(self.start, root.unknowns, restart=False))
        )

    def keep_if_best(self, root: Root) -> None:
        """Keep a root if it is the best."""
        self.last = root
        if not root.converged:
            return
        if self.is_better(root):
            if is_minimum(self.solver, self.start, root):
                self.best = root
                self.again = 0
        elif self.best is not None and abs(root.propellant_kg - self.best.propellant_kg) < _SAME_KG:
            self.again += 1

    def is_better(self, root: Root) -> bool:
        """Return true if a root is better than the best so far.

        A root above ground is better than one below; otherwise the one with less propellant.
        """
        if self.best is None:
            return True
        below, best_is_below = self.is_below_ground(root), self.is_below_ground(self.best)
        if below != best_is_below:
            return best_is_below
        return root.propellant_kg < self.best.propellant_kg - _SAME_KG

    def is_below_ground(self, root: Root) -> bool:
        """Return true if a flight goes below the ground; kept only if no other is found."""
        return root.lowest_m < float(self.solver.arrays.environment[0]["polar_radius"])

    def descend(self, root: Root, held: Mapping[int, float]) -> None:
        """Descend from a flight of held lengths, then release the arcs."""
        little = _NEXT_TO_NOTHING * float(self.solver.arrays.arcs[-1]["propellant"])
        there = self.downhill(root, held, little)
        if not there.converged:
            return
        if there.propellant_kg >= little:
            self.release(there)
        elif self.is_better(there) and not self.is_below_ground(there):
            self.vanishes = True
            self.best = there

    def downhill(self, root: Root, held: Mapping[int, float], enough_kg: float) -> Root:
        """Reduce the propellant of a flight of held lengths, down to ``enough_kg``.

        The gradient is the switching function of each arc. Quasi-Newton steps (BFGS) stay between
        the bounds and within a trust region, so that each root is found from the one before.
        """
        names = list(held)
        bounds = length_bounds(self.solver.arrays, self.start[0])
        low, high = bounds[0][names], bounds[1][names]
        x = np.clip(np.array([held[f] for f in names]), low, high)
        there, slope = self._held(root, names, x)
        radius = _FIRST_STEP
        inverse = np.zeros((x.size, x.size))
        for _ in range(_DESCENTS):
            if not there.converged or there.propellant_kg < enough_kg:
                break
            free = ~((x <= low) & (slope > 0.0) | (x >= high) & (slope < 0.0))
            step = _step_down(inverse, slope, free, radius)
            moved = np.clip(x + step, low, high) - x
            # without propellant there is no root to continue from
            beyond = there.propellant_kg - 0.8 * enough_kg
            moved *= min(1.0, beyond / max(-float(slope @ moved), _TINY))
            if not np.abs(moved).max(initial=0.0) > _LAST_STEP:
                break
            further, next_slope = self._held(there, names, x + moved)
            gain = there.propellant_kg - further.propellant_kg
            if not further.converged or gain < _ARMIJO * -float(slope @ moved):
                radius = 0.25 * float(np.abs(moved).max())
                continue
            inverse = _updated(inverse, moved, next_slope - slope)
            radius = min(2.0 * radius, _LONGEST_STEP)
            x, there, slope = x + moved, further, next_slope
        return there

    def _held(self, root: Root, names: list[int], x: Array) -> tuple[Root, Array]:
        """Solve with arcs held; return the root and the gradient of the propellant, kg/s."""
        solver, start = self.solver, self.start
        solver.hold(start, dict(zip(names, x, strict=True)))
        there = self.count_work(solver.solve(start, root.unknowns, restart=False))
        return there, -solver.work["switches"]["worth"][0, names] / solver.work["price"][0]


def _step_down(inverse: Array, slope: Array, free: NDArray[np.bool_], radius: float) -> Array:
    """Return the quasi-Newton step along the free lengths, within a radius."""
    step = np.where(free, -(inverse @ np.where(free, slope, 0.0)), 0.0)
    if not step @ slope < 0.0:
        step = np.where(free, -slope, 0.0)
        size = float(np.abs(step).max(initial=0.0))
        return step * (radius / size) if size > 0.0 else step
    return step * min(1.0, radius / float(np.abs(step).max()))


def _updated(inverse: Array, moved: Array, change: Array) -> Array:
    """Update the inverse Hessian by BFGS; reset it where the curvature is not positive."""
    curvature = float(moved @ change)
    if curvature <= 0.0:
        return np.zeros_like(inverse)
    if not inverse.any():
        inverse = np.eye(moved.size) * curvature / float(change @ change)
    turn = np.eye(moved.size) - np.outer(moved, change) / curvature
    return turn @ inverse @ turn.T + np.outer(moved, moved) / curvature


def unknowns_of(
    solver: TwoPointSolver, start: NDArray[np.void], lengths: Array, last: float
) -> Array:
    """Return unknowns with the times of arcs of given lengths; costates zero.

    Args:
        solver: of the mission.
        start: shape (1,), dtype NAVIGATION.
        lengths: of the free arcs, s.
        last: length of the last arc, s.
    """
    arcs = solver.arrays.arcs
    free = free_arcs(solver.arrays, start[0])
    unknowns = np.zeros(solver.size(start))
    ends = unknowns[solver.ends(start)]
    time = float(start["arc_start_time"][0])
    for k in range(int(start["arc"][0]), len(arcs) - 1):
        if k in free:
            time += float(lengths[free.index(k)])
            ends[free.index(k)] = time
        else:
            time += float(arcs[k]["duration"])
    unknowns[COLUMN_CUTOFF] = time + last
    drops = unknowns[COLUMN_JETTISON : solver.ends(start).start : 2]
    drops[:] = np.linspace(float(start["time"][0]), time, drops.size + 2)[1:-1]
    return unknowns


def lengths_of(solver: TwoPointSolver, start: NDArray[np.void], unknowns: Array) -> Array:
    """Return the lengths of the free arcs, s, from unknowns: inverse of :func:`unknowns_of`."""
    arcs = solver.arrays.arcs
    free = free_arcs(solver.arrays, start[0])
    ends = unknowns[solver.ends(start)]
    lengths = np.zeros(len(free))
    time = float(start["arc_start_time"][0])
    for k in range(int(start["arc"][0]), len(arcs) - 1):
        if k in free:
            lengths[free.index(k)] = ends[free.index(k)] - time
            time = float(ends[free.index(k)])
        else:
            time += float(arcs[k]["duration"])
    return lengths


def along_velocity(solver: TwoPointSolver, start: NDArray[np.void], unknowns: Array) -> Array:
    """Set the costates to thrust along the velocity at the next ignition."""
    records = solver.arrays.records()
    ignition = next_ignition(start[0], records, unknowns[solver.ends(start)])
    there = tangential_primer(start[0], records, ignition)
    primer, rate = propagated_back(start[0], records, ignition, there)
    out = unknowns.copy()
    out[PRIMER] = primer
    out[LAMBDA_R] = [-component for component in rate]
    return out


def find_planned(
    solver: TwoPointSolver, start: NDArray[np.void], guess: Array | None = None
) -> Root:
    """Find the best root, with all free arcs at their optimal lengths.

    Args:
        solver: of the mission.
        start: shape (1,), dtype NAVIGATION.
        guess: unknowns to try first; None: none.

    Returns:
        the root with the least propellant, else the last one tried, not converged. Its arcs at a
        bound stay held afterwards; all of them if the propellant is negligible.
    """
    search = _RootSearch(solver, start)
    whole = int(solver.options["max_iterations"][0])
    solver.options["max_iterations"] = _ITERATIONS
    try:
        if guess is not None:
            search.keep_if_best(search.count_work(solver.solve(start, guess, restart=False)))
            _from_held(search, lengths_of(solver, start, guess), guess)
        for trial, lengths in enumerate(trial_lengths(solver.arrays, start)):
            # one is flown even where the time limit has just passed
            over = trial > 0 and solver.deadline.passed
            if trial == _MOST_TRIALS or search.vanishes or over:
                break
            if trial >= _LEAST_TRIALS and search.again >= _ENOUGH:
                break
            _try(search, lengths)
    finally:
        solver.options["max_iterations"] = whole
    root = search.best or search.last
    assert root is not None
    # these arcs stay held when the root is refined
    held = {f: root.lengths[f] for f, hold in enumerate(root.holds) if hold != NOT_HELD}
    solver.hold(start, held)
    return replace(root, iterations=search.iterations, restarts=max(0, search.restarts - 1))


def refine_planned(solver: TwoPointSolver, start: NDArray[np.void], root: Root) -> Root:
    """Refine a root of :func:`find_planned` on the current grid of the solver.

    A root with little propellant is followed downhill until the propellant is negligible.
    """
    held = {f: root.lengths[f] for f, hold in enumerate(root.holds) if hold == HELD}
    if not held:
        return solver.solve(start, root.unknowns, restart=False)
    search = _RootSearch(solver, start)
    nothing = _NOTHING_S * float(solver.arrays.arcs[-1]["mass_flow"])
    there = search.downhill(root, held, nothing)
    if there.converged and there.propellant_kg >= nothing:
        search.release(there)
    found = search.best or there
    return replace(found, iterations=search.iterations, restarts=search.restarts)


def _try(search: _RootSearch, lengths: Array) -> None:
    """Try one set of lengths: held first, then free from a primer along the velocity."""
    solver, start = search.solver, search.start
    longest = _longest_last(solver)
    _from_held(search, lengths)
    solver.hold(start, {})
    # from an orbit the last burn is the longest
    orbits = solver.arrays.arcs[int(start["arc"][0])]["kind"] == COAST
    for part in (_BURNT, _NEARLY_BURNT) if orbits else (_BURNT,):
        unknowns = unknowns_of(solver, start, lengths, part * longest)
        ahead = along_velocity(solver, start, unknowns)
        search.keep_if_best(search.count_work(solver.solve(start, ahead, restart=False)))


def _from_held(search: _RootSearch, lengths: Array, guess: Array | None = None) -> None:
    """Search from held lengths, by a guess or the built-in guesses; release or descend."""
    solver, start = search.solver, search.start
    times = unknowns_of(solver, start, lengths, _BURNT * _longest_last(solver))
    held = dict(enumerate(lengths))
    if math.isfinite(solver.arrays.arcs[-1]["duration"]):
        # one burn must stay free to determine the price of propellant
        held.pop(_last_free_burn(solver, start))
    solver.hold(start, held)
    fewer = int(solver.options["max_iterations"][0])
    solver.options["max_iterations"] = _ITERATIONS_HELD
    root = search.count_work(solver.solve(start, guess, times=times, restart=guess is None))
    solver.options["max_iterations"] = fewer
    if root.converged:
        search.release(root)
        if search.is_better(root) and not search.vanishes:
            search.descend(root, held)


def _last_free_burn(solver: TwoPointSolver, start: NDArray[np.void]) -> int:
    """Return the index of the last free burn among the free arcs."""
    arcs = solver.arrays.arcs
    free = free_arcs(solver.arrays, start[0])
    return max(f for f, k in enumerate(free) if arcs[k]["kind"] == BURN)


def _longest_last(solver: TwoPointSolver) -> float:
    """Return the longest possible length of the last burn, s."""
    last = solver.arrays.arcs[-1]
    if math.isfinite(last["duration"]):
        return float(last["duration"])
    return longest_burn(solver.arrays, len(solver.arrays.arcs) - 1)


def is_minimum(solver: TwoPointSolver, start: NDArray[np.void], root: Root) -> bool:
    """Return true if no free arc would save propellant a little longer or shorter.

    The other arcs stay free. Arcs held at a bound are not tested: their multiplier has the right
    sign.
    """
    arrays = solver.arrays
    free = free_arcs(arrays, start[0])
    for f, hold in enumerate(root.holds):
        if hold != NOT_HELD:
            continue
        length = float(root.lengths[f])
        move = max(_MOVE_S, _MOVE_PART * length)
        arc = arrays.arcs[free[f]]
        for moved in (length - move, length + move):
            if not float(arc["shortest"]) < moved < float(arc["longest"]):
                continue
            solver.hold(start, {f: moved})
            beside = solver.solve(start, root.unknowns, restart=False)
            if beside.converged and beside.propellant_kg < root.propellant_kg - _SAME_KG:
                solver.hold(start, {})
                return False
    solver.hold(start, {})
    return True
