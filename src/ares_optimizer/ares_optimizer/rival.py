# SPDX-License-Identifier: Apache-2.0
"""Compare an extremal with a direct solution: necessary conditions are not sufficient.

Close to cut-off the two-point problem has a root that leaves the target, flies a loop of several
hundred seconds and returns. It meets Pontryagin's conditions and every constraint, but is not
optimal.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, MissionArrays
from ares_models.kernels.targets import desired_state, plane_normal, project_to_plane
from ares_models.kernels.vectors import Vector, cross, dot, load, norm, sub
from ares_optimizer.direct.free_arcs import reach_without
from ares_optimizer.direct.search import SearchResult, find_direct, steering_laws
from ares_optimizer.indirect.solve import solve_indirect
from ares_optimizer.indirect.solver import IndirectGuess, TwoPointOptions
from ares_optimizer.plan import (
    held_ahead,
    last_begin,
    plans_arcs,
    spent,
    throttled_ahead,
    with_lengths,
)
from ares_optimizer.registry import DIRECT_METHODS
from ares_optimizer.request import Heating, Request
from ares_optimizer.solution import (
    Cause,
    OptimizerError,
    Solution,
    Status,
    UnfitMethod,
    next_to_nothing,
)

_SAME_KG = 1.0
_RIVAL_NOTE = "direct11_m_f_kg"
#: Time limit of a direct solution of a mission with free arcs, s; over long coasts it often fails.
_RIVAL_S = 1.0
#: Time limit of the search for a flight without free burns, s.
_NOTHING_SOUGHT_S = 3.0
#: Ratio to the velocity of a transfer in two successive manoeuvres from which a flight is a detour.
_DETOUR = 2.0
#: Factor on the ideal velocity of fixed burns: drops in flight add to that of the full stacks.
_LIGHTER = 1.05


@dataclass(frozen=True)
class Rival:
    """Hold a direct solution of the same flight.

    Attributes:
        found: outcome of the direct method.
    """

    found: SearchResult

    def is_better_than(self, solution: Solution) -> bool:
        """Return true if it cuts off earlier than a solution."""
        margin = _SAME_KG / self.found.transcription.flow_kg_s
        return self.found.converged and not solution.t_meco_s <= self.found.cutoff_s + margin

    @property
    def m_f_kg(self) -> float:
        """Return the final mass, kg."""
        return float(self.found.final[7])

    def guess(self) -> IndirectGuess:
        """Return its steering as costates at the start: lambda_v = B, lambda_r = -A (Eq. 3.34)."""
        # the last of the start: a drop there lies before it, by the solver's tolerance
        start = self.found.transcription.problem.start_time
        laws = steering_laws(self.found.transcription, self.found.variables)
        law = next((law for law in reversed(laws) if law.time <= start), laws[0])
        drops = dict(
            zip(self.found.transcription.heating_jettisons, self.found.drop_times_s, strict=True)
        )
        return IndirectGuess(
            (float(law.direction[0]), float(law.direction[1]), float(law.direction[2])),
            (-float(law.rate[0]), -float(law.rate[1]), -float(law.rate[2])),
            self.found.cutoff_s,
            tuple(drops[j] for j in sorted(drops)),
        )


def find_rival(request: Request) -> Rival | None:
    """Solve by ``direct11`` from its sweep; return None where no search is possible."""
    arrays, start = request.arrays, request.state[0]
    try:
        return Rival(
            find_direct(arrays, start, "direct11", request.heating, None, request.deadline)
        )
    except OptimizerError:
        return None


def ample_delta_v(arrays: MissionArrays, start: NDArray[np.void]) -> float:
    """Return an upper estimate of the velocity needed, m/s: change speed, then place.

    The end point is that of the target on the ray through the current position; a displacement d
    needs 2 sqrt(a d) from rest to rest at thrust acceleration a.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
    """
    r = load(start[0]["position"])
    v = load(start[0]["velocity"])
    wanted_r, wanted_v = _end_above(arrays, start)
    last = arrays.arcs[-1]
    mass = float(last["stack_mass"])
    if start[0]["mass"] > 0.0:
        mass = min(mass, float(start[0]["mass"]))
    acceleration = float(last["thrust"]) / mass
    distance = norm(sub(wanted_r, r))
    return norm(sub(wanted_v, v)) + 2.0 * math.sqrt(acceleration * distance)


def _end_above(arrays: MissionArrays, start: NDArray[np.void]) -> tuple[Vector, Vector]:
    """Return position, m, and velocity, m/s, of the target on the current position's ray."""
    r = load(start[0]["position"])
    v = load(start[0]["velocity"])
    target = arrays.target[0]
    mu = float(arrays.environment[0]["mu"])
    normal, _ = plane_normal(target, r, cross(r, v))
    wanted_r, wanted_v, _ = desired_state(target, mu, project_to_plane(r, normal), normal)
    return wanted_r, wanted_v


def fixed_burns_fall_short(arrays: MissionArrays, start: NDArray[np.void]) -> bool:
    """Return true if the fixed burns lack the energy for the target.

    This holds for any steering: the speed at ground level, w = sqrt(2 (E + mu/r)), has a rate of at
    most T/m, as w dw = dE = (T/m) . V dt and |V| <= w.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
    """
    mu = float(arrays.environment[0]["mu"])
    ground = float(arrays.environment[0]["polar_radius"])

    def at_ground(r: Vector, v: Vector) -> float:
        return math.sqrt(max(0.0, dot(v, v) + 2.0 * mu * (1.0 / ground - 1.0 / norm(r))))

    wanted = at_ground(*_end_above(arrays, start))
    gain = wanted - at_ground(load(start[0]["position"]), load(start[0]["velocity"]))
    mass = float(start[0]["mass"])
    for arc in arrays.arcs[int(start[0]["arc"]) :]:
        if arc["begins_stage"] == 1:
            mass = float(arc["stack_mass"])
        if arc["kind"] == BURN and math.isfinite(arc["duration"]):
            after = mass - float(arc["mass_flow"] * arc["duration"])
            gain -= _LIGHTER * float(arc["exhaust_velocity"]) * math.log(mass / after)
            mass = after
    return gain > 0.0


def detour_line(arrays: MissionArrays, start: NDArray[np.void], solution: Solution) -> str:
    """Return a line if a solution spends far more velocity than needed, else ""."""
    spent = sum(arc.delta_v_m_s for arc in solution.arcs)
    ample = ample_delta_v(arrays, start)
    if spent <= _DETOUR * ample:
        return ""
    return (
        f"no optimum found: the extremal that was found spends {spent:,.0f} m/s on a detour to a "
        f"target that {ample:,.0f} m/s should reach"
    )


def beside_rival(
    request: Request, solution: Solution, extremal: Callable[[IndirectGuess], Solution]
) -> Solution:
    """Compare the result of the indirect method with a direct solution.

    A better direct solution is the next guess; an extremal that is still worse is not optimal.
    Without a direct solution, an extremal with a detour is not accepted.

    Args:
        request: request of the indirect method.
        solution: its result, converged or not.
        extremal: solves by the indirect method from another guess.
    """
    began = time.perf_counter()
    rival = None if request.deadline.passed else find_rival(request)
    if rival is None or not rival.found.converged:
        detour = detour_line(request.arrays, request.state, solution) if solution.converged else ""
        return replace(solution, status=Status.NOT_OPTIMAL, reason=detour) if detour else solution
    if rival.is_better_than(solution):
        again = extremal(rival.guess())
        better = again.converged and not rival.is_better_than(again)
        solution = replace(
            again if better else solution,
            iterations=solution.iterations + rival.found.iterations + again.iterations,
            restarts=solution.restarts + again.restarts + 1,
            solve_ms=solution.solve_ms + 1e3 * (time.perf_counter() - began),
        )
        if solution.converged and not better:
            solution = replace(
                solution,
                status=Status.NOT_OPTIMAL,
                reason=f"no optimum found: the extremal that was found reaches "
                f"{solution.m_f_kg:,.1f} kg, direct11 {rival.m_f_kg:,.1f} kg",
            )
    return replace(solution, notes={**solution.notes, _RIVAL_NOTE: rival.m_f_kg})


def solve_beside_rival(request: Request) -> Solution:
    """Solve by an indirect method and compare with a direct solution.

    Raises:
        OptimizerError: the guess or the mission is not valid for the method.
    """
    arrays, state, guess = request.arrays, request.state, request.guess
    if request.heating is Heating.FROM_JETTISON:
        raise UnfitMethod(
            f"heating is 'from_jettison'; {request.method} takes at_jettison or ignored"
        )
    if isinstance(guess, Solution) and guess.method in DIRECT_METHODS:
        guess = _costates_of(request, guess)
    options = TwoPointOptions(
        propagator="closed_form" if request.method == "closed_form" else "runge_kutta",
        heating=request.heating,
    )

    def extremal(guess: Any) -> Solution:
        return solve_indirect(
            arrays,
            state,
            options,
            guess=guess,
            deadline=request.deadline,
            verify=request.verify,
        )

    solution = extremal(guess)
    if plans_arcs(arrays, state[0]):
        judged = _beside_planned(request, options, solution)
        believed = not request.verify or _RIVAL_NOTE in judged.notes
        if judged.converged and believed:
            return judged
        return _without_free_burns(request, judged)
    # no direct method flies throttled burns
    if throttled_ahead(arrays, state[0]).any():
        return solution
    if solution.converged and not request.verify and not detour_line(arrays, state, solution):
        return solution
    return beside_rival(request, solution, extremal)


def _beside_planned(
    request: Request, options: TwoPointOptions, solution: Solution, again: bool = True
) -> Solution:
    """Compare an extremal with free arcs with a direct solution at the same lengths.

    If that is better, the extremal found from it is solved again with free lengths.

    Args:
        request: request of the indirect method.
        options: of the indirect method.
        solution: its result.
        again: follow up a better direct solution.
    """
    start = request.state
    throttled = throttled_ahead(request.arrays, start[0]).any()
    if not solution.converged or not request.verify or throttled:
        return solution
    planned = with_lengths(request.arrays, start[0], np.array(solution.lengths_s))
    beside = replace(request, arrays=planned, deadline=request.deadline.within(_RIVAL_S))
    followed: list[Solution] = []

    def extremal(guess: Any) -> Solution:
        followed.append(
            solve_indirect(planned, start, options, guess=guess, deadline=request.deadline)
        )
        return followed[-1]

    judged = beside_rival(beside, solution, extremal)
    if not followed:
        return judged
    there = followed[-1].parameters
    if not (again and followed[-1].converged) or there is None or solution.parameters is None:
        cause = _worse_extremal(judged)
        return judged if judged.lengths_s else replace(solution, **cause._asdict())
    count = len(solution.lengths_s)
    first = there.size - 3 * len(held_ahead(request.arrays, start[0]))
    ends = solution.parameters[first : first + count]
    found = solve_indirect(
        request.arrays,
        start,
        options,
        guess=np.concatenate([there[:first], ends, there[first:]]),
        deadline=request.deadline,
    )
    return _beside_planned(request, options, found, again=False)


def _without_free_burns(request: Request, solution: Solution) -> Solution:
    """Return a solution, or a ``direct11`` flight almost without free burns.

    If the burns of fixed length reach the target alone, the two-point problem has no root for this
    flight.

    Args:
        request: request of the indirect method.
        solution: its result, not compared with a direct solution, or not converged.
    """
    arrays, start = request.arrays, request.state[0]
    if throttled_ahead(arrays, start).any() or fixed_burns_fall_short(arrays, request.state):
        return solution
    flown = reach_without(replace(request, deadline=request.deadline.within(_NOTHING_SOUGHT_S)))
    if flown is None:
        return solution
    propellant_kg = _free_propellant_kg(request, flown)
    if solution.converged and _free_propellant_kg(request, solution) < propellant_kg + _SAME_KG:
        return solution
    return replace(
        flown,
        method=solution.method,
        reason=next_to_nothing(propellant_kg),
        # those of the direct method are no unknowns of the two-point problem
        parameters=None,
        iterations=solution.iterations + flown.iterations,
        restarts=solution.restarts + flown.restarts + 1,
        solve_ms=solution.solve_ms + flown.solve_ms,
        notes={**flown.notes, _RIVAL_NOTE: flown.m_f_kg},
    )


def _free_propellant_kg(request: Request, solution: Solution) -> float:
    """Return the propellant of the free burns of a solution, kg."""
    start = request.state[0]
    lengths = np.array(solution.lengths_s)
    burn = solution.t_meco_s - last_begin(request.arrays, start, lengths)
    return spent(request.arrays, start, lengths, burn)


def _worse_extremal(better: Solution) -> Cause:
    """Return the cause of an extremal that is worse than a direct solution at the same lengths."""
    return Cause(
        Status.NOT_OPTIMAL,
        f"no optimum found: with arcs of the same lengths {better.m_f_kg:,.1f} kg can be reached",
    )


def _costates_of(request: Request, solution: Solution) -> IndirectGuess:
    """Convert a direct solution to a guess of the two-point problem.

    Raises:
        OptimizerError: it has no costates.
    """
    if solution.costates is None:
        raise OptimizerError("guess: the solution has no costates; solve it with verify")
    limits = [
        (float(jettison["value"]), at)
        for jettison, at in zip(request.arrays.jettisons, solution.jettison_times_s, strict=True)
        if jettison["criterion"] == HEATING_LIMIT and math.isfinite(at)
    ]
    free = limits if request.heating is Heating.AT_JETTISON else []
    lambda_v = solution.costates.lambda_v[0]
    lambda_r = solution.costates.lambda_r[0]
    return IndirectGuess(
        tuple(lambda_v),
        tuple(lambda_r),
        solution.t_meco_s,
        tuple(at for _, at in free),
        tuple(pi * limit for pi, (limit, _) in zip(solution.costates.jump_pi, free, strict=False)),
    )
