# SPDX-License-Identifier: Apache-2.0
"""Lengths of the intervals of a phase: short where the thrust turns or an orbit is fast."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from ares_models.arrays import Record

Array = NDArray[np.float64]

#: Angle of an interval in a burn and in a coast, rad of a low circular orbit; bounds of the count.
_BURN_TURN = 0.12
COAST_TURN = 0.25
_AIR_TURN = 0.03
#: Altitude up to which the air needs such short intervals, m.
_THICK_AIR_M = 6e4
_LEAST_BURN = 2
_MOST_BURN = 40
_LEAST_COAST = 2
_MOST_COAST = 400
#: Share of the intervals of a coast that are equal, and the most in rad of a low circular orbit:
#: they resolve orbits that become others.
_COAST_EVEN = 0.05
_MOST_EVEN = 3.0
#: Turn of the thrust per additional interval, rad; most intervals of a phase; resolution of their
#: ends.
_THRUST_TURN = 0.15
_MOST_TURNS = 80
_PLACES = 2001
_SHORT = 5.0  # s


def _equal_shares(whole: Array, count: int) -> Array:
    """Return the ends of intervals with equal shares of a measure, as fractions of the phase.

    Args:
        whole: the measure from 0 on, increasing, at equal fractions of the phase.
        count: of the intervals.
    """
    even = np.linspace(0.0, 1.0, len(whole))
    places: Array = np.interp(np.linspace(0.0, whole[-1], count + 1), whole, even)
    places[0], places[-1] = 0.0, 1.0
    return places


class Turning(NamedTuple):
    """Hold the turn of the thrust direction along a flight.

    Attributes:
        time: s, shape (n,), increasing.
        turned: angle turned since the first time, rad, shape (n,).
    """

    time: Array
    turned: Array


class Sweep(NamedTuple):
    """Hold the angle that circular orbits at the radii of a flight sweep.

    Attributes:
        time: s, shape (n,), not decreasing.
        angle: swept since the first time, rad, shape (n,).
        above_air_s: time at which the flight leaves thick air, s.
    """

    time: Array
    angle: Array
    above_air_s: float = math.inf


def sweep_of(time: Array, position: Array, environment: Record) -> Sweep:
    """Integrate the rate of a circular orbit at the radius of a flight.

    Args:
        time: s, shape (n,), not decreasing.
        position: m, shape (n, 3).
        environment: record ENVIRONMENT.
    """
    radius = np.maximum(np.linalg.norm(position, axis=1), 1.0)
    angle: Array = cumulative_trapezoid(
        np.sqrt(float(environment["mu"]) / radius**3), time, initial=0
    )
    low = np.flatnonzero(radius < float(environment["equatorial_radius"]) + _THICK_AIR_M)
    return Sweep(time, angle, float(time[low[-1] if low.size else 0]))


def has_thrust(piece: Record) -> bool:
    """Return true if a segment, record SEGMENT, has thrust."""
    return bool(piece["thrust"] > 0.0 or piece["thrust_slope"] > 0.0)


def place_intervals(
    piece: Record, unit_s: float, air_end_s: float, finer: float, turning: Turning | None
) -> Array:
    """Return the ends of the intervals of a phase, as fractions of the phase.

    Args:
        piece: the phase's segment, record SEGMENT.
        unit_s: time of 1 rad of a low circular orbit.
        air_end_s: time up to which forces of the air need short intervals, s.
        finer: factor on the number of intervals.
        turning: turn of the thrust in a similar flight; None: intervals are equal.
    """
    begin, end = float(piece["start"]), float(piece["end"])
    if end - begin < _SHORT:
        return np.linspace(0.0, 1.0, math.ceil(finer) + 1)
    burning = has_thrust(piece)
    step, least, most = (
        (_BURN_TURN, _LEAST_BURN, _MOST_BURN)
        if burning
        else (COAST_TURN, _LEAST_COAST, _MOST_COAST)
    )
    even = np.linspace(0.0, 1.0, _PLACES)
    times = begin + even * (end - begin)
    in_air = np.clip(times, begin, max(begin, air_end_s if burning else begin)) - begin
    air_step = _AIR_TURN if turning is None else 2.0 * _AIR_TURN
    whole = (in_air / air_step + (times - begin - in_air) / step) / unit_s
    count = min(max(math.ceil(whole[-1]), least), most)
    whole *= count / whole[-1]
    if turning is not None and burning:
        turned = np.interp(times, *turning)
        # additional intervals in proportion to the turn of the thrust
        whole += (turned - turned[0]) / _THRUST_TURN
        count = min(whole[-1], _MOST_TURNS)
    return _equal_shares(whole, math.ceil(finer * count))


def place_by_sweep(piece: Record, unit_s: float, finer: float, sweep: Sweep) -> tuple[Array, float]:
    """Place the intervals of a coast by the angle that it sweeps.

    Args:
        piece: the coast's segment, record SEGMENT.
        unit_s: time of 1 rad of a low circular orbit.
        finer: factor on the number of intervals.
        sweep: of a similar flight.

    Returns:
        ends of the intervals as fractions of the coast; the swept angle over that of a low
        circular orbit, 1 at most.
    """
    begin, end = float(piece["start"]), float(piece["end"])
    if end - begin < _SHORT:
        return np.linspace(0.0, 1.0, math.ceil(finer) + 1), 1.0
    low = (end - begin) / unit_s
    even = np.linspace(0.0, 1.0, _PLACES)
    angle = np.interp(begin + even * (end - begin), sweep.time, sweep.angle)
    whole = angle - angle[0] + min(_COAST_EVEN * low, _MOST_EVEN) * even
    count = min(max(math.ceil(whole[-1] / COAST_TURN), _LEAST_COAST), _MOST_COAST)
    pace = min(1.0, float(angle[-1] - angle[0]) / low)
    return _equal_shares(whole, math.ceil(finer * count)), pace
