# SPDX-License-Identifier: Apache-2.0
"""Compute costates and sensitivities from the multipliers of a direct solution.

The multipliers of the terminal equations give the costates at cut-off. They are integrated
backwards along the flight by Eqs. 3.16 and 3.17 with the gravity gradient of the mission, and jump
at a heating-limited jettison by the multiplier of its limit (Eqs. 3.46 and, corrected, 3.47).
The steering of the direct solution enters through the flight alone, so a comparison of lambda_v
with B + A t tests it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ares_models.arrays import MissionArrays, Record
from ares_models.kernels.environment import heating_rate, log_heating_gradient
from ares_optimizer.direct.kernels.evaluate import (
    evaluate_with_gradients,
    make_point,
    make_scratch,
)
from ares_optimizer.direct.kernels.flight import gravity_gradient
from ares_optimizer.direct.kernels.lagrangian import Multipliers, Workspace, lagrangian_gradient
from ares_optimizer.direct.kernels.problem import (
    D_LOG_LIMIT,
    HEATING_FROM_JETTISON,
    PEAKS,
    TIME_SCALE,
    Problem,
)
from ares_optimizer.direct.kernels.quadratic import Frame, reduced_hessian
from ares_optimizer.direct.search import SearchResult, path_peaks
from ares_optimizer.kernels.terminal import MAX_ROWS, terminal_rows
from ares_optimizer.proof.flight import Direction, Piece, ProofFlight, Steering
from ares_optimizer.results import vector_of
from ares_optimizer.solution import Check, Costates
from ares_optimizer.targets import target_rows

Array = NDArray[np.float64]

_TOLERANCE = 1e-10
_SAME_TIME = 1e-6
_PERIOD = 2.0  # of the samples, s


#: A check and its jettison, if it has one.
CheckKey = tuple[Check, int | None]


def terminal_costates(problem: Problem, nu: Array, r: Array, v: Array) -> Array:
    """Return the costates at the end of thrust, shape (6,): -d(objective)/d(state)."""
    c = np.empty(MAX_ROWS)
    rows = np.empty((MAX_ROWS, 6))
    count = terminal_rows(
        problem.target[0], problem.environment[0]["mu"], vector_of(r), vector_of(v), c, rows
    )
    return -np.asarray(nu[:count] @ rows[:count])


@dataclass(frozen=True)
class Jump:
    """Hold a time at which the heating limit is active.

    Attributes:
        time_s: time, s.
        multiplier: of the log of the limit, not negative.
        drop: index of the free drop at that time; -1 for a later heating peak.
    """

    time_s: float
    multiplier: float
    drop: int


def heating_jumps(found: SearchResult) -> list[Jump]:
    """Return the times at which the costates of a solution jump."""
    jumps = [
        Jump(time, float(found.inequalities[3 * d]), d) for d, time in enumerate(found.drop_times_s)
    ]
    return jumps + [Jump(time, mu, -1) for time, mu in path_peaks(found)]


def _heating_gradient(problem: Problem, y: Array) -> Array:
    """Return the gradient of log heating by position and velocity, shape (6,)."""
    _, by_position, by_velocity = log_heating_gradient(
        vector_of(y[:3]), vector_of(y[3:6]), problem.environment[0], problem.atmosphere
    )
    return np.array([*by_position, *by_velocity])


def _integrate_back(
    arrays: MissionArrays,
    piece: Piece,
    direction: Direction,
    costate: Array,
) -> tuple[Array, Array]:
    """Integrate the costates backwards over one smooth piece.

    Returns:
        times, shape (k,), descending, and costates at these times, shape (k, 7): lambda_r,
        lambda_v, lambda_m.
    """
    environment = arrays.environment[0]

    def motion(t: float, x: Array) -> Array:
        y = piece.state(t)
        _, first, second = gravity_gradient(vector_of(y), environment)
        gradient = np.array(
            [
                [first[0], first[1], first[2]],
                [first[1], second[0], second[1]],
                [first[2], second[1], second[2]],
            ]
        )
        along = float(x[3:6] @ direction(t))
        mass_rate = along * piece.engine(t, y[6])[0] / y[6] ** 2
        return np.concatenate((-gradient @ x[3:6], -x[:3], [mass_rate]))

    begin, end = piece.begin, piece.end
    result = solve_ivp(
        motion,
        (end, begin),
        costate,
        method="DOP853",
        rtol=_TOLERANCE,
        atol=1e-11 * float(np.abs(costate[:6]).max()),
        dense_output=True,
    )
    if result.sol is None:
        raise AssertionError("asked for dense output")
    grid = np.linspace(end, begin, max(2, math.ceil((end - begin) / _PERIOD) + 1))
    samples = result.sol(grid).T
    samples[0] = costate
    samples[-1] = result.y[:, -1]
    return grid, samples


def _final_costates(found: SearchResult, flight: ProofFlight, jumps: list[Jump]) -> Array:
    """Return the costates before the jumps at cut-off, shape (7,): lambda_r, lambda_v, lambda_m."""
    problem = found.transcription.problem
    final = flight.final
    costate = np.zeros(7)
    costate[:6] = terminal_costates(problem, found.equations, final[:3], final[3:6])
    for jump in jumps:
        if jump.drop < 0 and jump.time_s >= flight.pieces[-1].end - _SAME_TIME:
            costate[:6] -= jump.multiplier * _heating_gradient(problem, final)
    return costate


def _hamiltonians(
    environment: Record, piece: Piece, direction: Direction, times: Array, costates: Array
) -> tuple[Array, Array]:
    """Return the Hamiltonian at times of a piece, without and with the term of the mass costate."""
    plain = np.empty(len(times))
    whole = np.empty(len(times))
    for i, (t, x) in enumerate(zip(times, costates, strict=True)):
        y = piece.state(t)
        thrust, flow = piece.engine(t, y[6])
        g, _, _ = gravity_gradient(vector_of(y), environment)
        along = float(x[3:6] @ direction(t))
        plain[i] = x[:3] @ y[3:6] + x[3:6] @ np.array(g) + along * thrust / y[6]
        whole[i] = plain[i] - x[6] * flow
    return plain, whole


def recover_costates(
    arrays: MissionArrays, found: SearchResult, flight: ProofFlight, steering: Steering
) -> Costates:
    """Compute the costates of a direct solution along its verified flight.

    Args:
        arrays: the mission.
        found: a converged solution.
        flight: the same flight, integrated by ``proof.flight.fly``.
        steering: its steering.

    Returns:
        costates scaled to |lambda_v| = 1 at the start; jump_pi per free drop.
    """
    problem = found.transcription.problem
    environment = problem.environment[0]
    jumps = heating_jumps(found)
    last = flight.pieces[-1].end
    costate = _final_costates(found, flight, jumps)
    times: list[Array] = []
    values: list[Array] = []
    hamiltonians: list[Array] = []
    spread: list[float] = []
    pi = [0.0] * len(problem.drops)
    for piece in reversed(flight.pieces):
        begin, end = piece.begin, piece.end
        if any(abs(end - time) <= _SAME_TIME for time, _ in flight.plan.stagings):
            costate[6] = 0.0
        for jump in jumps:
            if end < last and abs(end - jump.time_s) <= _SAME_TIME:
                y = piece.state(end)
                costate[:6] -= jump.multiplier * _heating_gradient(problem, y)
                if jump.drop >= 0:
                    pi[jump.drop] = -jump.multiplier / heating_rate(
                        vector_of(y[:3]),
                        vector_of(y[3:6]),
                        environment,
                        arrays.atmosphere,
                    )
        direction = steering(begin, end)
        grid, samples = _integrate_back(arrays, piece, direction, costate)
        plain, whole = _hamiltonians(environment, piece, direction, grid, samples)
        times.append(grid)
        values.append(samples)
        hamiltonians.append(plain)
        spread.append(float(np.ptp(whole)))
        costate = samples[-1].copy()
    table = np.concatenate(values)[::-1]
    size = float(np.linalg.norm(table[0, 3:6]))
    h = np.concatenate(hamiltonians)[::-1] / size
    greatest = float(np.abs(h).max())
    return Costates(
        np.concatenate(times)[::-1].copy(),
        table[:, :3] / size,
        table[:, 3:6] / size,
        h,
        tuple(value / size / greatest for value in reversed(spread)),
        tuple(value / size for value in pi),
    )


def limit_sensitivities(found: SearchResult, flight: ProofFlight) -> dict[CheckKey, float]:
    """Return the sensitivity to each limit: kg of final mass per unit of the limit.

    Elements of the target: per m, m/s, deg or 1. Heating limits: per W/m2.

    Args:
        found: a converged solution.
        flight: the same flight, verified.
    """
    problem = found.transcription.problem
    target = problem.target.copy()
    mu = float(problem.environment[0]["mu"])
    r = vector_of(flight.final[:3])
    v = vector_of(flight.final[3:6])
    per_time = found.transcription.flow_kg_s * TIME_SCALE

    def lagrangian() -> float:
        c = np.empty(MAX_ROWS)
        count = terminal_rows(target[0], mu, r, v, c, np.empty((MAX_ROWS, 6)))
        return float(found.equations[:count] @ c[:count])

    table: dict[CheckKey, float] = {}
    for key, _, unit, _ in target_rows(target[0]):
        value = float(target[key][0])
        step = 1e-6 * max(abs(value), 1e-2)
        target[key] = value + step
        above = lagrangian()
        target[key] = value - step
        slope = (above - lagrangian()) / (2.0 * step)
        target[key] = value
        table[key, None] = -per_time * slope * (math.pi / 180.0 if unit == "deg" else 1.0)
    for d, j in enumerate(found.transcription.heating_jettisons):
        limit = math.exp(problem.drops[d, D_LOG_LIMIT])
        table[Check.HEATING_AT_JETTISON, j] = per_time * float(found.inequalities[3 * d]) / limit
    if problem.heating == HEATING_FROM_JETTISON and len(problem.drops):
        limit = math.exp(problem.drops[-1, D_LOG_LIMIT])
        table[Check.HEATING_FROM_JETTISON, None] = (
            per_time * float(found.inequalities[-PEAKS:].sum()) / limit
        )
    return table


def least_curvature(found: SearchResult) -> float:
    """Return the least eigenvalue of the Hessian projected on the active constraints.

    The Hessian is that of the Lagrangian, in the solver's units, in the null space of the active
    constraints. Positive at a strict minimum; inf where the null space is empty.
    """
    problem = found.transcription.problem
    n = problem.variables
    workspace = Workspace(make_scratch(problem), make_point(problem), make_point(problem))
    point = workspace.point
    evaluate_with_gradients(found.variables, problem, workspace.scratch, point)
    active = found.inequalities > 0.0
    rows = np.concatenate((point.equation_rows, point.inequality_rows[active]))
    basis = np.linalg.svd(rows)[2][len(rows) :].T
    if basis.shape[1] == 0:
        return math.inf
    base = np.empty(n)
    multipliers = Multipliers(found.equations, found.inequalities)
    lagrangian_gradient(point, multipliers, base)
    frame = Frame(np.ascontiguousarray(basis), np.zeros(n), base)
    hessian, _ = reduced_hessian(found.variables, problem, workspace, multipliers, frame)
    return float(np.linalg.eigvalsh(hessian)[0])
