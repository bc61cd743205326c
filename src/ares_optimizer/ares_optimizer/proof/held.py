# SPDX-License-Identifier: Apache-2.0
"""Check that the direction of each burn in held attitude is the optimal one.

The optimal direction is parallel to the integral of lambda_v T/m over the burn. Thrust and mass are
those of the verified flight, the costates those of the solution; quadrature is by Gauss-Legendre.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from ares_models.arrays import MissionArrays
from ares_optimizer.proof.flight import Piece, ProofFlight, Steering
from ares_optimizer.solution import Cause, Check, ConstraintCheck, Costates, Status

Array = NDArray[np.float64]

_GAUSS = np.polynomial.legendre.leggauss(24)
_SAME_TIME = 1e-9  # s
_SAME_DIRECTION_DEG = 0.05  # costs 4e-7 of the velocity gain of the burn


def _primer_in(piece: Piece, costates: Costates) -> CubicHermiteSpline:
    """Return lambda_v within a piece; a jettison has two samples."""
    times = costates.time_s
    first = int(np.flatnonzero(times <= piece.begin + _SAME_TIME)[-1])
    last = int(np.flatnonzero(times >= piece.end - _SAME_TIME)[0])
    rows = slice(first, last + 1)
    return CubicHermiteSpline(times[rows], costates.lambda_v[rows], -costates.lambda_r[rows])


def _held_arcs(arrays: MissionArrays, flight: ProofFlight) -> list[int]:
    return [k for k, _, _ in flight.plan.arcs if arrays.arcs[k]["held"]]


def held_offsets(
    arrays: MissionArrays, flight: ProofFlight, steering: Steering, costates: Costates
) -> tuple[float, ...]:
    """Return the angle of each held direction from the optimal one, deg.

    Args:
        arrays: the mission.
        flight: from :func:`fly`.
        steering: of the flight; the largest angle of any piece counts.
        costates: of the solution.
    """
    offsets = []
    for k in _held_arcs(arrays, flight):
        engines = [engine for engine in flight.plan.engines if engine.arc == k]
        impulse = np.zeros(3)
        directions = []
        for piece in flight.pieces:
            middle = 0.5 * (piece.begin + piece.end)
            if piece.end - piece.begin <= 2.0 * _SAME_TIME:
                # between two events at once; its costates may be one sample
                continue
            if not any(engine.begin < middle < engine.end for engine in engines):
                continue
            primer = _primer_in(piece, costates)
            half = 0.5 * (piece.end - piece.begin)
            for x, weight in zip(*_GAUSS, strict=True):
                t = middle + half * x
                mass = float(piece.state(t)[6])
                impulse += half * weight * piece.engine(t, mass)[0] / mass * primer(t)
            direction = steering(piece.begin, piece.end)
            directions += [direction(piece.begin), direction(piece.end)]
        offsets.append(max((_angle_deg(w, impulse) for w in directions), default=0.0))
    return tuple(offsets)


def held_checks(
    arrays: MissionArrays, flight: ProofFlight, offsets: tuple[float, ...]
) -> tuple[ConstraintCheck, ...]:
    """Return checks on the angles of :func:`held_offsets`."""
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
    """Return the cause if a held direction is not optimal, else None."""
    for check in checks:
        if not check.satisfied:
            reason = f"{check.name} is {check.value:,.3g} deg off the best one"
            return Cause(Status.NOT_OPTIMAL, f"no optimum found: {reason}")
    return None


def _angle_deg(a: Array, b: Array) -> float:
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))
