# SPDX-License-Identifier: Apache-2.0
"""Verify a solution by an independent integrator.

SciPy's DOP853 (Hairer, Norsett, Wanner) integrates the flight again from the mission's arrays. The
sequence of events, gravity, heating and orbit are written a second time here, without any of the
solver's kernels, so a difference is an error of the solver.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from ares_models.arrays import (
    HEATING_LIMIT,
    MissionArrays,
    Record,
)
from ares_optimizer.proof.physics import acceleration, heating
from ares_optimizer.proof.sequence import (
    Plan,
    plan_flight,
    running,
    spared_by_throttle,
    start_mass,
    thrust_and_flow,
)
from ares_optimizer.solution import FlownArc, SteeringArc, Trajectory, joined

Array = NDArray[np.float64]

#: Thrust direction within a piece: unit vector, shape (3,), at a time in s.
Direction = Callable[[float], Array]
#: State within a piece: position, velocity and mass, shape (7,) or (7, n), at one time or n, s.
State = Callable[[Any], Array]
#: Direction of the piece between two times in s.
Steering = Callable[[float, float], Direction]

RELATIVE_TOLERANCE = 1e-11
#: The same in the air, where steering and drag are smooth in pieces only.
AIR_TOLERANCE = 1e-9
ABSOLUTE_TOLERANCE = np.array([1e-6] * 3 + [1e-9] * 3 + [1e-6])
SAMPLE_PERIOD = 1.0  # s; longer in a burn or in the long coasts of more than MOST_SAMPLES
MOST_SAMPLES = 5000
_LONG_COAST = 600.0  # s
_SAME_TIME = 1e-9
_SIDE = 1e-6


class Piece(NamedTuple):
    """Hold a smooth piece of a flight.

    Attributes:
        begin, end: s.
        state: state at a time.
        engine: thrust in N and mass flow in kg/s, at a time in s and a mass in kg.
        direction: of the thrust, at a time in s.
    """

    begin: float
    end: float
    state: State
    engine: Callable[[float, float], tuple[float, float]]
    direction: Direction


@dataclass(frozen=True)
class ProofFlight:
    """Hold a flight as integrated here.

    Attributes:
        plan: its sequence.
        trajectory: samples, two at each event.
        final: shape (7,): position m, velocity m/s, mass kg.
        at_jettison: per jettison of the mission, (heating W/m2, time s) or None.
        peak_w_m2: greatest heating after the last heating-limited jettison; nan without one.
        pieces: in order of time.
        used_kg: propellant of the last stage burnt by the end.
    """

    plan: Plan
    trajectory: Trajectory
    final: Array
    at_jettison: tuple[tuple[float, float] | None, ...]
    peak_w_m2: float
    pieces: tuple[Piece, ...]
    used_kg: float

    @property
    def whole(self) -> bool:
        """Return true if the flight lasts to the end of its plan."""
        return self.pieces[-1].end >= self.plan.end - _SAME_TIME

    def defects(self, nodes: Array) -> tuple[float, float, float]:
        """Return the largest distances of a solver's nodes from this flight.

        Args:
            nodes: shape (k, 8): time s, position m, velocity m/s, mass kg. At an event the
                nearer side counts; the start is given, and may have a drop at once.

        Returns:
            distance in m, in m/s and in kg.
        """
        worst = np.zeros(3)
        for node in nodes[nodes[:, 0] > self.pieces[0].begin + _SIDE]:
            sides = [
                np.abs(piece.state(min(max(node[0], piece.begin), piece.end)) - node[1:])
                for piece in self.pieces
                if piece.begin - _SIDE <= node[0] <= piece.end + _SIDE
            ]
            if sides:
                near = min(sides, key=lambda d: float(d[6]))
                size = (np.linalg.norm(near[:3]), np.linalg.norm(near[3:6]), near[6])
                worst = np.maximum(worst, size)
        return float(worst[0]), float(worst[1]), float(worst[2])


def steering_of(arcs: Sequence[SteeringArc]) -> Steering:
    """Return the steering of a solution's arcs; a time outside uses the nearest arc."""

    def steering(begin: float, end: float) -> Direction:
        middle = 0.5 * (begin + end)
        arc = min(arcs, key=lambda a: max(a.start_s - middle, middle - a.end_s))
        direction = np.asarray(arc.direction)
        rate = np.asarray(arc.direction_rate)

        def at(t: float) -> Array:
            vector = direction + rate * (t - arc.reference_time_s)
            return vector / math.sqrt(vector @ vector)

        return at

    return steering


def _stack_mass(arrays: MissionArrays, arc: int, done: set[int]) -> float:
    """Return the mass at the begin of a stage, kg.

    It is that of the stack and of jettisons of earlier stages that have not been dropped.
    """
    stage = arrays.arcs[arc]["stage"]
    return float(arrays.arcs[arc]["stack_mass"]) + sum(
        float(jettison["mass"])
        for j, jettison in enumerate(arrays.jettisons)
        if j not in done and jettison["stage"] < stage
    )


def flies_in_air(arrays: MissionArrays) -> bool:
    """Return whether forces of the air or a vertical rise are part of a flight."""
    return any(bool(arrays.arcs[name].any()) for name in ("drag_knots", "exit_area", "vertical"))


def _integrate(
    arrays: MissionArrays,
    plan: Plan,
    direction: Direction,
    span: tuple[float, float],
    y: Array,
) -> tuple[Piece, Array]:
    """Integrate Eq. 2.1 over one smooth piece.

    Returns:
        the piece, shorter than ``span`` if the flight falls to the centre of attraction, and the
        state at its end, shape (7,).
    """
    engines = running(plan.engines, *span)
    arc = arrays.arcs[plan.arc_at(0.5 * (span[0] + span[1]))]
    in_air = flies_in_air(arrays)

    def engine(t: float, mass: float) -> tuple[float, float]:
        return thrust_and_flow(arrays.arcs, engines, t, mass)

    def motion(t: float, y: Array) -> Array:
        thrust, flow = engine(t, float(y[6]))
        along = direction(t) if thrust > 0.0 or in_air else y[:3]
        return np.concatenate((y[3:6], acceleration(y, thrust, along, arc, arrays), [-flow]))

    result = solve_ivp(
        motion,
        span,
        y,
        method="DOP853",
        rtol=AIR_TOLERANCE if in_air else RELATIVE_TOLERANCE,
        atol=ABSOLUTE_TOLERANCE,
        dense_output=True,
    )
    state = result.sol
    if state is None:
        raise AssertionError("asked for dense output")
    return Piece(span[0], float(result.t[-1]), state, engine, direction), result.y[:, -1].copy()


def _sampled(
    arrays: MissionArrays,
    piece: Piece,
    direction: Direction,
    period: float,
    ends: tuple[Array, Array],
) -> Trajectory:
    """Sample a piece every ``period`` s, and at its ends, whose states are given."""
    count = max(2, math.ceil((piece.end - piece.begin) / period) + 1)
    grid = np.linspace(piece.begin, piece.end, count)
    states = piece.state(grid).T
    states[0], states[-1] = ends
    return Trajectory(
        grid,
        states[:, :3],
        states[:, 3:6],
        states[:, 6],
        np.array([direction(t) for t in grid]),
        heating(states[:, :3], states[:, 3:6], arrays),
        np.array([piece.engine(t, y[6])[0] for t, y in zip(grid, states, strict=True)]),
    )


def _greatest_heating(arrays: MissionArrays, state: State, track: Trajectory) -> float:
    """Return the greatest heating over a piece, W/m2."""
    grid, values = track.time_s, track.heating_rate
    best = int(np.argmax(values))
    if not 0 < best < len(grid) - 1:
        return float(values[best])
    refined = minimize_scalar(
        lambda t: -float(heating(state(t)[:3], state(t)[3:6], arrays)),
        bounds=(grid[best - 1], grid[best + 1]),
        method="bounded",
        options={"xatol": 1e-6},
    )
    return -float(refined.fun)


def _drop_times(
    arrays: MissionArrays, start: Record, jettison_times: Sequence[float], t_meco: float
) -> tuple[set[int], dict[int, float]]:
    """Return the jettisons dropped before the start, and the times of those to come, s."""
    done = {j for j in range(len(arrays.jettisons)) if (int(start["jettisoned"]) >> j) & 1}
    last, now = t_meco + _SAME_TIME, float(start["time"])
    times = enumerate(jettison_times)
    due = {j: max(t, now) for j, t in times if t <= last and math.isfinite(t) and j not in done}
    return done, due


def _dropped(
    arrays: MissionArrays,
    due: Mapping[int, float],
    done: set[int],
    at_jettison: list[tuple[float, float] | None],
    t: float,
    y: Array,
) -> bool:
    """Drop what is due at a time from the state; return whether a heating limit caused a drop."""
    heated = False
    for j, time in due.items():
        if j not in done and time <= t + _SAME_TIME:
            done.add(j)
            y[6] -= float(arrays.jettisons[j]["mass"])
            at_jettison[j] = (float(heating(y[:3], y[3:6], arrays)), t)
            heated |= bool(arrays.jettisons[j]["criterion"] == HEATING_LIMIT)
    return heated


def fly(
    arrays: MissionArrays,
    start: Record,
    steering: Steering,
    jettison_times: Sequence[float],
    t_meco: float,
    boundaries: Sequence[float] = (),
) -> ProofFlight:
    """Integrate a flight to its end, or until it falls to the centre of attraction.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        steering: thrust direction per piece.
        jettison_times: s, one per jettison of the mission; nan: not dropped.
        t_meco: cut-off command, s.
        boundaries: further times at which the steering is not smooth, s.
    """
    plan = plan_flight(arrays, start, t_meco)
    now = float(start["time"])
    done, due = _drop_times(arrays, start, jettison_times, t_meco)
    breaks = plan.breaks | set(due.values()) | {t for t in boundaries if now < t < plan.end}
    ends = sorted(t for t in breaks if t > now + _SAME_TIME)
    y = np.concatenate((start["position"], start["velocity"], [start_mass(arrays, start)]))
    at_jettison: list[tuple[float, float] | None] = [None] * len(arrays.jettisons)
    tracks: list[Trajectory] = []
    pieces: list[Piece] = []
    watching = False
    peak, spared, t = -math.inf, 0.0, now
    for end in [*ends, math.inf]:
        for time, k in plan.stagings:
            if abs(time - t) <= _SAME_TIME:
                y[6] = _stack_mass(arrays, k, done)
        if _dropped(arrays, due, done, at_jettison, t, y):
            watching, peak = True, -math.inf
        if math.isinf(end):
            break
        direction = steering(t, end)
        piece, after = _integrate(arrays, plan, direction, (t, end), y)
        pieces.append(piece)
        coasts = not running(plan.engines, t, end) and end - t > _LONG_COAST
        period = max(SAMPLE_PERIOD, (plan.end - now if coasts else end - t) / MOST_SAMPLES)
        tracks.append(_sampled(arrays, piece, direction, period, (y, after)))
        if watching:
            peak = max(peak, _greatest_heating(arrays, piece.state, tracks[-1]))
        spared += spared_by_throttle(
            arrays.arcs, running(plan.engines, t, end), y[6] - after[6], t, piece.end
        )
        y, t = after, end
        if piece.end < end:
            break
    return ProofFlight(
        plan,
        joined(tracks),
        y,
        tuple(at_jettison),
        peak if math.isfinite(peak) else math.nan,
        tuple(pieces),
        plan.used_kg - spared,
    )


def flown_arcs(arrays: MissionArrays, start: Record, t_meco: float) -> tuple[FlownArc, ...]:
    """Return the arcs from the start on, with their times.

    Args:
        arrays: the mission, with arcs of given lengths.
        start: record NAVIGATION.
        t_meco: cut-off command, s.
    """
    return tuple(FlownArc(*arc) for arc in plan_flight(arrays, start, t_meco).arcs)
