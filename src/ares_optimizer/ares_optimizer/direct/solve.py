# SPDX-License-Identifier: Apache-2.0
"""Solve a mission by a direct method: a proven solution or a named cause."""

import math
import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ares_optimizer.direct.diagnose import (
    failure_cause,
    held_by_heating,
    propellant_obstacle,
    rescue,
)
from ares_optimizer.direct.multipliers import (
    CheckKey,
    heating_jumps,
    least_curvature,
    limit_sensitivities,
    recover_costates,
)
from ares_optimizer.direct.report import jettison_times, solver_nodes, steering_arcs
from ares_optimizer.direct.search import Guess, SearchResult, continue_to, find_direct
from ares_optimizer.obstacles import check_obstacle, target_obstacle
from ares_optimizer.proof.checks import constraint_table, verification
from ares_optimizer.proof.flight import fly, steering_of
from ares_optimizer.proof.held import held_checks, held_obstacle, held_offsets
from ares_optimizer.request import Request
from ares_optimizer.solution import (
    OPTIMAL,
    OUT_OF_TIME,
    Cause,
    ConstraintCheck,
    OptimizerError,
    Solution,
    Status,
    failed,
    infeasible,
)

_SADDLE = -1e-6
_RESCUE = 0.5  # s, time limit of ``rescue``
_FLIES = 5.0  # scaled violation above which the flight of a failed search is not returned


def guess_from(solution: Solution) -> Guess:
    """Convert any solution with steering arcs to a guess for a direct method.

    Raises:
        OptimizerError: the solution has no steering.
    """
    if not solution.arcs:
        raise OptimizerError("guess: the solution has no steering arcs")
    # a held burn does not show the law that it overrides
    guided = [arc for arc in solution.arcs if any(arc.direction_rate)] or solution.arcs
    first = guided[0]
    start = solution.arcs[0].start_s
    back = np.asarray(first.direction_rate) * (first.reference_time_s - start)
    jettison = solution.heating_jettison_s
    after = None
    if math.isfinite(jettison):
        later = [arc for arc in guided if arc.start_s >= jettison - 1e-6]
        arc = later[0] if later else guided[-1]
        # rates are for unit directions: scale to the length of B + A t at the jettison
        before = [arc for arc in guided if arc.end_s <= jettison + 1e-6]
        size = 1.0
        for piece in before:
            end = np.asarray(piece.direction) + np.asarray(piece.direction_rate) * (
                piece.end_s - piece.reference_time_s
            )
            size *= float(np.linalg.norm(end))
        after = tuple(size * x for x in arc.direction_rate)
    begin = jettison if math.isfinite(jettison) else start
    return Guess(
        tuple(np.asarray(first.direction) - back),
        first.direction_rate,
        jettison if math.isfinite(jettison) else None,
        solution.t_meco_s - begin,
        after,
    )


def solve_direct(request: Request) -> Solution:
    """Compute the optimal ascent by a direct method.

    Raises:
        OptimizerError: the guess is of another method.
    """
    arrays, method, deadline = request.arrays, request.method, request.deadline
    guess = guess_from(request.guess) if isinstance(request.guess, Solution) else request.guess
    if guess is not None and not isinstance(guess, Guess):
        raise OptimizerError(
            f"guess is a {type(guess).__name__}; expected a Guess or a Solution for {method}"
        )
    cause = infeasible(target_obstacle(arrays))
    if cause is None and deadline.passed:
        cause = OUT_OF_TIME
    if cause is not None:
        return failed(method, cause)
    start = request.state[0]
    heating = request.heating
    began = time.perf_counter()
    found = find_direct(arrays, start, method, heating, guess, deadline)
    if not found.base_converged or (propellant_obstacle(found) and held_by_heating(found)):
        found, cause = rescue(arrays, start, heating, found, deadline.within(_RESCUE))
        if cause is None:
            found = continue_to(arrays, start, method, heating, found, deadline)
    elapsed = 1e3 * (time.perf_counter() - began)
    if found.converged:
        cause = cause or infeasible(propellant_obstacle(found)) or OPTIMAL
    elif deadline.passed:
        cause = OUT_OF_TIME
    else:
        cause = cause or failure_cause(arrays, found)
    # a search that ended early may burn more than the vehicle's mass
    flies = found.miss <= _FLIES and found.cutoff_s > start["time"] and found.final[7] > 0.0
    if not flies:
        solution = failed(method, cause, iterations=found.iterations, solve_ms=elapsed)
        return replace(solution, restarts=found.restarts)
    solution = Solution(
        method,
        *cause,
        jettison_times(found, len(arrays.jettisons)),
        found.cutoff_s,
        float(found.final[7]),
        found.iterations,
        elapsed,
        arcs=steering_arcs(found),
        parameters=found.variables,
        restarts=found.restarts,
    )
    if not request.verify or cause is OUT_OF_TIME:
        return solution
    return _prove_direct(request, found, solution)


def _prove_direct(request: Request, found: SearchResult, solution: Solution) -> Solution:
    """Add verification, constraints with sensitivities, trajectory and costates."""
    arrays = request.arrays
    steering = steering_of(solution.arcs)
    boundaries = [arc.start_s for arc in solution.arcs]
    boundaries += [jump.time_s for jump in heating_jumps(found)]
    start = request.state[0]
    flight = fly(arrays, start, steering, solution.jettison_times_s, solution.t_meco_s, boundaries)
    checks = constraint_table(arrays, start, flight, request.heating)
    proof = verification(arrays, flight, solver_nodes(found))
    solution = replace(solution, verification=proof, trajectory=flight.trajectory)
    if not flight.whole:
        lost = Cause(Status.NOT_OPTIMAL, "the flight falls to the centre of the attraction")
        return replace(solution, **lost._asdict(), constraints=checks)
    if found.converged:
        checks = _with_sensitivities(checks, limit_sensitivities(found, flight))
        curvature = least_curvature(found)
        costates = recover_costates(arrays, found, flight, steering)
        offsets = held_offsets(arrays, flight, steering, costates)
        directions = held_checks(arrays, flight, offsets)
        checks = (*checks, *directions)
        solution = replace(
            solution,
            costates=replace(costates, held_off_deg=offsets),
            notes={**solution.notes, "least_curvature": curvature},
        )
        cause = infeasible(check_obstacle(checks)) or held_obstacle(directions)
        if cause is None and curvature < _SADDLE:
            cause = Cause(Status.NOT_OPTIMAL, "stationary, but a saddle and not an optimum")
        if cause is not None and solution.converged:
            solution = replace(solution, **cause._asdict())
    return replace(solution, constraints=checks)


def _with_sensitivities(
    checks: tuple[ConstraintCheck, ...], sensitivities: Mapping[CheckKey, float]
) -> tuple[ConstraintCheck, ...]:
    """Return the constraint table with kg of final mass per unit of each limit."""
    return tuple(
        replace(
            check,
            multiplier=sensitivities.get((check.key, check.number), math.nan)
            if check.active
            else 0.0,
        )
        for check in checks
    )
