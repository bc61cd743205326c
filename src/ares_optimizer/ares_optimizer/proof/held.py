# SPDX-License-Identifier: Apache-2.0
"""Burns in held attitude: is the direction flown the best one?

The best direction lies along the integral of lambda_v T/m over the burn. Thrust and mass are
those of the proof's own flight, the costates those of the solution, and the integral is Gauss'.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from ares_models.arrays import MissionArrays
from ares_optimizer.proof.flight import Flight, Piece, Steering
from ares_optimizer.solution import Cause, Check, ConstraintCheck, Costates, Status

Array = NDArray[np.float64]

_GAUSS = np.polynomial.legendre.leggauss(24)
_SAME_TIME = 1e-9  # s
_SAME_DIRECTION_DEG = 0.05  # costs 4e-7 of the velocity that the burn gives


def _primer_in(piece: Piece, costates: Costates) -> CubicHermiteSpline:
    """lambda_v within a piece: a jettison stands twice among the samples."""
    times = costates.time_s
    first = int(np.flatnonzero(times <= piece.begin + _SAME_TIME)[-1])
    last = int(np.flatnonzero(times >= piece.end - _SAME_TIME)[0])
    rows = slice(first, last + 1)
    return CubicHermiteSpline(times[rows], costates.lambda_v[rows], -costates.lambda_r[rows])


def _held_arcs(arrays: MissionArrays, flight: Flight) -> list[int]:
    return [k for k, _, _ in flight.plan.arcs if arrays.arcs[k]["held"]]


def held_offsets(
    arrays: MissionArrays, flight: Flight, steering: Steering, costates: Costates
) -> tuple[float, ...]:
    """Per held burn flown: angle between its direction and what lambda_v pulls towards, deg.

    Args:
        arrays: the mission.
        flight: from :func:`fly`.
        steering: that it was flown with; the greatest angle of any piece counts.
        costates: of the solution.
    """
    offsets = []
    for k in _held_arcs(arrays, flight):
        engines = [engine for engine in flight.plan.engines if engine.arc == k]
        pull = np.zeros(3)
        directions = []
        for piece in flight.pieces:
            middle = 0.5 * (piece.begin + piece.end)
            if not any(engine.begin < middle < engine.end for engine in engines):
                continue
            primer = _primer_in(piece, costates)
            half = 0.5 * (piece.end - piece.begin)
            for x, weight in zip(*_GAUSS, strict=True):
                t = middle + half * x
                mass = float(piece.state(t)[6])
                pull += half * weight * piece.engine(t, mass)[0] / mass * primer(t)
            towards = steering(piece.begin, piece.end)
            directions += [towards(piece.begin), towards(piece.end)]
        offsets.append(max((_angle_deg(w, pull) for w in directions), default=0.0))
    return tuple(offsets)


def held_checks(
    arrays: MissionArrays, flight: Flight, offsets: tuple[float, ...]
) -> tuple[ConstraintCheck, ...]:
    """The angles of :func:`held_offsets` beside 0."""
    return tuple(
        ConstraintCheck(
            Check.HELD_DIRECTION,
            f"direction of held arc {k}",
            off,
            0.0,
            True,
            "deg",
            off <= _SAME_DIRECTION_DEG,
            0.0,
        )
        for k, off in zip(_held_arcs(arrays, flight), offsets, strict=True)
    )


def held_obstacle(checks: tuple[ConstraintCheck, ...]) -> Cause | None:
    """Why a flight is no optimum, if a held direction is not the best one."""
    for check in checks:
        if not check.satisfied:
            reason = f"{check.name} is {check.value:,.3g} deg off the best one"
            return Cause(Status.NOT_OPTIMAL, f"no optimum found: {reason}")
    return None


def _angle_deg(a: Array, b: Array) -> float:
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))
