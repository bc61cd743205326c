# SPDX-License-Identifier: Apache-2.0
"""Solve a mission by any method: a proven solution or a named cause."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, MISSION_TIME, MissionArrays
from ares_models.floors import orbits_of
from ares_models.kernels.sequence import SAME_TIME
from ares_models.mission import Mission
from ares_models.plans import flies_in_air
from ares_optimizer.auto import solve_auto
from ares_optimizer.collocation.boost import after_boost
from ares_optimizer.collocation.solve import solve_collocation
from ares_optimizer.deadline import Deadline
from ares_optimizer.direct.free_arcs import solve_direct_planned
from ares_optimizer.direct.solve import solve_direct
from ares_optimizer.floor_check import below_floor
from ares_optimizer.kernels.timetable import MAX_HELD, last_tail
from ares_optimizer.methods import find_method
from ares_optimizer.obstacles import check_obstacle
from ares_optimizer.plan import (
    free_arcs,
    held_ahead,
    plans_arcs,
    saving_stage,
    throttled_ahead,
    with_lengths,
)
from ares_optimizer.proof.flight import flown_arcs
from ares_optimizer.registry import (
    AUTO,
    COLLOCATION,
    HELD_METHODS,
    INDIRECT_METHODS,
    METHODS,
    method_names,
)
from ares_optimizer.request import Heating, Request, arrays_and_state, hold_jettisons
from ares_optimizer.rival import solve_beside_rival
from ares_optimizer.solution import (
    ConstraintCheck,
    OptimizerError,
    Solution,
    Status,
    UnfitMethod,
)

#: Without PASSIVE, which gives no optimum and serves for comparison.
CHOICES = (Heating.AT_JETTISON, Heating.FROM_JETTISON, Heating.IGNORED)


def solve(
    mission: Mission | MissionArrays,
    method: str = "direct11",
    *,
    guess: Any = None,
    state: NDArray[np.void] | None = None,
    heating: str | None = None,
    jettison_times: Mapping[int, float] | None = None,
    time_limit_s: float | None = None,
    deadline: Deadline | None = None,
    verify: bool = True,
) -> Solution:
    """Compute the optimal ascent.

    Args:
        mission: the mission.
        method: one of `registry.method_names`.
        guess: for the direct methods a :class:`Guess` or an earlier solution; for the
            indirect ones a guess of :func:`ares_optimizer.indirect.solve.solve_indirect` or a
            solution of any method with costates; for ``collocation`` and ``auto`` the solution of
            a like mission, whose evidence counts. None: the built-in guesses.
        state: start, shape (1,), dtype NAVIGATION; None: that of the mission. A boost programme of
            the mission is flown first, and what is left is solved for.
        heating: ``at_jettison``: the limit holds at the jettison of the fairing (the thesis);
            ``from_jettison``: from then on; ``ignored``: the fairing is dropped at ignition.
            None: that of the mission; ``at_jettison`` for a mission given as arrays.
        jettison_times: fixed times of jettisons, s, by index: their limits are ignored.
        time_limit_s: wall time after which the search ends, compiled parts included; the
            verification is not cut short. None: no limit.
        deadline: replaces ``time_limit_s``: another thread can end it, and it reports progress.
        verify: fly the solution again and fill ``verification``, ``constraints``,
            ``trajectory`` and ``costates``. Without it ``converged`` is not verified, and the
            ``trajectory`` of the indirect methods is that of the solver.

    Returns:
        the solution; ``converged`` only if every constraint is met; for an
        approximation such as ``analytic``, if its iteration converged. ``solve_ms`` is the search
        alone.

    Raises:
        OptimizerError: unknown method, bad guess or state.
    """
    if method not in method_names():
        raise OptimizerError(f"method is {method!r}; expected one of {', '.join(method_names())}")
    if heating is None:
        heating = mission.heating_limit_holds if isinstance(mission, Mission) else "at_jettison"
    if heating not in CHOICES:
        raise OptimizerError(
            f"heating is {heating!r}; expected at_jettison, from_jettison or ignored"
        )
    arrays, state = arrays_and_state(mission, state)
    heated = np.flatnonzero(arrays.jettisons["criterion"] == HEATING_LIMIT).tolist()
    state, flown = after_boost(arrays, state)
    if time_limit_s is not None and not time_limit_s >= 0.0:
        raise OptimizerError(f"time_limit_s is {time_limit_s} s; expected 0 or more")
    if jettison_times:
        arrays = hold_jettisons(arrays, jettison_times)
    with deadline or Deadline(time_limit_s) as deadline:
        request = Request(arrays, state, method, Heating(heating), deadline, guess, verify)
        _check_arcs(request)
        solution = _with_arcs(request, _above_floors(request, _solve(request)))
    return replace(_with_programme(solution, flown), heated=tuple(heated))


def _with_programme(solution: Solution, flown: tuple[ConstraintCheck, ...]) -> Solution:
    """Return a solution with the pressure limits of the programme before it."""
    by_name = {check.name: check for check in flown}
    constraints = tuple(
        max(check, by_name.get(check.name, check), key=lambda one: one.value)
        for check in solution.constraints
    )
    solution = replace(solution, constraints=constraints)
    broken = tuple(check for check in flown if not check.satisfied)
    if not broken or not solution.converged:
        return solution
    reason = f"the programme of the file passes a limit: {check_obstacle(broken[:1])}"
    return replace(solution, status=Status.FEASIBLE, reason=reason)


def _solve(request: Request) -> Solution:
    if request.method not in METHODS:
        return find_method(request.method).solve(request)
    if request.method in INDIRECT_METHODS:
        return solve_beside_rival(request)
    if request.method == AUTO:
        return solve_auto(request)
    if request.method == COLLOCATION:
        return solve_collocation(request)
    if plans_arcs(request.arrays, request.state[0]):
        return solve_direct_planned(request)
    return solve_direct(request)


def _check_arcs(request: Request) -> None:
    """Refuse arcs that no method plans, or that this method does not plan."""
    throttled = throttled_ahead(request.arrays, request.state[0])
    if throttled.any() and request.method not in (AUTO, COLLOCATION, "indirect"):
        arc = int(request.state[0]["arc"]) + int(np.argmax(throttled))
        raise _unfit(
            request, (AUTO, COLLOCATION, "indirect"), f"arc {arc} has max_acceleration_m_s2"
        )
    _check_held(request)
    fixed = saving_stage(request.arrays, request.state[0]) < 0
    if fixed and request.method not in (AUTO, COLLOCATION):
        raise _unfit(request, (AUTO, COLLOCATION), "no burn is free")
    if flies_in_air(request.arrays.arcs) and request.method not in (AUTO, COLLOCATION):
        raise _unfit(request, (AUTO, COLLOCATION), "the flight is in the air")
    named = orbits_of(request.arrays, request.state)
    if named and request.method not in (AUTO, COLLOCATION):
        arc = min(named)
        raise _unfit(request, (AUTO, COLLOCATION), f"arc {arc} names its orbit")
    if not plans_arcs(request.arrays, request.state[0]):
        return
    if request.method == "closed_form" or request.method not in METHODS:
        arc = free_arcs(request.arrays, request.state[0])[0]
        raise _unfit(request, (AUTO, COLLOCATION, "indirect"), f"arc {arc} is free")
    timed = request.arrays.jettisons["criterion"] == MISSION_TIME
    if timed.any():
        raise UnfitMethod(
            f"jettison {int(np.argmax(timed))} is held at a time; expected none to be in a mission "
            "with free arcs before its last"
        )


def _unfit(request: Request, methods: Sequence[str], why: str) -> UnfitMethod:
    """Return the refusal of a method that does not plan what is in the mission."""
    return UnfitMethod(f"method is {request.method}; expected {' or '.join(methods)}: {why}")


def _check_held(request: Request) -> None:
    """Refuse burns in held attitude that cannot be planned, or not by this method."""
    arrays, start = request.arrays, request.state[0]
    present = int(start["arc"])
    held = held_ahead(arrays, start)
    if held and request.method not in HELD_METHODS:
        raise _unfit(request, HELD_METHODS, f"arc {held[0]} has attitude: held")
    if len(held) > MAX_HELD:
        raise UnfitMethod(f"{len(held)} burns have attitude: held; expected at most {MAX_HELD}")
    running = present if start["time"] > start["arc_start_time"] + SAME_TIME else -1
    tail, ended = last_tail(start, arrays.arcs)
    if tail >= 0 and start["time"] < ended + arrays.arcs[tail]["tail_time"].max() - SAME_TIME:
        running = tail
    if running >= 0 and arrays.arcs[running]["held"]:
        raise UnfitMethod(
            f"arc {running} has attitude: held and burns already; the state does not say in which "
            "direction"
        )
    ahead = arrays.arcs[present:]
    if held and not ((ahead["kind"] == BURN) & (ahead["held"] == 0)).any():
        raise UnfitMethod(f"arc {held[0]} has attitude: held; expected a guided burn too")


def _above_floors(request: Request, solution: Solution) -> Solution:
    """Set NOT_OPTIMAL on a solution below the floor of an arc."""
    if not solution.flyable:
        return solution
    low = below_floor(request.arrays, request.state, solution)
    return replace(solution, status=Status.NOT_OPTIMAL, reason=low) if low else solution


def _with_arcs(request: Request, solution: Solution) -> Solution:
    """Add the arcs of the mission with their times to a solution."""
    start = request.state[0]
    if not solution.arcs or len(solution.lengths_s) != len(free_arcs(request.arrays, start)):
        return solution
    planned = with_lengths(request.arrays, start, np.array(solution.lengths_s))
    return replace(solution, flown=flown_arcs(planned, start, solution.t_meco_s))
