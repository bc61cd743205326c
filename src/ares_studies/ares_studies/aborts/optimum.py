# SPDX-License-Identifier: Apache-2.0
"""Solve for the best end with a failure known from the start, by continuation over failure times.

The flight with a failure one second earlier is nearly the same: each optimum is the initial guess
of the next. A target out of reach of the propellant is lowered until it is reached: the speed taken
off is the unknown of an outer iteration.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance.kernels.shortfall import lower_target
from ares_models.arrays import (
    HEATING_LIMIT,
    MISSION_TIME,
    NAMES_FLIGHT_PATH_ANGLE,
    NAMES_RADIUS,
    NAMES_SPEED,
    TARGET_ELEMENTS,
    MissionArrays,
)
from ares_models.failures import Failure
from ares_models.judge import End
from ares_models.mission import Mission
from ares_optimizer.foreknown import Foreknown, begin_times, foreknown
from ares_optimizer.indirect.kernels import sample
from ares_optimizer.indirect.solve import solve_indirect
from ares_optimizer.indirect.solver import TwoPointSolver
from ares_optimizer.kernels.timetable import (
    COLUMN_CUTOFF,
    begin_mass,
    propellant_used,
    segment_mass,
)
from ares_optimizer.solution import OptimizerError
from ares_optimizer.two_point.arrays import LAMBDA_R, PRIMER
from ares_studies.aborts.ends import NOWHERE, Judge, Reached

Array = NDArray[np.float64]

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
    """Hold the continuations of one start state: to the target, to a safe orbit."""

    lowered: _Track
    safe: _Track


class Optimizer:
    """Find the best ends of one mission, for failures in consecutive order."""

    def __init__(self, mission: Mission, judge: Judge):
        """Solve for the optimum without failure.

        Args:
            mission: only its last arc is free.
            judge: of its ends.

        Raises:
            OptimizerError: there is none, or another arc is free.
        """
        self._judge = judge
        self._start = mission.start().navigation()
        self._arrays = mission.arrays()
        # raises if the failures of the mission have no time
        begin_times(self._arrays, float(self._start["time"][0]))
        whole = Foreknown(self._arrays, math.inf)
        flown = self._solve(whole, self._start, None, thorough=True)
        if flown is None or flown.over_s > _SAME_END_S:
            raise OptimizerError("without a failure no optimum was found that reaches the target")
        self._whole = flown
        self.nominal = self._told(flown)
        solution = solve_indirect(self._arrays, self._start, guess=flown.unknowns, verify=False)
        self.drops_s = solution.jettison_times_s
        self._costates = TwoPointSolver(self._arrays).sample(self._start, flown.unknowns)
        self.forget()

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
        known = foreknown(self._arrays, self._start, failure)
        return self._best(known, self._start, self._knew)

    def told(self, failure: Failure, state: NDArray[np.void]) -> Reached:
        """Solve for the best end with a failure known from a state on.

        Args:
            failure: close to the previous one.
            state: last state before the failure, shape (1,), dtype NAVIGATION.

        Raises:
            OptimizerError: see :meth:`knew`.
        """
        known = foreknown(self._arrays, self._start, failure)
        row = state[0]
        if row["arc"] >= len(known.arrays.arcs) or known.end_s <= row["time"] + _SAME_END_S:
            # no thrust is left to steer
            return self._judge.judge(
                row["position"],
                row["velocity"],
                float(row["mass"]),
                float(row["time"]),
                int(row["jettisoned"]),
            )
        family = self._told_late
        for track in (family.lowered, family.safe):
            if track.unknowns is None:
                track.unknowns = self._on_the_way(float(row["time"]))
        return self._best(known, state, family)

    def _on_the_way(self, time_s: float) -> Array:
        """Return the unknowns of the flight without failure, from a time on."""
        i = int(np.searchsorted(self._costates[:, sample.TIME], time_s))
        row = self._costates[min(i, len(self._costates) - 1)]
        unknowns = self._whole.unknowns.copy()
        primer = row[sample.LAMBDA_V : sample.LAMBDA_V + 3]
        size = float(np.linalg.norm(primer))
        unknowns[PRIMER] = primer / size
        unknowns[LAMBDA_R] = row[sample.LAMBDA_R : sample.LAMBDA_R + 3] / size
        return unknowns

    def _best(self, known: Foreknown, start: NDArray[np.void], family: _Family) -> Reached:
        lowered = self._above_ground(known, start, self._lower(known, start, family.lowered))
        reached = NOWHERE if lowered is None else self._told(lowered)
        if lowered is not None and reached.end is not End.SAFE_ORBIT:
            family.safe.unknowns = lowered.unknowns
        if reached.end in (End.TARGET, End.LOWERED):
            return reached
        circle = known.arrays._replace(target=self._safe_target())
        known = known._replace(arrays=circle)
        safe = self._above_ground(known, start, self._attempt(known, start, family.safe))
        if safe is not None and safe.over_s <= _SAME_END_S:
            return self._told(safe)
        return reached

    def _above_ground(
        self, known: Foreknown, start: NDArray[np.void], flown: _Flown | None
    ) -> _Flown | None:
        """Return an extremal if it stays above the ground, else None.

        The two-point problem has no ground.
        """
        if flown is None:
            return None
        way = TwoPointSolver(known.arrays).sample(start, flown.unknowns, _LOOK_S)
        places = way[:, sample.POSITION : sample.POSITION + 3]
        return None if self._judge.meets_ground(way[:, sample.TIME], places) else flown

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
        target["kind"] = TARGET_ELEMENTS
        target["named"] = NAMES_RADIUS | NAMES_SPEED | NAMES_FLIGHT_PATH_ANGLE
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
        if flown is None and track.in_vain < _PATIENCE:
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
        solver = TwoPointSolver(known.arrays)
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
        fitting[guess.size :] = self._whole.unknowns[guess.size : size]
        return fitting


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


def _jettisoned(arrays: MissionArrays, end_s: float) -> int:
    """Return a bit mask of the jettisons done at the end: all that are not due later."""
    later = (arrays.jettisons["criterion"] == MISSION_TIME) & (arrays.jettisons["value"] > end_s)
    return sum(1 << j for j, late in enumerate(later) if not late)


def _with_fairing(known: Foreknown) -> Foreknown:
    """Keep the parts with a heating limit on board to the end."""
    jettisons = known.arrays.jettisons.copy()
    heated = jettisons["criterion"] == HEATING_LIMIT
    jettisons["criterion"][heated] = MISSION_TIME
    jettisons["value"][heated] = math.inf
    arrays: MissionArrays = known.arrays._replace(jettisons=jettisons)
    return known._replace(arrays=arrays)
