# SPDX-License-Identifier: Apache-2.0
"""Sparsity patterns of a program, in the order in which the kernels write the entries."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_optimizer.collocation.arrays import COASTING, GUIDED, HELD_ATTITUDE
from ares_optimizer.collocation.kernels import RULE_LOCALS, Program

#: Rows and columns of entries, each of shape (n,).
Pattern = tuple[NDArray[np.int64], NDArray[np.int64]]


def _pairs_of(count: int) -> NDArray[np.int64]:
    """Return all pairs of indices below a count, the second not above the first, in order."""
    return np.column_stack(np.tril_indices(count))


def _motion_entries(of_rates: list[list[int]]) -> NDArray[np.int64]:
    """Return rows and columns of the derivatives of the motion at a point, shape (n, 2).

    Columns are among the local variables: position, velocity, length, mass, direction.

    Args:
        of_rates: what each component of the acceleration depends on.
    """
    entries = []
    for c, at in enumerate(of_rates):
        entries += [(c, 3 + c), (c, 6), *((3 + c, column) for column in at)]
    return np.array(entries)


_AIR, _CALM, _COAST, _BURN = "in the air", "in the air, no control", "coast", "burn"
#: Entries of the Jacobian and of the Hessian at a point, by kind of motion.
_SLOPES = {
    _AIR: _motion_entries([list(range(11))] * 3),
    _CALM: _motion_entries([list(range(8))] * 3),
    _COAST: _motion_entries([[0, 1, 2, 6]] * 3),
    _BURN: _motion_entries([[0, 1, 2, 6, 8 + c, 7] for c in range(3)]),
}
_OF_COAST = [*_pairs_of(3).tolist(), *([6, k] for c in range(3) for k in (3 + c, c))]
_OF_BURN = [*([k, 8 + c] for c in range(3) for k in (6, 7)), [6, 6], [7, 6], [7, 7]]
_CURVES = {
    _AIR: _pairs_of(11),
    _CALM: _pairs_of(8),
    _COAST: np.array(_OF_COAST),
    _BURN: np.array(_OF_COAST + _OF_BURN),
}


def _kind_of(phase: Record) -> str:
    """Return the kind of the motion at the points of a phase, by the variables it depends on."""
    if phase["in_air"]:
        return _AIR if phase["steering"] in (GUIDED, HELD_ATTITUDE) else _CALM
    return _COAST if phase["steering"] == COASTING else _BURN


def jacobian_of(program: Program) -> Pattern:
    """Return the pattern of the Jacobian, without that of linear rows."""
    rows: list[NDArray[np.int64]] = []
    columns: list[NDArray[np.int64]] = []

    def put(row: NDArray[np.int64], at: NDArray[np.int64]) -> None:
        rows.append(np.broadcast_to(row, at.shape).ravel())
        columns.append(at.ravel())

    per_interval = program.derivative.shape[1]
    for phase, points, numbers in _points_by_phase(program):
        own = _locals(phase, points)
        nodes = points["node"][:, None] + np.arange(per_interval)
        of_states = 6 * nodes[:, None, :] + np.arange(6)[:, None]
        row, column = _SLOPES[_kind_of(phase)].T
        defects = np.concatenate((np.repeat(np.arange(6), per_interval), row))
        at = np.hstack((of_states.reshape(len(points), -1), own[:, column]))
        put(6 * numbers[:, None] + defects, at)
    first = 6 * len(program.points)
    put(first + np.arange(len(program.controls))[:, None], _directions(program))
    phases = program.phases
    masses = np.column_stack((phases["end"], phases["length"], phases["mass"]))
    put(phases["link"][:, None], masses)
    for rule in program.rules:
        there = np.array(_rule_columns(rule))
        put(rule["row"] + np.arange(rule["rows"])[:, None], np.tile(there, (rule["rows"], 1)))
    return np.concatenate(rows), np.concatenate(columns)


def hessian_of(program: Program) -> Pattern:
    """Return the pattern of the Hessian of the Lagrangian, its lower triangle."""
    ones: list[NDArray[np.int64]] = []
    others: list[NDArray[np.int64]] = []

    def put(columns: NDArray[np.int64], pairs: NDArray[np.int64]) -> None:
        ones.append(columns[:, pairs[:, 0]].ravel())
        others.append(columns[:, pairs[:, 1]].ravel())

    for phase, points, _ in _points_by_phase(program):
        put(_locals(phase, points), _CURVES[_kind_of(phase)])
    put(_directions(program), np.array([[0, 0], [1, 1], [2, 2]]))
    phases = program.phases
    put(np.column_stack((phases["length"], phases["mass"])), np.array([[0, 0], [1, 0]]))
    for rule in program.rules:
        there = np.array([_rule_columns(rule)])
        put(there, _pairs_of(there.shape[1]))
    one, other = np.concatenate(ones), np.concatenate(others)
    return np.maximum(one, other), np.minimum(one, other)


def _points_by_phase(
    program: Program,
) -> Iterator[tuple[Record, NDArray[np.void], NDArray[np.int64]]]:
    """Yield each phase with its points and their indices."""
    for p, phase in enumerate(program.phases):
        numbers = np.flatnonzero(program.points["phase"] == p)
        yield phase, program.points[numbers], numbers


def _locals(phase: Record, points: NDArray[np.void]) -> NDArray[np.int64]:
    """Return the columns of the local variables of points of a phase, shape (n, 8 or 11)."""
    at = 6 * (points["node"] + points["number"])[:, None]
    shared = np.tile((phase["length"], phase["mass"]), (len(points), 1))
    own = np.hstack((at + np.arange(6), shared))
    if (points["control"] < 0).all():
        return own
    return np.hstack((own, points["control"][:, None] + np.arange(3)))


def _directions(program: Program) -> NDArray[np.int64]:
    """Return the columns of the thrust directions, shape (n, 3)."""
    columns: NDArray[np.int64] = program.controls[:, None] + np.arange(3)
    return columns


def _rule_columns(rule: Record) -> list[int]:
    """Return the columns of the variables of a constraint."""
    at, control = 6 * int(rule["node"]), int(rule["control"])
    own = [] if control < 0 else range(control, control + RULE_LOCALS - 6)
    return [*range(at, at + 6), *own]
