# SPDX-License-Identifier: Apache-2.0
"""Solve for the optimum by the indirect method, as the root of a two-point problem.

Costates follow Eqs. 3.15-3.21 under inverse-square or linear gravity, thrust is along lambda_v, the
interior condition is that of Eqs. 3.44-3.51 with the term that the print lacks, and reduced
transversality covers the free elements of the target. The kernels (``two_point/kernels``) solve;
this module converts a mission to their input and their result to a :class:`Solution`.
"""

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from ares_models.arrays import (
    HEATING_LIMIT,
    LONGEST_FLIGHT,
    MISSION_TIME,
    TARGET_ELEMENTS,
    MissionArrays,
)
from ares_models.judge import judge
from ares_optimizer.deadline import Deadline
from ares_optimizer.indirect.closed_form import flight_errors
from ares_optimizer.indirect.free_arcs import find_planned, lengths_of, refine_planned
from ares_optimizer.indirect.kernels import sample
from ares_optimizer.indirect.solver import (
    Guess,
    IndirectGuess,
    Root,
    TwoPointOptions,
    TwoPointSolver,
)
from ares_optimizer.kernels import timetable
from ares_optimizer.obstacles import check_obstacle, target_obstacle
from ares_optimizer.pieces import first_ignitions
from ares_optimizer.plan import free_arcs, length_bounds, with_lengths
from ares_optimizer.proof.checks import constraint_table, verification
from ares_optimizer.proof.flight import Direction, Steering, fly
from ares_optimizer.proof.held import held_checks, held_obstacle, held_offsets
from ares_optimizer.request import Heating, Request
from ares_optimizer.sensitivities import target_sensitivities
from ares_optimizer.solution import (
    OPTIMAL,
    OUT_OF_TIME,
    Cause,
    Check,
    ConstraintCheck,
    Costates,
    OptimizerError,
    Solution,
    Status,
    SteeringArc,
    Trajectory,
    failed,
    infeasible,
    next_to_nothing,
)
from ares_optimizer.targets import target_rows
from ares_optimizer.two_point.arrays import (
    DRY,
    HELD,
    INVERSE_SQUARE,
    LINEAR,
    RUNGE_KUTTA,
)
from ares_optimizer.two_point.kernels import newton

Array = NDArray[np.float64]


_SAME_LENGTH = 1e-3  # s
_NODE_STRIDE = 10  # the verification compares every tenth sample
_SHORT_KG = 0.1  # least shortfall of propellant that is reported
_SEARCH_STEP_S = 40.0
_LEAST_STEPS = 16  # in a flight
# continuation: first fraction, most steps, initial factor on the heating limits
_FIRST_PART = 0.1
_MOST_PARTS = 60
_HIGHEST_LIMIT = 1e4
_OPEN = 0.1  # initial eccentricity of the continuation to a nearly circular orbit


_CAUSES = {
    newton.ITERATION_LIMIT: Cause(
        Status.ITERATION_LIMIT, "Newton's method did not end within its iterations"
    ),
    newton.STALLED: Cause(
        Status.STALLED, "no step of Newton's method brings the flight nearer to its target"
    ),
    newton.SINGULAR: Cause(Status.STALLED, "the Jacobian of the two-point problem is singular"),
    newton.AT_FLOOR: Cause(Status.STALLED, "a heating limit is exceeded when its jettison is due"),
    newton.STOPPED: OUT_OF_TIME,
    newton.AT_BOUND: Cause(
        Status.STALLED, "a free arc goes from one bound of its length to another"
    ),
    newton.UNSOUND: Cause(
        Status.NOT_OPTIMAL,
        "the root found is not a flight: below ground, or a longer burn would cost less",
    ),
}


def solve_indirect(
    arrays: MissionArrays,
    start: NDArray[np.void],
    options: TwoPointOptions | None = None,
    *,
    guess: Guess = None,
    finish: bool = True,
    deadline: Deadline | None = None,
    verify: bool = True,
) -> Solution:
    """Compute the optimal ascent by the indirect method.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION, see :func:`navigation`.
        options: physical model and step sizes.
        guess: an :class:`IndirectGuess`, an earlier solution of this method, or its parameters,
            shape (7 + 2 drops,); None: the built-in guesses. When a guess leads to a root, the
            built-in guesses are tried too and the better root is kept.
        finish: under inverse-square gravity, refine the root of the closed form to the exact one
            by Runge-Kutta; the result of the closed form is in ``notes``.
        deadline: time limit; None: no limit.
        verify: fly the solution again and fill ``verification``, ``constraints``,
            ``trajectory`` and ``costates``. Without it ``converged`` is not verified.

    Returns:
        the solution with sampled ``costates``. ``hamiltonian_spread`` has one entry per piece of
        constant thrust and includes the mass costate term.

    Raises:
        OptimizerError: the guess or the mission is not valid for this method.
    """
    options = options or TwoPointOptions()
    method = "closed_form" if options.in_closed_form else "indirect"
    solver = TwoPointSolver(arrays, options, deadline)
    unknowns = _as_unknowns(guess, solver, start)
    began = time.perf_counter()
    cause = infeasible(target_obstacle(arrays))
    if cause is None and solver.deadline.passed:
        cause = OUT_OF_TIME
    if cause is not None:
        return failed(method, cause, solve_ms=_elapsed_ms(began))
    root = _find(solver, start, unknowns)
    notes: dict[str, float] = {}
    if root.converged and options.in_closed_form and options.gravity == "inverse_square":
        fine = TwoPointOptions(
            heating=options.heating, step_s=_final_step(options.step_s, start, root)
        )
        notes = _closed_form_notes(solver, start, root, options)
        if finish:
            solver = TwoPointSolver(arrays, fine, solver.deadline)
            root = _with_work_of(solver.solve(start, root.unknowns), root, 0)
    elapsed = _elapsed_ms(began)
    if not root.converged:
        late = solver.deadline.passed
        cause = OUT_OF_TIME if late else _failure_cause(solver, start, root)
        return replace(
            failed(method, cause, iterations=root.iterations),
            solve_ms=elapsed,
            parameters=root.unknowns,
            restarts=root.restarts,
        )
    solution = _solution(method, solver, start, root, elapsed, notes)
    return _verified(solver, start, root, solution) if verify else solution


def refine_root(request: Request, unknowns: Array) -> Solution:
    """Refine unknowns near a root by Newton's method, without any other search.

    Args:
        request: request for the indirect method.
        unknowns: shape (n,), see :attr:`ares_optimizer.indirect.solver.Root.unknowns`.

    Raises:
        OptimizerError: the mission is not valid for this method.
    """
    began = time.perf_counter()
    start = request.state
    options = TwoPointOptions(heating=request.heating)
    solver = TwoPointSolver(request.arrays, options, request.deadline)
    _as_unknowns(unknowns, solver, start)
    if solver.plans_arcs(start):
        solver.hold_at_bounds(start, lengths_of(solver, start, unknowns))
    root = solver.solve(start, unknowns, restart=False)
    if root.converged:
        fine = _final_step(float(solver.options["step"][0]), start, root)
        if fine < float(solver.options["step"][0]):
            solver.options["step"] = fine
            root = _with_work_of(solver.solve(start, root.unknowns, restart=False), root, 0)
    elapsed = _elapsed_ms(began)
    if not root.converged:
        return failed("indirect", _CAUSES[root.status], iterations=root.iterations)
    solution = _solution("indirect", solver, start, root, elapsed, {})
    return _verified(solver, start, root, solution) if request.verify else solution


def _elapsed_ms(began: float) -> float:
    """Return the time since ``began``, ms."""
    return 1e3 * (time.perf_counter() - began)


def _as_unknowns(guess: Guess, solver: TwoPointSolver, start: NDArray[np.void]) -> Array | None:
    if guess is None:
        return None
    size = solver.size(start)
    if isinstance(guess, IndirectGuess):
        known = guess.unknowns(solver.drops(start))
        # the solver sets the directions of held burns
        return np.concatenate((known, np.zeros(size - known.size)))
    values = guess if isinstance(guess, np.ndarray) else guess.parameters
    if values is None:
        raise OptimizerError("guess: the solution has no parameters")
    values = np.asarray(values, dtype=np.float64)
    if values.shape != (size,) or not np.isfinite(values).all():
        raise OptimizerError(
            f"guess: parameters have shape {values.shape}; expected ({size},), finite"
        )
    return values


def _find(solver: TwoPointSolver, start: NDArray[np.void], guess: Array | None) -> Root:
    """Find the best root on a coarse grid, by continuation where needed; refine it.

    The guess and the built-in guesses come first, then the continuations.
    """
    fine = float(solver.options["step"][0])
    if solver.options["propagator"][0] == RUNGE_KUTTA:
        solver.options["step"] = max(fine, _SEARCH_STEP_S)
    planned = solver.plans_arcs(start)
    if planned:
        root = find_planned(solver, start, guess)
    else:
        root = solver.solve(start, guess, thorough=True)
    if not root.converged and not planned:
        for ladder in (
            _from_linear_gravity,
            _from_light_drops,
            _from_high_limits,
            _from_open_orbit,
        ):
            if solver.deadline.passed:
                break
            further = ladder(solver, start)
            if further is not None and further.converged:
                root = _with_work_of(further, root, 1)
                break
    solver.options["step"] = fine
    if not root.converged:
        return root
    if solver.options["propagator"][0] == RUNGE_KUTTA:
        solver.options["step"] = _final_step(fine, start, root)
    if planned:
        return _with_work_of(refine_planned(solver, start, root), root, 0)
    return _with_work_of(solver.solve(start, root.unknowns, restart=False), root, 0)


def _final_step(step_s: float, start: NDArray[np.void], root: Root) -> float:
    """Return the step of the final grid, s; a short flight gets _LEAST_STEPS too."""
    return min(step_s, float(root.cutoff_s - start["time"][0]) / _LEAST_STEPS)


def _with_work_of(root: Root, before: Root, starts: int) -> Root:
    """Return a root with the iterations and restarts of an earlier one added."""
    return replace(
        root,
        iterations=root.iterations + before.iterations,
        restarts=root.restarts + before.restarts + starts,
    )


def _from_linear_gravity(solver: TwoPointSolver, start: NDArray[np.void]) -> Root | None:
    """Solve in the linear field first."""
    if solver.options["gravity"][0] == LINEAR:
        return None
    corrected = int(solver.options["corrected"][0])
    solver.options["gravity"] = LINEAR
    solver.options["corrected"] = 0
    root = solver.solve(start)
    solver.options["gravity"] = INVERSE_SQUARE
    solver.options["corrected"] = corrected
    if not root.converged:
        return None
    return _with_work_of(solver.solve(start, root.unknowns, restart=False), root, 0)


def _from_light_drops(solver: TwoPointSolver, start: NDArray[np.void]) -> Root | None:
    """Solve by continuation from lighter fairings, whose drop turns the primer less."""
    if solver.drops(start) == 0:
        return None
    whole = solver.arrays.jettisons["mass"].copy()

    def part(fraction: float) -> None:
        solver.arrays.jettisons["mass"] = whole * fraction

    return _continue(solver, start, part)


def _from_high_limits(solver: TwoPointSolver, start: NDArray[np.void]) -> Root | None:
    """Solve by continuation from higher heating limits."""
    if solver.drops(start) == 0:
        return None
    heated = solver.arrays.jettisons["criterion"] == HEATING_LIMIT
    whole = solver.arrays.jettisons["value"].copy()

    def part(fraction: float) -> None:
        higher = whole * _HIGHEST_LIMIT ** (1.0 - fraction)
        solver.arrays.jettisons["value"] = np.where(heated, higher, whole)

    return _continue(solver, start, part)


def _from_open_orbit(solver: TwoPointSolver, start: NDArray[np.void]) -> Root | None:
    """Solve a nearly circular target by continuation from a more eccentric orbit."""
    target = solver.arrays.target[0]
    e = float(target["eccentricity"])
    if target["kind"] != TARGET_ELEMENTS or not 0.0 < e < _OPEN:
        return None
    mu = float(solver.arrays.environment[0]["mu"])
    perigee = float(target["perigee_radius"])
    whole = target.copy()

    def part(fraction: float) -> None:
        opened = e**fraction * _OPEN ** (1.0 - fraction)
        target["eccentricity"] = opened
        target["apogee_radius"] = perigee * (1.0 + opened) / (1.0 - opened)
        target["semi_major_axis"] = perigee / (1.0 - opened)
        target["c3"] = mu * (opened - 1.0) / perigee
        if fraction == 1.0:
            solver.arrays.target[0] = whole

    return _continue(solver, start, part)


def _continue(
    solver: TwoPointSolver, start: NDArray[np.void], part: Callable[[float], None]
) -> Root | None:
    """Solve by continuation in the fraction of the difficulty, from _FIRST_PART to 1."""
    try:
        done = 0.0
        step = _FIRST_PART
        part(done + step)
        root = solver.solve(start)
        if not root.converged:
            return None
        done = step
        for _ in range(_MOST_PARTS):
            if solver.deadline.passed:
                return None
            trial = min(1.0, done + step)
            part(trial)
            further = _with_work_of(solver.solve(start, root.unknowns, restart=False), root, 0)
            if not further.converged:
                step *= 0.25
                continue
            root = further
            if trial == 1.0:
                return root
            done = trial
            step *= 2.0
    finally:
        part(1.0)
    return None


def _propellant_obstacle(solver: TwoPointSolver, start: NDArray[np.void], root: Root) -> str:
    """Return a line if the last stage is depleted before cut-off, else ""."""
    arrays = solver.arrays
    last = arrays.arcs[-1]
    solver.final_hamiltonian(start, root.unknowns)
    used = 0.0
    if arrays.arcs[start["arc"][0]]["stage"] == last["stage"]:
        mass = timetable.begin_mass(start[0], arrays.arcs)
        used = timetable.propellant_used(start[0], mass, arrays.arcs, arrays.jettisons)
    for piece in _pieces(solver):
        if arrays.arcs[piece["arc"]]["stage"] == last["stage"]:
            used += piece["mass"] - timetable.segment_mass(piece, piece["end"])
    short = float(used - last["propellant"])
    if short <= _SHORT_KG:
        return ""
    return (
        f"propellant of the last stage: {short:,.0f} kg short, the best flight takes "
        f"{used:,.0f} kg of {last['propellant']:,.0f} kg"
    )


def _pieces(solver: TwoPointSolver) -> NDArray[np.void]:
    """Return the segments of the last flight."""
    work = solver.work[0]
    pieces: NDArray[np.void] = work["segments"][: work["segment_count"]]
    return pieces


def _failure_cause(solver: TwoPointSolver, start: NDArray[np.void], root: Root) -> Cause:
    """Return the cause of a failed search: heating limit, target, or the search itself."""
    if root.status == newton.BAD_TIMETABLE or root.iterations == 0:
        return Cause(
            Status.ILLEGAL_START,
            "no flight can be laid out: the last burn does not begin, or only "
            f"{LONGEST_FLIGHT:,.0f} s after the start, or too many events",
        )
    options = solver.options.copy()
    solver.options["step"] = max(float(options["step"][0]), _SEARCH_STEP_S)
    solver.options["heating"] = timetable.HEATING_IGNORED
    free = solver.solve(start)
    if free.converged:
        cause = infeasible(_heating_obstacle(solver, start, free)) or _CAUSES[root.status]
    elif misses := _target_errors(solver, start, free):
        out = free.status == newton.ITERATION_LIMIT
        cause = Cause(
            Status.ITERATION_LIMIT if out else Status.INFEASIBLE,
            f"no flight to the target found: {', '.join(misses)}",
        )
    else:
        # the target is met, the conditions of an optimum are not
        cause = _CAUSES[free.status]
    solver.options[:] = options
    return cause


def _heating_obstacle(solver: TwoPointSolver, start: NDArray[np.void], free: Root) -> str:
    """Return a line if a flight without heating limits violates one, else ""."""
    flight = solver.sample(start, free.unknowns)
    stages = solver.arrays.arcs["stage"][_arc_of(solver, flight)]
    line = ""
    for j, jettison in enumerate(solver.arrays.jettisons):
        if jettison["criterion"] != HEATING_LIMIT or int(start["jettisoned"][0]) >> j & 1:
            continue
        after = flight[stages >= jettison["stage"]]
        least = after[np.argmin(after[:, sample.LOG_HEATING])]
        rate = math.exp(least[sample.LOG_HEATING])
        if rate > jettison["value"]:
            line = (
                f"no flight found that meets the heating limit of jettison {j}, "
                f"{jettison['value']:.6g} W/m2: without it the least is {rate:.6g} W/m2, "
                f"at {least[sample.TIME]:.1f} s"
            )
    return line


def _target_errors(solver: TwoPointSolver, start: NDArray[np.void], root: Root) -> list[str]:
    """Return the errors of the last flight tried against the target, as the judge finds them."""
    flight = solver.sample(start, root.unknowns)
    if len(flight) == 0:
        return ["no flight is possible with these times"]
    environment = solver.arrays.environment[0]
    return judge(
        flight[-1, sample.POSITION : sample.POSITION + 3],
        flight[-1, sample.VELOCITY : sample.VELOCITY + 3],
        solver.arrays.target[0],
        float(environment["mu"]),
        float(environment["equatorial_radius"]),
    ).misses()


def _arc_of(solver: TwoPointSolver, flight: Array) -> NDArray[np.int64]:
    """Return the arc of every sample."""
    arcs: NDArray[np.int64] = solver.work[0]["segments"]["arc"][
        flight[:, sample.PIECE].astype(np.int64)
    ]
    return arcs


def _closed_form_notes(
    solver: TwoPointSolver, start: NDArray[np.void], root: Root, options: TwoPointOptions
) -> dict[str, float]:
    """Return the result of the closed form and its error against the exact flight."""
    flight = solver.sample(start, root.unknowns)
    error = flight_errors(solver.arrays, start, root.unknowns, options)
    times = root.drop_times_s
    return {
        "closed_form_m_f_kg": float(flight[-1, sample.MASS]),
        "closed_form_t_meco_s": root.cutoff_s,
        "closed_form_t_plf_s": float(times[-1]) if times.size else math.nan,
        "closed_form_position_error_m": error.position_m,
        "closed_form_velocity_error_m_s": error.velocity_m_s,
    }


def _jettison_times(
    solver: TwoPointSolver, start: NDArray[np.void], root: Root
) -> tuple[float, ...]:
    """Return the time of every jettison, s; nan if done before or not in this flight."""
    arrays = solver.arrays
    ignitions = first_ignitions(start[0], _pieces(solver), arrays.arcs)
    now = float(start["time"][0])
    times = []
    heated = iter(root.drop_times_s)
    for j, jettison in enumerate(arrays.jettisons):
        if (int(start["jettisoned"][0]) >> j) & 1:
            times.append(math.nan)
            continue
        earliest = max(now, ignitions[int(jettison["stage"])])
        if jettison["criterion"] == HEATING_LIMIT:
            if solver.options["heating"][0] == timetable.HEATING_IGNORED:
                at = earliest
            else:
                at = float(next(heated))
        elif jettison["criterion"] == MISSION_TIME:
            at = max(earliest, float(jettison["value"]))
        else:
            at = max(now, ignitions[int(jettison["stage"])] + float(jettison["value"]))
        times.append(at if at <= root.cutoff_s else math.nan)
    return tuple(times)


def _steering_arcs(pieces: NDArray[np.void], flight: Array) -> tuple[SteeringArc, ...]:
    """Return a linear-tangent law per piece, the chord between the primers at its ends."""
    laws = []
    for i, piece in enumerate(pieces):
        rows = flight[flight[:, sample.PIECE] == i]
        first, last = rows[0], rows[-1]
        steered = sample.DIRECTION if piece["held"] else sample.LAMBDA_V
        primer = first[steered : steered + 3]
        change = last[steered : steered + 3] - primer
        length = float(piece["end"] - piece["start"])
        size = float(np.linalg.norm(primer))
        acceleration = rows[:, sample.THRUST] / rows[:, sample.MASS]
        if piece["flow"] > 0.0 and piece["flow_slope"] == 0.0:
            speed = float(piece["thrust"] / piece["flow"])
            delta_v = speed * math.log(first[sample.MASS] / last[sample.MASS])
        else:
            delta_v = float(np.trapezoid(acceleration, rows[:, sample.TIME]))
        direction = primer / size
        rate = change / (size * length)
        primer_rate = -first[sample.LAMBDA_R : sample.LAMBDA_R + 3] / size
        if piece["held"]:
            # a held direction is not the primer
            primer_rate = np.full(3, math.nan)
        laws.append(
            SteeringArc(
                float(piece["start"]),
                float(piece["end"]),
                float(piece["start"]),
                (float(direction[0]), float(direction[1]), float(direction[2])),
                (float(rate[0]), float(rate[1]), float(rate[2])),
                float(first[sample.MASS]),
                float(last[sample.MASS]),
                delta_v,
                (float(primer_rate[0]), float(primer_rate[1]), float(primer_rate[2])),
            )
        )
    return tuple(laws)


def _hamiltonian_spread(pieces: NDArray[np.void], flight: Array) -> tuple[float, ...]:
    """Return the relative spread of the Hamiltonian per piece of constant thrust."""
    full = flight[:, sample.HAMILTONIAN] - flight[:, sample.FLOW] * flight[:, sample.MASS_COSTATE]
    size = float(np.abs(flight[:, sample.HAMILTONIAN]).max())
    spread = []
    for i, piece in enumerate(pieces):
        if piece["thrust_slope"] == 0.0 and piece["fading"] == 0.0:
            values = full[flight[:, sample.PIECE] == i]
            spread.append(float(np.ptp(values)) / size)
    return tuple(spread)


def _primer_steering(pieces: NDArray[np.void], flight: Array) -> Steering:
    """Return the thrust direction of a sampled flight, from a cubic Hermite primer.

    The primer is exact in value and rate at the samples. In a held burn the direction is its own.
    """

    def steering(begin: float, end: float) -> Direction:
        middle = 0.5 * (begin + end)
        times = flight[:, sample.TIME]
        piece = flight[np.searchsorted(times, middle) - 1, sample.PIECE]
        rows = flight[flight[:, sample.PIECE] == piece]
        if pieces["held"][int(piece)]:
            held = rows[0, sample.DIRECTION : sample.DIRECTION + 3]
            return lambda _: np.asarray(held / math.sqrt(held @ held))
        primer = CubicHermiteSpline(
            rows[:, sample.TIME],
            rows[:, sample.LAMBDA_V : sample.LAMBDA_V + 3],
            -rows[:, sample.LAMBDA_R : sample.LAMBDA_R + 3],
        )

        def at(t: float) -> Array:
            vector = primer(t)
            return np.asarray(vector / math.sqrt(vector @ vector))

        return at

    return steering


def _multipliers(
    solver: TwoPointSolver,
    start: NDArray[np.void],
    root: Root,
    flight: Array,
    price: float,
    table: tuple[ConstraintCheck, ...],
) -> tuple[ConstraintCheck, ...]:
    """Return the constraint table with sensitivities from the costates.

    At cut-off lambda . dx = H_f dt_f. lambda_f is a combination of the gradients of the target's
    elements; each factor divided by the price of propellant, H_f per kg/s, is kg per unit of the
    element. At a heating jettison pi divided by that price is kg per unit of log heating.
    """
    arrays = solver.arrays
    mu = float(arrays.environment[0]["mu"])
    last = flight[-1]
    state = last[sample.POSITION : sample.VELOCITY + 3]
    costate = np.concatenate(
        (
            last[sample.LAMBDA_R : sample.LAMBDA_R + 3],
            last[sample.LAMBDA_V : sample.LAMBDA_V + 3],
        )
    )
    rows = target_rows(arrays.target[0])
    worth = target_sensitivities(arrays.target[0], mu, state, costate)
    flow = -1.0 / price
    per_unit: dict[tuple[Check, int | None], float] = {
        (rows[i].key, None): flow * float(worth[i]) for i in range(len(rows))
    }
    heated = [
        j
        for j, jettison in enumerate(arrays.jettisons)
        if jettison["criterion"] == HEATING_LIMIT and not (int(start["jettisoned"][0]) >> j) & 1
    ]
    if solver.options["heating"][0] == timetable.HEATING_OPTIMAL:
        for j, pi in zip(heated, root.pis, strict=True):
            per_unit[Check.HEATING_AT_JETTISON, j] = (
                flow * float(pi) / float(arrays.jettisons[j]["value"])
            )
    return tuple(
        replace(check, multiplier=per_unit.get((check.key, check.jettison), check.multiplier))
        for check in table
    )


def _optimality(solver: TwoPointSolver, start: NDArray[np.void], root: Root) -> Cause:
    """Return OPTIMAL, or CONVERGED where a free arc was held as propellant is negligible."""
    low, high = length_bounds(solver.arrays, start[0])
    inside = (root.lengths > low + _SAME_LENGTH) & (root.lengths < high - _SAME_LENGTH)
    if not any(hold == HELD and free for hold, free in zip(root.holds, inside, strict=True)):
        return OPTIMAL
    return Cause(Status.CONVERGED, next_to_nothing(root.propellant_kg))


def _length_checks(
    solver: TwoPointSolver, start: NDArray[np.void], root: Root, price: float
) -> tuple[ConstraintCheck, ...]:
    """Return checks on the lengths of the free arcs with kg per second."""
    arrays = solver.arrays
    checks = []
    low, high = length_bounds(arrays, start[0])
    for f, k in enumerate(free_arcs(arrays, start[0])):
        length = float(root.lengths[f])
        short = length < low[f] + _SAME_LENGTH
        long = length > high[f] - _SAME_LENGTH or root.holds[f] == DRY
        bound = float(low[f]) if short or math.isinf(high[f]) else float(high[f])
        if root.holds[f] == DRY:
            bound = length
        active = short or long
        worth = float(solver.work["switches"]["worth"][0, f]) / price
        checks.append(
            ConstraintCheck(
                Check.ARC_LENGTH,
                f"length of arc {k}",
                length,
                bound,
                active,
                "s",
                bool(low[f] - _SAME_LENGTH <= length <= high[f] + _SAME_LENGTH),
                worth if active else 0.0,
            )
        )
    return tuple(checks)


def _solution(
    method: str,
    solver: TwoPointSolver,
    start: NDArray[np.void],
    root: Root,
    elapsed: float,
    notes: dict[str, float],
) -> Solution:
    """Convert a root to a solution: times, mass, steering laws."""
    flight = solver.sample(start, root.unknowns)
    laws = _steering_arcs(_pieces(solver), flight)
    times = _jettison_times(solver, start, root)
    cause = infeasible(_propellant_obstacle(solver, start, root)) or _optimality(
        solver, start, root
    )
    return Solution(
        method,
        *cause,
        times,
        root.cutoff_s,
        float(flight[-1, sample.MASS]),
        root.iterations,
        elapsed,
        arcs=laws,
        lengths_s=tuple(float(length) for length in root.lengths),
        trajectory=_trajectory(flight),
        parameters=root.unknowns,
        restarts=root.restarts,
        notes={"residual_norm": root.residual_norm, **notes},
    )


def _trajectory(flight: Array) -> Trajectory:
    """Convert a sampled flight of the solver to a trajectory."""
    return Trajectory(
        flight[:, sample.TIME].copy(),
        flight[:, sample.POSITION : sample.POSITION + 3].copy(),
        flight[:, sample.VELOCITY : sample.VELOCITY + 3].copy(),
        flight[:, sample.MASS].copy(),
        flight[:, sample.DIRECTION : sample.DIRECTION + 3].copy(),
        np.exp(flight[:, sample.LOG_HEATING]),
        flight[:, sample.THRUST].copy(),
    )


def _verified(
    solver: TwoPointSolver, start: NDArray[np.void], root: Root, solution: Solution
) -> Solution:
    """Verify a solution by another integrator; add constraints and costates."""
    arrays = with_lengths(solver.arrays, start[0], root.lengths)
    final = solver.final_hamiltonian(start, root.unknowns)
    price = final / float(arrays.arcs[-1]["mass_flow"])
    if solver.plans_arcs(start):
        price = float(solver.work["price"][0])
    flight = solver.sample(start, root.unknowns)
    pieces = _pieces(solver)
    steering = _primer_steering(pieces, flight)
    flown = fly(
        arrays,
        start[0],
        steering,
        solution.jettison_times_s,
        solution.t_meco_s,
        [float(piece["start"]) for piece in pieces],
    )
    ignored = solver.options["heating"][0] == timetable.HEATING_IGNORED
    held = Heating.IGNORED if ignored else Heating.AT_JETTISON
    checks = constraint_table(arrays, start[0], flown, held)
    nodes = np.column_stack(
        (
            flight[:, sample.TIME],
            flight[:, sample.POSITION : sample.VELOCITY + 3],
            flight[:, sample.MASS],
        )
    )
    ends = np.flatnonzero(np.diff(flight[:, sample.PIECE], append=-1.0))
    picked = nodes[np.union1d(ends, np.arange(0, len(nodes), _NODE_STRIDE))]
    broken = check_obstacle(checks)
    cause = Cause(solution.status, solution.reason)
    if broken and solution.converged:
        reason = broken
        if solver.options["gravity"][0] == LINEAR:
            reason = f"optimal in the linear field, but in inverse-square gravity {broken}"
        elif solver.options["propagator"][0] != RUNGE_KUTTA:
            reason = f"optimal in closed form, but flown exactly {broken}"
        cause = Cause(Status.INFEASIBLE, reason)
    limits = [
        float(jettison["value"])
        for j, jettison in enumerate(arrays.jettisons)
        if jettison["criterion"] == HEATING_LIMIT and not (int(start["jettisoned"][0]) >> j) & 1
    ]
    guided = pieces["held"][flight[:, sample.PIECE].astype(np.int64)] == 0
    turn = np.cross(
        flight[:, sample.POSITION : sample.POSITION + 3],
        flight[:, sample.LAMBDA_R : sample.LAMBDA_R + 3],
    ) + np.cross(
        flight[:, sample.VELOCITY : sample.VELOCITY + 3],
        flight[:, sample.LAMBDA_V : sample.LAMBDA_V + 3],
    )
    costates = Costates(
        flight[:, sample.TIME].copy(),
        flight[:, sample.LAMBDA_R : sample.LAMBDA_R + 3].copy(),
        flight[:, sample.LAMBDA_V : sample.LAMBDA_V + 3].copy(),
        flight[:, sample.HAMILTONIAN].copy(),
        _hamiltonian_spread(pieces, flight),
        tuple(float(pi) / limit for pi, limit in zip(root.pis, limits, strict=False)),
    )
    offsets = held_offsets(arrays, flown, steering, costates)
    directions = held_checks(arrays, flown, offsets)
    if solution.converged and not broken:
        cause = held_obstacle(directions) or cause
    return replace(
        solution,
        **cause._asdict(),
        constraints=(
            *_multipliers(solver, start, root, flight, price, checks),
            *_length_checks(solver, start, root, price),
            *directions,
        ),
        verification=verification(arrays, flown, picked),
        trajectory=flown.trajectory,
        costates=replace(costates, held_off_deg=offsets),
        notes={
            **solution.notes,
            "final_hamiltonian_m_s2": final,
            # polar component of C = r x lambda_r + V x lambda_v: constant along the flight,
            # jettisons included; in a held burn only from end to end
            "pole_turn_spread_m_s": float(np.ptp(turn[guided, 2])),
        },
    )
