# SPDX-License-Identifier: Apache-2.0
"""Solve for the best end with a failure known from the start, by continuation over failure times.

The flight with a failure one second earlier is nearly the same: each optimum is the initial guess
of the next. A target out of reach of the propellant is lowered until it is reached: the speed taken
off is the unknown of an outer iteration. From the pad the first guess is the plan of collocation,
and the forces of the air are part of the two-point problem.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance.kernels.monitors.shortfall import lower_target
from ares_models import arrays as layout
from ares_models.failures import Failure
from ares_models.floors import edge_of_air
from ares_models.judge import End
from ares_models.mission import Mission
from ares_models.plans import flies_in_air
from ares_models.tolerances import ROUNDING_M
from ares_optimizer.foreknown import Foreknown, begin_times
from ares_optimizer.indirect.kernels import sample
from ares_optimizer.indirect.solve import solve_indirect
from ares_optimizer.indirect.solver import TwoPointOptions, TwoPointSolver
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    begin_mass,
    propellant_used,
    segment_mass,
)
from ares_optimizer.solution import OptimizerError, Solution, UnfitMethod
from ares_optimizer.solve import solve
from ares_optimizer.two_point.arrays import LAMBDA_R, PRIMER
from ares_studies.aborts.ends import NOWHERE, Judge, Reached, better
from ares_studies.aborts.partial import partly

Array = NDArray[np.float64]

_NO_NOMINAL = "without a failure no optimum was found that reaches the target"
#: Burn time beyond its end, s, that counts as zero.
_SAME_END_S = 1e-3
#: Outer iteration: most rounds, largest step, m/s, most halvings of a step.
_ROUNDS = 30
_LONGEST_STEP = 300.0
_HALVINGS = 4
#: Difference, m/s, between requested and possible lowering of the target that shows its limit.
_TAKEN_WHOLE = 1e-3
#: Interval, s, between the positions checked against the ground.
_LOOK_S = 5.0
#: Consecutive points without an optimum after which the thorough search is skipped.
_PATIENCE = 3
#: Most steps of the integrator in one search in the air, per second of the flight: those of some 30
#: iterations, tenths of a second of computing.
_STEPS_IN_AIR = 100
#: First and least share of a failure by which a track is moved towards it.
_FIRST_SHARE, _LEAST_SHARE = 0.25, 0.004
#: Largest turn of the thrust, rad, and change of the target, m/s, in one such step.
_LONGEST_TURN, _MOST_OFF_M_S = 0.3, 600.0


@dataclass(frozen=True)
class _Flown:
    """Hold an extremal.

    Attributes:
        unknowns: of the two-point problem.
        position, velocity: at the end of the thrust, m and m/s.
        m_f_kg: final mass.
        end_s: end of the thrust.
        over_s: burn time beyond its allowed end or its propellant.
        acceleration: at cut-off, m/s2.
        jettisoned: bit k: jettison k is done.
    """

    unknowns: Array
    position: Array
    velocity: Array
    m_f_kg: float
    end_s: float
    over_s: float
    acceleration: float
    jettisoned: int


@dataclass
class _Track:
    """Hold the state of a continuation over failures.

    Attributes:
        unknowns: of the last optimum; None before the first.
        off_m_s: speed taken off its target.
        in_vain: consecutive points without an optimum.
    """

    unknowns: Array | None = None
    off_m_s: float = 0.0
    in_vain: int = 0


@dataclass
class _Family:
    """Hold the continuations of one start state.

    Attributes:
        lowered, safe: to the target, and to a safe orbit.
        lost: consecutive points at which the first was lost.
    """

    lowered: _Track
    safe: _Track
    lost: int = 0


def _without_pressure_limits(arrays: layout.MissionArrays) -> layout.MissionArrays:
    """Return a mission without limits of the dynamic pressure: the two-point problem keeps none."""
    arcs = arrays.arcs.copy()
    arcs["max_dynamic_pressure"] = math.inf
    free: layout.MissionArrays = arrays._replace(arcs=arcs)
    return free


def plan_in_air(mission: Mission, plan: Solution) -> Solution:
    """Return a plan with costates, of a flight that keeps no limit of the dynamic pressure.

    Args:
        mission: in the air.
        plan: of the mission.

    Raises:
        UnfitMethod: the mission has a programme of its own, or a burn in held attitude.
    """
    arrays = mission.arrays()
    held = np.flatnonzero(arrays.arcs["held"])
    if held.size:
        raise UnfitMethod(
            f"arc {held[0]} has attitude: held; expected guided, since the optimizers of the map "
            "steer all of a flight in the air"
        )
    if arrays.environment[0]["boost"]["knots"] > 0:
        raise UnfitMethod(
            "programme is given; expected none, since the optimizers of the map steer all of a "
            "flight in the air"
        )
    if not np.isfinite(arrays.arcs["max_dynamic_pressure"]).any():
        return plan
    start = mission.start().navigation()
    return solve(_without_pressure_limits(arrays), "auto", state=start)


class Optimizer:
    """Find the best ends of one mission, for failures in consecutive order."""

    def __init__(self, mission: Mission, judge: Judge, plan: Solution | None = None):
        """Solve for the optimum without failure.

        Args:
            mission: only its last arc is free.
            judge: of its ends.
            plan: of a mission in the air, of :func:`plan_in_air`.

        Raises:
            OptimizerError: there is none, or another arc is free.
        """
        self._judge = judge
        self._start = mission.start().navigation()
        self._arrays = _without_pressure_limits(mission.arrays())
        # raises if the failures of the mission have no time
        begin_times(self._arrays, float(self._start["time"][0]))
        self._options = TwoPointOptions()
        self._edge_of_air_m = edge_of_air(self._arrays)
        guess = None
        if flies_in_air(self._arrays.arcs):
            guess = None if plan is None else plan.parameters
            if guess is None:
                raise OptimizerError(_NO_NOMINAL)
            steps = math.ceil(_STEPS_IN_AIR * float(guess[COLUMN_CUTOFF]))
            self._options = TwoPointOptions(in_air=True, max_steps=steps)
        whole = Foreknown(self._arrays, math.inf)
        flown = self._solve(whole, self._start, guess, thorough=guess is None)
        flown = self._above_ground(whole, self._start, flown)
        if flown is None or flown.over_s > _SAME_END_S:
            raise OptimizerError(_NO_NOMINAL)
        self._whole = flown
        self.nominal = self._told(flown)
        if plan is None:
            plan = solve_indirect(self._arrays, self._start, guess=flown.unknowns, verify=False)
        self.drops_s = plan.jettison_times_s
        self._costates = self._solver(whole).sample(self._start, flown.unknowns)
        self.forget()

    def _solver(self, known: Foreknown) -> TwoPointSolver:
        options = self._options
        if options.in_air:
            # a tail-off in the air would have no thrust
            tails = np.flatnonzero(known.arrays.arcs["tail_knots"])
            begins = begin_times(known.arrays, float(self._start["time"][0]))
            options = replace(
                options, air_end_s=float(begins[tails[0]]) if tails.size else math.inf
            )
        return TwoPointSolver(known.arrays, options)

    @property
    def cutoff_s(self) -> float:
        """Return the cut-off time of the flight without failure."""
        return float(self._whole.unknowns[COLUMN_CUTOFF])

    def forget(self) -> None:
        """Restart the continuation from the flight without failure, for another kind of failure."""
        first = self._whole.unknowns
        self._knew = _Family(_Track(first), _Track(first))
        self._told_late = _Family(_Track(), _Track())

    def knew(self, failure: Failure) -> Reached:
        """Solve for the best end with a failure known from the start.

        Args:
            failure: close to the previous one.

        Raises:
            OptimizerError: the failure is impossible.
        """
        return self._best(failure, self._known(failure), self._start, self._knew)

    def told(self, failure: Failure, state: NDArray[np.void]) -> Reached | None:
        """Solve for the best end with a failure known from a state on; None: no thrust is left.

        Args:
            failure: close to the previous one.
            state: last state before the failure, shape (1,), dtype NAVIGATION.

        Raises:
            OptimizerError: see :meth:`knew`.
        """
        known = self._known(failure)
        if math.isfinite(known.end_s):
            return None
        family = self._told_late
        for track in (family.lowered, family.safe):
            if track.unknowns is None:
                track.unknowns = self._on_the_way(float(state["time"][0]))
        return self._best(failure, known, state, family)

    def _known(self, failure: Failure) -> Foreknown:
        """Return the mission with a failure."""
        known = self._partly(failure, 1.0)
        assert known is not None
        return known

    def _partly(self, failure: Failure, share: float) -> Foreknown | None:
        """Return the mission with a share of a failure, see :func:`partly`."""
        return partly(self._arrays, self._start, failure, share, self.cutoff_s)

    def _on_the_way(self, time_s: float) -> Array:
        """Return the unknowns of the flight without failure, from a time on."""
        i = int(np.searchsorted(self._costates[:, sample.TIME], time_s))
        row = self._costates[min(i, len(self._costates) - 1)]
        if self._options.in_air and i > 0:
            # there a guess of two seconds later is too far
            before = self._costates[i - 1]
            span = row[sample.TIME] - before[sample.TIME]
            part = (time_s - before[sample.TIME]) / span if span > 0.0 else 1.0
            row = before + min(part, 1.0) * (row - before)
        unknowns = self._whole.unknowns.copy()
        primer = row[sample.LAMBDA_V : sample.LAMBDA_V + 3]
        size = float(np.linalg.norm(primer))
        unknowns[PRIMER] = primer / size
        unknowns[LAMBDA_R] = row[sample.LAMBDA_R : sample.LAMBDA_R + 3] / size
        return unknowns

    def _sought(
        self, failure: Failure, known: Foreknown, start: NDArray[np.void], family: _Family
    ) -> _Flown | None:
        """Solve for the target, lowered as far as the propellant requires; None if that fails.

        In the air, where there are no built-in guesses to begin anew with, a track that is lost is
        led there from the flight without the failure.
        """
        flown = self._lower(known, start, family.lowered)
        if flown is None and self._options.in_air and family.lost < _PATIENCE:
            family.lowered = self._led(failure, start)
            flown = self._lower(known, start, family.lowered)
        family.lost = family.lost + 1 if flown is None else 0
        return flown

    def _led(self, failure: Failure, start: NDArray[np.void]) -> _Track:
        """Lead a track from the flight without a failure towards it, as far as it goes."""
        track = before = _Track(self._on_the_way(float(start["time"][0])))
        share, step, last = 0.0, _FIRST_SHARE, math.inf
        while share < 1.0 and step > _LEAST_SHARE:
            further = min(1.0, share + step)
            part = self._partly(failure, further)
            if part is None:
                break
            trial = _extrapolated(before, track, (further - share) / last)
            if self._lower(part, start, trial) is None or not _is_next(trial, track):
                step *= 0.5
                continue
            before, last = track, further - share
            track, share = trial, further
            step *= 2.0
        return track

    def _best(
        self, failure: Failure, known: Foreknown, start: NDArray[np.void], family: _Family
    ) -> Reached:
        lowered = self._above_ground(known, start, self._sought(failure, known, start, family))
        reached = NOWHERE if lowered is None else self._told(lowered)
        if lowered is not None and reached.end is not End.SAFE_ORBIT:
            family.safe.unknowns = lowered.unknowns
        if reached.end in (End.TARGET, End.LOWERED):
            return reached
        whole = known
        circle = known.arrays._replace(target=self._safe_target())
        known = known._replace(arrays=circle)
        safe = self._above_ground(known, start, self._attempt(known, start, family.safe))
        if safe is None or safe.over_s > _SAME_END_S:
            return reached
        reached = self._told(safe)
        if reached.end is End.LOWERED and safe.over_s < -_SAME_END_S:
            # with propellant left the target is lowered less
            track = _Track(safe.unknowns, reached.lacking_m_s)
            raised = self._above_ground(whole, start, self._lower(whole, start, track))
            if raised is not None:
                family.lowered = track
                reached = better(reached, self._told(raised))
        return reached

    def _above_ground(
        self, known: Foreknown, start: NDArray[np.void], flown: _Flown | None
    ) -> _Flown | None:
        """Return an extremal if it stays above the ground, else None.

        The two-point problem has no ground. Nor has it air where :meth:`_solver` leaves it out:
        there only an extremal above it counts.
        """
        if flown is None:
            return None
        solver = self._solver(known)
        way = solver.sample(start, flown.unknowns, _LOOK_S)
        times = way[:, sample.TIME]
        heights = self._judge.heights_m(times, way[:, sample.POSITION : sample.POSITION + 3])
        above_air = heights[times >= float(solver.options["air_end"][0])]
        if heights.min() < -ROUNDING_M or above_air.min(initial=math.inf) < self._edge_of_air_m:
            return None
        return flown

    def _told(self, flown: _Flown) -> Reached:
        return self._judge.judge(
            flown.position, flown.velocity, flown.m_f_kg, flown.end_s, flown.jettisoned
        )

    def _safe_target(self) -> NDArray[np.void]:
        """Return the safe circular orbit of least energy as a target, in any plane."""
        mu = float(self._arrays.environment[0]["mu"])
        radius = self._judge.safe_perigee_altitude_m
        radius += float(self._arrays.environment[0]["equatorial_radius"])
        target = self._arrays.target.copy()
        target["kind"] = layout.TARGET_ELEMENTS
        target["named"] = layout.NAMES_RADIUS | layout.NAMES_SPEED | layout.NAMES_FLIGHT_PATH_ANGLE
        for name in ("radius", "perigee_radius", "apogee_radius", "semi_major_axis"):
            target[name] = radius
        target["speed"] = math.sqrt(mu / radius)
        target["c3"] = -mu / radius
        for name in ("flight_path_angle", "eccentricity", "true_anomaly"):
            target[name] = 0.0
        return target

    def _lower(self, known: Foreknown, start: NDArray[np.void], track: _Track) -> _Flown | None:
        """Solve for the target, lowered as far as the propellant requires; None if that fails."""
        off = origin = track.off_m_s
        step, halvings = 0.0, 0
        found = False
        for _ in range(_ROUNDS):
            taken, target = self._lowered_by(off)
            trial = known._replace(arrays=known.arrays._replace(target=target))
            flown = self._attempt(trial, start, track)
            if flown is None:
                halvings += 1
                if not found or halvings > _HALVINGS:
                    return None
                step *= 0.5
            else:
                found = True
                if abs(flown.over_s) <= _SAME_END_S or (off == 0.0 and flown.over_s < 0.0):
                    track.off_m_s = off
                    return flown
                if taken < off - _TAKEN_WHOLE:
                    return None
                origin = off
                step = flown.over_s * flown.acceleration
                step = math.copysign(min(abs(step), _LONGEST_STEP), step)
            off = max(0.0, origin + step)
        return None

    def _lowered_by(self, off_m_s: float) -> tuple[float, NDArray[np.void]]:
        target = self._arrays.target.copy()
        if off_m_s == 0.0:
            return 0.0, target
        return lower_target(target[0], float(self._arrays.environment[0]["mu"]), off_m_s), target

    def _attempt(self, known: Foreknown, start: NDArray[np.void], track: _Track) -> _Flown | None:
        """Continue a track to the next optimum; None if it is lost."""
        flown = self._solve(known, start, track.unknowns)
        if flown is None and track.in_vain < _PATIENCE and not self._options.in_air:
            # the built-in guesses know of no air
            flown = self._solve(known, start, track.unknowns, thorough=True)
        if flown is None and math.isfinite(known.end_s):
            # a heating jettison may not come before the end
            flown = self._solve(_with_fairing(known), start, track.unknowns)
        if flown is None:
            track.in_vain += 1
            return None
        track.in_vain = 0
        track.unknowns = flown.unknowns
        return flown

    def _solve(
        self,
        known: Foreknown,
        start: NDArray[np.void],
        guess: Array | None,
        *,
        thorough: bool = False,
    ) -> _Flown | None:
        solver = self._solver(known)
        if guess is not None:
            guess = self._fitting(guess, solver.size(start))
        root = solver.solve(start, guess, restart=thorough, thorough=thorough)
        if not root.converged:
            return None
        solver.final_hamiltonian(start, root.unknowns)
        return _flown(known, start, solver, root.unknowns)

    def _fitting(self, guess: Array, size: int) -> Array:
        """Fit a guess to the drops to come; take missing ones from the flight without failure."""
        fitting = np.zeros(size)
        fitting[: min(size, guess.size)] = guess[:size]
        if guess.size < size:
            fitting[guess.size :] = self._whole.unknowns[guess.size : size]
        return fitting


def _is_next(trial: _Track, track: _Track) -> bool:
    """Tell whether an optimum is so near to the last one that it is no other extremal."""
    assert trial.unknowns is not None
    assert track.unknowns is not None
    turn = float(np.linalg.norm(trial.unknowns[PRIMER] - track.unknowns[PRIMER]))
    return turn < _LONGEST_TURN and abs(trial.off_m_s - track.off_m_s) < _MOST_OFF_M_S


def _extrapolated(before: _Track, track: _Track, times: float) -> _Track:
    """Return a track moved on by so many times its last step."""
    assert before.unknowns is not None
    assert track.unknowns is not None
    if before.unknowns.size != track.unknowns.size:
        return replace(track)
    unknowns = track.unknowns + times * (track.unknowns - before.unknowns)
    unknowns[PRIMER] /= np.linalg.norm(unknowns[PRIMER])
    return _Track(unknowns, max(0.0, track.off_m_s + times * (track.off_m_s - before.off_m_s)))


def _flown(
    known: Foreknown, start: NDArray[np.void], solver: TwoPointSolver, unknowns: Array
) -> _Flown:
    """Return the extremal of a solver's last evaluation."""
    work = solver.work[0]
    pieces = work["segments"][: work["segment_count"]]
    arcs = known.arrays.arcs
    last = arcs[-1]
    final = pieces[-1]
    mass = float(segment_mass(final, final["end"]))
    used = 0.0
    if arcs[start["arc"][0]]["stage"] == last["stage"]:
        begun = begin_mass(start[0], arcs)
        used = float(propellant_used(start[0], begun, arcs, known.arrays.jettisons))
    for piece in pieces:
        if arcs[piece["arc"]]["stage"] == last["stage"]:
            used += float(piece["mass"] - segment_mass(piece, piece["end"]))
    over = (used - float(last["propellant"])) / float(last["mass_flow"])
    state: Any = work["state"]
    return _Flown(
        unknowns,
        state[0:3].copy(),
        state[3:6].copy(),
        mass,
        float(final["end"]),
        max(over, float(unknowns[COLUMN_CUTOFF]) - known.end_s),
        float(last["thrust"]) / mass,
        _jettisoned(known.arrays, float(final["end"])),
    )


def _jettisoned(arrays: layout.MissionArrays, end_s: float) -> int:
    """Return a bit mask of the jettisons done at the end: all that are not due later."""
    later = (arrays.jettisons["criterion"] == layout.MISSION_TIME) & (
        arrays.jettisons["value"] > end_s
    )
    return sum(1 << j for j, late in enumerate(later) if not late)


def _with_fairing(known: Foreknown) -> Foreknown:
    """Keep the parts with a heating limit on board to the end."""
    jettisons = known.arrays.jettisons.copy()
    heated = jettisons["criterion"] == layout.HEATING_LIMIT
    jettisons["criterion"][heated] = layout.MISSION_TIME
    jettisons["value"][heated] = math.inf
    arrays: layout.MissionArrays = known.arrays._replace(jettisons=jettisons)
    return known._replace(arrays=arrays)
