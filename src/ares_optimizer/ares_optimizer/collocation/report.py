# SPDX-License-Identifier: Apache-2.0
"""Convert a proven point of a program to a solution: arcs, costates, checks, status."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ares_models.arrays import BURN
from ares_models.floors import Floor
from ares_models.judge import judge
from ares_models.kernels.environment import heating_rate
from ares_optimizer.collocation.arrays import COASTING, GUIDED, Q_ALPHA_RULE
from ares_optimizer.collocation.costates import costates_of
from ares_optimizer.collocation.points import (
    Array,
    FoundOptimum,
    acting_limits,
    free_propellant,
    hamiltonian_spread,
    is_saddle,
    jettison_times_of,
    lowest_in,
    times_of,
)
from ares_optimizer.collocation.refine import PRESSURE_CHECKS, SAG, Proven, allowed_spread
from ares_optimizer.collocation.search import LEAST_MET, SAME_MASS, Search
from ares_optimizer.collocation.solver import StoppingPoint
from ares_optimizer.collocation.transcription import CollocationProgram, FreeTimes
from ares_optimizer.collocation.variables import node_times
from ares_optimizer.kernels import timetable
from ares_optimizer.obstacles import check_obstacle
from ares_optimizer.plan import free_arcs, length_bounds, with_lengths
from ares_optimizer.proof.checks import limits_of, verification
from ares_optimizer.proof.held import held_checks, held_offsets
from ares_optimizer.results import (
    SAME_LENGTH,
    length_checks,
    steering_arc,
    with_multipliers,
)
from ares_optimizer.sensitivities import target_sensitivities
from ares_optimizer.solution import (
    NOTHING_SAVED,
    OPTIMAL,
    OUT_OF_TIME,
    TOO_MUCH,
    Cause,
    Check,
    ConstraintCheck,
    Solution,
    Status,
    SteeringArc,
    Trajectory,
    next_to_nothing,
)
from ares_optimizer.targets import in_unit, target_rows

METHOD = "collocation"
#: Note of a solution: number of local optima that the starts led to.
LOCAL_OPTIMA = "collocation_valleys"
#: Relative difference of the masses at the end of a program and of its verification.
_SAME_END = 1e-6
#: Altitude above a floor within which it is active, m.
_ACTIVE = 10.0
_NOTHING_KG = 0.1
#: Length from which on a burn has a rate of its direction, s.
_TURNING_S = 0.1
#: Reason of an optimum that no steering betters.
_SHORTEST_BURNS = (
    "optimal: the free burns have their least length; the burns of fixed length give more delta-V "
    "than the target needs, and the steering wastes the surplus"
)
#: Remedy where the flight turns faster than the intervals of the program resolve.
_TOO_FAST = (
    "the vehicle keeps its limits of dynamic pressure and q alpha only by turning sharply; raise "
    "the limits or lower the thrust"
)


def _steering_arcs(proven: Proven, idle: bool) -> tuple[SteeringArc, ...]:
    """Return a linear-tangent law per phase: the chord from first to last direction.

    Args:
        proven: the point of a program.
        idle: propellant has no price, and the directions have no primer.
    """
    arcs = []
    program, point, adjoint = proven.found.program, proven.found.point, proven.adjoint
    lengths = program.time * point.x[program.lengths]
    begins = float(program.start["time"][0]) + np.concatenate(([0.0], np.cumsum(lengths)))
    for p, phase in enumerate(program.phases):
        rows = np.flatnonzero(adjoint.phase == p)
        first_mass = float(point.x[program.masses[p]]) * program.mass
        last_mass = float(point.x[program.ends[p]]) * program.mass
        primer = adjoint.by_velocity[rows]
        primed = phase["steering"] == GUIDED and not idle
        if phase["steering"] != COASTING and (phase["in_air"] or not primed):
            primer = adjoint.direction[rows]
        size = max(float(np.linalg.norm(primer[0])), 1e-300)
        direction = primer[0] / size
        rate = np.zeros(3)
        if lengths[p] > _TURNING_S:
            rate = (primer[-1] - primer[0]) / (size * float(lengths[p]))
        gained = 0.0
        primer_rate = None
        if primed:
            scale = max(float(np.linalg.norm(adjoint.by_velocity[rows[0]])), 1e-300)
            primer_rate = -adjoint.by_position[rows[0]] / scale
        if phase["steering"] != COASTING:
            k = int(program.segments[p]["arc"])
            exhaust = float(program.arrays.arcs[k]["exhaust_velocity"])
            gained = exhaust * math.log(first_mass / last_mass)
        arcs.append(
            steering_arc(
                (begins[p], begins[p + 1]),
                direction,
                rate,
                (first_mass, last_mass),
                gained,
                primer_rate,
            )
        )
    return tuple(arcs)


def solution_of(
    search: Search, proven: Proven, floors: tuple[Floor, ...], elapsed: float
) -> Solution:
    """Convert a point of a program to a solution."""
    program, point, flight = proven.found.program, proven.found.point, proven.flight
    times = times_of(program, point.x, apart=0.0)
    planned = with_lengths(search.arrays, search.start[0], times.lengths)
    costates = costates_of(program, point, proven.adjoint)
    spread = hamiltonian_spread(proven.found, proven.adjoint)
    # a floor that the file does not name is told where it acts
    floor_checks = tuple(
        check
        for floor in floors
        for check in (_floor_check(proven.found, floor),)
        if check.active or floor not in search.added
    )
    checks = (
        *_with_sensitivities(search, proven, proven.checks),
        *floor_checks,
        *_orbit_checks(proven),
        *length_checks(
            program.arrays,
            program.start[0],
            times.lengths,
            _length_worths(program, point, times),
            np.zeros(len(times.lengths), bool),
        ),
    )
    nodes = _nodes(program, point)
    solution = Solution(
        METHOD,
        *verdict_of(search, proven, checks, spread),
        jettison_times_of(program, point.x, times),
        times.cutoff,
        proven.found.end_kg,
        search.iterations,
        elapsed,
        arcs=_steering_arcs(proven, search.idle),
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
    if not search.idle:
        checks = (*checks, *held_checks(planned, flight, offsets))
    return replace(
        solution,
        **verdict_of(search, proven, checks, spread)._asdict(),
        m_f_kg=float(flight.final[6]),
        constraints=checks,
        verification=verification(planned, flight, _at_begins(program, nodes)),
        trajectory=flight.trajectory,
        costates=replace(costates, held_off_deg=offsets),
    )


def _unknowns(program: CollocationProgram, proven: Proven, times: FreeTimes) -> Array:
    """Return the unknowns of the two-point problem, see ``indirect.solver.Root``."""
    point, adjoint = proven.found.point, proven.adjoint
    arrays, start = program.arrays, program.start[0]
    size = max(float(np.linalg.norm(adjoint.by_velocity[0])), 1e-300)
    unknowns = [*adjoint.by_velocity[0] / size, *adjoint.by_position[0] / size, times.cutoff]
    for j, at in zip(program.waiting_for_heating, times.drops, strict=True):
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


def _sampled(program: CollocationProgram, proven: Proven, nodes: Array) -> Trajectory:
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


def _nodes(program: CollocationProgram, point: StoppingPoint) -> Array:
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


def _at_begins(program: CollocationProgram, nodes: Array) -> Array:
    """Return the nodes at the begins of all phases that have a length, and the last node."""
    begins = nodes[program.first]
    return begins[np.append(np.diff(begins[:, 0]) > SAME_LENGTH, True)]


def verdict_of(
    search: Search, proven: Proven, checks: tuple[ConstraintCheck, ...], spread: float
) -> Cause:
    """Return OPTIMAL, or the cause why a solution is not proven optimal."""
    broken = next((check for check in checks if not check.satisfied), None)
    propellant = free_propellant(proven.found)
    if broken is not None:
        reason = f"{check_obstacle((broken,))}, when flown by another integrator"
        if propellant < _NOTHING_KG:
            reason += f"; {TOO_MUCH}"
        elif search.request.deadline.passed:
            return Cause(Status.TIME_LIMIT, f"{OUT_OF_TIME.reason}: {reason}")
        elif not proven.exact and acting_limits(proven.found):
            reason += f"; {_TOO_FAST}"
        return Cause(Status.NOT_OPTIMAL, reason)
    flown_kg = proven.found.end_kg if proven.flight is None else float(proven.flight.final[6])
    if not math.isclose(flown_kg, proven.found.end_kg, rel_tol=_SAME_END):
        return Cause(
            Status.NOT_OPTIMAL,
            f"the flight ends with {flown_kg:,.3f} kg instead of {proven.found.end_kg:,.3f} kg, "
            "when flown by another integrator",
        )
    if not math.isfinite(propellant):
        return Cause(Status.FEASIBLE, NOTHING_SAVED)
    if search.idle and propellant > _NOTHING_KG:
        return Cause(Status.CONVERGED, _SHORTEST_BURNS)
    # on the coarse intervals of the search, as the test uses dense matrices
    if proven.found.point.regularized and search.best is not None and is_saddle(search.best):
        return Cause(Status.FEASIBLE, "the second-order conditions are not met")
    if propellant < _NOTHING_KG:
        return Cause(Status.CONVERGED, next_to_nothing(propellant))
    if proven.found.point.unsettled:
        return Cause(Status.FEASIBLE, "the best length of a coast was not found")
    if search.unfinished:
        return Cause(Status.FEASIBLE, f"{OUT_OF_TIME.reason}: there may be a better flight")
    # on fine intervals, where floors and limits hold between the coarse ones too, the mass differs
    met = max(search.again, search.led_to(proven.found.m_f_kg))
    if search.starts > 1 and met < LEAST_MET:
        return Cause(
            Status.FEASIBLE,
            f"only one of {search.starts} first guesses led here: there may be a better flight",
        )
    if search.sunk_kg > (1.0 + SAME_MASS) * proven.found.m_f_kg:
        return Cause(
            Status.FEASIBLE,
            f"a flight that goes through the ground ends with {search.sunk_kg:,.6g} kg, and no "
            "flight above the ground was found near it: there may be a better one",
        )
    most = allowed_spread(proven.found)
    if spread > most:
        return Cause(
            Status.FEASIBLE,
            f"the Hamiltonian is constant within {spread:.1e}; expected {most:g} at most",
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
            f"{search.added[0].altitude_m:,.0f} m, near the altitude of the start; set "
            "min_altitude_m of that arc in the mission file",
        )
    return OPTIMAL


def _floor_name(arc: int) -> str:
    return f"lowest altitude in arc {arc}"


def _floor_check(found: FoundOptimum, floor: Floor) -> ConstraintCheck:
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
        low >= floor.altitude_m - SAG,
        price,
    )


def _perigee_check(found: FoundOptimum, floor: Floor) -> ConstraintCheck:
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
        perigee >= floor.perigee_m - SAG,
        float(found.point.multipliers[row]) * program.mass * slope,
    )


def _orbit_checks(proven: Proven) -> Iterator[ConstraintCheck]:
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
    search: Search, proven: Proven, checks: tuple[ConstraintCheck, ...]
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
    for stage, kind in acting_limits(proven.found):
        key, rows = PRESSURE_CHECKS[kind], program.limit_rows[stage, kind]
        # row: 1 - q / limit, or 1 - (q alpha / limit)^2
        slope = (2.0 if kind == Q_ALPHA_RULE else 1.0) / limits_of(arrays, key)[stage]
        sum_of_rows = float(point.multipliers[rows].sum())
        sensitivities[key, stage] = -sum_of_rows * program.mass * slope
    return with_multipliers(checks, sensitivities)


def _length_worths(program: CollocationProgram, point: StoppingPoint, times: FreeTimes) -> Array:
    """Return kg of final mass per second of the bound of each free arc; nan: not known."""
    arrays, start = program.arrays, program.start[0]
    _, high = length_bounds(arrays, start)
    worths = []
    for f, k in enumerate(free_arcs(arrays, start)):
        members = program.arc_phases.get(k, [])
        depleted = arrays.arcs[k]["kind"] == BURN and times.lengths[f] > high[f] - SAME_LENGTH
        worth = math.nan
        if len(members) == 1 and not depleted:
            at = program.lengths[members[0]]
            worth = float(point.at_upper[at] - point.at_lower[at]) * program.mass / program.time
        worths.append(worth)
    return np.array(worths)
