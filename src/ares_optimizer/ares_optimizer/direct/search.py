# SPDX-License-Identifier: Apache-2.0
"""Search direct solutions: linear-tangent steering, optimised on exact gradients.

The 11-parameter problem is solved first: from the caller's guess if there is one, and from the
starts of a sweep if there is none or it fails. All other problems start from that solution: more
free parameters (``direct14``, ``direct20``), the analytic jump condition (``jump``), the heating
limit from the jettison on. A limit that is hard to meet is lowered in steps (``tighten``).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays, Record
from ares_optimizer.deadline import Deadline, Progress
from ares_optimizer.direct.kernels.breaks import drop_column
from ares_optimizer.direct.kernels.evaluate import evaluate, make_point, make_scratch
from ares_optimizer.direct.kernels.problem import (
    AT_DROP,
    D_LOG_LIMIT,
    HEATING_FROM_JETTISON,
    L_BEGINS,
    L_DIRECTION,
    L_DROP,
    L_RATE,
    PEAKS,
    RATE_SCALE,
    TIME_SCALE,
    Problem,
)
from ares_optimizer.direct.kernels.scratch import LATER_PEAKS
from ares_optimizer.direct.kernels.sqp import CONVERGED, NO_PROGRESS, NOT_FEASIBLE, search
from ares_optimizer.direct.kernels.start import place_drops, set_law, sweep
from ares_optimizer.direct.transcription import Transcription, transcribe
from ares_optimizer.request import Heating
from ares_optimizer.solution import OptimizerError

Array = NDArray[np.float64]
#: A law longer than this, s, is split into equal parts with a free rate each.
LONGEST_LAW = 450.0
#: Most such splits; a longer flight has longer parts.
MOST_CUTS = 32
#: Added to a log heating limit to remove it.
LIFTED = 60.0
_ITERATIONS = 40
_GUESS_IS_RESTORED_TO = 1.0
_SOLUTION_IS_RESTORED_TO = 10.0
_STARTS = 4
_SMALLEST_RELAXATION = 3e-4  # smallest step of a log heating limit
_MOST_RELAXATIONS = 120
_SAME_TIME = 1.0  # of a jettison, s
_JUMP_MAY_COST = 3.0  # kg more propellant than direct11
_LATE = 2.0  # before cut-off, s
_COSTS_NOTHING = 1e-6  # s


@dataclass(frozen=True)
class Guess:
    """Hold the start of a search.

    Attributes:
        direction: steering vector at the start, any length, shape (3,).
        direction_rate: its rate, 1/s, for a unit ``direction``.
        t_plf_s: time of the (last) heating-limited jettison; None: where the heating allows.
        t_burn_s: from there to cut-off; from the start if there is no such jettison.
        rate_after_jettison: rate from the jettison on; None: ``direction_rate``.
    """

    direction: Sequence[float]
    direction_rate: Sequence[float]
    t_plf_s: float | None
    t_burn_s: float
    rate_after_jettison: Sequence[float] | None = None


@dataclass
class SearchResult:
    """Hold the outcome of a search.

    Attributes:
        transcription: the problem that was solved.
        variables: shape (n,).
        end: exit status of the solver, CONVERGED or another of ``kernels/sqp.py``.
        miss: largest scaled violation.
        curvature: least eigenvalue of the reduced Hessian.
        equations: multipliers of the equations.
        inequalities: multipliers of the inequalities.
        values: values of the inequalities.
        final: shape (8,): time s after the start, position, velocity, mass.
        iterations: of all searches so far.
        restarts: searches beyond the first.
        base_converged: true if the 11-parameter problem was solved.
        excess: log heating limits of the problem minus those of the mission.
    """

    transcription: Transcription
    variables: Array
    end: int
    miss: float
    curvature: float
    equations: Array
    inequalities: Array
    values: Array
    final: Array
    iterations: int = 0
    restarts: int = 0
    base_converged: bool = False
    excess: float = 0.0

    @property
    def converged(self) -> bool:
        """Return true if the end point meets the conditions of an optimum."""
        return self.end == CONVERGED

    @property
    def cutoff_s(self) -> float:
        """Return the cut-off time, s."""
        return float(self.transcription.problem.start_time + TIME_SCALE * self.variables[-1])

    @property
    def drop_times_s(self) -> tuple[float, ...]:
        """Return the times of the free drops, s."""
        problem = self.transcription.problem
        return tuple(
            float(problem.start_time + TIME_SCALE * self.variables[drop_column(problem, d)])
            for d in range(len(problem.drops))
        )


def run(
    transcription: Transcription, guess: Array, goal: float, deadline: Deadline
) -> SearchResult:
    """Search once, from one guess."""
    variables = np.array(guess, dtype=np.float64)
    problem = transcription.problem._replace(stop=deadline.flag)
    end, iterations, miss, curvature, nu, mu, values, final = search(
        variables, problem, goal, _ITERATIONS
    )
    deadline.report(Progress("direct", iterations, miss, float(final[7])))
    return SearchResult(
        transcription, variables, end, miss, curvature, nu, mu, values, final, iterations
    )


def guess_variables(problem: Problem, guess: Guess) -> Array:
    """Convert a guess to variables of a problem.

    Raises:
        OptimizerError: a number of the guess is not finite, or the direction is zero.
    """
    direction = np.asarray(guess.direction, dtype=np.float64)
    rate = np.asarray(guess.direction_rate, dtype=np.float64)
    after = rate if guess.rate_after_jettison is None else guess.rate_after_jettison
    after = np.asarray(after, dtype=np.float64)
    for name, value in (
        ("direction", direction),
        ("direction_rate", rate),
        ("rate_after_jettison", after),
    ):
        if value.shape != (3,) or not np.all(np.isfinite(value)):
            raise OptimizerError(f"guess.{name} is {value.tolist()}; expected three finite numbers")
    size = float(np.linalg.norm(direction))
    if size == 0.0:
        raise OptimizerError("guess.direction is zero; expected a vector with a direction")
    jettison = guess.t_plf_s if guess.t_plf_s is not None else problem.start_time
    if not (math.isfinite(jettison) and math.isfinite(guess.t_burn_s)):
        raise OptimizerError(
            f"guess times are {guess.t_plf_s} and {guess.t_burn_s} s; expected finite numbers"
        )
    variables = np.zeros(problem.variables)
    begin = jettison if len(problem.drops) else problem.start_time
    for d in range(len(problem.drops)):
        variables[drop_column(problem, d)] = (jettison - problem.start_time) / TIME_SCALE
    unit = direction / size
    set_law(variables, problem, tuple(unit), tuple(rate), begin + guess.t_burn_s)
    for law in problem.laws:
        if law[L_BEGINS] == AT_DROP and law[L_RATE] >= 0:
            variables[law[L_RATE] : law[L_RATE] + 3] = after / RATE_SCALE
    if len(problem.drops) and guess.t_plf_s is None:
        scratch = make_scratch(problem)
        evaluate(variables, problem, scratch, make_point(problem))
        place_drops(variables, problem, scratch)
    return variables


def law_times(problem: Problem, variables: Array) -> list[float]:
    """Return the time, s, at which each law begins."""
    times = []
    for law, fixed in zip(problem.laws, problem.law_time, strict=True):
        if law[L_BEGINS] == AT_DROP:
            column = drop_column(problem, int(law[L_DROP]))
            times.append(float(problem.start_time + TIME_SCALE * variables[column]))
        else:
            times.append(float(fixed))
    return times


@dataclass(frozen=True)
class SteeringLaw:
    """Hold a steering law: direction + rate (t - time), not normalised."""

    time: float
    direction: Array
    rate: Array

    def at(self, t: float) -> Array:
        """Return the steering vector at ``t``, s."""
        return self.direction + self.rate * (t - self.time)


def steering_laws(transcription: Transcription, variables: Array) -> list[SteeringLaw]:
    """Return the laws of a solution in order of time, without those of held burns."""
    problem = transcription.problem
    laws: list[SteeringLaw] = []
    times = law_times(problem, variables)
    jumps = None
    for k in sorted(range(len(times)), key=lambda k: (times[k], k)):
        row = problem.laws[k]
        direction = laws[-1].at(times[k]) if laws else np.zeros(3)
        if row[L_DIRECTION] >= 0:
            direction = variables[row[L_DIRECTION] : row[L_DIRECTION] + 3].copy()
        if row[L_RATE] >= 0:
            rate = RATE_SCALE * variables[row[L_RATE] : row[L_RATE] + 3]
        else:
            if jumps is None:
                jumps = _jump_laws(problem, variables)
            direction, rate = jumps[int(row[L_DROP])]
        laws.append(SteeringLaw(times[k], direction, rate))
    return laws


def _jump_laws(problem: Problem, variables: Array) -> dict[int, tuple[Array, Array]]:
    """Return the steering vector and its rate after each jettison by the jump condition."""
    scratch = make_scratch(problem)
    evaluate(variables, problem, scratch, make_point(problem))
    return {d: (row[8:11].copy(), row[11:14].copy()) for d, row in enumerate(scratch.drops[:-1])}


def carry_over(found: SearchResult, transcription: Transcription) -> Array:
    """Convert a solution to variables of another problem with the same or a similar flight.

    Args:
        found: a solution.
        transcription: a problem of the same mission and start, with the same free drops.
    """
    problem = transcription.problem
    laws = steering_laws(found.transcription, found.variables)
    variables = np.zeros(problem.variables)
    old = dict(zip(found.transcription.heating_jettisons, found.drop_times_s, strict=True))
    for d, j in enumerate(transcription.heating_jettisons):
        variables[drop_column(problem, d)] = (old[j] - problem.start_time) / TIME_SCALE
    variables[-1] = found.variables[-1]
    for column, before in zip(problem.held, found.transcription.problem.held, strict=True):
        variables[column : column + 3] = found.variables[before : before + 3]
    times = law_times(problem, variables)
    size = 1.0
    for k in sorted(range(len(times)), key=lambda k: (times[k], k)):
        law = [law for law in laws if law.time <= times[k] + 1e-9][-1]
        row = problem.laws[k]
        if row[L_DIRECTION] >= 0:
            direction = law.at(times[k])
            size = float(np.linalg.norm(direction))
            variables[row[L_DIRECTION] : row[L_DIRECTION] + 3] = direction / size
        if row[L_RATE] >= 0:
            variables[row[L_RATE] : row[L_RATE] + 3] = law.rate / (RATE_SCALE * size)
    return variables


def own_starts(transcription: Transcription, deadline: Deadline) -> Array:
    """Return the best starts of the sweep, best first, shape (k, n)."""
    problem = transcription.problem._replace(stop=deadline.flag)
    starts = np.zeros((_STARTS, problem.variables))
    misses = np.zeros(_STARTS)
    count = sweep(problem, make_scratch(problem), make_point(problem), starts, misses)
    return starts[:count]


def _better(a: SearchResult | None, b: SearchResult) -> SearchResult:
    """Return the better of two outcomes, with the iterations and restarts of both."""
    if a is None:
        return b
    keep = b
    if a.converged == b.converged:
        keep = a if (a.cutoff_s <= b.cutoff_s if a.converged else a.miss <= b.miss) else b
    elif a.converged:
        keep = a
    keep.iterations, keep.restarts = a.iterations + b.iterations, a.restarts + b.restarts + 1
    return keep


def relaxed(transcription: Transcription, amount: float) -> Transcription:
    """Return a copy of the problem with every log heating limit raised by ``amount``."""
    drops = transcription.problem.drops.copy()
    drops[:, D_LOG_LIMIT] += amount
    return replace(transcription, problem=transcription.problem._replace(drops=drops))


def _first_crossing(found: SearchResult) -> Array | None:
    """Return variables with earlier drops where the heating allows them, else None."""
    problem = found.transcription.problem
    if not len(problem.drops):
        return None
    scratch = make_scratch(problem)
    evaluate(found.variables, problem, scratch, make_point(problem))
    moved = found.variables.copy()
    place_drops(moved, problem, scratch)
    for d in range(len(problem.drops)):
        column = drop_column(problem, d)
        if moved[column] < found.variables[column] - _SAME_TIME / TIME_SCALE:
            return moved
    return None


def solve_base(
    transcription: Transcription, guess: Guess | None, deadline: Deadline
) -> SearchResult:
    """Solve a problem from the guess, then from the starts of the sweep."""
    best: SearchResult | None = None
    if guess is not None:
        start = guess_variables(transcription.problem, guess)
        best = run(transcription, start, _GUESS_IS_RESTORED_TO, deadline)
    if best is None or not best.converged:
        for start in own_starts(transcription, deadline):
            best = _better(best, run(transcription, start, _GUESS_IS_RESTORED_TO, deadline))
            if best.converged or deadline.passed:
                break
    if best is None:
        raise OptimizerError("no steering law of the sweep gives a finite flight")
    if best.converged and not deadline.passed:
        # a jettison at a later crossing of the limit may be a local optimum
        moved = _first_crossing(best)
        if moved is not None:
            best = _better(best, run(transcription, moved, _GUESS_IS_RESTORED_TO, deadline))
    return best


def heating_excess(variables: Array, problem: Problem) -> float:
    """Return the greatest log ratio of heating to limit where the limits hold."""
    scratch = make_scratch(problem)
    point = make_point(problem)
    evaluate(variables, problem, scratch, point)
    drops = len(problem.drops)
    levels = [float(point.inequalities[3 * d]) for d in range(drops)]
    if problem.heating == HEATING_FROM_JETTISON and drops:
        levels += point.inequalities[-PEAKS:].tolist()
    return max(levels, default=0.0)


def tighten(
    found: SearchResult, transcription: Transcription, deadline: Deadline, bound: float = math.inf
) -> SearchResult:
    """Lower raised heating limits in steps to those of the problem.

    Args:
        found: a solution of the same flight, with any heating.
        transcription: the problem to be solved.
        deadline: time limit.
        bound: cut-off time of a known solution, s; stop when the cut-off is later.

    Returns:
        the converged outcome with the lowest limits, ``found`` if there is none; its ``excess``
        is 0 when the limits of the problem are reached.
    """
    best = replace(found, iterations=0, restarts=0)
    variables = carry_over(found, transcription)
    reached = max(0.0, heating_excess(variables, transcription.problem))
    step = reached
    iterations = 0
    restarts = 0
    while reached > 0.0 and step > _SMALLEST_RELAXATION and not deadline.passed:
        if best.cutoff_s > bound:
            break
        amount = max(0.0, reached - step)
        target = relaxed(transcription, amount) if amount > 0.0 else transcription
        trial = run(target, variables, _SOLUTION_IS_RESTORED_TO, deadline)
        iterations += trial.iterations
        restarts += 1
        if restarts > _MOST_RELAXATIONS:
            break
        if trial.converged:
            best, variables, reached = trial, trial.variables, amount
            step *= 1.5
        else:
            step = min(step, reached) * 0.4
    best.iterations = iterations
    best.restarts = restarts
    best.excess = reached
    if reached > 0.0:
        best.end = NOT_FEASIBLE
    return best


def continue_from(
    found: SearchResult, transcription: Transcription, deadline: Deadline
) -> SearchResult:
    """Solve a similar problem from a solution, adding up iterations and restarts."""
    guess = carry_over(found, transcription)
    more = run(transcription, guess, _SOLUTION_IS_RESTORED_TO, deadline)
    more.iterations += found.iterations
    more.restarts = found.restarts
    return more


def splits_for(found: SearchResult) -> tuple[float, ...]:
    """Return the times, s, that split every overlong law into equal parts.

    Empty where a time is not finite.
    """
    times = [*law_times(found.transcription.problem, found.variables), found.cutoff_s]
    if not np.isfinite(times).all():
        return ()
    times.sort()
    longest = max(LONGEST_LAW, (times[-1] - times[0]) / MOST_CUTS)
    cuts: list[float] = []
    for begin, end in pairwise(times):
        parts = math.ceil((end - begin) / longest)
        cuts += [begin + (end - begin) * k / parts for k in range(1, parts)]
    return tuple(cuts)


def find_direct(
    arrays: MissionArrays,
    start: Record,
    method: str,
    heating: Heating = Heating.AT_JETTISON,
    guess: Guess | None = None,
    deadline: Deadline | None = None,
) -> SearchResult:
    """Solve a mission with ``direct11``, ``direct14``, ``direct20`` or ``jump``.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        method: one of these four.
        heating: where the heating limit holds.
        guess: start of the search; None: the sweep.
        deadline: time limit.

    Raises:
        OptimizerError: no timetable exists, or the guess is not valid.
    """
    deadline = deadline or Deadline()
    first = Heating.AT_JETTISON if heating is Heating.FROM_JETTISON else heating
    found = solve_base(transcribe(arrays, start, "direct11", first), guess, deadline)
    found.base_converged = found.converged
    if not found.converged:
        return found
    return continue_to(arrays, start, method, heating, found, deadline)


def _extend_limit(
    arrays: MissionArrays,
    start: Record,
    method: str,
    splits: tuple[float, ...],
    before: SearchResult,
    deadline: Deadline,
) -> SearchResult:
    """Extend the heating limit from the jettison to the rest of the flight.

    Two solutions may exist: a more lofted flight, and one that keeps the fairing until the later
    heating peak has passed. The better one is returned.

    Args:
        arrays, start, method: as in :func:`find_direct`.
        splits: further times at which the rate is free, s.
        before: solution with the limit at the jettison.
        deadline: time limit.
    """

    def problem(method: str, heating: Heating, more: Sequence[float] = ()) -> Transcription:
        return transcribe(arrays, start, method, heating, splits=(*splits, *more))

    path = problem(method, Heating.FROM_JETTISON)
    found = continue_from(before, path, deadline)
    if found.converged and found.cutoff_s <= before.cutoff_s + _COSTS_NOTHING:
        return found
    # with all parameters free the search converges to a late jettison from a distant guess
    free = problem("direct20", Heating.AT_JETTISON)
    late_guess = _late_drops(carry_over(before, free), free.problem)
    late = run(free, late_guess, math.inf, deadline)
    if late.converged:
        late = continue_from(late, path, deadline)
    if not found.converged:
        bound = late.cutoff_s if late.converged else math.inf
        tightened = tighten(before, path, deadline, bound)
        tightened.iterations += found.iterations
        tightened.restarts += found.restarts
        found = tightened
    found = _better(found, late)
    if found.converged and method != "jump":
        # the rate of the primer jumps where the limit is active: free that of the steering there
        touched = [t for t, mu in path_peaks(found) if mu > 0.0]
        if touched:
            refined = problem(method, Heating.FROM_JETTISON, touched)
            better = continue_from(found, refined, deadline)
            found = _better(found, better)
    return found


def path_peaks(found: SearchResult) -> list[tuple[float, float]]:
    """Return the later heating peaks at the limit: (time s, multiplier of the log limit)."""
    problem = found.transcription.problem
    if problem.heating != HEATING_FROM_JETTISON or not len(problem.drops):
        return []
    scratch = make_scratch(problem)
    evaluate(found.variables, problem, scratch, make_point(problem))
    rows = found.inequalities[-PEAKS:]
    return [
        (problem.start_time + float(scratch.peaks[k]), float(rows[k]))
        for k in range(int(scratch.counts[LATER_PEAKS]))
    ]


def _late_drops(variables: Array, problem: Problem) -> Array:
    """Return the variables with the last drop just before cut-off."""
    moved = variables.copy()
    moved[drop_column(problem, len(problem.drops) - 1)] = moved[-1] - _LATE / TIME_SCALE
    return moved


def continue_to(
    arrays: MissionArrays,
    start: Record,
    method: str,
    heating: Heating,
    base: SearchResult,
    deadline: Deadline,
) -> SearchResult:
    """Solve for a method, starting from the 11-parameter solution.

    Args:
        arrays, start, method, heating: as in :func:`find_direct`.
        base: converged solution of ``direct11`` with the limit at the jettison (or ignored).
        deadline: time limit.
    """
    first = Heating.AT_JETTISON if heating is Heating.FROM_JETTISON else heating
    splits: tuple[float, ...] = ()
    found = base
    if method == "jump":
        found = continue_from(base, transcribe(arrays, start, method, first), deadline)
        if (found.cutoff_s - base.cutoff_s) * base.transcription.flow_kg_s > _JUMP_MAY_COST:
            # another root of the jump condition, not an optimum
            found.end = NO_PROGRESS
    else:
        splits = splits_for(base)
        if splits or method != "direct11":
            cut = transcribe(arrays, start, method, first, splits=splits)
            found = continue_from(base, cut, deadline)
        if splits and not found.converged:
            # the splits are a refinement: do without them
            splits = ()
            plain = base
            if method != "direct11":
                plain = continue_from(base, transcribe(arrays, start, method, first), deadline)
            found = _better(found, plain)
    if heating is Heating.FROM_JETTISON and found.converged and found.drop_times_s:
        found = _extend_limit(arrays, start, method, splits, found, deadline)
    found.base_converged = True
    return found
