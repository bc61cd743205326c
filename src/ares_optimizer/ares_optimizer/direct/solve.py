"""The direct methods: a mission in, a proven solution or a named reason out."""

import math
import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ares_models.arrays import MissionArrays
from ares_optimizer.deadline import TIME_LIMIT_PASSED
from ares_optimizer.direct.diagnose import (
    held_by_heating,
    no_flight_line,
    propellant_obstacle,
    rescue,
)
from ares_optimizer.direct.multipliers import (
    heating_jumps,
    least_curvature,
    prices,
    recover_costates,
)
from ares_optimizer.direct.search import (
    Found,
    Guess,
    continue_to,
    find_direct,
    jettison_times,
    solver_nodes,
    steering_arcs,
)
from ares_optimizer.obstacles import check_obstacle, target_obstacle
from ares_optimizer.proof.checks import constraint_table, verification
from ares_optimizer.proof.flight import fly, steering_of
from ares_optimizer.request import Request
from ares_optimizer.solution import ConstraintCheck, OptimizerError, Solution, failed
from ares_optimizer.targets import target_rows

_SADDLE = -1e-6
_RESCUE = 0.5  # s, for finding out why there is no solution
_FLIES = 5.0  # scaled violation above which a failed search has no flight worth showing


def guess_from(solution: Solution) -> Guess:
    """A guess for a direct method out of any solution with steering arcs.

    Raises:
        OptimizerError: the solution has no steering.
    """
    if not solution.arcs:
        raise OptimizerError("guess: the solution has no steering arcs")
    first = solution.arcs[0]
    jettison = solution.t_plf_s
    after = None
    if math.isfinite(jettison):
        later = [arc for arc in solution.arcs if arc.start_s >= jettison - 1e-6]
        arc = later[0] if later else solution.arcs[-1]
        # rates hold for unit directions: bring it to the length that B + A t has by then
        before = [arc for arc in solution.arcs if arc.end_s <= jettison + 1e-6]
        size = 1.0
        for piece in before:
            end = np.asarray(piece.direction) + np.asarray(piece.direction_rate) * (
                piece.end_s - piece.reference_time_s
            )
            size *= float(np.linalg.norm(end))
        after = tuple(size * x for x in arc.direction_rate)
    begin = jettison if math.isfinite(jettison) else first.start_s
    return Guess(
        first.direction,
        first.direction_rate,
        jettison if math.isfinite(jettison) else None,
        solution.t_meco_s - begin,
        after,
    )


def solve_direct(request: Request) -> Solution:
    """The optimal ascent by a direct method.

    Raises:
        OptimizerError: a guess that is none for a direct method.
    """
    arrays, method, deadline = request.arrays, request.method, request.deadline
    guess = guess_from(request.guess) if isinstance(request.guess, Solution) else request.guess
    if guess is not None and not isinstance(guess, Guess):
        raise OptimizerError(
            f"guess is a {type(guess).__name__}; expected a Guess or a Solution for {method}"
        )
    obstacle = target_obstacle(arrays)
    if obstacle:
        return failed(method, obstacle)
    if deadline.passed:
        return failed(method, TIME_LIMIT_PASSED)
    start = request.state[0]
    heating = request.heating
    began = time.perf_counter()
    found = find_direct(arrays, start, method, heating, guess, deadline)
    reason = ""
    if not found.base_converged or (propellant_obstacle(found) and held_by_heating(found)):
        found, reason = rescue(arrays, start, heating, found, deadline.within(_RESCUE))
        if not reason:
            found = continue_to(arrays, start, method, heating, found, deadline)
    elapsed = 1e3 * (time.perf_counter() - began)
    if found.converged:
        reason = reason or propellant_obstacle(found)
    converged = found.converged and not reason
    if not found.converged and deadline.passed:
        reason = TIME_LIMIT_PASSED
    elif not converged and not reason:
        reason = no_flight_line(arrays, found)
    reason = reason or "optimal"
    if not found.miss <= _FLIES or found.cutoff_s <= start["time"]:
        solution = failed(method, reason, iterations=found.iterations, solve_ms=elapsed)
        return replace(solution, restarts=found.restarts)
    solution = Solution(
        method,
        converged,
        reason,
        jettison_times(found, len(arrays.jettisons)),
        found.cutoff_s,
        float(found.final[7]),
        found.iterations,
        elapsed,
        arcs=steering_arcs(found),
        parameters=found.variables,
        restarts=found.restarts,
    )
    if not request.verify or reason == TIME_LIMIT_PASSED:
        return solution
    return _prove_direct(request, found, solution)


def _prove_direct(request: Request, found: Found, solution: Solution) -> Solution:
    """Verification, constraints with their prices, trajectory and costates."""
    arrays = request.arrays
    steering = steering_of(solution.arcs)
    boundaries = [arc.start_s for arc in solution.arcs]
    boundaries += [jump.time_s for jump in heating_jumps(found)]
    start = request.state[0]
    flight = fly(arrays, start, steering, solution.jettison_times_s, solution.t_meco_s, boundaries)
    checks = constraint_table(arrays, start, flight, request.heating)
    proof = verification(arrays, flight, solver_nodes(found))
    solution = replace(solution, verification=proof, trajectory=flight.trajectory)
    if found.converged:
        checks = _with_prices(arrays, checks, prices(found, flight))
        curvature = least_curvature(found)
        solution = replace(
            solution,
            costates=recover_costates(arrays, found, flight, steering),
            notes={**solution.notes, "least_curvature": curvature},
        )
        obstacle = check_obstacle(checks)
        if not obstacle and curvature < _SADDLE:
            obstacle = "stationary, but a saddle and not an optimum"
        if obstacle and solution.converged:
            solution = replace(solution, converged=False, reason=obstacle)
    return replace(solution, constraints=checks)


def _with_prices(
    arrays: MissionArrays, checks: tuple[ConstraintCheck, ...], table: Mapping[str, float]
) -> tuple[ConstraintCheck, ...]:
    """The constraint table with kg of final mass per unit of each limit."""
    names = {name: key for key, name, _, _ in target_rows(int(arrays.target[0]["kind"]))}
    priced = []
    for check in checks:
        key = names.get(check.name, check.name.removeprefix("heating at jettison "))
        if check.name.startswith("heating at jettison"):
            key = f"heating {key}"
        elif check.name == "heating from the jettison on":
            key = "heating after jettison"
        value = table.get(key, math.nan)
        if not check.active:
            value = 0.0
        priced.append(replace(check, multiplier=value))
    return tuple(priced)
