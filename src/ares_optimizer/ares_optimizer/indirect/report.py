# SPDX-License-Identifier: Apache-2.0
"""Convert a root of the two-point problem to a solution, verified, or to the cause of a failure."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from ares_models.arrays import (
    HEATING_LIMIT,
    LONGEST_FLIGHT,
)
from ares_models.judge import judge
from ares_optimizer.indirect.closed_form import flight_errors
from ares_optimizer.indirect.kernels import sample
from ares_optimizer.indirect.solver import (
    Root,
    TwoPointOptions,
    TwoPointSolver,
)
from ares_optimizer.kernels import timetable
from ares_optimizer.obstacles import check_obstacle
from ares_optimizer.plan import length_bounds, waiting_for_heating, with_lengths
from ares_optimizer.proof.checks import constraint_table, verification
from ares_optimizer.proof.flight import Direction, Steering, fly
from ares_optimizer.proof.held import held_checks, held_obstacle, held_offsets
from ares_optimizer.request import Heating
from ares_optimizer.results import (
    SAME_LENGTH,
    jettison_times,
    length_checks,
    steering_arc,
    with_multipliers,
)
from ares_optimizer.sensitivities import target_sensitivities
from ares_optimizer.solution import (
    OPTIMAL,
    OUT_OF_TIME,
    Cause,
    Check,
    ConstraintCheck,
    Costates,
    Solution,
    Status,
    SteeringArc,
    Trajectory,
    infeasible,
    next_to_nothing,
)
from ares_optimizer.targets import target_rows
from ares_optimizer.two_point.arrays import (
    DRY,
    HELD,
    LINEAR,
    RUNGE_KUTTA,
)
from ares_optimizer.two_point.kernels import newton

Array = NDArray[np.float64]
_NODE_STRIDE = 10  # the verification compares every tenth sample
_SHORT_KG = 0.1  # least shortfall of propellant that is reported
_SEARCH_STEP_S = 40.0
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
        f"propellant of the last stage: {short:,.0f} kg short; best flight needs "
        f"{used:,.0f} kg, usable {last['propellant']:,.0f} kg"
    )


def _pieces(solver: TwoPointSolver) -> NDArray[np.void]:
    """Return the segments of the last flight."""
    work = solver.work[0]
    pieces: NDArray[np.void] = work["segments"][: work["segment_count"]]
    return pieces


def failure_cause(solver: TwoPointSolver, start: NDArray[np.void], root: Root) -> Cause:
    """Return the cause of a failed search: heating limit, target, or the search itself."""
    if root.status == newton.BAD_TIMETABLE or root.iterations == 0:
        return Cause(
            Status.ILLEGAL_START,
            "no flight can be computed: the last burn does not begin, or only "
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


def closed_form_notes(
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
        primer_rate = -first[sample.LAMBDA_R : sample.LAMBDA_R + 3] / size
        laws.append(
            steering_arc(
                (piece["start"], piece["end"]),
                primer / size,
                change / (size * length),
                (first[sample.MASS], last[sample.MASS]),
                delta_v,
                # a held direction is not the primer
                None if piece["held"] else primer_rate,
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
    heated = waiting_for_heating(arrays, start[0])
    if solver.options["heating"][0] == timetable.HEATING_OPTIMAL:
        for j, pi in zip(heated, root.pis, strict=True):
            per_unit[Check.HEATING_AT_JETTISON, j] = (
                flow * float(pi) / float(arrays.jettisons[j]["value"])
            )
    return with_multipliers(table, per_unit)


def _optimality(solver: TwoPointSolver, start: NDArray[np.void], root: Root) -> Cause:
    """Return OPTIMAL, or CONVERGED where a free arc was held as propellant is negligible."""
    low, high = length_bounds(solver.arrays, start[0])
    inside = (root.lengths > low + SAME_LENGTH) & (root.lengths < high - SAME_LENGTH)
    if not any(hold == HELD and free for hold, free in zip(root.holds, inside, strict=True)):
        return OPTIMAL
    return Cause(Status.CONVERGED, next_to_nothing(root.propellant_kg))


def _length_worths(solver: TwoPointSolver, root: Root, price: float) -> Array:
    """Return kg of final mass per second of the bound of each free arc."""
    return np.asarray(solver.work["switches"]["worth"][0, : len(root.lengths)]) / price


def solution_of(
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
    ignored = solver.options["heating"][0] == timetable.HEATING_IGNORED
    times = jettison_times(
        solver.arrays,
        start[0],
        _pieces(solver),
        None if ignored else root.drop_times_s,
        root.cutoff_s,
    )
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


def _costates(pieces: NDArray[np.void], flight: Array, jump_pi: tuple[float, ...]) -> Costates:
    """Convert a sampled flight of the solver to its costates."""
    return Costates(
        flight[:, sample.TIME].copy(),
        flight[:, sample.LAMBDA_R : sample.LAMBDA_R + 3].copy(),
        flight[:, sample.LAMBDA_V : sample.LAMBDA_V + 3].copy(),
        flight[:, sample.HAMILTONIAN].copy(),
        _hamiltonian_spread(pieces, flight),
        jump_pi,
    )


def _nodes(flight: Array) -> Array:
    """Return nodes of a sampled flight, shape (k, 8): time, position, velocity, mass."""
    nodes = np.column_stack(
        (
            flight[:, sample.TIME],
            flight[:, sample.POSITION : sample.VELOCITY + 3],
            flight[:, sample.MASS],
        )
    )
    ends = np.flatnonzero(np.diff(flight[:, sample.PIECE], append=-1.0))
    return np.asarray(nodes[np.union1d(ends, np.arange(0, len(nodes), _NODE_STRIDE))])


def _pole_turn_spread(pieces: NDArray[np.void], flight: Array) -> float:
    """Return the spread of the polar component of C = r x lambda_r + V x lambda_v, m/s.

    It is constant along the flight, jettisons included; in a held burn only from end to end.
    """
    guided = pieces["held"][flight[:, sample.PIECE].astype(np.int64)] == 0
    turn = np.cross(
        flight[:, sample.POSITION : sample.POSITION + 3],
        flight[:, sample.LAMBDA_R : sample.LAMBDA_R + 3],
    ) + np.cross(
        flight[:, sample.VELOCITY : sample.VELOCITY + 3],
        flight[:, sample.LAMBDA_V : sample.LAMBDA_V + 3],
    )
    return float(np.ptp(turn[guided, 2]))


def _broken_when_flown(solver: TwoPointSolver, broken: str) -> str:
    """Describe a constraint that the solver's model meets and the exact flight breaks."""
    if solver.options["gravity"][0] == LINEAR:
        return f"optimal in the linear field, but in inverse-square gravity {broken}"
    if solver.options["propagator"][0] != RUNGE_KUTTA:
        return f"optimal in closed form, but flown exactly {broken}"
    return broken


def verified(
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
    broken = check_obstacle(checks)
    cause = Cause(solution.status, solution.reason)
    if broken and solution.converged:
        cause = Cause(Status.INFEASIBLE, _broken_when_flown(solver, broken))
    limits = [float(arrays.jettisons[j]["value"]) for j in waiting_for_heating(arrays, start[0])]
    jump_pi = tuple(float(pi) / limit for pi, limit in zip(root.pis, limits, strict=False))
    costates = _costates(pieces, flight, jump_pi)
    offsets = held_offsets(arrays, flown, steering, costates)
    directions = held_checks(arrays, flown, offsets)
    if solution.converged and not broken:
        cause = held_obstacle(directions) or cause
    return replace(
        solution,
        **cause._asdict(),
        constraints=(
            *_multipliers(solver, start, root, flight, price, checks),
            *length_checks(
                solver.arrays,
                start[0],
                root.lengths,
                _length_worths(solver, root, price),
                np.array(root.holds[: len(root.lengths)]) == DRY,
            ),
            *directions,
        ),
        verification=verification(arrays, flown, _nodes(flight)),
        trajectory=flown.trajectory,
        costates=replace(costates, held_off_deg=offsets),
        notes={
            **solution.notes,
            "final_hamiltonian_m_s2": final,
            "pole_turn_spread_m_s": _pole_turn_spread(pieces, flight),
        },
    )
