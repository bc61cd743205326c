# SPDX-License-Identifier: Apache-2.0
"""Search the local optima of a mission: collocation on coarse intervals from several starts."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import COAST, LONGEST_FLIGHT, MissionArrays
from ares_models.floors import Floor, edge_of_air
from ares_models.kernels.environment import altitude
from ares_models.plans import flies_in_air
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.carry import carried_point, carried_variables
from ares_optimizer.collocation.pilot import (
    Pilot,
    TrialFlight,
    are_alike,
    floors_on,
    is_reversed,
)
from ares_optimizer.collocation.points import (
    Array,
    FoundOptimum,
    acting_limits,
    has_long_intervals,
    is_idle,
    lowest_in,
    mass_of,
    penalize_waste,
    sweep_of_found,
    times_of,
    turning_of,
    worst_row,
)
from ares_optimizer.collocation.reorder import moved_events
from ares_optimizer.collocation.solver import (
    GIVEN_UP,
    LOCALLY_INFEASIBLE,
    StoppingPoint,
    solve_program,
)
from ares_optimizer.collocation.steps import LengthSteps
from ares_optimizer.collocation.transcription import CollocationProgram
from ares_optimizer.collocation.variables import guess_of, sweep_of_trial
from ares_optimizer.plan import free_arcs
from ares_optimizer.request import Request
from ares_optimizer.solution import OUT_OF_TIME, Cause, Status
from ares_optimizer.targets import miss_line

#: Relative difference of mass within which two solutions are the same local optimum. On coarse
#: intervals floors hold at the states only.
SAME_MASS = 3e-4
#: The same between coarse and fine intervals where a pressure limit acts.
LIMITED_MASS = 5e-3
#: Difference of the lengths of free arcs, relative and in s, beyond which two solutions differ.
_SAME_ARCS = 0.02
_SAME_ARC_S = 1.0
#: The search ends when so many starts led to the best solution. With a free coast it also needs so
#: many starts, of which no other solution came from any and so few failed. From the pad two
#: suffice, unless an arc beside several free coasts is shorter than so many s.
ENOUGH = 3
_ENOUGH_IN_AIR = 2
_LEAST_STARTS = 5
_VANISHED_S = 1.0
_FAILED = 1
#: Least number of starts that led to a solution called optimal.
LEAST_MET = 2
#: Miss of a trial flight beyond which a start mostly fails, slowly.
_FAR_OFF = 0.3
#: Miss of a trial flight that ends at the target.
_AT_TARGET = 1e-3
#: Most such moves in a row, and least relative gain of mass to continue.
_MOST_MOVES = 3
_GAINED = 1e-7
#: Iterations from a first guess; longer searches mostly fail or repeat a solution.
_MOST_FIRST = 100
#: The same from a flight that reaches the target, and from one where the steps have failed.
_MOST_NEAR = 200
_MOST_RESUMED = 60
#: The same from a solution on other intervals, with its multipliers.
_MOST_WARM = 40
#: Depth below ground at which an arc without a floor gets one, m.
_DEEP_M = 1.0
#: Such a floor is so far below the start of the flight, m.
_BELOW_START_M = 1e3
#: Depth below a floor between the states, m, beyond which the intervals are too long.
_SAGS = 1e3
#: Initial barrier parameter near a solution, and in a corner of its limits.
_NEAR = 1e-4
CORNER = 1e-6
#: Relative gain of mass by the next step that is next to nothing: in a start, and on the finer
#: intervals after it.
_FLAT = 1e-5
_FLAT_WHEN_REFINED = 1e-6
#: Most iterations of one solution in steps, more of the first, of a start, and of a start when a
#: solution is known.
_MOST_IN_STEPS = 200
_MOST_TO_SETTLE = 600
_MOST_OF_START = 300
_MOST_OF_OTHERS = 200
#: Factors on the limits of dynamic pressure and q alpha, one after the other, and most steps
#: between them.
_LIMIT_STEPS = (30.0, 2.0, 1.0)
_MOST_NARROWED = 6


@dataclass
class LocalOptimum:
    """Hold a local optimum and the number of starts that led to it.

    Attributes:
        found: its best solution.
        lengths: of its free arcs, s.
        met: number of starts that led to it.
    """

    found: FoundOptimum
    lengths: Array
    met: int = 1

    def holds(self, found: FoundOptimum, lengths: Array) -> bool:
        """Return true if a solution is this local optimum."""
        near = SAME_MASS * self.found.m_f_kg
        if abs(found.m_f_kg - self.found.m_f_kg) > near:
            return False
        allowed = _SAME_ARCS * np.maximum(self.lengths, lengths) + _SAME_ARC_S
        return bool((np.abs(self.lengths - lengths) <= allowed).all())


class Search:
    """Hold all starts of one mission.

    Attributes:
        added: floors that the mission lacks, of arcs that went below the ground.
        optima: the local optima, the best first.
        starts: number of starts tried.
        iterations: of all starts.
        least_starts: number of starts without which the search does not end.
        idle: true if no thrust direction of the best solution can save propellant.
        sunk_kg: greatest mass of a solution below the ground for which none was found above it.
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
        self.least_starts = 0
        self.idle = self.unfinished = False
        self.sunk_kg = -math.inf
        self._violations: list[tuple[float, str]] = []
        self._unproven = False
        self._nearest: TrialFlight | None = None
        #: Number of iterations at which a start is given up.
        self._most_iterations: float = math.inf
        #: Least factor on the pressure limits with which a flight was found where one failed, and
        #: if more of them were tried.
        self.limits_met = math.inf
        self.narrowed = False
        r = start["position"][0]
        self._start_m = float(altitude(tuple(r), arrays.environment[0]))

    @property
    def best(self) -> FoundOptimum | None:
        """Return the local optimum with the greatest mass."""
        return self.optima[0].found if self.optima else None

    @property
    def again(self) -> int:
        """Count the starts that led to the mass of the best solution."""
        return self.led_to(self.optima[0].found.m_f_kg) if self.optima else 0

    def led_to(self, mass_kg: float) -> int:
        """Count the starts that led to a mass or more."""
        least = (1.0 - SAME_MASS) * mass_kg
        return sum(optimum.met for optimum in self.optima if optimum.found.m_f_kg >= least)

    @property
    def is_conclusive(self) -> bool:
        """Return true if enough starts led to the best solution.

        A free coast may have several local optima: all starts are tried, unless the first ones,
        which cover the lengths, led to a single one. From the pad two that agree suffice after the
        likeliest ones, which go by different parking orbits and coasts; three if an arc beside
        several free coasts has vanished, since another may be the one to do without.
        """
        if self.best is None or self.starts < self.least_starts:
            return False
        in_air = flies_in_air(self.arrays.arcs)
        free = free_arcs(self.arrays, self.start[0])
        coasts = [k for k in free if self.arrays.arcs[k]["kind"] == COAST]
        whole = len(coasts) <= 1 or float(self.optima[0].lengths.min()) > _VANISHED_S
        if self.again < (_ENOUGH_IN_AIR if in_air and whole else ENOUGH):
            return False
        if in_air or not coasts:
            return True
        led = sum(optimum.met for optimum in self.optima)
        return (
            len(coasts) == 1
            and self.starts >= _LEAST_STARTS
            and led == self.again >= self.starts - _FAILED
        )

    def try_start(self, trial: TrialFlight) -> None:
        """Solve from a trial flight; skip one far from its target if a solution is known.

        First guesses that led to the trial flight agree on its solution only if that is like it.
        """
        if self.best is not None and trial.miss > _FAR_OFF:
            return
        self.starts += 1
        if self._nearest is None or trial.miss < self._nearest.miss:
            self._nearest = trial
        self._allow_iterations()
        found = self._found_from(trial)
        self._most_iterations = math.inf
        if found is not None and not self._underground(found) and not self._is_reversed(found):
            times = times_of(found.program, found.point.x)
            alike = are_alike(times.lengths, trial.times.lengths)
            if times.cutoff - float(self.start["time"][0]) <= LONGEST_FLIGHT:
                self.keep(found, trial.met if alike else min(1, trial.met))
                return
        self._unproven |= found is not None

    def _allow_iterations(self) -> None:
        """Bound the iterations from here on by those of a start."""
        most = _MOST_OF_START if self.best is None else _MOST_OF_OTHERS
        self._most_iterations = self.iterations + most

    def _found_from(self, trial: TrialFlight) -> FoundOptimum | None:
        """Solve from a trial flight, with floors where it goes below the ground."""
        found = self._solved(trial)
        deep = self._without_floor() if found is None else self._underground(found)
        if deep:
            # floor of these arcs: below the start, at most the edge of the air
            level = min(self._start_m - _BELOW_START_M, edge_of_air(self.arrays))
            added = tuple(Floor(k, level, math.nan, said=True) for k in deep)
            self.floors += added
            self.added += added
            self._allow_iterations()
            sunk, found = found, self._solved(trial)
            if sunk is not None and (found is None or self._underground(found)):
                self.sunk_kg = max(self.sunk_kg, sunk.m_f_kg)
        return found

    def _without_floor(self) -> list[int]:
        """Return the arcs without a floor if the start is near the ground, where searches sink."""
        if self.best is not None or self._start_m > _BELOW_START_M:
            return []
        known = {floor.arc for floor in self.floors}
        return [
            k for k in range(int(self.start["arc"][0]), len(self.arrays.arcs)) if k not in known
        ]

    def _underground(self, found: FoundOptimum) -> list[int]:
        """Return the arcs without a floor that a flight flies below the ground."""
        rows = found.program.floor_rows
        return [
            k
            for k in found.program.arc_phases
            if not rows.get(k) and lowest_in(found, k) < -_DEEP_M
        ]

    def _is_reversed(self, found: FoundOptimum) -> bool:
        """Return true if a flight ends in another plane than asked, or the other way round."""
        end = found.point.x[6 * found.program.nodes - 6 : 6 * found.program.nodes]
        return is_reversed(self.arrays, self.start, end)

    def _solved(self, trial: TrialFlight) -> FoundOptimum | None:
        """Solve from a trial flight; return None on failure."""
        floors = floors_on(self.floors, self._start_m, trial)
        if trial.limited:
            # it is above the ground, and more rows lead the solver astray
            floors = tuple(floor for floor in floors if floor not in self.added)
        try:
            program = CollocationProgram(
                self.arrays,
                self.start,
                trial.times,
                floors,
                sweep=sweep_of_trial(trial, self.arrays),
            )
        except ValueError:
            self._unproven = True
            return None
        point = self._first_point(program, trial)
        if not point.solved and self._wastes(program, trial, point):
            point = self._first_without_waste(program, trial)
        if not point.solved:
            if point.status == LOCALLY_INFEASIBLE:
                self._violations.append((point.violation, worst_row(program, point)))
            else:
                self._unproven = True
            return None
        known = FoundOptimum(program, point, mass_of(program, point))
        rough = self._dips_below_floor(known) or has_long_intervals(known)
        found = self._retranscribed(known, floors) if rough else known
        if found is None:
            self._unproven = True
            return None
        for _ in range(_MOST_MOVES):
            better = self._reordered(found, floors)
            if better is None:
                break
            found = better
        return found

    def _first_point(self, program: CollocationProgram, trial: TrialFlight) -> StoppingPoint:
        """Solve a program from a first guess.

        Pressure limits that the guess does not keep are narrowed in steps; the first search that
        fails so continues with smaller ones.
        """
        x: Array = guess_of(program, trial)
        for near in (_NEAR, CORNER) if trial.near else ():
            # the bounds of steps would be in its way
            point = self._solved_program(program, x, near, _MOST_NEAR)
            if point.solved:
                return point
        mu: float | None = None
        kept = trial.limited or trial.turned or not program.limit_rows
        steps, met = [1.0] if kept else list(_LIMIT_STEPS), math.inf
        more = 0 if kept or self.narrowed else _MOST_NARROWED
        while True:
            program.scale_limits(dict.fromkeys(program.limit_rows, steps[0]))
            point = self.solve_in_steps(program, x, mu)
            if point.solved:
                x, mu, met = point.x, CORNER, steps.pop(0)
                if not steps:
                    return point
            elif math.isinf(met) or not more:
                break
            else:
                # half way, in proportion
                more -= 1
                self.narrowed = True
                steps.insert(0, math.sqrt(steps[0] * met))
        if not kept:
            self.limits_met = min(met, self.limits_met)
        program.scale_limits(dict.fromkeys(program.limit_rows, 1.0))
        if trial.limited and trial.miss == 0.0 and not trial.near:
            # it consists of solutions
            again = self._solved_program(program, x, _NEAR, _MOST_RESUMED)
            point = again if again.solved else point
        return point

    def _wastes(
        self, program: CollocationProgram, trial: TrialFlight, point: StoppingPoint
    ) -> bool:
        """Return true if a trial flight in the air, or the last step from it, has energy to spare.

        Args:
            program: of the trial flight.
            trial: the flight.
            point: where the solver stopped; where steps were given up, the last that was solved.
        """
        if not program.phases["in_air"].any():
            return False
        stepped = point.status == GIVEN_UP and is_idle(FoundOptimum(program, point, 0.0))
        return stepped or Pilot(self.arrays, self.start, ()).has_needless_burn(trial.times)

    def _first_without_waste(
        self, program: CollocationProgram, trial: TrialFlight
    ) -> StoppingPoint:
        """Solve a program from a first guess by way of its solution with a cost of waste.

        The burns of fixed length have energy to spare, and many directions waste the same.
        """
        penalize_waste(program)
        self._allow_iterations()
        steady = self._first_point(program, trial)
        program.drop_cost()
        point = self.solve_in_steps(program, steady.x, CORNER) if steady.solved else steady
        return point if point.solved else steady

    def solve_in_steps(
        self,
        program: CollocationProgram,
        begin: Array | StoppingPoint,
        mu: float | None,
        narrow: bool = False,
    ) -> StoppingPoint:
        """Solve a program; with a free coast in steps that change free lengths a little.

        Steps that are given up keep the last one, unsettled: in a start if the next would gain next
        to nothing, or if its flight is better than all known ones.

        Args:
            program: the program.
            begin: first guess, shape (n,), or the solution of a program of the same pattern.
            mu: initial barrier parameter; None: that of the solver.
            narrow: hold free lengths nearly in the first step.
        """
        steps = LengthSteps(program, narrow)
        if not steps.needed:
            return self._solved_program(program, begin, mu)
        last = min(self.iterations + _MOST_IN_STEPS, self._most_iterations)
        while True:
            with steps.bounded(begin) as first:
                point = self._solved_program(program, first, mu)
            if steps.arrived(point, begin):
                return point
            in_start = math.isfinite(self._most_iterations)
            if in_start and self.iterations >= last and steps.known and self.best is None:
                # a first flight is worth more
                last, self._most_iterations = last + _MOST_TO_SETTLE, math.inf
            if steps.gave_up or self.iterations >= last:
                known = steps.known
                best_kg = self.best.m_f_kg if self.best is not None else math.inf
                fit = not in_start or steps.gain < _FLAT
                if known and (fit or mass_of(program, known) > best_kg):
                    return steps.released(known)
                return replace(known or point, status=GIVEN_UP)
            if point.solved:
                begin, mu = point, None
            elif isinstance(begin, StoppingPoint) and steps.begins_anew:
                # its multipliers may mislead
                begin, mu = begin.x, CORNER

    def _solved_program(
        self,
        program: CollocationProgram,
        begin: Array | StoppingPoint,
        mu: float | None,
        most: int | None = None,
    ) -> StoppingPoint:
        """Solve a program and count the iterations."""
        if most is None:
            most = _MOST_WARM if isinstance(begin, StoppingPoint) else _MOST_FIRST
        point = solve_program(program, begin, self.request.deadline, mu=mu, most=most)
        self.iterations += point.iterations
        return point

    def _dips_below_floor(self, found: FoundOptimum) -> bool:
        """Return true if a coast dips below a floor between its states."""
        return any(
            lowest_in(found, floor.arc) < floor.altitude_m - _SAGS
            for floor in self.floors
            if found.program.floor_rows.get(floor.arc)
        )

    def _retranscribed(self, found: FoundOptimum, floors: tuple[Floor, ...]) -> FoundOptimum | None:
        """Solve on intervals for the lengths of a solution; return None on failure."""
        again = refined(self, found, floors, 1.0)
        return again if again is None or not self._dips_below_floor(again) else None

    def _reordered(self, found: FoundOptimum, floors: tuple[Floor, ...]) -> FoundOptimum | None:
        """Solve with two events in the other order; return None where that is no better.

        A fairing may drop in another arc, and the limit of a throttle may be reached in another
        burn or in none, than in the trial flight.
        """
        for times in moved_events(found):
            try:
                program = CollocationProgram(
                    self.arrays, self.start, times, floors, sweep=sweep_of_found(found)
                )
            except ValueError:
                continue
            guess = carried_variables(program, found.program, found.point.x)
            point = self._solved_program(program, guess, CORNER)
            if point.solved and mass_of(program, point) > found.m_f_kg * (1.0 + _GAINED):
                return FoundOptimum(program, point, mass_of(program, point))
        return None

    def keep(self, found: FoundOptimum, met: int = 1) -> None:
        """Store a local optimum, or count it with a known one.

        Args:
            found: the local optimum.
            met: number of first guesses that led to it.
        """
        lengths = times_of(found.program, found.point.x).lengths
        for optimum in self.optima:
            if optimum.holds(found, lengths):
                optimum.met += met
                if found.m_f_kg > optimum.found.m_f_kg:
                    optimum.found, optimum.lengths = found, lengths
                break
        else:
            self.optima.append(LocalOptimum(found, lengths, met))
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
                f"no flight to the target found from {self._first_guesses()}: what fails most is "
                f"the {name}, by {violation:.2g} of its scale",
            )
        if self._nearest is None:
            return Cause(
                Status.ILLEGAL_START,
                "no flight can be computed: the last burn does not begin, or too many events",
            )
        reason = f"no flight to the target found from {self._first_guesses()}"
        if 1.0 < self.limits_met < math.inf:
            reason += (
                f" within the limits of dynamic pressure and q alpha; with limits "
                f"{self.limits_met:.2f} times as high there is one"
            )
        elif self._nearest.miss < _AT_TARGET:
            reason += "; the nearest of these ends at the target, but nothing near it that keeps "
            reason += "all limits was found"
        else:
            reason += f"; the nearest of these {self._course_of(self._nearest.track)}"
        return Cause(Status.STALLED, reason)

    def _course_of(self, track: Array) -> str:
        """Describe where a trial flight falls to the ground, or how far it ends from the target."""
        heights = track[:, rollout.ALTITUDE]
        fallen = int(np.argmax(heights < self._start_m - _BELOW_START_M))
        if fallen:
            return (
                f"rises to {heights[:fallen].max() / 1e3:,.1f} km and is on the ground again at "
                f"{track[fallen, rollout.TIME]:,.0f} s"
            )
        end, mu = track[-1], float(self.arrays.environment[0]["mu"])
        r, v = end[rollout.POSITION : rollout.VELOCITY], end[rollout.VELOCITY : rollout.DIRECTION]
        return f"ends with the {miss_line(self.arrays.target[0], r, v, mu)}"

    def _first_guesses(self) -> str:
        return f"{self.starts} first guess{'es' * (self.starts != 1)}"


def again_found(
    found: FoundOptimum, program: CollocationProgram, point: StoppingPoint
) -> FoundOptimum:
    """Return a solution of a program, settled if it is flat and another one like it was settled."""
    if point.unsettled < _FLAT_WHEN_REFINED and not found.point.unsettled:
        point = replace(point, unsettled=0.0)
    return FoundOptimum(program, point, mass_of(program, point))


def refined(
    search: Search, found: FoundOptimum, floors: tuple[Floor, ...], finer: float
) -> FoundOptimum | None:
    """Solve on finer intervals from a point; return None on failure."""
    times = times_of(found.program, found.point.x)
    try:
        turning = None if search.idle else turning_of(found)
        program = CollocationProgram(
            search.arrays,
            search.start,
            times,
            floors,
            finer=finer,
            turning=turning,
            sweep=sweep_of_found(found),
        )
    except ValueError:
        return None
    warm = None if search.idle else carried_point(program, found.program, found.point)
    guess = carried_variables(program, found.program, found.point.x)
    if search.idle:
        penalize_waste(program)
    known: FoundOptimum | None = None
    limited = bool(acting_limits(found))
    same = LIMITED_MASS if limited else SAME_MASS
    ways: list[tuple[Array | StoppingPoint, float | None]]
    ways = [(guess, mu) for mu in ((CORNER,) if limited else (None, _NEAR))]
    if warm is not None:
        ways.insert(0, (warm, None))
    for begin, mu in ways:
        point = search.solve_in_steps(program, begin, mu, narrow=True)
        if point.solved and (known is None or mass_of(program, point) > known.m_f_kg):
            known = again_found(found, program, point)
        # without the multipliers the barrier may lead away from the solution nearby
        near = LIMITED_MASS if begin is warm else same
        if known is not None and known.m_f_kg > found.m_f_kg * (1.0 - near):
            break
    return known
