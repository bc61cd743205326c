# SPDX-License-Identifier: Apache-2.0
"""Solve a mission by collocation: several starts, the best refined and proven."""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator, CubicHermiteSpline
from scipy.linalg import qr

from ares_models.arrays import (
    BURN,
    COAST,
    HEATING_LIMIT,
    MISSION_TIME,
    TIME_AFTER_IGNITION,
    MissionArrays,
)
from ares_models.floors import Floor, edge_of_air, floors_of
from ares_models.judge import judge
from ares_models.kernels.environment import altitude, heating_rate
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.arrays import COASTING, GUIDED
from ares_optimizer.collocation.costates import Adjoint, adjoint_of, costates_of, spread_of
from ares_optimizer.collocation.guess import Trial, guess_of, node_times, trials
from ares_optimizer.collocation.solver import LOCALLY_INFEASIBLE, Point, solve_program
from ares_optimizer.collocation.transcription import Times, Transcription, Turning
from ares_optimizer.kernels import timetable
from ares_optimizer.pieces import first_ignitions
from ares_optimizer.plan import SHORTEST, free_arcs, length_bounds, saving_stage, with_lengths
from ares_optimizer.proof.checks import constraint_table, verification
from ares_optimizer.proof.flight import Direction, Flight, Steering, fly
from ares_optimizer.proof.held import held_checks, held_offsets
from ares_optimizer.request import Heating, Request
from ares_optimizer.sensitivities import target_sensitivities
from ares_optimizer.solution import (
    NOTHING_SAVED,
    OPTIMAL,
    OUT_OF_TIME,
    Cause,
    Check,
    ConstraintCheck,
    Solution,
    Status,
    SteeringArc,
    Trajectory,
    UnfitMethod,
    failed,
    next_to_nothing,
)
from ares_optimizer.targets import in_unit, target_rows

Array = NDArray[np.float64]

METHOD = "collocation"
#: Note of a solution: number of local optima that the starts led to.
LOCAL_OPTIMA = "collocation_valleys"
#: Relative difference of mass within which two solutions are the same local optimum. On coarse
#: intervals floors hold at the states only.
SAME_MASS = 3e-4
#: Difference of the lengths of free arcs, relative and in s, beyond which two solutions differ.
_SAME_ARCS = 0.02
_SAME_ARC_S = 1.0
#: The search ends when so many starts led to the best solution. With a free coast it also needs so
#: many starts, of which no other solution came from any and so few failed.
_ENOUGH = 3
_LEAST_STARTS = 5
_FAILED = 1
#: Least number of starts that led to a solution called optimal.
_LEAST_MET = 2
#: Miss of a trial flight beyond which a start mostly fails, slowly.
_FAR_OFF = 0.3
#: Most starts of a search.
_MOST_STARTS = 12
#: Time by which an event is moved past another, s.
_MOVES_S = (1.0, 0.1)
#: Most such moves in a row, and least relative gain of mass to continue.
_MOST_MOVES = 3
_GAINED = 1e-7
#: Propellant fraction of the last stage in the search for the shortfall of propellant.
_MOST_PROPELLANT = 0.97
#: Iterations from a first guess; longer searches mostly fail or repeat a solution.
_MOST_FIRST = 100
#: Factors on the number of intervals of the refined programs.
_FINER = (1.5, 3.0, 5.0)
#: Largest relative spread of the Hamiltonian along a phase.
SPREAD = 1e-4
#: Tolerance of the lowest point of a flight against its floor, m.
_SAG = 0.5
#: Depth below ground at which an arc without a floor gets one, m.
_DEEP_M = 1.0
#: Such a floor is so far below the start of the flight, m.
_BELOW_START_M = 1e3
#: Most solutions with adjusted floors.
_MOST_LEVELS = 3
#: Depth below a floor between the states, m, beyond which the intervals are too long.
_SAGS = 1e3
#: Altitude above a floor within which it is active, m.
_ACTIVE = 10.0
#: Distance within which the bound of a variable is active.
_AT_BOUND = 1e-6
#: Curvature, relative to the greatest, that counts as zero.
_STRAIGHT = 1e-7
#: Multiplier above which a limit is active.
_BINDING = 1e-8
#: Multipliers of the motion below which no propellant can be saved, and the linear cost that
#: then aligns the directions of thrust.
_IDLE = 1e-6
_ALIGNING = 1e-4
#: Tolerances between the ends of a program and of its verification, m and m/s.
_END_M = 2.0
_END_M_S = 1e-2
#: Samples of a coast per state.
_SAMPLES = 8
#: Initial barrier parameter near a solution.
_NEAR = 1e-4
_CORNER = 1e-6
#: Angle between thrust and primer beyond which the primer does not steer, rad.
_ASIDE = 1e-2
#: Thrust, relative to the greatest of a phase, at which the direction is not compared.
_LITTLE = 1e-3
_SAME_LENGTH = 1e-3  # s
_NOTHING_KG = 0.1


@dataclass(frozen=True)
class Found:
    """Hold a local optimum.

    Attributes:
        program: the program.
        point: its solution.
        m_f_kg: the mass that is maximised, see :func:`mass_of`.
    """

    program: Transcription
    point: Point
    m_f_kg: float


def solve_collocation(request: Request, beat_kg: float | None = None) -> Solution:
    """Solve a mission by collocation.

    Args:
        request: see :class:`ares_optimizer.request.Request`.
        beat_kg: refine the best solution only if its mass is at least this; None: always.

    Raises:
        UnfitMethod: the heating limit must hold from the jettison on.

    Returns:
        the best solution of all starts. CONVERGED: first- and second-order conditions are met,
        the Hamiltonian is constant within :data:`SPREAD`, and another integrator confirms the
        flight. FEASIBLE: the flight reaches the target, but one of these fails.
    """
    began = time.perf_counter()
    arrays, start = request.arrays, request.state
    if request.heating is Heating.FROM_JETTISON:
        raise UnfitMethod("heating is 'from_jettison'; collocation takes at_jettison or ignored")
    if request.heating is Heating.IGNORED:
        arrays = _dropped_at_ignition(arrays)
    floors = floors_of(arrays, start)
    search = _Search(arrays, start, floors, request)
    for trial in islice(trials(arrays, start, floors), _MOST_STARTS):
        if request.deadline.passed or search.is_conclusive:
            break
        search.try_start(trial)
    cause = search.failure()
    if search.best is None and beat_kg is None and not request.deadline.passed:
        cause = _short_of_propellant(search, cause)
    best = search.best
    elapsed = 1e3 * (time.perf_counter() - began)
    if best is None or (beat_kg is not None and best.m_f_kg < beat_kg):
        return replace(
            failed(METHOD, cause, iterations=search.iterations, solve_ms=elapsed),
            restarts=max(0, search.starts - 1),
        )
    return _refined_solution(search, best, began)


def _dropped_at_ignition(arrays: MissionArrays) -> MissionArrays:
    """Return the mission with heating jettisons at the ignition of their stages."""
    jettisons = arrays.jettisons.copy()
    waiting = jettisons["criterion"] == HEATING_LIMIT
    jettisons["criterion"][waiting] = TIME_AFTER_IGNITION
    jettisons["value"][waiting] = 0.0
    return arrays._replace(jettisons=jettisons)


@dataclass
class LocalOptimum:
    """Hold a local optimum and the number of starts that led to it.

    Attributes:
        found: its best solution.
        lengths: of its free arcs, s.
        met: number of starts that led to it.
    """

    found: Found
    lengths: Array
    met: int = 1

    def holds(self, found: Found, lengths: Array) -> bool:
        """Return true if a solution is this local optimum."""
        near = SAME_MASS * self.found.m_f_kg
        if abs(found.m_f_kg - self.found.m_f_kg) > near:
            return False
        allowed = _SAME_ARCS * np.maximum(self.lengths, lengths) + _SAME_ARC_S
        return bool((np.abs(self.lengths - lengths) <= allowed).all())


class _Search:
    """Hold all starts of one mission.

    Attributes:
        added: floors that the mission lacks, of arcs that went below the ground.
        optima: the local optima, the best first.
        starts: number of starts tried.
        iterations: of all starts.
        idle: true if no thrust direction of the best solution can save propellant.
    """

    def __init__(
        self,
        arrays: MissionArrays,
        start: NDArray[np.void],
        floors: tuple[Floor, ...],
        request: Request,
    ) -> None:
        self.arrays, self.start, self.floors = arrays, start, floors
        self.request = request
        self.added: tuple[Floor, ...] = ()
        self.optima: list[LocalOptimum] = []
        self.starts = 0
        self.iterations = 0
        self.idle = False
        self._violations: list[tuple[float, str]] = []
        self._unproven = False
        r = start["position"][0]
        self._start_m = float(altitude(tuple(r), arrays.environment[0]))

    @property
    def best(self) -> Found | None:
        """Return the local optimum with the greatest mass."""
        return self.optima[0].found if self.optima else None

    @property
    def again(self) -> int:
        """Count the starts that led to the mass of the best solution."""
        if not self.optima:
            return 0
        least = (1.0 - SAME_MASS) * self.optima[0].found.m_f_kg
        return sum(optimum.met for optimum in self.optima if optimum.found.m_f_kg >= least)

    @property
    def is_conclusive(self) -> bool:
        """Return true if enough starts led to the best solution.

        A free coast may have several local optima: all starts are tried, unless the first ones,
        which cover the lengths, led to a single one.
        """
        if self.again < _ENOUGH:
            return False
        free = free_arcs(self.arrays, self.start[0])
        coasts = [k for k in free if self.arrays.arcs[k]["kind"] == COAST]
        if not coasts:
            return True
        led = sum(optimum.met for optimum in self.optima)
        return (
            len(coasts) == 1
            and self.starts >= _LEAST_STARTS
            and led == self.again >= self.starts - _FAILED
        )

    def try_start(self, trial: Trial) -> None:
        """Solve from a trial flight; skip one far from its target if a solution is known."""
        if self.best is not None and trial.miss > _FAR_OFF:
            return
        self.starts += 1
        found = self._solved(trial)
        if found is not None and (deep := self._underground(found)):
            # floor of these arcs: _BELOW_START_M below the start, at most the edge of the air
            level = max(0.0, min(self._start_m - _BELOW_START_M, edge_of_air(self.arrays)))
            added = tuple(Floor(k, level, math.nan, said=True) for k in deep)
            self.floors += added
            self.added += added
            found = self._solved(trial)
        if found is not None and not self._underground(found):
            self.keep(found)
        elif found is not None:
            self._unproven = True

    def _underground(self, found: Found) -> list[int]:
        """Return the arcs without a floor that a flight flies below the ground."""
        rows = found.program.floor_rows
        return [
            k
            for k in found.program.arc_phases
            if not rows.get(k) and lowest_in(found, k) < -_DEEP_M
        ]

    def _solved(self, trial: Trial) -> Found | None:
        """Solve from a trial flight; return None on failure."""
        floors = floors_on(self.floors, self._start_m, trial)
        try:
            program = Transcription(self.arrays, self.start, trial.times, floors)
        except ValueError:
            self._unproven = True
            return None
        point = solve_program(
            program, guess_of(program, trial), self.request.deadline, most=_MOST_FIRST
        )
        self.iterations += point.iterations
        if not point.solved:
            if point.status == LOCALLY_INFEASIBLE:
                self._violations.append((point.violation, worst_row(program, point)))
            else:
                self._unproven = True
            return None
        known = Found(program, point, mass_of(program, point))
        found = known if not self._dips_below_floor(known) else self._retranscribed(known, floors)
        if found is None:
            self._unproven = True
            return None
        for _ in range(_MOST_MOVES):
            better = self._reordered(found, floors)
            if better is None:
                break
            found = better
        return found

    def _dips_below_floor(self, found: Found) -> bool:
        """Return true if a coast dips below a floor between its states."""
        return any(
            lowest_in(found, floor.arc) < floor.altitude_m - _SAGS
            for floor in self.floors
            if found.program.floor_rows.get(floor.arc)
        )

    def _retranscribed(self, found: Found, floors: tuple[Floor, ...]) -> Found | None:
        """Solve on intervals for the lengths of a solution; return None on failure."""
        again = _refined(self, found, floors, 1.0)
        return again if again is None or not self._dips_below_floor(again) else None

    def _reordered(self, found: Found, floors: tuple[Floor, ...]) -> Found | None:
        """Solve with two events in the other order; return None where that is no better.

        A fairing may drop in another arc, and the limit of a throttle may be reached in another
        burn or in none, than in the trial flight.
        """
        for times in moved_events(found):
            try:
                program = Transcription(self.arrays, self.start, times, floors)
            except ValueError:
                continue
            guess = finer_guess(program, found.program, found.point.x)
            point = solve_program(
                program, guess, self.request.deadline, mu=_CORNER, most=_MOST_FIRST
            )
            self.iterations += point.iterations
            if point.solved and mass_of(program, point) > found.m_f_kg * (1.0 + _GAINED):
                return Found(program, point, mass_of(program, point))
        return None

    def keep(self, found: Found) -> None:
        """Store a local optimum, or count it with a known one."""
        lengths = times_of(found.program, found.point.x).lengths
        for optimum in self.optima:
            if optimum.holds(found, lengths):
                optimum.met += 1
                if found.m_f_kg > optimum.found.m_f_kg:
                    optimum.found, optimum.lengths = found, lengths
                break
        else:
            self.optima.append(LocalOptimum(found, lengths))
        self.optima.sort(key=lambda optimum: -optimum.found.m_f_kg)

    def failure(self) -> Cause:
        """Return the cause of a search without solution."""
        if self.best is not None:
            return Cause(Status.NOT_OPTIMAL, "no better solution was found")
        if self.request.deadline.passed:
            return OUT_OF_TIME
        if self._violations and not self._unproven:
            violation, name = min(self._violations)
            return Cause(
                Status.INFEASIBLE,
                f"no flight to the target exists near any of {self.starts} starts: the least "
                f"violation is {violation:.2g}, of {name}",
            )
        if not self.starts:
            return Cause(
                Status.ILLEGAL_START,
                "no flight can be laid out: the last burn does not begin, or too many events",
            )
        return Cause(Status.STALLED, f"no flight to the target found from {self.starts} starts")


def with_more_propellant(arrays: MissionArrays) -> MissionArrays:
    """Return the mission with a last stage that is nearly all propellant."""
    arcs = arrays.arcs.copy()
    last = arcs["stage"] == arcs[-1]["stage"]
    most = _MOST_PROPELLANT * float(arcs["stack_mass"][last][0])
    arcs["propellant"][last] = max(float(arcs[-1]["propellant"]), most)
    return arrays._replace(arcs=arcs)


def _short_of_propellant(search: _Search, cause: Cause) -> Cause:
    """Return the cause of a failed search, with the shortfall of propellant if any.

    The search is repeated with more propellant in the last stage. A solution that needs no more
    than the mission has goes to the search of the mission.
    """
    arrays = with_more_propellant(search.arrays)
    arcs = arrays.arcs
    last = arcs["stage"] == arcs[-1]["stage"]
    usable = float(search.arrays.arcs[-1]["propellant"])
    if not np.isinf(arcs["duration"][last]).any() or usable >= arcs[-1]["propellant"]:
        return cause
    more = _Search(arrays, search.start, search.floors, search.request)
    for trial in trials(more.arrays, search.start, search.floors):
        if search.request.deadline.passed or more.is_conclusive:
            break
        more.try_start(trial)
    search.iterations += more.iterations
    if more.best is None:
        return cause
    program, x = more.best.program, more.best.point.x
    stages = arcs["stage"][program.segments["arc"]]
    members = np.flatnonzero(stages == arcs[-1]["stage"])
    burnt = program.mass * float((x[program.masses[members]] - x[program.ends[members]]).sum())
    if burnt <= usable:
        search.starts += more.starts
        search.keep(more.best)
        return cause
    return Cause(
        Status.INFEASIBLE,
        f"propellant of the last stage: {burnt - usable:,.0f} kg short, the best flight takes "
        f"{burnt:,.0f} kg of {usable:,.0f} kg",
    )


def worst_row(program: Transcription, point: Point) -> str:
    """Return the name of the row with the largest violation."""
    rows = np.zeros(program.row_lower.size)
    program.rows(point.x, rows)
    off = np.maximum(program.row_lower - rows, rows - program.row_upper)
    return program.names[int(np.argmax(off))]


def mass_of(program: Transcription, point: Point) -> float:
    """Return the mass at the end of the last stage with a free burn, kg."""
    return float(point.x[program.ends[program.saving]] * program.mass)


def moved_events(found: Found) -> Iterator[Times]:
    """Yield times with an event moved past another that it coincides with."""
    program, x = found.program, found.point.x
    lengths = x[program.lengths] * program.time
    for move in _MOVES_S:
        for phases in program.arc_phases.values():
            for p in phases:
                if len(phases) > 1 and lengths[p] <= _SAME_LENGTH:
                    times = _moved_times(program, times_of(program, x), phases, p, move)
                    if times is not None:
                        yield times


def _moved_times(
    program: Transcription, times: Times, phases: list[int], p: int, move: float
) -> Times | None:
    """Return the times with the event at a vanished phase moved out of its arc.

    Args:
        program: the program.
        times: of its solution.
        phases: of the arc.
        p: the vanished phase.
        move: time by which to move, s.
    """
    drops = times.drops.copy()
    for number, at in program.drop_ends.items():
        if at == p and p == phases[0]:
            drops[number] -= move
        if at == p - 1 and p == phases[-1]:
            drops[number] += move
    if (drops != times.drops).any():
        return times._replace(drops=drops)
    # limit of a throttle: end the burn before it, or the burn before later
    k = int(program.segments[p]["arc"])
    burn, step = (k, -move) if p == phases[-1] else (_burn_before(program, k), move)
    free = free_arcs(program.arrays, program.start[0])
    if burn == len(program.arrays.arcs) - 1:
        return times._replace(cutoff=times.cutoff + step)
    if burn not in free:
        return None
    moved = times.lengths.copy()
    moved[free.index(burn)] += step
    return times._replace(lengths=moved)


def _burn_before(program: Transcription, k: int) -> int:
    """Return the burn before an arc; -1: none."""
    burns = [b for b in program.arc_phases if b < k and program.arrays.arcs[b]["kind"] == BURN]
    return max(burns, default=-1)


def floors_on(floors: tuple[Floor, ...], start_m: float, trial: Trial) -> tuple[Floor, ...]:
    """Return the active floors: in the ascent a coast may be below the default floor.

    Args:
        floors: of the mission.
        start_m: altitude at the start.
        trial: a flight.
    """
    kept = []
    for floor in floors:
        arcs, heights = trial.track[:, rollout.ARC], trial.track[:, rollout.ALTITUDE]
        before = heights[arcs < floor.arc]
        highest = max(start_m, float(before.max(initial=-math.inf)))
        if floor.said or highest >= floor.altitude_m:
            kept.append(floor)
    return tuple(kept)


# ---- from a coarse program to a proven flight


def times_of(program: Transcription, x: Array) -> Times:
    """Return the free times at a point of a program."""
    begins = float(program.start["time"][0]) + program.time * np.concatenate(
        ([0.0], np.cumsum(x[program.lengths]))
    )
    arrays, start = program.arrays, program.start[0]
    lengths = []
    low, _ = length_bounds(arrays, start)
    for f, k in enumerate(free_arcs(arrays, start)):
        members = program.arc_phases.get(k, [])
        length = float(x[program.lengths[members]].sum()) * program.time if members else 0.0
        past = float(start["time"] - start["arc_start_time"]) if k == start["arc"] else 0.0
        lengths.append(max(length + past, float(low[f])))
    last = program.arc_phases[max(program.arc_phases)][-1]
    cutoff = float(begins[last + 1])
    drops = []
    for number in range(program.waiting):
        p = program.drop_ends.get(number)
        at = program.trial.drops[number] if p is None else float(begins[p + 1])
        drops.append(_at_event(at, begins, p))
    return Times(np.array(lengths), cutoff, np.array(drops))


def _at_event(at: float, begins: Array, p: int | None) -> float:
    """Return the time of a drop, snapped to a coincident event."""
    if p is None:
        return at
    others = np.delete(begins, p + 1)
    nearest = float(others[np.argmin(np.abs(others - at))])
    return nearest if abs(nearest - at) < _SAME_LENGTH else at


def finer_guess(program: Transcription, old: Transcription, x: Array) -> Array:
    """Interpolate the variables of a finer program from those of a coarser one."""
    lengths = x[old.lengths] * old.time
    out = np.zeros(program.size)
    pieces = program.segments
    for p, piece in enumerate(pieces):
        out[program.lengths[p]] = float(piece["end"] - piece["start"]) / program.time
        out[program.masses[p]] = float(piece["mass"]) / program.mass
        out[program.ends[p]] = timetable.segment_mass(piece, piece["end"]) / program.mass
    then, now = node_times(old, lengths), node_times(program)
    states = x[: 6 * old.nodes].reshape(-1, 6)
    steady = np.concatenate(([True], np.diff(then) > 1e-9))
    track = CubicHermiteSpline(
        then[steady], states[steady, :3], states[steady, 3:] * (old.speed / old.radius)
    )
    inside = np.clip(now, then[0], then[-1])
    new = np.column_stack((track(inside), track(inside, 1) * (old.radius / old.speed)))
    new[0] = program.start_state
    for c in range(3, 6):
        new[1:, c] = np.interp(inside[1:], then[steady], states[steady, c])
    out[: 6 * program.nodes] = new.ravel()
    thrust_times, directions = [], []
    for point in old.points:
        if point["control"] >= 0:
            at = int(point["control"])
            thrust_times.append(then[int(point["node"] + point["number"])])
            directions.append(x[at : at + 3])
    if directions:
        table = np.array(directions)
        for point in program.points:
            if point["control"] >= 0:
                t = now[int(point["node"] + point["number"])]
                u = np.array([np.interp(t, thrust_times, table[:, c]) for c in range(3)])
                at = int(point["control"])
                out[at : at + 3] = u / max(float(np.linalg.norm(u)), 1e-9)
    return out


@dataclass(frozen=True)
class _Proven:
    """Hold a point of a program with the flight that verifies it.

    Attributes:
        found: the point.
        adjoint: its costates.
        steering: the steering of the flight.
        flight: None if no verification is requested.
        checks: of the flight.
        exact: true if the flight ends at the end state of the program.
    """

    found: Found
    adjoint: Adjoint
    steering: Steering
    flight: Flight | None
    checks: tuple[ConstraintCheck, ...]
    exact: bool


def _refined_solution(search: _Search, best: Found, began: float) -> Solution:
    """Refine the best solution until its flight is proven."""
    request = search.request
    search.idle = is_idle(best)
    floors = {floor.arc: floor for floor in search.floors if best.program.floor_rows.get(floor.arc)}
    levels = {k: floor.altitude_m for k, floor in floors.items()}
    proven: _Proven | None = None
    found = best
    for finer in _FINER:
        there = tuple(floor._replace(altitude_m=levels[k]) for k, floor in floors.items())
        found = _refined(search, found, there, finer) or found
        for _ in range(_MOST_LEVELS):
            if not _moved(found, floors, levels):
                break
            found = _with_levels(search, found, levels) or found
        adjoint = adjoint_of(found.program, found.point)
        steady = hamiltonian_spread(found, adjoint) <= SPREAD
        if request.deadline.passed and not steady:
            break
        if not steady and finer < _FINER[-1]:
            continue
        proven = _verified(search, found, adjoint)
        if (proven.exact and all(c.satisfied for c in proven.checks)) or request.deadline.passed:
            break
    elapsed = 1e3 * (time.perf_counter() - began)
    if proven is None:
        proven = _verified(search, found, adjoint_of(found.program, found.point))
    return _solution(search, proven, tuple(floors.values()), elapsed)


def _refined(
    search: _Search, found: Found, floors: tuple[Floor, ...], finer: float
) -> Found | None:
    """Solve on finer intervals from a point; return None on failure."""
    times = times_of(found.program, found.point.x)
    try:
        turning = None if search.idle else turning_of(found)
        program = Transcription(
            search.arrays, search.start, times, floors, finer=finer, turning=turning
        )
    except ValueError:
        return None
    guess = finer_guess(program, found.program, found.point.x)
    if search.idle:
        align_directions(program, guess)
    known: Found | None = None
    for mu in (_NEAR, None):
        point = solve_program(program, guess, search.request.deadline, mu=mu)
        search.iterations += point.iterations
        if point.solved and (known is None or mass_of(program, point) > known.m_f_kg):
            known = Found(program, point, mass_of(program, point))
        # the barrier may lead away from the solution nearby
        if known is not None and known.m_f_kg > found.m_f_kg * (1.0 - SAME_MASS):
            break
    return known


def is_idle(found: Found) -> bool:
    """Return true if no direction of the thrust can save propellant."""
    rows = 6 * len(found.program.points)
    return float(np.abs(found.point.multipliers[:rows]).max()) < _IDLE


def align_directions(program: Transcription, x: Array) -> None:
    """Add a linear cost that aligns the directions of each guided phase.

    Used where the mass does not depend on them.
    """
    for p in range(len(program.phases)):
        if program.steering[p] == GUIDED:
            at = program.control_of[p][:, None] + np.arange(3)
            mean = x[at].mean(axis=0)
            program.linear_cost[at] = (
                -_ALIGNING * mean / (len(at) * max(float(np.linalg.norm(mean)), 1e-9))
            )


def turning_of(found: Found) -> Turning | None:
    """Return the turn of the thrust over time; None without thrust."""
    program, x = found.program, found.point.x
    guided = np.flatnonzero(program.points["control"] >= 0)
    if not guided.size:
        return None
    points = program.points[guided]
    times = node_times(program, program.time * x[program.lengths])
    times = times[points["node"] + points["number"]]
    u = x[points["control"][:, None] + np.arange(3)]
    turns = np.arccos(np.clip((u[1:] * u[:-1]).sum(axis=1), -1.0, 1.0))
    # ignore the direction as the thrust vanishes
    turns[np.diff(times) < _SAME_LENGTH] = 0.0
    return Turning(times, np.concatenate(([0.0], np.cumsum(turns))))


def _with_levels(search: _Search, found: Found, levels: dict[int, float]) -> Found | None:
    """Solve again with other floors; return None on failure."""
    program = found.program
    for arc, level in levels.items():
        program.move_floor(arc, level)
    point = solve_program(program, found.point, search.request.deadline)
    search.iterations += point.iterations
    if not point.solved:
        return None
    return Found(program, point, mass_of(program, point))


def _moved(found: Found, floors: dict[int, Floor], levels: dict[int, float]) -> bool:
    """Adjust the levels of the floors at the states, so that the flight between them stays above.

    Returns:
        true if a level changed.
    """
    moved = False
    for k, floor in floors.items():
        if not math.isfinite(floor.altitude_m):
            continue
        sag = floor.altitude_m + _SAG - lowest_in(found, k)
        if sag > _SAG or (sag < -_SAG and levels[k] > floor.altitude_m + _SAG):
            levels[k] = max(floor.altitude_m, levels[k] + sag)
            moved = True
    return moved


def is_saddle(found: Found) -> bool:
    """Return true if the second-order conditions fail: mass can be gained at fixed rows.

    The test is the sign of the least eigenvalue of the Hessian of the Lagrangian in the null space
    of the active rows and bounds (Nocedal and Wright, Numerical Optimization, section 12.5).
    """
    program, point = found.program, found.point
    n, m = program.size, program.row_lower.size
    values = np.zeros(len(program.jacobian_pattern[0]))
    program.jacobian(point.x, values)
    rows = np.zeros((m, n))
    np.add.at(rows, program.jacobian_pattern, values)
    entries = np.zeros(len(program.hessian_pattern[0]))
    program.hessian(point.x, point.multipliers, 1.0, entries)
    hessian = np.zeros((n, n))
    np.add.at(hessian, program.hessian_pattern, entries)
    hessian = np.tril(hessian) + np.tril(hessian, -1).T
    loose = (point.x - program.lower > _AT_BOUND) & (program.upper - point.x > _AT_BOUND)
    holds = (program.row_lower == program.row_upper) | (np.abs(point.multipliers) > _BINDING)
    held = rows[holds][:, loose].T
    free = qr(held)[0][:, held.shape[1] :]
    if not free.size:
        return False
    curvatures = np.linalg.eigvalsh(free.T @ hessian[np.ix_(loose, loose)] @ free)
    return bool(curvatures[0] < -_STRAIGHT * max(1.0, abs(float(curvatures[-1]))))


def hamiltonian_spread(found: Found, adjoint: Adjoint) -> float:
    """Return the relative spread of the Hamiltonian in phases that touch no floor.

    Where a coast touches its floor between two states, the multipliers are at these states, and the
    Hamiltonian changes with the altitude from one to the other.
    """
    program = found.program
    touched = {
        p
        for arc, rows in program.floor_rows.items()
        if rows and np.abs(found.point.multipliers[rows]).max() > _BINDING
        for p in program.arc_phases.get(arc, [])
    }
    spreads = spread_of(program, adjoint)
    return max((s for p, s in spreads.items() if p not in touched), default=0.0)


def lowest_in(found: Found, arc: int) -> float:
    """Return the least altitude in an arc, m, also between its states."""
    program, x = found.program, found.point.x
    phases = program.arc_phases.get(arc, [])
    if not phases:
        return math.inf
    times = node_times(program, x[program.lengths] * program.time)
    states = x[: 6 * program.nodes].reshape(-1, 6)
    inside = slice(int(program.first[phases[0]]), int(program.first[phases[-1] + 1]) + 1)
    times, states = times[inside], states[inside]
    if times[-1] - times[0] < _SAME_LENGTH:
        times, states = times[:1], states[:1]
        grid = states[:, :3] * program.radius
    else:
        keep = np.concatenate(([True], np.diff(times) > 0.0))
        track = CubicHermiteSpline(
            times[keep], states[keep, :3] * program.radius, states[keep, 3:] * program.speed
        )
        grid = track(np.linspace(times[0], times[-1], _SAMPLES * len(times)))
    environment = program.arrays.environment[0]
    return float(min(altitude(tuple(r), environment) for r in grid))


def _verified(search: _Search, found: Found, adjoint: Adjoint) -> _Proven:
    """Fly a point of a program by another integrator, if the request asks to verify."""
    program, point, request = found.program, found.point, search.request
    steering = steering_of(program, point, adjoint)
    if not request.verify:
        return _Proven(found, adjoint, steering, None, (), exact=True)
    times = times_of(program, point.x)
    planned = with_lengths(search.arrays, search.start[0], times.lengths)
    flight = fly(
        planned,
        search.start[0],
        steering,
        jettison_times(program, times),
        times.cutoff,
        [float(t) for t in adjoint.time[np.flatnonzero(np.diff(adjoint.phase)) + 1]],
    )
    held = Heating.IGNORED if request.heating is Heating.IGNORED else Heating.AT_JETTISON
    checks = constraint_table(planned, search.start[0], flight, held)
    off = flight.final[:6] - adjoint.state[-1]
    exact = bool(np.linalg.norm(off[:3]) < _END_M and np.linalg.norm(off[3:]) < _END_M_S)
    return _Proven(found, adjoint, steering, flight, checks, exact)


def steering_of(program: Transcription, point: Point, adjoint: Adjoint) -> Steering:
    """Return the steering of a point: along the primer where thrust and primer agree.

    There is no primer where propellant has no price, for example where burns of fixed length give
    excess energy: the directions are interpolated instead.
    """
    laws: dict[int, Callable[[float], Array]] = {}
    for p, phase in enumerate(program.phases):
        if phase["steering"] == COASTING:
            continue
        rows = np.flatnonzero(adjoint.phase == p)
        controls = program.control_of[p]
        u = point.x[controls[:, None] + np.arange(3)]
        times = adjoint.time[rows]
        if phase["steering"] == GUIDED:
            primer = adjoint.by_velocity[rows]
            size = np.linalg.norm(primer, axis=1)
            along = (primer[1:] * u).sum(axis=1) / np.maximum(size[1:], 1e-300)
            thrust = phase["thrust"] + phase["thrust_slope"] * (times[1:] - times[0]) / program.time
            along[thrust < _LITTLE * thrust.max()] = 1.0
            if size.min() > 0.0 and along.min() > math.cos(_ASIDE) and np.ptp(times) > _SAME_LENGTH:
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
    program: Transcription, p: int, times: Array, u: Array
) -> Callable[[float], Array]:
    """Interpolate the directions at the Radau points of a phase, by a polynomial per interval."""
    d = program.degree
    pieces = [
        BarycentricInterpolator(times[1 + k * d : 1 + (k + 1) * d], u[k * d : (k + 1) * d])
        for k in range(int(program.intervals[p]))
    ]
    begins = times[:-1:d]

    def law(t: float) -> Array:
        k = min(max(int(np.searchsorted(begins, t, side="right")) - 1, 0), len(pieces) - 1)
        return np.asarray(pieces[k](t))

    if times[-1] - times[0] < _SAME_LENGTH or program.steering[p] != GUIDED:
        return lambda _: u[-1]
    return law


def jettison_times(program: Transcription, times: Times) -> tuple[float, ...]:
    """Return the time of every jettison, s; nan: done before, or not in this flight."""
    arrays, start = program.arrays, program.start[0]
    ignitions = first_ignitions(start, program.segments, arrays.arcs)
    now = float(start["time"])
    waiting = iter(times.drops)
    out = []
    for j, jettison in enumerate(arrays.jettisons):
        if (int(start["jettisoned"]) >> j) & 1:
            out.append(math.nan)
            continue
        lit = max(now, ignitions[int(jettison["stage"])])
        if jettison["criterion"] == HEATING_LIMIT:
            at = max(lit, float(next(waiting)))
        elif jettison["criterion"] == MISSION_TIME:
            at = max(lit, float(jettison["value"]))
        else:
            at = max(now, ignitions[int(jettison["stage"])] + float(jettison["value"]))
        out.append(at if at <= times.cutoff else math.nan)
    return tuple(out)


def _steering_arcs(
    program: Transcription, point: Point, adjoint: Adjoint
) -> tuple[SteeringArc, ...]:
    """Return a linear-tangent law per phase: the chord from first to last direction."""
    arcs = []
    lengths = program.time * point.x[program.lengths]
    begins = float(program.start["time"][0]) + np.concatenate(([0.0], np.cumsum(lengths)))
    for p, phase in enumerate(program.phases):
        rows = np.flatnonzero(adjoint.phase == p)
        first_mass = float(point.x[program.masses[p]]) * program.mass
        last_mass = float(point.x[program.ends[p]]) * program.mass
        primer = adjoint.by_velocity[rows]
        if phase["steering"] not in (COASTING, GUIDED):
            primer = adjoint.direction[rows]
        size = max(float(np.linalg.norm(primer[0])), 1e-300)
        direction = primer[0] / size
        rate = (primer[-1] - primer[0]) / (size * max(float(lengths[p]), SHORTEST))
        gained = 0.0
        primer_rate = np.full(3, math.nan)
        if phase["steering"] == GUIDED:
            primer_rate = -adjoint.by_position[rows[0]] / size
        if phase["steering"] != COASTING:
            k = int(program.segments[p]["arc"])
            exhaust = float(program.arrays.arcs[k]["exhaust_velocity"])
            gained = exhaust * math.log(first_mass / last_mass)
        arcs.append(
            SteeringArc(
                float(begins[p]),
                float(begins[p + 1]),
                float(begins[p]),
                (float(direction[0]), float(direction[1]), float(direction[2])),
                (float(rate[0]), float(rate[1]), float(rate[2])),
                first_mass,
                last_mass,
                gained,
                (float(primer_rate[0]), float(primer_rate[1]), float(primer_rate[2])),
            )
        )
    return tuple(arcs)


def _solution(
    search: _Search, proven: _Proven, floors: tuple[Floor, ...], elapsed: float
) -> Solution:
    """Convert a point of a program to a solution."""
    program, point, flight = proven.found.program, proven.found.point, proven.flight
    times = times_of(program, point.x)
    planned = with_lengths(search.arrays, search.start[0], times.lengths)
    costates = costates_of(program, point, proven.adjoint)
    spread = hamiltonian_spread(proven.found, proven.adjoint)
    floor_checks = tuple(_floor_check(proven.found, floor) for floor in floors)
    checks = (
        *_with_sensitivities(search, proven, proven.checks),
        *floor_checks,
        *_orbit_checks(proven),
        *_length_checks(program, point, times),
    )
    nodes = _nodes(program, point)
    solution = Solution(
        METHOD,
        *_verdict(search, proven, checks, spread),
        jettison_times(program, times),
        times.cutoff,
        float(proven.found.point.x[program.ends[-1]]) * program.mass,
        search.iterations,
        elapsed,
        arcs=_steering_arcs(program, point, proven.adjoint),
        lengths_s=tuple(float(length) for length in times.lengths),
        constraints=checks,
        trajectory=_sampled(program, proven, nodes),
        costates=costates,
        parameters=_unknowns(program, proven, times),
        restarts=max(0, search.starts - 1),
        by_legs=True,
        notes={LOCAL_OPTIMA: float(len(search.optima))},
    )
    if flight is None:
        return solution
    offsets = held_offsets(planned, flight, proven.steering, costates)
    directions = held_checks(planned, flight, offsets)
    checks = (*checks, *directions)
    return replace(
        solution,
        **_verdict(search, proven, checks, spread)._asdict(),
        m_f_kg=float(flight.final[6]),
        constraints=checks,
        verification=verification(planned, flight, nodes[program.first]),
        trajectory=flight.trajectory,
        costates=replace(costates, held_off_deg=offsets),
    )


def _unknowns(program: Transcription, proven: _Proven, times: Times) -> Array:
    """Return the unknowns of the two-point problem, see ``indirect.solver.Root``."""
    point, adjoint = proven.found.point, proven.adjoint
    arrays, start = program.arrays, program.start[0]
    size = max(float(np.linalg.norm(adjoint.by_velocity[0])), 1e-300)
    unknowns = [*adjoint.by_velocity[0] / size, *adjoint.by_position[0] / size, times.cutoff]
    waiting = [
        j
        for j, jettison in enumerate(arrays.jettisons)
        if jettison["criterion"] == HEATING_LIMIT and not (int(start["jettisoned"]) >> j) & 1
    ]
    for j, at in zip(waiting, times.drops, strict=True):
        row = program.heating_rows.get(j)
        pi = 0.0 if row is None else float(point.multipliers[row]) * program.mass / size
        unknowns += [at, min(0.0, pi)]
    now = float(start["arc_start_time"])
    lengths = iter(times.lengths)
    free = free_arcs(arrays, start)
    for k in range(int(start["arc"]), len(arrays.arcs) - 1):
        now += float(next(lengths)) if k in free else float(arrays.arcs[k]["duration"])
        if k in free:
            unknowns.append(now)
    for k in range(int(start["arc"]), len(arrays.arcs)):
        if arrays.arcs[k]["held"]:
            p = next(p for p in range(len(program.phases)) if program.segments[p]["arc"] == k)
            at = program.control_of[p][0]
            unknowns += list(point.x[at : at + 3])
    return np.array(unknowns)


def _sampled(program: Transcription, proven: _Proven, nodes: Array) -> Trajectory:
    """Convert the states of a program to a trajectory, with samples at both ends of phases."""
    adjoint = proven.adjoint
    masses = np.interp(adjoint.time, nodes[:, 0], nodes[:, 7])
    thrust = np.zeros(len(adjoint.time))
    for p, piece in enumerate(program.segments):
        rows = adjoint.phase == p
        begin = float(proven.found.point.x[program.masses[p]]) * program.mass
        into = adjoint.time[rows] - adjoint.time[rows][0]
        moved = piece.copy()
        moved["start"], moved["mass"] = 0.0, begin
        masses[rows] = [timetable.segment_mass(moved, s) for s in into]
        thrust[rows] = [timetable.segment_thrust(moved, s) for s in into]
    direction = adjoint.direction.copy()
    for i in range(1, len(direction)):
        if np.isnan(direction[i]).any():
            direction[i] = direction[i - 1]
    first = np.argmax(~np.isnan(direction).any(axis=1))
    direction[:first] = direction[first]
    state = adjoint.state
    environment, atmosphere = program.arrays.environment[0], program.arrays.atmosphere
    rates = [heating_rate(tuple(y[:3]), tuple(y[3:]), environment, atmosphere) for y in state]
    return Trajectory(
        adjoint.time, state[:, :3], state[:, 3:], masses, direction, np.array(rates), thrust
    )


def _nodes(program: Transcription, point: Point) -> Array:
    """Return the states of the program with time and mass, shape (n, 8).

    Masses are exact at the begins of phases and interpolated between them.
    """
    times = node_times(program, program.time * point.x[program.lengths])
    states = point.x[: 6 * program.nodes].reshape(-1, 6)
    masses = np.interp(
        np.arange(program.nodes),
        program.first,
        program.mass * np.concatenate((point.x[program.masses], point.x[program.ends[-1:]])),
    )
    return np.column_stack(
        (times, program.radius * states[:, :3], program.speed * states[:, 3:], masses)
    )


def _verdict(
    search: _Search, proven: _Proven, checks: tuple[ConstraintCheck, ...], spread: float
) -> Cause:
    """Return OPTIMAL, or the cause why a solution is not proven optimal."""
    broken = next((check for check in checks if not check.satisfied), None)
    if broken is not None:
        return Cause(
            Status.NOT_OPTIMAL,
            f"{broken.name} is off its limit of {broken.limit:,.7g} {broken.unit} by "
            f"{broken.value - broken.limit:,.3g} {broken.unit} when flown by another integrator",
        )
    propellant = _free_propellant(proven.found)
    if not math.isfinite(propellant):
        return Cause(Status.FEASIBLE, NOTHING_SAVED)
    # on the coarse intervals of the search, as the test uses dense matrices
    if proven.found.point.regularized and search.best is not None and is_saddle(search.best):
        return Cause(Status.FEASIBLE, "the second-order conditions are not met")
    if propellant < _NOTHING_KG:
        return Cause(Status.CONVERGED, next_to_nothing(propellant))
    if search.starts > 1 and search.again < _LEAST_MET:
        return Cause(
            Status.FEASIBLE,
            f"only one of {search.starts} starts led here: there may be a better one",
        )
    if spread > SPREAD:
        return Cause(
            Status.FEASIBLE,
            f"the Hamiltonian wanders by {spread:.1e}; at most {SPREAD:g} counts",
        )
    touched = [
        floor.arc
        for floor in search.added
        for check in checks
        if check.active and check.name == _floor_name(floor.arc)
    ]
    if touched:
        return Cause(
            Status.FEASIBLE,
            f"arc {touched[0]} would go through the ground and is kept above "
            f"{search.added[0].altitude_m:,.0f} m, near where the flight begins; the file does not "
            "say how low it may be (min_altitude_m)",
        )
    return OPTIMAL


def _floor_name(arc: int) -> str:
    return f"lowest altitude in arc {arc}"


def _free_propellant(found: Found) -> float:
    """Return the propellant of the free burns of the saving stage, kg; inf: it has none."""
    program = found.program
    arcs = program.arrays.arcs
    saving = saving_stage(program.arrays, program.start[0])
    burns = [
        k
        for k in program.arc_phases
        if arcs[k]["stage"] == saving
        and arcs[k]["kind"] == BURN
        and math.isinf(arcs[k]["duration"])
    ]
    phases = [p for k in burns for p in program.arc_phases[k]]
    if not phases:
        return math.inf
    burnt = found.point.x[program.masses[phases]] - found.point.x[program.ends[phases]]
    return float(burnt.sum()) * program.mass


def _floor_check(found: Found, floor: Floor) -> ConstraintCheck:
    """Return the check of a floor, with kg of final mass per m."""
    rows = found.program.floor_rows[floor.arc]
    if not math.isfinite(floor.altitude_m):
        return _perigee_check(found, floor)
    price = float(found.point.multipliers[rows].sum()) * found.program.mass / found.program.radius
    low = lowest_in(found, floor.arc)
    return ConstraintCheck(
        Check.LOWEST_ALTITUDE,
        _floor_name(floor.arc),
        low,
        floor.altitude_m,
        low < floor.altitude_m + _ACTIVE,
        "m",
        low >= floor.altitude_m - 0.1 * _SAG,
        price,
    )


def _perigee_check(found: Found, floor: Floor) -> ConstraintCheck:
    """Return the check of the perigee of a coast's orbit, with kg of final mass per m."""
    program, x = found.program, found.point.x
    node = int(program.first[program.arc_phases[floor.arc][0]])
    r = x[6 * node : 6 * node + 3] * program.radius
    v = x[6 * node + 3 : 6 * node + 6] * program.speed
    mu = float(program.arrays.environment[0]["mu"])
    h = float(np.linalg.norm(np.cross(r, v)))
    energy = 0.5 * float(v @ v) - mu / float(np.linalg.norm(r))
    e = math.sqrt(max(0.0, 1.0 + 2.0 * energy * h * h / mu**2))
    perigee = h * h / mu / (1.0 + e)
    row = program.floor_rows[floor.arc][-1]
    # row: (h^2 - p^2 (v^2 - 2 mu / r) - 2 mu p) / (2 mu p)
    slope = (2.0 * floor.perigee_m * energy + mu) / (mu * floor.perigee_m)
    return ConstraintCheck(
        Check.LOWEST_ALTITUDE,
        f"perigee radius in arc {floor.arc}",
        perigee,
        floor.perigee_m,
        perigee < floor.perigee_m + _ACTIVE,
        "m",
        perigee >= floor.perigee_m - _SAG,
        float(found.point.multipliers[row]) * program.mass * slope,
    )


def _orbit_checks(proven: _Proven) -> Iterator[ConstraintCheck]:
    """Yield checks of the orbits that coasts name, with kg of final mass per unit."""
    program, adjoint = proven.found.program, proven.adjoint
    environment = program.arrays.environment[0]
    mu, ground = float(environment["mu"]), float(environment["equatorial_radius"])
    for orbit, (k, p) in zip(program.targets[1:], program.orbit_phases.items(), strict=True):
        at = int(np.argmax(adjoint.phase == p))
        state = adjoint.state[at]
        # jump of the costates at the constraint
        jump = np.concatenate(
            [
                costate[at - 1] - costate[at]
                for costate in (adjoint.by_position, adjoint.by_velocity)
            ]
        )
        judged = judge(state[:3], state[3:], orbit, mu, ground)
        rows = target_rows(orbit)
        worth = target_sensitivities(orbit, mu, state, jump)
        for row, price in zip(rows, worth, strict=True):
            limit = in_unit(orbit, row)
            error, allowed = judged.error_of(row.key)
            name = f"{row.name.removesuffix(' at cut-off')} in arc {k}"
            yield ConstraintCheck(
                Check.PARKING_ORBIT,
                name,
                limit + error,
                limit,
                True,
                row.unit,
                abs(error) <= allowed,
                -float(price),
            )


def _with_sensitivities(
    search: _Search, proven: _Proven, checks: tuple[ConstraintCheck, ...]
) -> tuple[ConstraintCheck, ...]:
    """Return the checks with sensitivities, kg of final mass per unit."""
    arrays = search.arrays
    program, point, adjoint = proven.found.program, proven.found.point, proven.adjoint
    target = arrays.target[0]
    costate = np.concatenate((adjoint.by_position[-1], adjoint.by_velocity[-1]))
    mu = float(arrays.environment[0]["mu"])
    worth = target_sensitivities(target, mu, adjoint.state[-1], costate)
    sensitivities: dict[tuple[Check, int | None], float] = {
        (row.key, None): -float(value)
        for row, value in zip(target_rows(target), worth, strict=True)
    }
    for j, row in program.heating_rows.items():
        sensitivities[Check.HEATING_AT_JETTISON, j] = (
            -float(point.multipliers[row]) * program.mass / float(arrays.jettisons[j]["value"])
        )
    return tuple(
        replace(check, multiplier=sensitivities.get((check.key, check.jettison), check.multiplier))
        for check in checks
    )


def _length_checks(
    program: Transcription, point: Point, times: Times
) -> tuple[ConstraintCheck, ...]:
    """Return checks on the lengths of the free arcs, with kg of final mass per second."""
    arrays, start = program.arrays, program.start[0]
    low, high = length_bounds(arrays, start)
    checks = []
    for f, k in enumerate(free_arcs(arrays, start)):
        length = float(times.lengths[f])
        short = length < low[f] + _SAME_LENGTH
        long = length > high[f] - _SAME_LENGTH
        bound = float(low[f]) if short or math.isinf(high[f]) else float(high[f])
        members = program.arc_phases.get(k, [])
        worth = math.nan
        if len(members) == 1:
            at = program.lengths[members[0]]
            worth = float(point.at_upper[at] - point.at_lower[at]) * program.mass / program.time
        burn = arrays.arcs[k]["kind"] == BURN
        checks.append(
            ConstraintCheck(
                Check.ARC_LENGTH,
                f"length of arc {k}",
                length,
                bound,
                bool(short or long),
                "s",
                bool(low[f] - _SAME_LENGTH <= length <= high[f] + _SAME_LENGTH),
                (math.nan if burn and long else worth) if short or long else 0.0,
            )
        )
    return tuple(checks)
