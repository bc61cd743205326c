# SPDX-License-Identifier: Apache-2.0
"""Measure and interpolate the solution of a program: times, floors, second-order conditions."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import qr
from scipy.sparse import csr_array, lil_array

from ares_models.arrays import BURN
from ares_models.kernels.aerodynamics import mach_number
from ares_models.kernels.environment import altitude
from ares_optimizer.collocation.arrays import COASTING, GUIDED
from ares_optimizer.collocation.costates import Adjoint, spread_of
from ares_optimizer.collocation.intervals import COAST_TURN, Sweep, Turning, sweep_of
from ares_optimizer.collocation.solver import StoppingPoint
from ares_optimizer.collocation.transcription import CollocationProgram, FreeTimes
from ares_optimizer.collocation.variables import node_times
from ares_optimizer.plan import free_arcs, length_bounds, saving_stage
from ares_optimizer.results import SAME_LENGTH, jettison_times

Array = NDArray[np.float64]
#: Distance within which the bound of a variable is active.
_AT_BOUND = 1e-6
#: Curvature, relative to the greatest, that counts as zero.
_STRAIGHT = 1e-7
#: Multiplier above which a limit is active.
_BINDING = 1e-8
#: Multipliers of the motion below which no propellant can be saved, and the cost of a turn of the
#: thrust by 1 rad, evenly over the flight, that then holds it steady.
_IDLE = 1e-6
_TURNING = 1e-6
#: Cost of a drop after one unit of time.
_LATE = 1e-5
#: Mach number beyond which the drag coefficient is steady, change of it that counts as 1 rad of a
#: turn, turn for each end of an active limit, rad, its duration, s, and samples of it all.
_FASTEST_MACH = 4.0
_MACH_TURN = 1.6
_JUNCTION_TURN = 0.6
_JUNCTION_S = 4.0
#: Multiplier of a pressure limit, relative to the greatest, from which it acts.
_ACTING = 1e-2
_GRID = 4001
#: Angle of the intervals of a coast, relative to that of new ones, from which they are too long;
#: the same of the length of a burn, relative to its trial flight and in s.
_LONG = 2.0
_LONG_S = 10.0
#: Samples of a coast per state.
_SAMPLES = 8


@dataclass(frozen=True)
class FoundOptimum:
    """Hold a local optimum.

    Attributes:
        program: the program.
        point: its solution.
        m_f_kg: the mass that is maximised, see :func:`mass_of`.
    """

    program: CollocationProgram
    point: StoppingPoint
    m_f_kg: float

    @property
    def end_kg(self) -> float:
        """Return the mass at the end of the flight, kg."""
        return float(self.point.x[self.program.ends[-1]]) * self.program.mass


def worst_row(program: CollocationProgram, point: StoppingPoint) -> str:
    """Return the name of the row with the largest violation."""
    rows = np.zeros(program.row_lower.size)
    program.rows(point.x, rows)
    off = np.maximum(program.row_lower - rows, rows - program.row_upper)
    return program.names[int(np.argmax(off))]


def mass_of(program: CollocationProgram, point: StoppingPoint) -> float:
    """Return the mass at the end of the last stage with a free burn, kg."""
    return float(point.x[program.ends[program.saving]] * program.mass)


def times_of(program: CollocationProgram, x: Array, apart: float = 2.0 * SAME_LENGTH) -> FreeTimes:
    """Return the free times at a point of a program.

    Args:
        program: the program.
        x: shape (n,), its variables.
        apart: time between a drop and another event with which it coincides, s. Apart from it, in
            the order of the program, the drop is an event of its own in another program too, with
            its limit of the heating. 0: the drop is at the event, as it is flown.
    """
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
    drops = [_drop_time(begins, program.drop_ends[n], apart) for n in range(program.waiting)]
    return FreeTimes(np.array(lengths), cutoff, np.array(drops))


def jettison_times_of(program: CollocationProgram, x: Array, times: FreeTimes) -> tuple[float, ...]:
    """Return the time of every jettison at a point of a program, s; nan: not in this flight.

    Args:
        program: the program.
        x: shape (n,), its variables.
        times: of the point, from :func:`times_of`.
    """
    pieces = program.segments.copy()
    lengths = program.time * x[program.lengths]
    pieces["end"] = float(program.start["time"][0]) + np.cumsum(lengths)
    pieces["start"] = pieces["end"] - lengths
    return jettison_times(program.arrays, program.start[0], pieces, times.drops, times.cutoff)


def _drop_time(begins: Array, p: int, apart: float) -> float:
    """Return the time of a drop at the end of phase ``p``, ``apart`` from a coincident event."""
    at = float(begins[p + 1])
    distances = np.abs(begins - at)
    distances[p + 1] = math.inf
    other = int(np.argmin(distances))
    if distances[other] >= SAME_LENGTH:
        return at
    return float(begins[other]) + (apart if other <= p else -apart)


def is_idle(found: FoundOptimum) -> bool:
    """Return true if no direction of the thrust can save propellant."""
    rows = 6 * len(found.program.points)
    return float(np.abs(found.point.multipliers[:rows]).max()) < _IDLE


def penalize_waste(program: CollocationProgram) -> None:
    """Add a cost of the turning of the thrust and of late drops, where no mass depends on them.

    Directions that waste the same are one as good as the other, jumps to and fro too, and a fairing
    may serve as ballast. The first cost is the integral of the squared rate over the thrust, with
    the lengths of the trial flight; the second the square of the time of each drop.
    """
    guided = program.points[program.steering[program.points["phase"]] == GUIDED]
    pieces = program.segments[guided["phase"]]
    times = pieces["start"] + guided["fraction"] * (pieces["end"] - pieces["start"])
    steps = np.maximum(np.diff(times), SAME_LENGTH) / (times[-1] - times[0])
    columns = guided["control"][:, None] + np.arange(3)
    scales = np.repeat(np.sqrt(_TURNING / steps), 3)
    turns = csr_array(
        (
            np.concatenate((-scales, scales)),
            (
                np.tile(np.arange(len(scales)), 2),
                np.concatenate((columns[:-1].ravel(), columns[1:].ravel())),
            ),
        ),
        shape=(len(scales), program.size),
    )
    late = lil_array((len(program.drop_ends), program.size))
    for row, p in enumerate(program.drop_ends.values()):
        late[row, program.lengths[: p + 1]] = math.sqrt(_LATE)
    program.add_cost(turns.T @ turns + csr_array(late).T @ csr_array(late))


def turning_of(found: FoundOptimum) -> Turning | None:
    """Return the turn of the thrust over time; None without thrust.

    In the air the Mach number, over which the drag coefficient changes, and the ends of active
    pressure limits count too.
    """
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
    turns[np.diff(times) < SAME_LENGTH] = 0.0
    turned = Turning(times, np.concatenate(([0.0], np.cumsum(turns))))
    return _with_air(found, turned) if program.phases["in_air"].any() else turned


def sweep_of_found(found: FoundOptimum) -> Sweep:
    """Return the sweep of a solution."""
    program, x = found.program, found.point.x
    position = program.radius * x[: 6 * program.nodes].reshape(-1, 6)[:, :3]
    times = node_times(program, program.time * x[program.lengths])
    return sweep_of(times, position, program.arrays.environment[0])


def has_long_intervals(found: FoundOptimum) -> bool:
    """Return true if a coast or a burn has become too long for its intervals."""
    program = found.program
    angles = np.diff(sweep_of_found(found).angle[program.first])
    lengths = program.time * found.point.x[program.lengths]
    tried = program.segments["end"] - program.segments["start"]
    long = np.where(
        program.steering == COASTING,
        angles > _LONG * COAST_TURN * program.intervals,
        lengths > _LONG * tried + _LONG_S,
    )
    return bool(long.any())


def _with_air(found: FoundOptimum, turning: Turning) -> Turning:
    """Add to a turn of the thrust what changes in the air."""
    program, x = found.program, found.point.x
    times = node_times(program, program.time * x[program.lengths])
    states = x[: 6 * program.nodes].reshape(-1, 6) * np.repeat((program.radius, program.speed), 3)
    surroundings = program.arrays.environment[0], program.arrays.atmosphere
    mach = [mach_number(tuple(y[:3]), tuple(y[3:]), *surroundings) for y in states.tolist()]
    changed = np.abs(np.diff(np.minimum(mach, _FASTEST_MACH))) / _MACH_TURN
    grid = np.linspace(times[0], times[-1], _GRID)
    turned = np.interp(grid, *turning)
    turned += np.interp(grid, times, np.concatenate(([0.0], np.cumsum(changed))))
    for junction in _junctions(found, times):
        turned += _JUNCTION_TURN * np.clip((grid - junction) / _JUNCTION_S + 0.5, 0.0, 1.0)
    return Turning(grid, turned)


def acting_limits(found: FoundOptimum) -> set[tuple[int, int]]:
    """Return the pressure limits that act, by the keys of ``limit_rows``."""
    return {
        key
        for key, rows in found.program.limit_rows.items()
        if np.abs(found.point.multipliers[rows]).max() > _BINDING
    }


def _junctions(found: FoundOptimum, times: Array) -> list[float]:
    """Return the times at which pressure limits begin and cease to act, s.

    Args:
        found: a solution.
        times: of its states, s.
    """
    program = found.program
    junctions: list[float] = []
    for rows in program.limit_rows.values():
        nodes = program.rules["node"][np.isin(program.rules["row"], rows)]
        size = np.abs(found.point.multipliers[rows])
        active = size > _ACTING * size.max()
        for i in np.flatnonzero(np.diff(active.astype(int))):
            at = float(0.5 * (times[nodes[i]] + times[nodes[i + 1]]))
            if size.max() > _BINDING and all(abs(at - t) > _JUNCTION_S for t in junctions):
                junctions.append(at)
    return junctions


def is_saddle(found: FoundOptimum) -> bool:
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


def hamiltonian_spread(found: FoundOptimum, adjoint: Adjoint) -> float:
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


def lowest_in(found: FoundOptimum, arc: int) -> float:
    """Return the least altitude in an arc, m, also between its states."""
    program, x = found.program, found.point.x
    phases = program.arc_phases.get(arc, [])
    if not phases:
        return math.inf
    times = node_times(program, x[program.lengths] * program.time)
    states = x[: 6 * program.nodes].reshape(-1, 6)
    inside = slice(int(program.first[phases[0]]), int(program.first[phases[-1] + 1]) + 1)
    times, states = times[inside], states[inside]
    if times[-1] - times[0] < SAME_LENGTH:
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


def free_propellant(found: FoundOptimum) -> float:
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
