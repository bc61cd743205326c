# SPDX-License-Identifier: Apache-2.0
"""Name the constraint that makes a mission infeasible, and its violation."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays, Record
from ares_models.kernels.environment import altitude, heating_rate
from ares_optimizer.deadline import Deadline
from ares_optimizer.direct.kernels.breaks import drop_column
from ares_optimizer.direct.kernels.evaluate import evaluate, make_point, make_scratch
from ares_optimizer.direct.kernels.problem import (
    D_LOG_LIMIT,
    HEATING_FROM_JETTISON,
    MINIMISE_HEATING,
)
from ares_optimizer.direct.kernels.scratch import N_POSITION, STORED
from ares_optimizer.direct.kernels.sqp import TOO_MANY_ITERATIONS
from ares_optimizer.direct.search import LIFTED, SearchResult, relaxed, run, solve_base, tighten
from ares_optimizer.direct.transcription import Transcription, transcribe
from ares_optimizer.request import Heating
from ares_optimizer.solution import Cause, Status, infeasible
from ares_optimizer.targets import miss_line

Array = NDArray[np.float64]

_FEASIBLE = 1e-6
_NEAR = 1e-3  # scaled terminal violation up to which a flight counts as reaching the target
_PLACES = (0.2, 0.5, 0.8, 0.98)  # trial drops, as fractions of earliest drop to cut-off


def propellant_obstacle(found: SearchResult) -> str:
    """Return a line if the optimum burns more than the last stage has, else ""."""
    transcription = found.transcription
    late = found.cutoff_s - transcription.depletion_s
    if late <= 0.0:
        return ""
    return (
        f"propellant of the last stage: {late * transcription.flow_kg_s:,.0f} kg short; "
        f"best flight cuts off at {found.cutoff_s:.1f} s, the propellant lasts to "
        f"{transcription.depletion_s:.1f} s"
    )


def held_by_heating(found: SearchResult) -> bool:
    """Return true if a heating limit at a jettison is active."""
    drops = len(found.transcription.problem.drops)
    return bool(np.any(found.inequalities[: 3 * drops : 3] > 0.0))


def nearest_line(arrays: MissionArrays, found: SearchResult) -> str:
    """Describe the errors of the nearest flight from the target, and if it takes all mass."""
    problem = found.transcription.problem
    mu = float(problem.environment[0]["mu"])
    text = miss_line(arrays.target[0], found.final[1:4], found.final[4:7], mu)
    latest = problem.latest_cutoff
    if found.cutoff_s >= latest - 1.0:
        text += "; the last stage would have to burn all of its mass"
    return text


def ground_obstacle(found: SearchResult) -> str:
    """Return a line if a node of the flight is below ground, else ""."""
    problem = found.transcription.problem
    scratch = make_scratch(problem)
    evaluate(found.variables, problem, scratch, make_point(problem))
    nodes = scratch.nodes[: scratch.counts[STORED], N_POSITION : N_POSITION + 3]
    environment = problem.environment[0]
    lowest = min(altitude((float(x), float(y), float(z)), environment) for x, y, z in nodes)
    if lowest >= 0.0:
        return ""
    return f"the flights found to the target go through the ground, {-lowest:,.0f} m deep"


def terminal_miss(found: SearchResult) -> float:
    """Return the largest scaled residual of the terminal equations."""
    problem = found.transcription.problem
    point = make_point(problem)
    evaluate(found.variables, problem, make_scratch(problem), point)
    return float(np.abs(point.equations).max())


def failure_cause(arrays: MissionArrays, found: SearchResult) -> Cause:
    """Return the cause of a failed search, derived from its last flight."""
    if terminal_miss(found) > _NEAR:
        line = f"no flight to the target found, the nearest: {nearest_line(arrays, found)}"
        return Cause(Status.INFEASIBLE, line)
    obstacle = ground_obstacle(found) or propellant_obstacle(found)
    if not obstacle and found.transcription.problem.heating == HEATING_FROM_JETTISON:
        obstacle = path_obstacle(found)
    return infeasible(obstacle) or Cause(
        Status.ITERATION_LIMIT if found.end == TOO_MANY_ITERATIONS else Status.STALLED,
        "flights to the target exist, but the search for the best one did not end",
    )


def path_obstacle(found: SearchResult) -> str:
    """Return a line on a heating limit that cannot be held from the jettison to cut-off."""
    problem = found.transcription.problem
    j = found.transcription.heating_jettisons[-1]
    lowest = math.exp(float(problem.drops[-1, D_LOG_LIMIT]))
    limit = lowest / math.exp(found.excess)
    text = f"heating from jettison {j} on: {limit:,.6g} W/m2 cannot be held to cut-off"
    if found.excess > 0.0:
        return (
            f"{text}, the lowest limit reached is {lowest:,.6g} W/m2, "
            f"{lowest - limit:,.4g} W/m2 too much"
        )
    final = found.final
    at_end = heating_rate(
        (float(final[1]), float(final[2]), float(final[3])),
        (float(final[4]), float(final[5]), float(final[6])),
        problem.environment[0],
        problem.atmosphere,
    )
    return f"{text}; at cut-off it is {at_end:,.6g} W/m2"


def _coolest(
    within: Transcription, lowered: SearchResult, found: SearchResult, deadline: Deadline
) -> tuple[float, Array]:
    """Seek the least log heating at the last jettison; return it with its variables, or infinity.

    The effort is added to ``found``.
    """
    best, coolest = math.inf, lowered.variables
    for fraction in _PLACES:
        variables = lowered.variables.copy()
        for d in range(len(within.problem.drops)):
            column = drop_column(within.problem, d)
            variables[column] += fraction * (variables[-1] - variables[column])
        cool = least_heating(within, variables, deadline)
        found.iterations += cool.iterations
        found.restarts += 1
        level = heating_level(cool)
        if cool.miss <= _FEASIBLE and level < best:
            best, coolest = level, cool.variables
        if deadline.passed:
            break
    return best, coolest


def _heating_obstacle(j: int, limit: float, best: float) -> str:
    """Describe a heating limit that no flight meets; limit and least heating in log W/m2."""
    if not math.isfinite(best):
        return (
            f"heating limit of jettison {j}: no flight found to the target that meets "
            f"{math.exp(limit):,.6g} W/m2"
        )
    return (
        f"heating limit of jettison {j}: {math.exp(limit):,.6g} W/m2 is not met by any flight "
        f"found to the target, the least is {math.exp(best):,.6g} W/m2, "
        f"{math.exp(best) - math.exp(limit):,.6g} W/m2 too much"
    )


def rescue(
    arrays: MissionArrays, start: Record, heating: Heating, found: SearchResult, deadline: Deadline
) -> tuple[SearchResult, Cause | None]:
    """Solve a mission that did not converge by another route, or find the cause.

    The heating limit is removed. If the target can then be reached, the limit is lowered in steps;
    if that fails, the flight with the least heating at the jettison is sought. If it meets the
    limit, the search starts again from it; if not, its heating goes into the message.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        heating: where the heating limit holds.
        found: the failed search.
        deadline: time limit.

    Returns:
        a converged outcome and None, or ``found`` and the cause.
    """
    first = Heating.AT_JETTISON if heating is Heating.FROM_JETTISON else heating
    base = transcribe(arrays, start, "direct11", first)
    lifted = found
    if len(base.problem.drops):
        lifted = solve_base(relaxed(base, LIFTED), None, deadline)
        found.iterations += lifted.iterations
        found.restarts += lifted.restarts + 1
    if not lifted.converged:
        return found, failure_cause(arrays, lifted)
    obstacle = ground_obstacle(lifted)
    if obstacle:
        return found, infeasible(obstacle)
    obstacle = propellant_obstacle(lifted)
    if obstacle:
        return found, infeasible(propellant_obstacle(found) if found.converged else obstacle)
    within = _within_propellant(base)
    lowered = tighten(lifted, within, deadline)
    found.iterations += lowered.iterations
    found.restarts += lowered.restarts
    if lowered.excess <= 0.0:
        lowered.iterations, lowered.restarts = found.iterations, found.restarts
        return lowered, None
    best, coolest = _coolest(within, lowered, found, deadline)
    limit = float(base.problem.drops[-1, D_LOG_LIMIT])
    if best <= limit + _FEASIBLE:
        again = run(within, coolest, 1.0, deadline)
        again.iterations += found.iterations
        again.restarts = found.restarts + 1
        if again.converged:
            return again, None
        return found, failure_cause(arrays, again)
    return found, infeasible(_heating_obstacle(base.heating_jettisons[-1], limit, best))


def _within_propellant(transcription: Transcription) -> Transcription:
    """Return a copy of the problem with the cut-off no later than depletion."""
    problem = transcription.problem
    latest = min(problem.latest_cutoff, transcription.depletion_s)
    return replace(transcription, problem=problem._replace(latest_cutoff=latest))


def least_heating(
    transcription: Transcription, variables: Array, deadline: Deadline
) -> SearchResult:
    """Search for the flight to the target with the least heating at the last free drop."""
    problem = transcription.problem._replace(objective=MINIMISE_HEATING)
    return run(replace(transcription, problem=problem), variables, 1.0, deadline)


def heating_level(found: SearchResult) -> float:
    """Return the log of the heating, W/m2, at the last free drop; inf when not finite."""
    problem = found.transcription.problem._replace(objective=MINIMISE_HEATING)
    level = evaluate(found.variables, problem, make_scratch(problem), make_point(problem))
    return level if math.isfinite(level) else math.inf
