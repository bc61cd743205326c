# SPDX-License-Identifier: Apache-2.0
"""Optimise the lengths of free arcs around the direct search for the steering.

At given lengths the steering is found as for a mission without free arcs. The propellant is then a
smooth function of a few lengths, which a derivative-free trust region minimises (COBYQA: Ragonneau
and Zhang, 2022) from the best of several trials.
"""

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from ares_models.arrays import BURN, MissionArrays
from ares_optimizer.direct.solve import solve_direct
from ares_optimizer.plan import (
    DEEPEST,
    free_arcs,
    last_begin,
    length_bounds,
    spent,
    trial_lengths,
    with_lengths,
)
from ares_optimizer.proof.flight import fly, steering_of
from ares_optimizer.request import Request
from ares_optimizer.solution import OUT_OF_TIME, Cause, Solution, Status, failed

Array = NDArray[np.float64]

_MOST_TRIALS = 9
_REFINED = 2  # number of trials that are refined
_EVALUATIONS = 120  # most evaluations of one refinement
_SCALE_S = 100.0
_RADIUS = 0.5  # first and last radius of the trust region, in units of _SCALE_S
_LAST_RADIUS = 1e-5
_NO_FLIGHT = 1e3  # scaled cost, above that of the first trial, of lengths without a solution
_SPARE = 0.4  # extra length of a last burn of fixed length during the search, fraction
_SAME_LENGTH = 1e-3  # s, of a last burn of fixed length
_NEXT_TO_NOTHING_S = 0.1  # negligible propellant, as a time of the last burn
_LONGEST_WAIT_S = 600.0  # longest trial coast beyond its shortest, where fixed burns suffice
_ROUNDING = 1e-9


@dataclass
class _Search:
    """Hold the flights tried and the best of them."""

    request: Request
    best: Solution | None = None
    last: Solution | None = None
    iterations: int = 0
    tried: int = 0

    def fly(self, lengths: Array, guess: Solution | None = None) -> Solution:
        """Optimise the steering for given lengths, s."""
        request = self.request
        spare = _SPARE * float(request.arrays.arcs[-1]["duration"])
        planned = _planned(request, lengths, spare)
        solution = solve_direct(replace(request, arrays=planned, guess=guess, verify=False))
        self.iterations += solution.iterations
        self.tried += 1
        self.last = replace(solution, lengths_s=tuple(float(length) for length in lengths))
        return self.last

    def stays_above_ground(self, solution: Solution) -> bool:
        """Return true if a flight reaches its target and does not dip deep below the surface."""
        if not solution.converged:
            return False
        request = self.request
        planned = with_lengths(request.arrays, request.state[0], np.array(solution.lengths_s))
        steering = steering_of(solution.arcs)
        begins = [arc.start_s for arc in solution.arcs]
        flight = fly(
            planned,
            request.state[0],
            steering,
            solution.jettison_times_s,
            solution.t_meco_s,
            begins,
        )
        lowest = float(np.linalg.norm(flight.trajectory.position, axis=1).min())
        ground = float(request.arrays.environment[0]["polar_radius"])
        return lowest > (1.0 - DEEPEST) * ground

    def last_length(self, solution: Solution) -> float:
        """Return the length of the last burn, s."""
        lengths = np.array(solution.lengths_s)
        start = self.request.state[0]
        return solution.t_meco_s - last_begin(self.request.arrays, start, lengths)

    def cost(self, solution: Solution) -> float:
        """Return the propellant of the free burns, kg."""
        arrays, start = self.request.arrays, self.request.state[0]
        return spent(arrays, start, np.array(solution.lengths_s), self.last_length(solution))


def _planned(request: Request, lengths: Array, spare_s: float) -> MissionArrays:
    """Return the mission with arcs of given lengths.

    Args:
        request: the mission is taken from it.
        lengths: of its free arcs before the last, s.
        spare_s: extra propellant, as burn time, of a last burn of fixed length, s. A search from
            both sides must not run out of propellant.
    """
    planned = with_lengths(request.arrays, request.state[0], lengths)
    last = request.arrays.arcs[-1]
    if math.isfinite(last["duration"]):
        planned.arcs["propellant"][planned.arcs["stage"] == last["stage"]] += (
            spare_s * last["mass_flow"]
        )
    return planned


def solve_direct_planned(request: Request, trials: Iterable[Array] | None = None) -> Solution:
    """Compute the optimal ascent and arc lengths by a direct method.

    Args:
        request: mission, method and start.
        trials: initial lengths of the free arcs, s, of which the best are refined; None: the
            first of ``trial_lengths``.

    Raises:
        OptimizerError: the guess is of another method.
    """
    began = time.perf_counter()
    search = _Search(request)
    if trials is None:
        trials = islice(trial_lengths(request.arrays, request.state), _MOST_TRIALS)
    flown = []
    for lengths in trials:
        if request.deadline.passed:
            break
        solution = search.fly(lengths)
        if solution.converged:
            flown.append(solution)
    flown.sort(key=search.cost)
    refined: list[Solution] = []
    for trial in flown:
        if len(refined) == _REFINED:
            break
        if search.stays_above_ground(trial):
            better = _refine(search, trial)
            refined.append(better if search.stays_above_ground(better) else trial)
    best = min(refined, key=search.cost, default=None)
    elapsed = 1e3 * (time.perf_counter() - began)
    if best is None and flown:
        # verify even if not requested: the proof names the ground
        search.request = replace(request, verify=True)
        best = flown[0]
    if best is None:
        if search.last is None:
            return failed(request.method, OUT_OF_TIME)
        return replace(search.last, solve_ms=elapsed, iterations=search.iterations)
    return _verified(search, best, elapsed)


def reach_without(request: Request) -> Solution | None:
    """Find a flight that needs almost no propellant of the free burns.

    The burns of fixed length then suffice. Any steering that wastes the excess energy is as good
    as another, and none is an extremal.

    Args:
        request: its method and its guess are not used.

    Returns:
        the proven flight, or None where none was found.
    """
    began = time.perf_counter()
    arrays, start = request.arrays, request.state
    # wasteful steering may turn too fast for the search's integration steps: always verify
    search = _Search(replace(request, method="direct11", guess=None, verify=True))
    nothing = _NEXT_TO_NOTHING_S * float(arrays.arcs[-1]["mass_flow"])
    for lengths in _coast_trials(arrays, start):
        if request.deadline.passed:
            break
        solution = search.fly(lengths)
        if solution.converged and search.cost(solution) < nothing:
            proven = _verified(search, solution, 1e3 * (time.perf_counter() - began))
            if proven.converged:
                return proven
    return None


def _coast_trials(arrays: MissionArrays, start: NDArray[np.void]) -> Iterator[Array]:
    """Generate lengths of the free arcs, s: shortest burns, coasts from shortest to longer."""
    free = free_arcs(arrays, start[0])
    low, high = length_bounds(arrays, start[0])
    coasts = arrays.arcs["kind"][free] != BURN
    each = int(_MOST_TRIALS ** (1.0 / max(1, coasts.sum())) + _ROUNDING)
    waits = np.linspace(0.0, _LONGEST_WAIT_S, each)
    for point in product(*(waits if coast else waits[:1] for coast in coasts)):
        yield np.minimum(low + np.array(point), high)


def _refine(search: _Search, first: Solution) -> Solution:
    """Optimise the lengths from a trial."""
    request = search.request
    arrays, start = request.arrays, request.state[0]
    low, high = length_bounds(arrays, start)
    state = {"best": first}
    unit = float(arrays.arcs[-1]["mass_flow"]) * _SCALE_S
    duration = float(arrays.arcs[-1]["duration"])
    flown: dict[bytes, Solution] = {}

    def fly(x: Array) -> Solution:
        key = x.tobytes()
        if key not in flown:
            flown[key] = search.fly(np.clip(_SCALE_S * x, low, high), state["best"])
        return flown[key]

    def cost(x: Array) -> float:
        solution = fly(x)
        if not solution.converged:
            return search.cost(first) / unit + _NO_FLIGHT
        if search.cost(solution) < search.cost(state["best"]) and math.isinf(duration):
            state["best"] = solution
        return search.cost(solution) / unit

    def excess(x: Array) -> list[float]:
        solution = fly(x)
        known = solution.converged
        return [(search.last_length(solution) - duration) / _SCALE_S if known else 1.0]

    constraints = () if math.isinf(duration) else (NonlinearConstraint(excess, 0.0, 0.0),)
    result = minimize(
        cost,
        np.array(first.lengths_s) / _SCALE_S,
        method="COBYQA",
        bounds=Bounds(low / _SCALE_S, np.minimum(high, 1e6) / _SCALE_S),
        constraints=constraints,
        options={
            "initial_tr_radius": _RADIUS,
            "final_tr_radius": _LAST_RADIUS,
            "maxfev": _EVALUATIONS,
        },
    )
    return state["best"] if math.isinf(duration) else fly(result.x)


def _verified(search: _Search, best: Solution, elapsed: float) -> Solution:
    """Verify the best flight, as one with arcs of given lengths."""
    request = search.request
    arrays = request.arrays
    lengths = np.array(best.lengths_s)
    if request.verify:
        planned = _planned(request, lengths, _SAME_LENGTH)
        best = solve_direct(replace(request, arrays=planned, guess=best))
    best = replace(
        best,
        lengths_s=tuple(float(length) for length in lengths),
        iterations=search.iterations,
        restarts=search.tried - 1,
        solve_ms=elapsed,
    )
    duration = float(arrays.arcs[-1]["duration"])
    missed = search.last_length(best) - duration if math.isfinite(duration) else 0.0
    if best.converged and abs(missed) > _SAME_LENGTH:
        reason = f"the last burn of {duration:g} s would have to be {missed:+.3f} s longer"
        return replace(best, **Cause(Status.INFEASIBLE, reason)._asdict())
    return best
