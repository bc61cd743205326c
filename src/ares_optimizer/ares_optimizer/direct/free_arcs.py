# SPDX-License-Identifier: Apache-2.0
"""Direct methods with free arcs: their lengths are sought around the search for the steering.

With its arcs of given lengths a flight is an ordinary one. What it takes of propellant is a
smooth function of a few lengths, which a derivative-free trust region minimises (COBYQA:
Ragonneau and Zhang, 2022) from the best of several trials.
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
_REFINED = 2  # of the trials
_EVALUATIONS = 120  # of one refinement
_SCALE_S = 100.0
_RADIUS = 0.5  # first and last radius of the trust region, in the scale
_LAST_RADIUS = 1e-5
_NO_FLIGHT = 1e3  # scaled cost of lengths that lead nowhere, beyond that of the best
_SPARE = 0.4  # of a last burn of fixed length, in the search
_SAME_LENGTH = 1e-3  # s, of a last burn of fixed length
_NEXT_TO_NOTHING_S = 0.1  # of the last burn
_LONGEST_WAIT_S = 600.0  # of a coast beyond its shortest, where nothing has to be burnt
_ROUNDING = 1e-9


@dataclass
class _Search:
    """The flights tried, and the best of them."""

    request: Request
    best: Solution | None = None
    last: Solution | None = None
    iterations: int = 0
    tried: int = 0

    def fly(self, lengths: Array, guess: Solution | None = None) -> Solution:
        """The best steering for given lengths."""
        request = self.request
        spare = _SPARE * float(request.arrays.arcs[-1]["duration"])
        planned = _planned(request, lengths, spare)
        solution = solve_direct(replace(request, arrays=planned, guess=guess, verify=False))
        self.iterations += solution.iterations
        self.tried += 1
        self.last = replace(solution, lengths_s=tuple(float(length) for length in lengths))
        return self.last

    def stays_up(self, solution: Solution) -> bool:
        """Tell if a flight reaches its target, and does not go deep through the ground."""
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
        """Length of the last burn, s."""
        lengths = np.array(solution.lengths_s)
        start = self.request.state[0]
        return solution.t_meco_s - last_begin(self.request.arrays, start, lengths)

    def cost(self, solution: Solution) -> float:
        """Propellant of the free burns, kg."""
        arrays, start = self.request.arrays, self.request.state[0]
        return spent(arrays, start, np.array(solution.lengths_s), self.last_length(solution))


def _planned(request: Request, lengths: Array, spare_s: float) -> MissionArrays:
    """The mission with arcs of given lengths.

    Args:
        request: what is asked.
        lengths: s, of its free arcs before the last.
        spare_s: s, that a last burn of fixed length may last longer: its propellant, which may
            end with it, is no obstacle to a search that comes from both sides.
    """
    planned = with_lengths(request.arrays, request.state[0], lengths)
    last = request.arrays.arcs[-1]
    if math.isfinite(last["duration"]):
        planned.arcs["propellant"][planned.arcs["stage"] == last["stage"]] += (
            spare_s * last["mass_flow"]
        )
    return planned


def solve_direct_planned(request: Request, trials: Iterable[Array] | None = None) -> Solution:
    """The optimal ascent by a direct method, with all free arcs at their best lengths.

    Args:
        request: what is asked.
        trials: lengths of the free arcs to begin with, s, of which the best are made better;
            None: the likeliest.

    Raises:
        OptimizerError: a guess that is none for a direct method.
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
        if search.stays_up(trial):
            better = _refine(search, trial)
            refined.append(better if search.stays_up(better) else trial)
    best = min(refined, key=search.cost, default=None)
    elapsed = 1e3 * (time.perf_counter() - began)
    if best is None and flown:
        # its proof names the ground, asked for or not
        search.request = replace(request, verify=True)
        best = flown[0]
    if best is None:
        if search.last is None:
            return failed(request.method, OUT_OF_TIME)
        return replace(search.last, solve_ms=elapsed, iterations=search.iterations)
    return _finished(search, best, elapsed)


def reach_without(request: Request) -> Solution | None:
    """A flight that takes next to nothing of the free burns: those of fixed length reach.

    There a steering that wastes what is too much is as good as another, and no extremal.

    Args:
        request: with any method; its guess is not used.

    Returns:
        the flight, proven, or None where none was found.
    """
    began = time.perf_counter()
    arrays, start = request.arrays, request.state
    # wasteful steering may turn faster than the search's own steps follow: not without a proof
    search = _Search(replace(request, method="direct11", guess=None, verify=True))
    nothing = _NEXT_TO_NOTHING_S * float(arrays.arcs[-1]["mass_flow"])
    for lengths in _waits(arrays, start):
        if request.deadline.passed:
            break
        solution = search.fly(lengths)
        if solution.converged and search.cost(solution) < nothing:
            proven = _finished(search, solution, 1e3 * (time.perf_counter() - began))
            if proven.converged:
                return proven
    return None


def _waits(arrays: MissionArrays, start: NDArray[np.void]) -> Iterator[Array]:
    """Lengths of the free arcs, s: burns at their shortest, coasts each short and longer."""
    free = free_arcs(arrays, start[0])
    low, high = length_bounds(arrays, start[0])
    coasts = arrays.arcs["kind"][free] != BURN
    each = int(_MOST_TRIALS ** (1.0 / max(1, coasts.sum())) + _ROUNDING)
    waits = np.linspace(0.0, _LONGEST_WAIT_S, each)
    for point in product(*(waits if coast else waits[:1] for coast in coasts)):
        yield np.minimum(low + np.array(point), high)


def _refine(search: _Search, first: Solution) -> Solution:
    """The best lengths near a trial."""
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


def _finished(search: _Search, best: Solution, elapsed: float) -> Solution:
    """The best flight, proven as one with arcs of given lengths."""
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
