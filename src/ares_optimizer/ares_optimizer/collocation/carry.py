# SPDX-License-Identifier: Apache-2.0
"""Carry a point of a program, with its multipliers, over to other intervals or longer coasts."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ares_models.kernels.kepler import kepler
from ares_optimizer.collocation.arrays import COASTING, GUIDED, HELD_ATTITUDE
from ares_optimizer.collocation.radau import radau
from ares_optimizer.collocation.solver import StoppingPoint
from ares_optimizer.collocation.transcription import CollocationProgram
from ares_optimizer.collocation.variables import node_times, variables_of_trial

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
    out = variables_of_trial(program)
    then, now = _times(old, x), node_times(program)
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
    here, there = _Layout.of(program, node_times(program)), _Layout.of(old, _times(old, point.x))
    if len(here.others) != len(there.others):
        return None
    multipliers = np.zeros(program.row_lower.size)
    multipliers[here.others] = point.multipliers[there.others]
    _carry_costates(program, old, point, multipliers)
    _carry_directions(here, there, point, multipliers)
    for key, rows in program.limit_rows.items():
        known = old.limit_rows[key]
        density = point.multipliers[known] / there.spans_of(known)
        times = here.times[here.node_of[rows]]
        multipliers[rows] = here.spans_of(rows) * np.interp(
            times, there.times[there.node_of[known]], density
        )
    for arc in program.floor_rows:
        rows, known = _altitude_rows(program, arc), _altitude_rows(old, arc)
        times = here.times[here.node_of[rows]]
        for row in known:
            if rows:
                nearest = int(np.argmin(np.abs(times - there.times[there.node_of[row]])))
                multipliers[rows[nearest]] += point.multipliers[row]
    # lengths and masses are the last variables; no other bound acts at a solution
    count = 3 * len(program.phases)
    lower, upper = np.zeros(program.size), np.zeros(program.size)
    lower[-count:], upper[-count:] = point.at_lower[-count:], point.at_upper[-count:]
    return replace(
        point,
        x=carried_variables(program, old, point.x),
        multipliers=multipliers,
        at_lower=lower,
        at_upper=upper,
    )


def _times(program: CollocationProgram, x: Array) -> Array:
    """Return the times of the states at a point, s."""
    return node_times(program, x[program.lengths] * program.time)


def _has_same_phases(program: CollocationProgram, old: CollocationProgram) -> bool:
    """Return true if two programs have the same phases and constraints between them."""
    return (
        len(program.segments) == len(old.segments)
        and bool((program.steering == old.steering).all())
        and bool((program.segments["arc"] == old.segments["arc"]).all())
        and program.limit_rows.keys() == old.limit_rows.keys()
        and program.floor_rows.keys() == old.floor_rows.keys()
    )


def _altitude_rows(program: CollocationProgram, arc: int) -> list[int]:
    """Return the rows of the floor of an arc at its states."""
    name = f"altitude in arc {arc}"
    return [row for row in program.floor_rows[arc] if program.names[row] == name]


class _Layout(NamedTuple):
    """Hold where the rows of a program are that depend on its intervals.

    Attributes:
        program: the program.
        times: of its states, s.
        shares: of each point, of the length of its phase.
        node_of: state of each row of a single state; -1 elsewhere.
        spans: time for which each state stands, s.
        others: the rows that do not depend on the intervals.
    """

    program: CollocationProgram
    times: Array
    shares: Array
    node_of: NDArray[np.int64]
    spans: Array
    others: NDArray[np.int64]

    @classmethod
    def of(cls, program: CollocationProgram, times: Array) -> "_Layout":
        """Lay out a program whose states have some times, s."""
        points, rows = program.points, program.row_lower.size
        shares = points["width"] * radau(program.degree)[2][-1][points["number"] - 1]
        node_of = np.full(rows, -1)
        node_of[program.rules["row"]] = program.rules["node"]
        lengths = np.maximum(np.diff(times[program.first]), _SHORTEST)
        spans = np.zeros(program.nodes)
        spans[points["node"] + points["number"]] = shares * lengths[points["phase"]]
        own = np.zeros(rows, bool)
        own[: 6 * len(points) + len(program.controls)] = True
        for limited in program.limit_rows.values():
            own[limited] = True
        for arc in program.floor_rows:
            own[_altitude_rows(program, arc)] = True
        return cls(program, times, shares, node_of, spans, np.flatnonzero(~own))

    def spans_of(self, rows: list[int]) -> Array:
        """Return the times for which the states of some rows stand, s."""
        return self.spans[self.node_of[rows]]

    def rows_of_directions(self, p: int) -> NDArray[np.int64]:
        """Return the row of each direction of a phase."""
        at = np.searchsorted(self.program.controls, self.program.control_of[p])
        return 6 * len(self.program.points) + at


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
        begin = -derivative[:, 0] @ blocks[np.flatnonzero(there)[0] // d]
        at = np.concatenate(([0.0], old.points["fraction"][there]))
        known = np.vstack((begin, costates[there]))
        for c in range(6):
            motion[here, c] = np.interp(program.points["fraction"][here], at, known[:, c])
    motion *= weights[program.points["number"] - 1][:, None]


def _carry_directions(here: _Layout, there: _Layout, point: StoppingPoint, out: Array) -> None:
    """Write the multipliers of the directions."""
    for p, steering in enumerate(here.program.steering):
        if steering == HELD_ATTITUDE:
            out[here.rows_of_directions(p)[0]] = point.multipliers[there.rows_of_directions(p)[0]]
        if steering != GUIDED:
            continue
        wanted, known = (each.program.points["phase"] == p for each in (here, there))
        density = point.multipliers[there.rows_of_directions(p)] / there.shares[known]
        at, then = (each.program.points["fraction"] for each in (here, there))
        out[here.rows_of_directions(p)] = here.shares[wanted] * np.interp(
            at[wanted], then[known], density
        )


def carried_along_coasts(
    program: CollocationProgram, point: StoppingPoint, lengths: Array
) -> StoppingPoint:
    """Carry a solution over to other lengths of its coasts, on their Keplerian orbits.

    What follows a coast turns with the position at its end, multipliers too: a target with a free
    argument of perigee is still met.

    Args:
        program: that was solved.
        point: its solution.
        lengths: of all phases, scaled; those of burns count for nothing.
    """
    x, multipliers = point.x.copy(), point.multipliers.copy()
    states = x[: 6 * program.nodes].reshape(-1, 6)
    rows = multipliers[: 6 * len(program.points)].reshape(-1, 6)
    nodes = program.points["node"] + program.points["number"]
    turn = Rotation.identity()
    for p, first in enumerate(program.first[:-1]):
        own = np.flatnonzero(program.points["phase"] == p)
        turns = Rotation.concatenate([turn] * len(own))
        length = lengths[p]
        if program.steering[p] == COASTING and length != x[program.lengths[p]]:
            begin = tuple(states[first].tolist())
            there = [
                np.concatenate(kepler(begin[:3], begin[3:], length * share, 1.0))
                for share in program.points["fraction"][own]
            ]
            turns = _turns_between(turns.apply(states[nodes[own], :3]), np.array(there)) * turns
            turn = turns[-1]
            states[nodes[own]] = there
            x[program.lengths[p]] = length
        else:
            _turn_rows(turns, states, nodes[own])
        _turn_rows(turns, rows, own)
        if program.steering[p] == GUIDED:
            at = program.control_of[p][:, None] + np.arange(3)
            x[at] = turns.apply(x[at])
    return replace(point, x=x, multipliers=multipliers)


def _turns_between(old: Array, new: Array) -> Rotation:
    """Return the rotations from positions, shape (n, 3), to those of states, shape (n, 6)."""
    h = np.cross(new[0, :3], new[0, 3:])
    axis = h / np.linalg.norm(h)
    sine = np.cross(old, new[:, :3]) @ axis
    angle = np.arctan2(sine, (old * new[:, :3]).sum(axis=1))
    return Rotation.from_rotvec(angle[:, None] * axis)


def _turn_rows(turns: Rotation, values: Array, rows: NDArray[np.int64]) -> None:
    """Rotate position and velocity parts of some rows, shape (n, 6), in place."""
    for part in (slice(0, 3), slice(3, 6)):
        values[rows, part] = turns.apply(values[rows, part])
