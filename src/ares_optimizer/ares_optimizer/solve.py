"""One call for every method: a mission in, a proven solution or a named reason out."""

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import HEATING_LIMIT, MISSION_TIME, NAVIGATION, MissionArrays
from ares_models.mission import Mission
from ares_optimizer.deadline import TIME_LIMIT_PASSED, Deadline
from ares_optimizer.diagnose import (
    check_obstacle,
    held_by_heating,
    no_flight_line,
    propellant_obstacle,
    rescue,
    target_obstacle,
)
from ares_optimizer.direct import (
    Found,
    Guess,
    continue_to,
    jettison_times,
    solve_direct,
    solver_nodes,
    steering_arcs,
)
from ares_optimizer.multipliers import heating_jumps, least_curvature, prices, recover_costates
from ares_optimizer.solution import (
    ConstraintCheck,
    OptimizerError,
    Solution,
    UnfitMethod,
    failed,
)
from ares_optimizer.transcription import Heating
from ares_optimizer.verify import (
    constraint_table,
    fly,
    steering_of,
    target_rows,
    verification,
)

Array = NDArray[np.float64]

DIRECT_METHODS = ("direct11", "direct14", "direct20", "jump")
INDIRECT_METHODS = ("indirect", "closed_form")
ANALYTIC_METHOD = "analytic"
METHODS = (*DIRECT_METHODS, *INDIRECT_METHODS, ANALYTIC_METHOD)

HeatingName = Literal["at_jettison", "from_jettison", "ignored"]

_SADDLE = -1e-6
_RESCUE = 0.5  # s, for finding out why there is no solution
_FLIES = 5.0  # scaled violation above which a failed search has no flight worth showing


def start_of(mission: Mission) -> NDArray[np.void]:
    """The mission's own start, shape (1,), dtype NAVIGATION."""
    start = mission.start()
    record = np.zeros(1, NAVIGATION)
    record["time"] = start.time_s
    record["position"] = start.position
    record["velocity"] = start.velocity
    record["mass"] = start.mass_kg
    record["arc_start_time"] = start.time_s
    record["heating_rate"] = math.nan
    return record


def hold_jettisons(arrays: MissionArrays, times: Mapping[int, float]) -> MissionArrays:
    """The mission with some jettisons at given times, whatever the heating.

    Args:
        arrays: the mission.
        times: mission elapsed time in s, by index of the jettison.

    Raises:
        OptimizerError: no such jettison, or a time that is not finite.
    """
    jettisons = arrays.jettisons.copy()
    for j, at in times.items():
        if not 0 <= j < len(jettisons):
            raise OptimizerError(
                f"jettison {j} does not exist; the mission has {len(jettisons)}, counted from 0"
            )
        if not math.isfinite(at):
            raise OptimizerError(f"jettison {j} is held at {at} s; expected a finite time")
        jettisons[j]["criterion"] = MISSION_TIME
        jettisons[j]["value"] = at
    return arrays._replace(jettisons=jettisons)


def check_state(arrays: MissionArrays, state: NDArray[np.void]) -> None:
    """Refuse a start from which no flight can be computed.

    Raises:
        OptimizerError: one line with the field, its value and what was expected.
    """
    if state.dtype != NAVIGATION or state.shape != (1,):
        raise OptimizerError(
            f"state has shape {state.shape}; expected one record of dtype NAVIGATION, shape (1,)"
        )
    row = state[0]
    for name in ("time", "arc_start_time", "position", "velocity", "mass"):
        if not np.all(np.isfinite(row[name])):
            raise OptimizerError(f"state.{name} is {row[name]}; expected finite numbers")
    if not 0 <= row["arc"] < len(arrays.arcs):
        raise OptimizerError(
            f"state.arc is {row['arc']}; expected 0 to {len(arrays.arcs) - 1}, as the mission has"
        )
    if row["mass"] <= 0.0:
        raise OptimizerError(f"state.mass is {row['mass']:g} kg; expected more than 0")
    radius = float(np.linalg.norm(row["position"]))
    ground = float(arrays.environment[0]["polar_radius"])
    if radius < ground:
        raise OptimizerError(
            f"state.position is {radius:,.0f} m from the Earth's centre; expected at least "
            f"{ground:,.0f} m"
        )


def arrays_and_state(
    mission: Mission | MissionArrays, state: NDArray[np.void] | None
) -> tuple[MissionArrays, NDArray[np.void]]:
    """A mission as arrays, and a checked start: the given state or the mission's own.

    Raises:
        OptimizerError: no start, or one from which no flight can be computed.
    """
    if isinstance(mission, Mission):
        arrays = mission.arrays()
        state = start_of(mission) if state is None else state
    else:
        arrays = mission
    if state is None:
        raise OptimizerError("state is missing; a mission given as arrays has no start of its own")
    check_state(arrays, state)
    return arrays, state


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


def solve(
    mission: Mission | MissionArrays,
    method: str = "direct11",
    *,
    guess: Any = None,
    state: NDArray[np.void] | None = None,
    heating: HeatingName | None = None,
    jettison_times: Mapping[int, float] | None = None,
    time_limit_s: float | None = None,
    verify: bool = True,
) -> Solution:
    """The optimal ascent.

    Args:
        mission: what is flown.
        method: one of METHODS.
        guess: for the direct methods a :class:`Guess` or an earlier solution; for the
            indirect ones what :func:`ares_optimizer.indirect.solve_indirect` takes, or a
            solution of any method with costates; none for ``analytic``. None: the solver's
            own start.
        state: where the flight is, shape (1,), dtype NAVIGATION; None: the mission's start.
        heating: ``at_jettison``: the limit holds when the fairing goes (the thesis);
            ``from_jettison``: from then on; ``ignored``: the fairing goes at ignition. None:
            as the mission says; ``at_jettison`` for a mission given as arrays.
        jettison_times: jettisons held at a time (s), by index: their limits are ignored.
        time_limit_s: wall clock after which the search ends, compiled parts of it too; the
            proof of what was found by then is not cut short. None: no limit.
        verify: fly the solution again and fill ``verification``, ``constraints``,
            ``trajectory`` and ``costates``. Without it ``converged`` is the solver's word, and
            the indirect methods sample the ``trajectory`` themselves.

    Returns:
        the solution; ``converged`` only if every constraint is met (``analytic``: if its
        iteration met its own conditions). ``solve_ms`` is the search alone.

    Raises:
        OptimizerError: a bad request: unknown method, bad guess or state.
    """
    if method not in METHODS:
        raise OptimizerError(f"method is {method!r}; expected one of {', '.join(METHODS)}")
    if heating is None:
        heating = mission.heating_limit_holds if isinstance(mission, Mission) else "at_jettison"
    if heating not in [choice.value for choice in Heating]:
        raise OptimizerError(
            f"heating is {heating!r}; expected at_jettison, from_jettison or ignored"
        )
    arrays, state = arrays_and_state(mission, state)
    if time_limit_s is not None and not time_limit_s >= 0.0:
        raise OptimizerError(f"time_limit_s is {time_limit_s} s; expected 0 or more")
    if jettison_times:
        arrays = hold_jettisons(arrays, jettison_times)
    with Deadline(time_limit_s) as deadline:
        if method == ANALYTIC_METHOD:
            return _solve_analytic(arrays, state, guess, heating, deadline, verify)
        if method in INDIRECT_METHODS:
            return _solve_indirect(arrays, state, method, guess, heating, deadline, verify)
        if isinstance(guess, Solution):
            guess = guess_from(guess)
        if guess is not None and not isinstance(guess, Guess):
            raise OptimizerError(
                f"guess is a {type(guess).__name__}; expected a Guess or a Solution for {method}"
            )
        return _solve_direct(arrays, state, method, guess, Heating(heating), deadline, verify)


def _solve_direct(
    arrays: MissionArrays,
    state: NDArray[np.void],
    method: str,
    guess: Guess | None,
    heating: Heating,
    deadline: Deadline,
    verify: bool,
) -> Solution:
    obstacle = target_obstacle(arrays)
    if obstacle:
        return failed(method, obstacle)
    if deadline.passed:
        return failed(method, TIME_LIMIT_PASSED)
    start = state[0]
    began = time.perf_counter()
    found = solve_direct(arrays, start, method, heating, guess, deadline)
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
    if not verify or reason == TIME_LIMIT_PASSED:
        return solution
    return _prove_direct(arrays, state, found, solution, heating)


def _prove_direct(
    arrays: MissionArrays,
    state: NDArray[np.void],
    found: Found,
    solution: Solution,
    heating: Heating,
) -> Solution:
    """Verification, constraints with their prices, trajectory and costates."""
    steering = steering_of(solution.arcs)
    boundaries = [arc.start_s for arc in solution.arcs]
    boundaries += [jump.time_s for jump in heating_jumps(found)]
    start = state[0]
    flight = fly(arrays, start, steering, solution.jettison_times_s, solution.t_meco_s, boundaries)
    checks = constraint_table(
        arrays,
        start,
        flight,
        heating is Heating.FROM_JETTISON,
        heating is not Heating.IGNORED,
    )
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
    names = {name: key for key, _, name, _, _ in target_rows(int(arrays.target[0]["kind"]))}
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


def _solve_indirect(
    arrays: MissionArrays,
    state: NDArray[np.void],
    method: str,
    guess: Any,
    heating: HeatingName,
    deadline: Deadline,
    verify: bool,
) -> Solution:
    # the two halves of the package meet here only
    from ares_optimizer.indirect import IndirectGuess, solve_indirect
    from ares_optimizer.rival import beside_rival, detour_line

    if heating == "from_jettison":
        raise UnfitMethod(f"heating is 'from_jettison'; {method} takes at_jettison or ignored")
    if isinstance(guess, Solution) and guess.method in DIRECT_METHODS:
        if guess.costates is None:
            raise OptimizerError("guess: the solution has no costates; solve it with verify")
        limits = [
            (float(jettison["value"]), at)
            for jettison, at in zip(arrays.jettisons, guess.jettison_times_s, strict=True)
            if jettison["criterion"] == HEATING_LIMIT and math.isfinite(at)
        ]
        free = limits if heating == "at_jettison" else []
        guess = IndirectGuess(
            tuple(guess.costates.lambda_v[0]),
            tuple(guess.costates.lambda_r[0]),
            guess.t_meco_s,
            tuple(at for _, at in free),
            tuple(pi * limit for pi, (limit, _) in zip(guess.costates.jump_pi, free, strict=False)),
        )

    def extremal(guess: Any) -> Solution:
        return solve_indirect(
            arrays,
            state,
            propagator="closed_form" if method == "closed_form" else "runge_kutta",
            guess=guess,
            heating=heating,
            deadline=deadline,
            verify=verify,
        )

    solution = extremal(guess)
    if solution.converged and not verify and not detour_line(arrays, state, solution):
        return solution
    return beside_rival(arrays, state, Heating(heating), solution, extremal, deadline)


def _solve_analytic(
    arrays: MissionArrays,
    state: NDArray[np.void],
    guess: Any,
    heating: HeatingName,
    deadline: Deadline,
    verify: bool,
) -> Solution:
    # it asks for an optimum itself
    from ares_optimizer.analytic import solve_analytic

    if guess is not None:
        raise OptimizerError(f"guess is a {type(guess).__name__}; analytic takes none")
    if heating != "at_jettison":
        raise UnfitMethod(f"heating is {heating!r}; analytic takes at_jettison")
    if deadline.passed:
        return failed(ANALYTIC_METHOD, TIME_LIMIT_PASSED)
    return solve_analytic(arrays, state=state, verify=verify, deadline=deadline).solution
