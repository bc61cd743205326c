# SPDX-License-Identifier: Apache-2.0
"""Solve a mission by collocation: several starts, the best refined and proven."""

import time
from dataclasses import replace

from ares_models.arrays import HEATING_LIMIT, TIME_AFTER_IGNITION, MissionArrays
from ares_models.floors import floors_of
from ares_models.plans import flies_in_air
from ares_optimizer.collocation.ascents import (
    first_guesses,
    try_coast_to_apogee,
    try_free_node,
    try_known,
    try_other_plane,
)
from ares_optimizer.collocation.bucket import try_throttle_bucket
from ares_optimizer.collocation.divided_burn import raises_slowly, try_divided_burn
from ares_optimizer.collocation.limits import limits_out_of_reach
from ares_optimizer.collocation.lower_coast import try_lower_coast
from ares_optimizer.collocation.refine import refine_solution
from ares_optimizer.collocation.report import METHOD, solution_of
from ares_optimizer.collocation.search import Search
from ares_optimizer.collocation.shortage import Shortage, short_of_propellant, too_heavy
from ares_optimizer.request import Heating, Request
from ares_optimizer.solution import Solution, Status, UnfitMethod, failed

#: Starts without a solution after which the propellant that one needs is looked for.
_UNMET = 2
#: Share of the time limit after which nothing better is looked for.
_SEARCHED = 0.8


def solve_collocation(request: Request, beat_kg: float | None = None) -> Solution:
    """Solve a mission by collocation.

    Args:
        request: see :class:`ares_optimizer.request.Request`.
        beat_kg: refine the best solution only if its mass is at least this; None: always.

    Raises:
        UnfitMethod: the heating limit must hold from the jettison on.

    Returns:
        the best solution of all starts. CONVERGED: first- and second-order conditions are met,
        the Hamiltonian is constant within :func:`allowed_spread`, and another integrator
        confirms the flight. FEASIBLE: the flight reaches the target, but one of these fails.
    """
    began = time.perf_counter()
    arrays, start = request.arrays, request.state
    if request.heating is Heating.FROM_JETTISON:
        raise UnfitMethod("heating is 'from_jettison'; collocation takes at_jettison or ignored")
    if request.heating is Heating.IGNORED:
        arrays = _dropped_at_ignition(arrays)
    if flies_in_air(arrays.arcs):
        # pressure limits are narrowed by the flight that verifies them
        request = replace(request, verify=True)
    floors = floors_of(arrays, start)
    search = Search(arrays, start, floors, request)
    short: Shortage | None = None
    try_known(search)
    if search.best is None and (beyond := limits_out_of_reach(search)):
        elapsed = 1e3 * (time.perf_counter() - began)
        return failed(METHOD, beyond, iterations=search.iterations, solve_ms=elapsed)
    if search.starts and search.best is None and beat_kg is None:
        short = short_of_propellant(search)
    begun = search.starts
    if not search.is_conclusive and not (short and short.sure):
        try_throttle_bucket(search)
    # other first guesses do not know where the pressure is high
    throttled = search.best is not None and search.starts > begun
    if slowly := raises_slowly(arrays, start):
        try_divided_burn(search)
    for trial in () if throttled or search.is_conclusive else first_guesses(search):
        if request.deadline.passed or search.is_conclusive or (short and short.sure):
            break
        if search.best is not None and request.deadline.share_passed > _SEARCHED:
            # what was found is to be refined and proven
            break
        search.try_start(trial)
        if search.starts == _UNMET and search.best is None and beat_kg is None:
            if not slowly:
                try_divided_burn(search)
            if search.best is None:
                try_free_node(search)
            short = short_of_propellant(search) if search.best is None else None
    if not throttled:
        try_coast_to_apogee(search)
    try_lower_coast(search)
    try_other_plane(search)
    search.unfinished = request.deadline.passed
    if search.best is None and short is None and search.starts < _UNMET and beat_kg is None:
        short = short_of_propellant(search)
    cause = short.cause if short else search.failure()
    if search.best is None and cause.status is Status.STALLED and short is None:
        cause = too_heavy(search) or cause
    best = search.best
    elapsed = 1e3 * (time.perf_counter() - began)
    if best is None or (beat_kg is not None and best.m_f_kg < beat_kg):
        return replace(
            failed(METHOD, cause, iterations=search.iterations, solve_ms=elapsed),
            restarts=max(0, search.starts - 1),
        )
    proven, floors = refine_solution(search, best)
    return solution_of(search, proven, floors, 1e3 * (time.perf_counter() - began))


def _dropped_at_ignition(arrays: MissionArrays) -> MissionArrays:
    """Return the mission with heating jettisons at the ignition of their stages."""
    jettisons = arrays.jettisons.copy()
    waiting = jettisons["criterion"] == HEATING_LIMIT
    jettisons["criterion"][waiting] = TIME_AFTER_IGNITION
    jettisons["value"][waiting] = 0.0
    return arrays._replace(jettisons=jettisons)
