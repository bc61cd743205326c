# SPDX-License-Identifier: Apache-2.0
"""Choose the method for a mission: indirect where it suffices, else collocation.

A mission whose last arc alone is free is solved by ``indirect`` in milliseconds, and compared with
collocation from several starts. Other missions are solved by collocation first; ``indirect`` then
refines the solution to the exact root if the two-point problem has all active constraints.
``Solution.steps`` records the methods used.
"""

import math
from dataclasses import replace

from ares_models.arrays import HEATING_LIMIT
from ares_models.floors import floors_of, orbits_of
from ares_models.plans import flies_in_air
from ares_models.tolerances import FLOOR_M
from ares_optimizer.collocation.report import LOCAL_OPTIMA
from ares_optimizer.collocation.solve import solve_collocation
from ares_optimizer.direct.solve import solve_direct
from ares_optimizer.floor_check import below_floor, depth_below_ground
from ares_optimizer.indirect.solve import refine_root, solve_indirect
from ares_optimizer.indirect.solver import TwoPointOptions
from ares_optimizer.out_of_reach import out_of_reach
from ares_optimizer.plan import plans_arcs, saving_stage, throttled_ahead
from ares_optimizer.proof.checks import heating_from_jettison
from ares_optimizer.request import Heating, Request
from ares_optimizer.rival import solve_beside_rival
from ares_optimizer.solution import (
    Cause,
    Check,
    ConstraintCheck,
    OptimizerError,
    Solution,
    Status,
    UnfitMethod,
    failed,
    next_to_nothing,
)

#: Least relative gain of mass for which a solution of collocation replaces another.
_BETTER = 1e-4
#: Largest relative loss of mass by the refinement with indirect.
_SAME = 1e-5
#: Number of local optima from which the built-in guesses of indirect are tried too.
_SEVERAL = 2
#: Negligible propellant of the last burn, kg.
_NOTHING_KG = 1.0
#: Length of a vanishing free arc, s: too short for a guidance cycle.
_VANISHING_S = 1.0


def solve_auto(request: Request) -> Solution:
    """Solve a mission by the methods that suit it.

    Args:
        request: see :class:`ares_optimizer.request.Request`; its method is ``auto``.

    Returns:
        the best solution found.
    """
    if evidence := out_of_reach(request.arrays, request.state):
        return failed("auto", Cause(Status.INFEASIBLE, evidence))
    if request.heating is Heating.FROM_JETTISON:
        return _cool_from_jettison(request)
    if flies_in_air(request.arrays.arcs):
        # no other method knows the forces of the air
        found = solve_collocation(replace(request, method="collocation"))
        return replace(found, steps=(step("collocation", found),))
    steps: list[str] = []
    fast = _fast(request)
    if fast is not None:
        steps.append(step("indirect", fast))
        deep = depth_below_ground(request.arrays, fast)
        if deep > FLOOR_M:
            steps[-1] = f"indirect: goes through the ground, {deep:,.0f} m deep"
            fast = None
        elif fast.converged and not request.verify:
            return replace(fast, steps=tuple(steps))
    beat = fast.m_f_kg * (1.0 + _BETTER) if fast is not None and fast.converged else None
    found = solve_collocation(replace(request, method="collocation"), beat)
    if fast is not None and fast.converged and not found.flyable:
        steps.append(f"collocation: nothing better from {found.restarts + 1} first guesses")
        return replace(fast, steps=tuple(steps))
    steps.append(step("collocation", found))
    if orbits_of(request.arrays, request.state):
        # no other method keeps them
        return replace(found, steps=tuple(steps))
    if found.flyable:
        other = _search_by_indirect(request, found)
        if other is not None:
            steps.append(step("indirect by its own search", other))
            return replace(other, steps=tuple(steps))
        exact = _refined_to_root(request, found)
        if exact is not None:
            steps.append(step("indirect from there", exact))
            return replace(exact, steps=tuple(steps))
        return replace(found, steps=tuple(steps))
    return _last_resort(request, found, steps)


def _cool_from_jettison(request: Request) -> Solution:
    """Solve a mission whose heating limit holds from the jettison on.

    First solve with the limit at the jettison only, a relaxation: its optimum is the solution if
    its later heating keeps the limit, and if it is infeasible, so is this problem. Otherwise use
    ``direct20``, which limits the heating along the flight if the last arc alone is free.
    """
    relaxed = solve_auto(replace(request, heating=Heating.AT_JETTISON, verify=True))
    planned = plans_arcs(request.arrays, request.state[0])
    if not relaxed.flyable:
        if planned or relaxed.status is Status.INFEASIBLE:
            return relaxed
        return _by_direct(request, relaxed.steps)
    peak = relaxed.verification.peak_fmhr_after_jettison_w_m2 if relaxed.verification else math.nan
    if not math.isfinite(peak):
        return relaxed
    jettisons = request.arrays.jettisons
    limit = float(jettisons["value"][jettisons["criterion"] == HEATING_LIMIT].min())
    check = heating_from_jettison(request.arrays, peak, limit)
    if check.satisfied:
        return replace(relaxed, constraints=(*relaxed.constraints, check))
    steps = (*relaxed.steps, f"heating from the jettison on: {peak:,.0f} W/m2, limit {limit:,.0f}")
    if planned:
        reason = (
            f"{steps[-1]}; no method limits the heating along free arcs: "
            "raise min_perigee_altitude_m of the free coast"
        )
        return replace(failed("auto", Cause(Status.STALLED, reason)), steps=steps)
    return _by_direct(request, steps)


def _by_direct(request: Request, steps: tuple[str, ...]) -> Solution:
    """Solve by ``direct20`` after other steps."""
    solution = solve_direct(replace(request, method="direct20"))
    return replace(solution, steps=(*steps, step("direct20", solution)))


def step(name: str, solution: Solution) -> str:
    """Describe the result of a method in one line."""
    if solution.flyable:
        word = "optimal" if solution.converged else "feasible"
        return f"{name}: {word}, {solution.m_f_kg:,.4f} kg"
    return f"{name}: {solution.reason}"


def _fast(request: Request) -> Solution | None:
    """Solve by ``indirect`` if only the last arc is free and no floor is set; else return None."""
    arrays, start = request.arrays, request.state
    if plans_arcs(arrays, start[0]) or any(floor.said for floor in floors_of(arrays, start)):
        return None
    try:
        return solve_beside_rival(replace(request, method="indirect", guess=None))
    except UnfitMethod:
        return None


def _saves_the_last_stage(request: Request) -> bool:
    """Return true if the last stage has a free burn, so that the final mass is the objective."""
    last = request.arrays.arcs[-1]["stage"]
    return bool(saving_stage(request.arrays, request.state[0]) == last)


def _is_floor(check: ConstraintCheck) -> bool:
    """Return true if a check is on the floor of one arc."""
    return check.key is Check.LOWEST_ALTITUDE and " in arc " in check.name


def _search_by_indirect(request: Request, found: Solution) -> Solution | None:
    """Search by ``indirect`` if collocation found several local optima or is not sure.

    Args:
        request: see :class:`ares_optimizer.request.Request`.
        found: solution of collocation.

    Returns:
        a proven, better solution that keeps its floors, or None.
    """
    if request.deadline.passed or (found.converged and found.notes[LOCAL_OPTIMA] < _SEVERAL):
        return None
    if not _saves_the_last_stage(request):
        return None
    least = found.m_f_kg * (1.0 + _BETTER)
    arrays, start = request.arrays, request.state
    try:
        other = solve_indirect(
            arrays,
            start,
            TwoPointOptions(heating=request.heating),
            deadline=request.deadline,
            verify=False,
        )
        if not other.converged or other.parameters is None or other.m_f_kg <= least:
            return None
        exact = refine_root(request, other.parameters)
    except OptimizerError:
        return None
    if not exact.converged or exact.m_f_kg <= least or below_floor(arrays, start, exact):
        return None
    if depth_below_ground(arrays, exact) > FLOOR_M:
        return None
    return replace(
        exact,
        iterations=found.iterations + other.iterations + exact.iterations,
        restarts=found.restarts + other.restarts + 1,
        solve_ms=found.solve_ms + other.solve_ms + exact.solve_ms,
    )


def _refined_to_root(request: Request, found: Solution) -> Solution | None:
    """Refine a solution to the root of the two-point problem; None if that problem differs."""
    touched = any(check.active and _is_floor(check) for check in found.constraints)
    if touched or found.parameters is None or not found.converged:
        return None
    try:
        exact = refine_root(request, found.parameters)
    except OptimizerError:
        return None
    worse = exact.m_f_kg < found.m_f_kg * (1.0 - _SAME)
    if not _saves_the_last_stage(request):
        worse = exact.delta_v_m_s > found.delta_v_m_s * (1.0 + _SAME)
    if exact.converged and not worse:
        lows = tuple(check for check in found.constraints if _is_floor(check))
        return replace(
            exact,
            constraints=(*exact.constraints, *lows) if exact.constraints else (),
            iterations=found.iterations + exact.iterations,
            restarts=found.restarts,
            solve_ms=found.solve_ms + exact.solve_ms,
            by_legs=min(exact.lengths_s, default=math.inf) < _VANISHING_S,
        )
    return None


def _last_resort(request: Request, found: Solution, steps: list[str]) -> Solution:
    """Try another method after collocation failed.

    If the burns of fixed length almost suffice, any steering that wastes the excess energy is a
    solution; ``direct11`` has few enough unknowns to find a smooth one.
    """
    if saving_stage(request.arrays, request.state[0]) < 0:
        return replace(found, steps=tuple(steps))
    planned = plans_arcs(request.arrays, request.state[0])
    method = "indirect" if planned else "direct11"
    throttled = throttled_ahead(request.arrays, request.state[0]).any()
    if request.deadline.passed or (throttled and not planned):
        return replace(found, steps=tuple(steps))
    try:
        if planned:
            other = solve_beside_rival(replace(request, method=method))
        else:
            other = solve_direct(replace(request, method=method))
    except OptimizerError:
        return replace(found, steps=tuple(steps))
    if not planned and other.converged:
        other = _rated(other)
    below = below_floor(request.arrays, request.state, other)
    kept = other.trajectory is not None and not below
    steps.append(f"{method}: {below}" if other.flyable and below else step(method, other))
    best = other if other.flyable and kept else found
    return replace(best, steps=tuple(steps))


def _rated(solution: Solution) -> Solution:
    """Set the status of a direct solution: optimal only if its last burn is negligible."""
    if solution.last_burn_kg < _NOTHING_KG:
        return replace(solution, reason=next_to_nothing(solution.last_burn_kg))
    reason = "linear-tangent steering; no other method proves it to be the best"
    return replace(solution, status=Status.FEASIBLE, reason=reason)
