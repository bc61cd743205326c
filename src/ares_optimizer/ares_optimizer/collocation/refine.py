# SPDX-License-Identifier: Apache-2.0
"""Refine a local optimum on finer intervals until another integrator confirms its flight."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline, make_interp_spline

from ares_models.floors import Floor
from ares_models.tolerances import FLOOR_M, PRESSURE_SHARE
from ares_optimizer.collocation.arrays import (
    COASTING,
    DYNAMIC_PRESSURE_RULE,
    GUIDED,
    Q_ALPHA_RULE,
    VERTICAL,
)
from ares_optimizer.collocation.costates import Adjoint, adjoint_of
from ares_optimizer.collocation.points import (
    Array,
    FoundOptimum,
    acting_limits,
    hamiltonian_spread,
    is_idle,
    jettison_times_of,
    lowest_in,
    times_of,
)
from ares_optimizer.collocation.search import (
    CORNER,
    LIMITED_MASS,
    LocalOptimum,
    Search,
    again_found,
    refined,
)
from ares_optimizer.collocation.solver import StoppingPoint
from ares_optimizer.collocation.transcription import CollocationProgram
from ares_optimizer.collocation.variables import node_times
from ares_optimizer.plan import with_lengths
from ares_optimizer.proof.checks import (
    constraint_table,
    limits_of,
    lowest_altitude,
    pressures_in,
)
from ares_optimizer.proof.flight import Direction, ProofFlight, Steering, fly
from ares_optimizer.request import Heating
from ares_optimizer.results import SAME_LENGTH
from ares_optimizer.solution import Check, ConstraintCheck

#: Factors on the number of intervals of the refined programs, and of those in which a pressure
#: limit acts: there the turn of coarse directions is overestimated.
_FINER = (1.5, 3.0, 5.0, 9.0)
_FINER_LIMITED = (0.7, 1.5, 3.0, 6.0)
#: Most local optima compared on finer intervals.
_MOST_COMPARED = 3
#: Largest relative spread of the Hamiltonian along a phase, and along one with an active pressure
#: limit: where that begins and ceases to act the multipliers jump within an interval.
SPREAD = 1e-4
PRESSURE_SPREAD = 1e-2
#: Tolerance of the lowest point of a flight against its floor, m.
SAG = 0.5
#: Most solutions with adjusted floors.
_MOST_LEVELS = 3
#: Share of a pressure limit by which a flight may exceed it, and from which intervals are too long:
#: to narrow a limit costs mass.
_OVER = 0.9 * PRESSURE_SHARE
_FAR_OVER = 2e-2
#: Checks of the pressure limits, by kind of constraint.
PRESSURE_CHECKS = {DYNAMIC_PRESSURE_RULE: Check.DYNAMIC_PRESSURE, Q_ALPHA_RULE: Check.Q_ALPHA}
_PRESSURES = set(PRESSURE_CHECKS.values())
#: Tolerances between the ends of a program and of its verification, m and m/s.
_END_M = 2.0
_END_M_S = 1e-2
#: Factors on these in the air, where the direction is interpolated, and where a pressure limit
#: acts, at whose ends the direction jumps within an interval. There a coast adds to the distance
#: what that speed makes of it; the target is judged apart.
_LOOSER = 10.0
_LOOSER_LIMITED = 30.0
#: Angle between thrust and primer beyond which the primer does not steer, rad.
_ASIDE = 1e-2
#: Thrust, relative to the greatest of a phase, at which the direction is not compared.
_LITTLE = 1e-3


@dataclass(frozen=True)
class Proven:
    """Hold a point of a program with the flight that verifies it.

    Attributes:
        found: the point.
        adjoint: its costates.
        steering: the steering of the flight.
        flight: None if no verification is requested.
        checks: of the flight.
        exact: true if the flight ends at the end state of the program.
    """

    found: FoundOptimum
    adjoint: Adjoint
    steering: Steering
    flight: ProofFlight | None
    checks: tuple[ConstraintCheck, ...]
    exact: bool


def refine_solution(search: Search, best: FoundOptimum) -> tuple[Proven, tuple[Floor, ...]]:
    """Refine the best solution until its flight is proven; return it with the floors it keeps."""
    request = search.request
    if acting_limits(best):
        best = _best_on_finer(search, best)
    search.idle = is_idle(best)
    floors = {floor.arc: floor for floor in search.floors if best.program.floor_rows.get(floor.arc)}
    levels = {k: floor.altitude_m for k, floor in floors.items()}
    proven: Proven | None = None
    found = best
    factors = _FINER_LIMITED if acting_limits(best) else _FINER
    for finer in factors:
        if request.deadline.passed:
            break
        there = tuple(floor._replace(altitude_m=levels[k]) for k, floor in floors.items())
        other = refined(search, found, there, finer)
        if other is None and finer < factors[-1]:
            continue
        found = _above_floors(search, other or found, floors, levels)
        adjoint = adjoint_of(found.program, found.point)
        steady = hamiltonian_spread(found, adjoint) <= allowed_spread(found)
        if not steady and finer < factors[-1]:
            continue
        proven = _verified(search, found, adjoint)
        if finer == factors[-1] or all(c.satisfied or c.key in _PRESSURES for c in proven.checks):
            proven = _within_limits(search, proven)
        found = _above_floors(search, proven.found, floors, levels)
        if found is not proven.found:
            proven = _verified(search, found, adjoint_of(found.program, found.point))
        proven = _lifted(search, proven, floors, levels)
        if proven.exact and all(c.satisfied for c in proven.checks):
            break
    if proven is None:
        proven = _verified(search, found, adjoint_of(found.program, found.point))
    return proven, tuple(floors.values())


def _best_on_finer(search: Search, best: FoundOptimum) -> FoundOptimum:
    """Return the solution that is best on finer intervals, and put it first in the search.

    On those of the search a flight exceeds its pressure limits between the states, unseen, and
    gains by that.
    """
    near = [o for o in search.optima if o.found.m_f_kg > (1.0 - LIMITED_MASS) * best.m_f_kg]
    masses: list[tuple[float, LocalOptimum]] = []
    for optimum in near[:_MOST_COMPARED] if len(near) > 1 else ():
        floors = tuple(f for f in search.floors if optimum.found.program.floor_rows.get(f.arc))
        other = refined(search, optimum.found, floors, _FINER_LIMITED[0])
        if other is not None:
            masses.append((other.m_f_kg, optimum))
    if not masses:
        return best
    first = max(masses, key=lambda one: one[0])[1]
    search.optima.remove(first)
    search.optima.insert(0, first)
    return first.found


def allowed_spread(found: FoundOptimum) -> float:
    """Return the largest relative spread of the Hamiltonian of a solution."""
    return PRESSURE_SPREAD if acting_limits(found) else SPREAD


def _above_floors(
    search: Search, found: FoundOptimum, floors: dict[int, Floor], levels: dict[int, float]
) -> FoundOptimum:
    """Solve again with other floors at the states until the flight between them keeps its own."""
    for _ in range(_MOST_LEVELS):
        if not _moved(found, floors, levels):
            break
        again = _with_levels(search, found, levels)
        if again is None:
            break
        found = again
    return found


def _lifted(
    search: Search, proven: Proven, floors: dict[int, Floor], levels: dict[int, float]
) -> Proven:
    """Solve again with higher floors at the states, if the flight that verifies dips below one."""
    flight = proven.flight
    if flight is None or not flight.whole:
        return proven
    raised = {}
    for k, floor in floors.items():
        sag = floor.altitude_m - lowest_altitude(search.arrays, flight, k)
        if math.isfinite(floor.altitude_m) and sag > FLOOR_M:
            raised[k] = levels[k] + sag
    found = _with_levels(search, proven.found, levels | raised) if raised else None
    if found is None:
        return proven
    return _verified(search, found, adjoint_of(found.program, found.point))


def _with_levels(
    search: Search, found: FoundOptimum, levels: dict[int, float]
) -> FoundOptimum | None:
    """Solve again with other floors; return None on failure."""
    for arc, level in levels.items():
        found.program.move_floor(arc, level)
    return _solved_again(search, found)


def _solved_again(search: Search, found: FoundOptimum) -> FoundOptimum | None:
    """Solve a program with changed limits from its solution; return None on failure."""
    program = found.program
    # the multipliers of the other limits may mislead
    ways: tuple[tuple[Array | StoppingPoint, float | None], ...]
    ways = ((found.point, None), (found.point.x, CORNER))
    for begin, mu in ways:
        point = search.solve_in_steps(program, begin, mu, narrow=True)
        if point.solved:
            return again_found(found, program, point)
    return None


def _within_limits(search: Search, proven: Proven) -> Proven:
    """Narrow the pressure limits at states between which the flight exceeds them."""
    factors: dict[tuple[int, int], Array] = {
        key: np.ones(len(rows)) for key, rows in proven.found.program.limit_rows.items()
    }
    for _ in range(_MOST_LEVELS):
        if search.request.deadline.passed or not _narrowed(search, proven, factors):
            break
        proven.found.program.scale_limits(factors)
        found = _solved_again(search, proven.found)
        if found is None:
            break
        proven = _verified(search, found, adjoint_of(found.program, found.point))
    return proven


def _narrowed(search: Search, proven: Proven, factors: dict[tuple[int, int], Array]) -> bool:
    """Narrow the factors on the limits at the states around an excess; return true if any is.

    Args:
        search: of the mission.
        proven: the point on its intervals.
        factors: by the keys of ``limit_rows``, for each row.
    """
    program, flight = proven.found.program, proven.flight
    over = False
    if flight is None:
        return over
    nodes = node_times(program, program.time * proven.found.point.x[program.lengths])
    for (stage, kind), rows in program.limit_rows.items():
        times, values = pressures_in(search.arrays, flight, PRESSURE_CHECKS[kind], stage)
        excess = values / limits_of(search.arrays, PRESSURE_CHECKS[kind])[stage]
        if not 1.0 + _OVER < excess.max(initial=0.0) < 1.0 + _FAR_OVER:
            continue
        over = True
        at = nodes[program.rules["node"][np.isin(program.rules["row"], rows)]]
        ends = np.concatenate(([-math.inf], at, [math.inf]))
        for i in range(len(rows)):
            near = excess[(times >= ends[i]) & (times <= ends[i + 2])].max(initial=0.0)
            if near > 1.0 + _OVER:
                factors[stage, kind][i] *= (1.0 + 0.5 * _OVER) / near
    return over


def _moved(found: FoundOptimum, floors: dict[int, Floor], levels: dict[int, float]) -> bool:
    """Adjust the levels of the floors at the states, so that the flight between them stays above.

    Returns:
        true if a level changed.
    """
    moved = False
    for k, floor in floors.items():
        if not math.isfinite(floor.altitude_m):
            continue
        sag = floor.altitude_m + SAG - lowest_in(found, k)
        if sag > SAG or (sag < -SAG and levels[k] > floor.altitude_m + SAG):
            levels[k] = max(floor.altitude_m, levels[k] + sag)
            moved = True
    return moved


def _verified(search: Search, found: FoundOptimum, adjoint: Adjoint) -> Proven:
    """Fly a point of a program by another integrator, if the request asks to verify.

    Directions that no price of propellant settles are always flown: they need fine intervals.
    """
    program, point, request = found.program, found.point, search.request
    steering = steering_of(program, point, adjoint)
    if not (request.verify or search.idle):
        return Proven(found, adjoint, steering, None, (), exact=True)
    times = times_of(program, point.x, apart=0.0)
    planned = with_lengths(search.arrays, search.start[0], times.lengths)
    flight = fly(
        planned,
        search.start[0],
        steering,
        jettison_times_of(program, point.x, times),
        times.cutoff,
        [float(t) for t in adjoint.time[np.flatnonzero(np.diff(adjoint.phase)) + 1]],
    )
    held = Heating.IGNORED if request.heating is Heating.IGNORED else Heating.AT_JETTISON
    checks = constraint_table(planned, search.start[0], flight, held)
    off = flight.final[:6] - adjoint.state[-1]
    loose, coasted = 1.0, 0.0
    if program.phases["in_air"].any():
        loose = _LOOSER_LIMITED if acting_limits(found) else _LOOSER
        coasting = np.flatnonzero(program.steering == COASTING)
        coasted = program.time * float(point.x[program.lengths[coasting]].sum())
    exact = bool(
        np.linalg.norm(off[:3]) < loose * (_END_M + _END_M_S * coasted)
        and np.linalg.norm(off[3:]) < loose * _END_M_S
    )
    return Proven(found, adjoint, steering, flight, checks, exact)


def steering_of(program: CollocationProgram, point: StoppingPoint, adjoint: Adjoint) -> Steering:
    """Return the steering of a point: along the primer where thrust and primer agree.

    There is no primer where propellant has no price, for example where burns of fixed length give
    excess energy: the directions are interpolated instead. So they are in the air, where the rate
    of the primer is not known.
    """
    laws: dict[int, Callable[[float], Array]] = {}
    for p, phase in enumerate(program.phases):
        if phase["steering"] == COASTING:
            continue
        rows = np.flatnonzero(adjoint.phase == p)
        if phase["steering"] == VERTICAL:
            laws[p] = make_interp_spline(adjoint.time[rows], adjoint.direction[rows], k=1)
            continue
        controls = program.control_of[p]
        u = point.x[controls[:, None] + np.arange(3)]
        times = adjoint.time[rows]
        if phase["steering"] == GUIDED and not phase["in_air"]:
            primer = adjoint.by_velocity[rows]
            size = np.linalg.norm(primer, axis=1)
            along = (primer[1:] * u).sum(axis=1) / np.maximum(size[1:], 1e-300)
            known = times[-1] if phase["from_end"] else times[0]
            thrust = phase["thrust"] + phase["thrust_slope"] * (times[1:] - known) / program.time
            along[thrust < _LITTLE * thrust.max()] = 1.0
            if size.min() > 0.0 and along.min() > math.cos(_ASIDE) and np.ptp(times) > SAME_LENGTH:
                laws[p] = CubicHermiteSpline(times, primer, -adjoint.by_position[rows])
                continue
        laws[p] = _interpolated(program, p, times, u)
    begins = [float(adjoint.time[np.argmax(adjoint.phase == p)]) for p in laws]
    numbers = list(laws)

    def steering(begin: float, end: float) -> Direction:
        middle = 0.5 * (begin + end)
        index = max(0, int(np.searchsorted(begins, middle + 1e-9)) - 1)
        law = laws[numbers[index]]

        def at(t: float) -> Array:
            vector = np.asarray(law(t))
            return vector / math.sqrt(vector @ vector)

        return at

    return steering


def _interpolated(
    program: CollocationProgram, p: int, times: Array, u: Array
) -> Callable[[float], Array]:
    """Interpolate the directions at the Radau points of a phase by modified Akima cubics.

    They hardly overshoot where the direction jumps at the end of a pressure limit.
    """
    if times[-1] - times[0] < SAME_LENGTH or program.steering[p] != GUIDED:
        return lambda _: u[-1]
    return Akima1DInterpolator(times[1:], u, method="makima", extrapolate=True)
