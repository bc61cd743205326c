# SPDX-License-Identifier: Apache-2.0
"""Carry a point of a program, with its multipliers, over to a program with other intervals."""

import numpy as np
from numpy.typing import NDArray

from ares_optimizer.collocation.arrays import GUIDED
from ares_optimizer.collocation.guess import node_times
from ares_optimizer.collocation.radau import radau
from ares_optimizer.collocation.solver import StoppingPoint
from ares_optimizer.collocation.transcription import CollocationProgram
from ares_optimizer.kernels import timetable

Array = NDArray[np.float64]
#: Least length of an interval of which states are interpolated, s.
_SHORTEST = 1e-6


def carried_variables(program: CollocationProgram, old: CollocationProgram, x: Array) -> Array:
    """Interpolate the variables of a program from those of another, at the same times.

    States are on the polynomials of the other program, directions between its Radau points.

    Args:
        program: with the trial times of the point.
        old: the other program, which may have its events in another order.
        x: variables of the other program.
    """
    out = np.zeros(program.size)
    pieces = program.segments
    for p, piece in enumerate(pieces):
        out[program.lengths[p]] = float(piece["end"] - piece["start"]) / program.time
        out[program.masses[p]] = float(piece["mass"]) / program.mass
        out[program.ends[p]] = timetable.segment_mass(piece, piece["end"]) / program.mass
    then, now = node_times(old, x[old.lengths] * old.time), node_times(program)
    states = _states_at(old, then, x[: 6 * old.nodes].reshape(-1, 6), now)
    states[0] = program.start_state
    out[: 6 * program.nodes] = states.ravel()
    known, wanted = (each.points[each.points["control"] >= 0] for each in (old, program))
    if len(known) and len(wanted):
        at = then[known["node"] + known["number"]]
        t = now[wanted["node"] + wanted["number"]]
        u = np.column_stack([np.interp(t, at, x[known["control"] + c]) for c in range(3)])
        u /= np.maximum(np.linalg.norm(u, axis=1), 1e-9)[:, None]
        for c in range(3):
            out[wanted["control"] + c] = u[:, c]
    return out


def _states_at(old: CollocationProgram, then: Array, states: Array, now: Array) -> Array:
    """Return the states at some times on the polynomials of a program, shape (n, 6)."""
    d = old.degree
    first = np.arange(0, old.nodes - 1, d)
    begin, width = then[first], then[first + d] - then[first]
    whole = width > _SHORTEST
    first, begin, width = first[whole], begin[whole], width[whole]
    index = np.clip(np.searchsorted(begin, now, "right") - 1, 0, len(begin) - 1)
    place = np.clip((now - begin[index]) / width[index], 0.0, 1.0)
    points = radau(d)[0]
    new = np.zeros((len(now), 6))
    for j in range(d + 1):
        others = np.delete(points, j)
        basis = np.prod((place[:, None] - others) / (points[j] - others), axis=1)
        new += basis[:, None] * states[first[index] + j]
    return new


def carried_point(
    program: CollocationProgram, old: CollocationProgram, point: StoppingPoint
) -> StoppingPoint | None:
    """Carry a solution over with its multipliers; return None if the phases differ.

    Multipliers of the motion are costates times quadrature weights; those of directions and of
    pressure limits are densities over time; a floor acts at single states.

    Args:
        program: with the trial times of the point.
        old: the program that was solved.
        point: its solution.
    """
    if not _has_same_phases(program, old):
        return None
    multipliers = np.zeros(program.row_lower.size)
    _carry_costates(program, old, point, multipliers)
    _carry_densities(program, old, point, multipliers)
    taken = [_rows_of_points(each) for each in (program, old)]
    rest = [
        np.setdiff1d(np.arange(len(each.names)), own) for each, own in zip((program, old), taken)
    ]
    if len(rest[0]) != len(rest[1]):
        return None
    multipliers[rest[0]] = point.multipliers[rest[1]]
    count = 3 * len(program.phases)
    bounds = [np.zeros(program.size), np.zeros(program.size)]
    for new, known in zip(bounds, (point.at_lower, point.at_upper), strict=True):
        new[-count:] = known[-count:]
    return StoppingPoint(
        carried_variables(program, old, point.x),
        point.status,
        multipliers,
        *bounds,
        point.violation,
        point.iterations,
        point.regularized,
    )


def _has_same_phases(program: CollocationProgram, old: CollocationProgram) -> bool:
    """Return true if two programs have the same phases and constraints between them."""
    return (
        len(program.segments) == len(old.segments)
        and bool((program.steering == old.steering).all())
        and bool((program.segments["arc"] == old.segments["arc"]).all())
        and program.limit_rows.keys() == old.limit_rows.keys()
        and program.floor_rows.keys() == old.floor_rows.keys()
    )


def _rows_of_points(program: CollocationProgram) -> NDArray[np.int64]:
    """Return the rows of which there are more with more intervals."""
    own = list(range(6 * len(program.points) + len(program.controls)))
    for rows in program.limit_rows.values():
        own += rows
    for arc, rows in program.floor_rows.items():
        own += [row for row in rows if program.names[row] == f"altitude in arc {arc}"]
    return np.array(own, np.int64)


def _carry_costates(
    program: CollocationProgram, old: CollocationProgram, point: StoppingPoint, out: Array
) -> None:
    """Write the multipliers of the motion."""
    _, derivative, integral = radau(old.degree)
    weights = integral[-1]
    d = old.degree
    blocks = point.multipliers[: 6 * len(old.points)].reshape(-1, d, 6)
    costates = (blocks / weights[:, None]).reshape(-1, 6)
    motion = out[: 6 * len(program.points)].reshape(-1, 6)
    for p in range(len(program.phases)):
        there, here = old.points["phase"] == p, program.points["phase"] == p
        known = costates[there]
        begin = -derivative[:, 0] @ blocks[np.flatnonzero(there)[0] // d]
        at = np.concatenate(([0.0], old.points["fraction"][there]))
        for c in range(6):
            values = np.concatenate(([begin[c]], known[:, c]))
            motion[here, c] = np.interp(program.points["fraction"][here], at, values)
    motion *= weights[program.points["number"] - 1][:, None]


def _carry_densities(
    program: CollocationProgram, old: CollocationProgram, point: StoppingPoint, out: Array
) -> None:
    """Write the multipliers of directions, pressure limits and floors."""
    weights = radau(old.degree)[2][-1]
    rows = [
        {int(control): 6 * len(each.points) + i for i, control in enumerate(each.controls)}
        for each in (program, old)
    ]
    shares = [each.points["width"] * weights[each.points["number"] - 1] for each in (program, old)]
    for p in range(len(program.phases)):
        there, here = old.points["phase"] == p, program.points["phase"] == p
        if program.steering[p] == GUIDED:
            known = [rows[1][int(control)] for control in old.points["control"][there]]
            wanted = [rows[0][int(control)] for control in program.points["control"][here]]
            density = point.multipliers[known] / shares[1][there]
            at = program.points["fraction"][here]
            out[wanted] = shares[0][here] * np.interp(at, old.points["fraction"][there], density)
        elif program.controls.size:
            for control, there_row in rows[1].items():
                if control == int(old.control_of[p][0]):
                    out[rows[0][int(program.control_of[p][0])]] = point.multipliers[there_row]
    then = node_times(old, point.x[old.lengths] * old.time)
    now = node_times(program)
    nodes = [
        dict(zip(each.rules["row"].tolist(), each.rules["node"].tolist()))
        for each in (program, old)
    ]
    lengths = program.segments["end"] - program.segments["start"]
    spans = [
        dict(
            zip(
                (each.points["node"] + each.points["number"]).tolist(),
                (share * np.maximum(lengths[each.points["phase"]], _SHORTEST)).tolist(),
            )
        )
        for each, share in zip((program, old), shares)
    ]
    for key, own in program.limit_rows.items():
        known = old.limit_rows[key]
        before = [nodes[1][row] for row in known]
        after = [nodes[0][row] for row in own]
        density = point.multipliers[known] / [spans[1][node] for node in before]
        out[own] = np.interp(now[after], then[before], density) * [spans[0][node] for node in after]
    for arc, own in program.floor_rows.items():
        name = f"altitude in arc {arc}"
        own = [row for row in own if program.names[row] == name]
        known = [row for row in old.floor_rows[arc] if old.names[row] == name]
        times = now[[nodes[0][row] for row in own]]
        for row in known:
            if own and point.multipliers[row] != 0.0:
                nearest = int(np.argmin(np.abs(times - then[nodes[1][row]])))
                out[own[nearest]] += point.multipliers[row]
