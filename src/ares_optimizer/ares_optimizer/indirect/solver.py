# SPDX-License-Identifier: Apache-2.0
"""Solve and fly the two-point problem of one mission by the kernels."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, NAVIGATION, MissionArrays
from ares_models.kernels.environment import log_heating_gradient
from ares_models.kernels.sequence import SAME_TIME
from ares_optimizer.deadline import Deadline, Progress
from ares_optimizer.indirect.kernels import sample
from ares_optimizer.kernels import timetable
from ares_optimizer.kernels.timetable import COLUMN_CUTOFF, COLUMN_JETTISON, MAX_UNKNOWNS
from ares_optimizer.plan import free_arcs, length_bounds, plans_arcs
from ares_optimizer.request import Heating
from ares_optimizer.solution import OptimizerError
from ares_optimizer.two_point.arrays import (
    AT_LONGEST,
    AT_SHORTEST,
    DRY,
    HELD,
    INVERSE_SQUARE,
    LAMBDA_R,
    LINEAR,
    NOT_HELD,
    OPTIONS,
    PIS,
    PRIMER,
    RUNGE_KUTTA,
    TIMES,
    WORK,
    Effort,
)
from ares_optimizer.two_point.kernels import closed_form, newton, search
from ares_optimizer.two_point.kernels.air import fly_in_air
from ares_optimizer.two_point.kernels.shooting import (
    begin_flight,
    fly_segment,
    part_of,
    shoot_with_jacobian,
    step_count,
)

Array = NDArray[np.float64]

GravityName = Literal["inverse_square", "linear"]
Propagator = Literal["runge_kutta", "closed_form"]
Rule = Literal["simpson", "milne"]

_GRAVITY = {"inverse_square": INVERSE_SQUARE, "linear": LINEAR}
RULES = {"simpson": closed_form.SIMPSON, "milne": closed_form.MILNE}
_HEATING = {
    Heating.AT_JETTISON: timetable.HEATING_OPTIMAL,
    Heating.PASSIVE: timetable.HEATING_PASSIVE,
    Heating.IGNORED: timetable.HEATING_IGNORED,
}

#: Longest Runge-Kutta step, s; error 0.05 mm and 0.2 um/s on the default mission.
STEP_S = 10.0
#: Length of an arc in closed form, s.
ARC_LENGTH_S = 5.0
_SAMPLE_S = 2.0
_AT_BOUND_S = 1e-6


@dataclass(frozen=True)
class IndirectGuess:
    """Hold a guess of the two-point problem.

    Attributes:
        lambda_v: primer at the start, any length, shape (3,); B in the thesis.
        lambda_r: shape (3,), 1/s for a primer of length 1; -A in the thesis.
        t_meco_s: cut-off time.
        jettison_times_s: per heating jettison still to come, in the order of the file.
        pi: jump of Eq. 3.44 per unit of log heating, for each of them; zeros if empty.
    """

    lambda_v: tuple[float, float, float]
    lambda_r: tuple[float, float, float]
    t_meco_s: float
    jettison_times_s: tuple[float, ...] = ()
    pi: tuple[float, ...] = ()

    def unknowns(self, drops: int) -> Array:
        """Return the unknowns without the ends of arcs, shape (7 + 2 drops,).

        Raises:
            OptimizerError: the guess does not fit the mission.
        """
        primer = np.asarray(self.lambda_v, dtype=np.float64)
        rate = np.asarray(self.lambda_r, dtype=np.float64)
        if primer.shape != (3,) or rate.shape != (3,):
            raise OptimizerError("guess: lambda_v and lambda_r must have three components each")
        size = float(np.linalg.norm(primer))
        if not (size > 0.0 and math.isfinite(size) and np.isfinite(rate).all()):
            raise OptimizerError(f"guess: lambda_v is {self.lambda_v}; expected a finite direction")
        if len(self.jettison_times_s) != drops:
            raise OptimizerError(
                f"guess: jettison_times_s has {len(self.jettison_times_s)} times; the mission has "
                f"{drops} heating jettisons to come"
            )
        if self.pi and len(self.pi) != drops:
            raise OptimizerError(f"guess: pi has {len(self.pi)} values; expected {drops}")
        unknowns = np.zeros(COLUMN_JETTISON + 2 * drops)
        unknowns[PRIMER] = primer / size
        unknowns[LAMBDA_R] = rate / size
        unknowns[COLUMN_CUTOFF] = self.t_meco_s
        unknowns[TIMES] = self.jettison_times_s
        unknowns[PIS] = self.pi if self.pi else 0.0
        if not np.isfinite(unknowns).all():
            raise OptimizerError("guess: times and pi must be finite")
        return unknowns


@dataclass(frozen=True)
class Root:
    """Hold the outcome of the compiled solver.

    Attributes:
        unknowns: shape (n,): lambda_v (3), lambda_r (3, 1/s), cut-off time (s), then time (s)
            and pi (per unit of log heating) of every heating jettison to come, then the end (s)
            of every free arc before the last, then the direction (3) of every held burn.
        iterations: Newton iterations, restarts included.
        residual_norm: norm of the last residuals, without unit.
        status: CONVERGED or another status of ``two_point.kernels.newton``.
        restarts: starts after the first.
        drops: number of heating jettisons to come.
        lengths: of the free arcs before the last, shape (n,), s.
        holds: active constraint on each of them: NOT_HELD, AT_SHORTEST, ... of
            ``two_point.arrays``.
        propellant_kg: propellant of the free burns from the start on, without the tail-off of the
            last; nan where the cut-off is the only free time.
        lowest_m: least radius of the flight.
    """

    unknowns: Array
    iterations: int
    residual_norm: float
    status: int
    restarts: int
    drops: int
    lengths: Array
    holds: tuple[int, ...]
    propellant_kg: float
    lowest_m: float

    @property
    def cutoff_s(self) -> float:
        """Return the cut-off time, s."""
        return float(self.unknowns[COLUMN_CUTOFF])

    @property
    def drop_times_s(self) -> Array:
        """Return the times of the heating jettisons to come, s, in the order of the file."""
        return self.unknowns[TIMES][: self.drops]

    @property
    def pis(self) -> Array:
        """Return pi of these jettisons, per unit of log heating."""
        return self.unknowns[PIS][: self.drops]

    @property
    def converged(self) -> bool:
        """Return true for a converged and sound root."""
        return self.status == newton.CONVERGED


class HasParameters(Protocol):
    """Describe a solution that can be a guess."""

    @property
    def parameters(self) -> Array | None:
        """Return the unknowns of the solver."""
        ...


Guess = IndirectGuess | HasParameters | Array | None


@dataclass(frozen=True)
class TwoPointOptions:
    """Select physical model and step sizes.

    Attributes:
        gravity: ``inverse_square`` (Eq. 2.13) or ``linear`` (Eq. 3.4, constant omega0 from the
            radius at the start).
        propagator: ``runge_kutta`` or ``closed_form`` (Eqs. 3.20-3.23, 3.27-3.29).
        heating: where the limit holds; PASSIVE: the drop waits for the limit, without a jump of
            the costates.
        step_s: longest Runge-Kutta step.
        arc_length_s: longest arc of the closed form.
        rule: quadrature of the thrust integrals, ``simpson`` or ``milne``.
        correction: under inverse-square gravity in closed form, apply the nonlinear part of
            gravity and of its gradient as impulses at the ends of the arcs; without it, the field
            is linear within each arc, and Eqs. 3.20, 3.21 omit part of its gradient.
        tolerance: of the last Newton step, in scaled unknowns.
        max_iterations: of one start.
        in_air: with the forces of the air and ambient pressure; limits of the dynamic pressure are
            not kept.
        air_end_s: time from which segments are flown without air; before it a tail-off has no
            thrust.
        max_steps: most steps of the integrator in one search; 0: no limit.
    """

    gravity: GravityName = "inverse_square"
    propagator: Propagator = "runge_kutta"
    heating: Heating = Heating.AT_JETTISON
    step_s: float = STEP_S
    arc_length_s: float = ARC_LENGTH_S
    rule: Rule = "milne"
    correction: bool = True
    tolerance: float = 1e-9
    max_iterations: int = 50
    in_air: bool = False
    air_end_s: float = math.inf
    max_steps: int = 0

    def __post_init__(self) -> None:
        """Check the choices.

        Raises:
            OptimizerError: an option is not valid.
        """
        choose("gravity", self.gravity, _GRAVITY)
        choose("propagator", self.propagator, get_args(Propagator))
        choose("heating", self.heating, _HEATING)
        choose("rule", self.rule, RULES)
        for name in ("step_s", "arc_length_s"):
            if not getattr(self, name) > 0.0:
                raise OptimizerError(f"{name} is {getattr(self, name):g}; expected more than 0")
        if self.in_air and (self.in_closed_form or self.gravity == "linear"):
            raise OptimizerError(
                "in_air is True; in closed form and in linear gravity expected False"
            )

    @property
    def in_closed_form(self) -> bool:
        """Return true if the propagator is the closed form."""
        return self.propagator == "closed_form"

    def record(self) -> NDArray[np.void]:
        """Return the options for the kernels, shape (1,), dtype OPTIONS."""
        options = np.zeros(1, OPTIONS)
        inverse_square = self.gravity == "inverse_square"
        options["gravity"] = _GRAVITY[self.gravity]
        options["propagator"] = RULES[self.rule] if self.in_closed_form else RUNGE_KUTTA
        options["corrected"] = int(self.in_closed_form and self.correction and inverse_square)
        options["heating"] = _HEATING[self.heating]
        options["step"] = self.arc_length_s if self.in_closed_form else self.step_s
        options["max_iterations"] = self.max_iterations
        options["tolerance"] = self.tolerance
        options["in_air"] = int(self.in_air)
        options["air_end"] = self.air_end_s
        options["max_steps"] = self.max_steps
        return options


def choose(name: str, value: str, choices: Any) -> None:
    """Refuse a value that is not among the choices.

    Raises:
        OptimizerError: one line with the name, the value and the choices.
    """
    if value not in choices:
        raise OptimizerError(f"{name} is {str(value)!r}; expected " + " or ".join(choices))


def navigation(
    time_s: float,
    position: Any,
    velocity: Any,
    mass_kg: float = 0.0,
    *,
    arc: int = 0,
    arc_start_time_s: float | None = None,
    jettisoned: int = 0,
) -> NDArray[np.void]:
    """Return a start of the optimizer, shape (1,), dtype NAVIGATION.

    Args:
        time_s: mission elapsed time.
        position: m, shape (3,), frame ares_eci.
        velocity: m/s, shape (3,).
        mass_kg: mass; 0: that of the stack of the arc.
        arc: current arc of the mission.
        arc_start_time_s: begin of that arc; None: ``time_s``.
        jettisoned: bit k set: jettison k is done.
    """
    record = np.zeros(1, NAVIGATION)
    record["time"] = time_s
    record["position"] = position
    record["velocity"] = velocity
    record["mass"] = mass_kg
    record["heating_rate"] = math.nan
    record["arc"] = arc
    record["arc_start_time"] = time_s if arc_start_time_s is None else arc_start_time_s
    record["jettisoned"] = jettisoned
    return record


class TwoPointSolver:
    """Solve the two-point problem of one mission, with work memory allocated once.

    Attributes:
        arrays: the mission.
        deadline: time limit of searches and continuations.
        options: shape (1,), dtype OPTIONS.
        work: shape (1,), dtype WORK.
    """

    def __init__(
        self,
        arrays: MissionArrays,
        options: TwoPointOptions | None = None,
        deadline: Deadline | None = None,
    ) -> None:
        """Allocate the work memory.

        Args:
            arrays: the mission.
            options: physical model and step sizes.
            deadline: time limit; None: no limit.

        Raises:
            OptimizerError: the mission is not valid for this method.
        """
        options = options or TwoPointOptions()
        j2 = arrays.environment[0]["j2"]
        if j2 != 0.0 and (options.in_closed_form or options.gravity == "linear"):
            raise OptimizerError(
                f"environment.j2 is {j2:g}; in closed form and in linear gravity the Earth is a "
                "sphere, 0"
            )
        if arrays.arcs[-1]["kind"] != BURN:
            raise OptimizerError("the last arc is a coast; the two-point problem ends with a burn")
        self.arrays = arrays
        self._mission = arrays.records()
        self._held = np.flatnonzero(arrays.arcs["held"]).tolist()
        self.deadline = deadline or Deadline()
        self.options = options.record()
        self.work = np.zeros(1, WORK)
        self.deadline.watch(self.work["stop"])

    def drops(self, start: NDArray[np.void]) -> int:
        """Return the number of heating jettisons whose time is unknown."""
        heating = int(self.options["heating"][0])
        return int(timetable.heating_count(start[0], self.arrays.jettisons, heating))

    def plans_arcs(self, start: NDArray[np.void]) -> bool:
        """Return true if free arcs precede the last, or the last burn has a fixed length."""
        return plans_arcs(self.arrays, start[0])

    def ends(self, start: NDArray[np.void]) -> slice:
        """Return the slice of the unknowns with the ends of free arcs before the last."""
        first = COLUMN_JETTISON + 2 * self.drops(start)
        return slice(first, first + len(free_arcs(self.arrays, start[0])))

    def size(self, start: NDArray[np.void]) -> int:
        """Return the number of unknowns."""
        present = int(start["arc"][0])
        return self.ends(start).stop + 3 * sum(k >= present for k in self._held)

    def _padded(self, start: NDArray[np.void], unknowns: Array | None) -> Array:
        """Return the unknowns padded to the size that the kernels need."""
        padded = np.zeros(MAX_UNKNOWNS)
        if unknowns is not None:
            n = self.size(start)
            padded[:n] = unknowns[:n]
        return padded

    def solve(
        self,
        start: NDArray[np.void],
        guess: Array | None = None,
        *,
        times: Array | None = None,
        restart: bool = True,
        thorough: bool = False,
    ) -> Root:
        """Find the optimum, from a guess or from the start alone.

        Args:
            start: shape (1,), dtype NAVIGATION, see :func:`navigation`.
            guess: shape (n,), see :attr:`Root.unknowns`; None: the built-in guesses.
            times: shape (n,), read without a guess: the ends of free arcs, for the built-in
                guesses.
            restart: try the built-in guesses when ``guess`` fails.
            thorough: search for further roots, see ``Effort``, and keep the best.
        """
        unknowns = self._padded(start, times if guess is None else guess)
        effort = Effort(guess is not None, restart, thorough, 0)
        iterations, residual, status, restarts = search.find_optimum(
            start[0], self._mission, self.options[0], effort, unknowns, self.work[0]
        )
        self.deadline.report(Progress("indirect", iterations, residual))
        return self._root(start, unknowns, iterations, residual, status, restarts)

    def _root(
        self,
        start: NDArray[np.void],
        unknowns: Array,
        iterations: int,
        residual: float,
        status: int,
        restarts: int,
    ) -> Root:
        """Collect the result of the kernels, with arc lengths and propellant."""
        n = self.size(start)
        lengths = np.zeros(0)
        propellant = math.nan
        lowest = float(self.work["lowest"][0])
        if self.plans_arcs(start):
            begin_flight(start[0], self._mission, self.options[0], unknowns, self.work[0])
            arcs = self.arrays.arcs
            begins = self.work["layout"]["begins"][0, : len(arcs)]
            free = free_arcs(self.arrays, start[0])
            lengths = unknowns[self.ends(start)] - begins["time"][free]
            pay = np.isinf(arcs["duration"]) & (arcs["kind"] == BURN)
            pay[: int(start["arc"][0])] = False
            propellant = float((begins["used_end"] - begins["used"])[pay].sum())
        holds = tuple(int(hold) for hold in self.work["switches"]["hold"][0, : lengths.size])
        return Root(
            unknowns[:n].copy(),
            iterations,
            residual,
            status,
            restarts,
            self.drops(start),
            lengths,
            holds,
            propellant,
            lowest,
        )

    def hold(self, start: NDArray[np.void], lengths: Mapping[int, float]) -> None:
        """Hold free arcs at given lengths in later searches; release the others.

        Args:
            start: shape (1,), dtype NAVIGATION.
            lengths: s, by index into :func:`plan.free_arcs`.
        """
        switches = self.work["switches"][0]
        switches["hold"] = NOT_HELD
        for f, length in lengths.items():
            switches[f]["hold"] = HELD
            switches[f]["length"] = length

    def hold_at_bounds(self, start: NDArray[np.void], lengths: Array) -> None:
        """Hold free arcs that are at a bound of their length there, until they are released.

        Args:
            start: shape (1,), dtype NAVIGATION.
            lengths: of the arcs of :func:`plan.free_arcs`, s.
        """
        switches = self.work["switches"][0]
        low, high = length_bounds(self.arrays, start[0])
        for f, k in enumerate(free_arcs(self.arrays, start[0])):
            if lengths[f] <= low[f] + _AT_BOUND_S:
                switches[f]["hold"] = AT_SHORTEST
            elif lengths[f] >= high[f] - _AT_BOUND_S:
                dry = high[f] < self.arrays.arcs[k]["longest"]
                switches[f]["hold"] = DRY if dry else AT_LONGEST

    def shoot(self, start: NDArray[np.void], unknowns: Array) -> tuple[Array, Array, Array]:
        """Fly the unknowns.

        Returns:
            residuals, shape (n,); Jacobian, shape (n, n); state at the end, shape (12,): r, V,
            lambda_v, lambda_v'.

        Raises:
            OptimizerError: the times are not possible.
        """
        n = self.size(start)
        self.work["steps"] = 0
        self.work["pinned"] = 0
        work = self.work[0]
        trial = self._padded(start, unknowns)
        if not shoot_with_jacobian(start[0], self._mission, self.options[0], trial, work):
            raise OptimizerError("no flight is possible with these times")
        return (
            work["residual"][:n].copy(),
            work["jacobian"][:n, :n].copy(),
            work["state"].copy(),
        )

    def sample(
        self, start: NDArray[np.void], unknowns: Array, interval_s: float = _SAMPLE_S
    ) -> Array:
        """Sample the flight: shape (k, ``indirect.kernels.sample.SAMPLE_COLUMNS``).

        In the air lambda_r is the last column.
        """
        trial = np.zeros(MAX_UNKNOWNS)
        trial[: unknowns.size] = unknowns
        if self.options["in_air"][0]:
            return self._sample_in_air(start, trial, interval_s)
        out = np.zeros((1024, sample.SAMPLE_COLUMNS))
        while True:
            rows = sample.sample_flight(
                start[0], self._mission, self.options[0], trial, interval_s, out, self.work[0]
            )
            if rows >= 0:
                return out[:rows].copy()
            out = np.zeros((-rows, sample.SAMPLE_COLUMNS))

    def _sample_in_air(self, start: NDArray[np.void], unknowns: Array, interval_s: float) -> Array:
        """Sample the flight through the air, both ends of every segment included."""
        work, options = self.work[0], self.options[0]
        gravity = begin_flight(start[0], self._mission, options, unknowns, work)
        work["columns"] = 0
        part = work["segments"][-1]
        rows = []
        for segment in work["segments"][: int(work["segment_count"])]:
            count = max(1, math.ceil((segment["end"] - segment["start"]) / interval_s))
            for k in range(count + 1):
                if k:
                    part_of(segment, k - 1, count, part)
                    part["arc"] = segment["arc"]
                    if segment["start"] < options["air_end"] - SAME_TIME:
                        fly_in_air(part, options["air_end"], gravity, self._mission, work)
                    else:
                        fly_segment(part, step_count(part, options["step"]), gravity, options, work)
                time_s = float(part["end"] if k else segment["start"])
                r, v, p, q = work["state"].reshape(4, 3)
                rows.append([time_s, *r, *v, timetable.segment_mass(segment, time_s), *p, *-q])
            if segment["end_heating"] >= 0 and options["heating"] == timetable.HEATING_OPTIMAL:
                self._jump(unknowns[COLUMN_JETTISON + 2 * int(segment["end_heating"]) + 1])
        return np.array(rows)

    def _jump(self, pi: float) -> None:
        """Apply the jump of the costates at a heating jettison to the state in ``work``."""
        state = self.work["state"][0]
        r, v = tuple(state[0:3].tolist()), tuple(state[3:6].tolist())
        _, by_r, by_v = log_heating_gradient(
            r, v, self._mission.environment, self._mission.atmosphere
        )
        state[6:9] -= pi * np.array(by_v)
        state[9:12] += pi * np.array(by_r)

    def final_hamiltonian(self, start: NDArray[np.void], unknowns: Array) -> float:
        """Return lambda_r . V + lambda_v . (g + u T/m) at cut-off, m/s2."""
        trial = np.zeros(MAX_UNKNOWNS)
        trial[: unknowns.size] = unknowns
        return float(
            search.final_hamiltonian(start[0], self._mission, self.options[0], trial, self.work[0])
        )
