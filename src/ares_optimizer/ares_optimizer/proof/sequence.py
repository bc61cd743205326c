# SPDX-License-Identifier: Apache-2.0
"""Lay out the times of thrust and staging from the mission's arrays."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ares_models.arrays import (
    BURN,
    MissionArrays,
    Record,
)

Array = NDArray[np.float64]

_SAME_TIME = 1e-9  # s


@dataclass(frozen=True)
class Thrust:
    """Hold the thrust interval of one arc: its own curve, or its tail-off."""

    arc: int
    begin: float
    end: float
    tail: bool


@dataclass
class Plan:
    """Hold the times of thrust, arcs and staging.

    Attributes:
        engines: thrust intervals, in order of time.
        stagings: (time s, arc that begins a stage).
        arcs: (arc, begin s, end s) in order of time.
        breaks: times at which the right-hand side is not smooth, s.
        end: end of thrust, s.
        used_kg: propellant of the last stage burnt by the end, at full thrust.
    """

    engines: list[Thrust] = field(default_factory=list)
    stagings: list[tuple[float, int]] = field(default_factory=list)
    arcs: list[tuple[int, float, float]] = field(default_factory=list)
    breaks: set[float] = field(default_factory=set)
    end: float = math.nan
    used_kg: float = 0.0

    def arc_at(self, t: float) -> int:
        """Return the arc that is flown at a time, s; the last one after the cut-off."""
        return next((k for k, begin, end in self.arcs if begin <= t < end), self.arcs[-1][0])


def _curve(arc: Record, name: str) -> tuple[Array, Array]:
    knots = int(arc[f"{name}_knots"])
    return arc[f"{name}_time"][:knots], arc[f"{name}_fraction"][:knots]


def thrust_fraction(arcs: NDArray[np.void], engine: Thrust, t: float) -> float:
    """Return the fraction of full thrust at a time."""
    times, fractions = _curve(arcs[engine.arc], "tail" if engine.tail else "start")
    if not len(times):
        return 1.0
    return float(np.interp(t - engine.begin, times, fractions))


def flow_fraction(arcs: NDArray[np.void], engine: Thrust, t: float) -> float:
    """Return the fraction of full mass flow at a time: tabled, or that of the thrust."""
    arc = arcs[engine.arc]
    if engine.tail or not arc["tabled"]:
        return thrust_fraction(arcs, engine, t)
    knots = int(arc["start_knots"])
    return float(np.interp(t - engine.begin, arc["start_time"][:knots], arc["start_flow"][:knots]))


def _burnt(arcs: NDArray[np.void], engines: Sequence[Thrust], begin: float, end: float) -> float:
    """Return the propellant of the given thrust intervals between two times, kg."""
    total = 0.0
    for engine in engines:
        low, high = max(begin, engine.begin), min(end, engine.end)
        if high <= low:
            continue
        times, _ = _curve(arcs[engine.arc], "tail" if engine.tail else "start")
        knots = [low, *(t for t in engine.begin + times if low < t < high), high]
        # straight between knots; at one of them the flow may jump
        area = sum(flow_fraction(arcs, engine, 0.5 * (a + b)) * (b - a) for a, b in pairwise(knots))
        total += float(arcs[engine.arc]["mass_flow"]) * area
    return total


def _burnout(
    arcs: NDArray[np.void],
    engines: Sequence[Thrust],
    begin: float,
    left: float,
    low: float,
    high: float,
) -> float:
    """Return the time at which the propellant ``left`` at ``begin`` is depleted, s."""
    return float(brentq(lambda t: _burnt(arcs, engines, begin, t) - left, low, high, xtol=1e-12))


def _left_running(arcs: NDArray[np.void], present: int, begin: float, now: float) -> list[Thrust]:
    """Return the tail-off still running at a start in the coast after it."""
    for k in range(present, 0, -1):
        if arcs[k]["begins_stage"] == 1:
            break
        if arcs[k - 1]["kind"] == BURN:
            times, _ = _curve(arcs[k - 1], "tail")
            if len(times) and begin + times[-1] > now:
                return [Thrust(k - 1, begin, begin + float(times[-1]), True)]
            break
        begin -= float(arcs[k - 1]["duration"])
    return []


def _full_mass(arrays: MissionArrays, start: Record) -> float:
    """Return the mass at the start of the present stage, less what has been dropped since, kg."""
    arc = arrays.arcs[start["arc"]]
    full = float(arc["stack_mass"])
    for j, jettison in enumerate(arrays.jettisons):
        gone = (int(start["jettisoned"]) >> j) & 1
        if not gone and jettison["stage"] < arc["stage"]:
            full += float(jettison["mass"])
        elif gone and jettison["stage"] >= arc["stage"]:
            full -= float(jettison["mass"])
    return full


def _depletion(
    arcs: NDArray[np.void],
    running: Sequence[Thrust],
    burn: Thrust,
    stage_begin: float,
    used: float,
    now: float,
) -> float | None:
    """Return the time at which a burn depletes its stage, s; None: not before its end.

    Args:
        arcs: of the mission.
        running: other thrust intervals of the stage.
        burn: its thrust interval.
        stage_begin: begin of the stage's burns, s.
        used: propellant burnt before, kg.
        now: begin of the flight, s.
    """
    # the start may be lighter than the empty stage
    left = max(0.0, float(arcs[burn.arc]["propellant"]) - used)
    far = min(burn.end, burn.begin + 1e5)
    trial = [*running, Thrust(burn.arc, burn.begin, far, False)]
    excess = _burnt(arcs, trial, stage_begin, far) - left
    if not excess > 1e-6 * float(arcs[burn.arc]["mass_flow"]):
        return None
    return _burnout(arcs, trial, stage_begin, left, max(burn.begin, now), far)


def start_mass(arrays: MissionArrays, start: Record) -> float:
    """Return the mass at the start, kg; that of the stack where none is given."""
    return float(start["mass"] if start["mass"] > 0.0 else arrays.arcs[start["arc"]]["stack_mass"])


def plan_flight(arrays: MissionArrays, start: Record, t_meco: float) -> Plan:
    """Lay out the arcs of a mission in time, from the start to the end of the tail-off.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        t_meco: cut-off command, s.
    """
    arcs = arrays.arcs
    now = float(start["time"])
    plan = Plan()
    k = int(start["arc"])
    begin = float(start["arc_start_time"])
    used = max(0.0, _full_mass(arrays, start) - start_mass(arrays, start))
    running = _left_running(arcs, k, begin, now)  # of this stage, for its propellant
    for tail in running:
        plan.engines.append(tail)
        plan.breaks.update(tail.begin + _curve(arcs[tail.arc], "tail")[0])
    stage_begin = now
    last = len(arcs) - 1
    while True:
        arc = arcs[k]
        end = t_meco if k == last else begin + float(arc["duration"])
        spent = False
        if arc["kind"] == BURN:
            engine = Thrust(k, begin, end, False)
            # a throttled burn ends by the clock: the mission file has enough propellant
            if k != last and not is_throttled(arc):
                depletion = _depletion(arcs, running, engine, stage_begin, used, now)
                if depletion is not None:
                    spent, end = True, depletion
                    engine = Thrust(k, begin, end, False)
            running.append(engine)
            plan.engines.append(engine)
            # knots of a table up to the end of the burn, except for rounding
            knots = begin + _curve(arc, "start")[0]
            plan.breaks.update(knots[knots < end - _SAME_TIME])
            tail_times, _ = _curve(arc, "tail")
            if len(tail_times) and not spent:
                tail = Thrust(k, end, end + float(tail_times[-1]), True)
                running.append(tail)
                plan.engines.append(tail)
                plan.breaks.update(end + tail_times)
        plan.breaks.add(end)
        plan.arcs.append((k, begin, end))
        if k == last:
            plan.end = max([t_meco, *(e.end for e in running if e.tail and e.begin >= t_meco)])
            plan.used_kg = used + _burnt(arcs, running, stage_begin, plan.end)
            break
        k += 1
        while spent and k < last and arcs[k]["kind"] == BURN and arcs[k]["stage"] == arc["stage"]:
            k += 1
        begin = end
        if arcs[k]["begins_stage"] == 1:
            plan.stagings.append((begin, k))
            # the tail-off of a separated stage does not count
            plan.engines = [Thrust(e.arc, e.begin, min(e.end, begin), e.tail) for e in plan.engines]
            running, used, stage_begin = [], 0.0, begin
    plan.breaks = {t for t in plan.breaks if now < t < plan.end} | {plan.end}
    return plan


def is_throttled(arc: Record) -> bool:
    """Return true if a burn has a limit of acceleration."""
    return arc["kind"] == BURN and math.isfinite(arc["max_acceleration"])


def throttle(arc: Record, mass: float) -> float:
    """Return the throttle, as fraction of full thrust, at a mass, kg."""
    if not is_throttled(arc):
        return 1.0
    wanted = float(arc["max_acceleration"]) * mass / float(arc["thrust"])
    return min(1.0, max(wanted, float(arc["min_throttle"])))


def thrust_and_flow(
    arcs: NDArray[np.void], engines: Sequence[Thrust], t: float, mass: float
) -> tuple[float, float]:
    """Return thrust, N, and mass flow, kg/s, at a time and a mass, kg."""
    thrust = 0.0
    flow = 0.0
    for engine in engines:
        part = throttle(arcs[engine.arc], mass)
        thrust += part * thrust_fraction(arcs, engine, t) * float(arcs[engine.arc]["thrust"])
        flow += part * flow_fraction(arcs, engine, t) * float(arcs[engine.arc]["mass_flow"])
    return thrust, flow


def spared_by_throttle(
    arcs: NDArray[np.void], engines: Sequence[Thrust], burnt: float, begin: float, end: float
) -> float:
    """Return the propellant that throttling saved in the last stage in a piece, kg."""
    stage = arcs[-1]["stage"]
    if not any(is_throttled(arcs[e.arc]) and arcs[e.arc]["stage"] == stage for e in engines):
        return 0.0
    return _burnt(arcs, engines, begin, end) - burnt


def running(engines: Sequence[Thrust], begin: float, end: float) -> list[Thrust]:
    """Return the thrust intervals that cover a piece of the flight."""
    middle = 0.5 * (begin + end)
    return [engine for engine in engines if engine.begin < middle < engine.end]
