# SPDX-License-Identifier: Apache-2.0
"""Monitors of every law's answer: an answer that violates a rule is held back.

The last good answer is sent instead, or only the jettison is held back; violations are counted.
"""

import math

from ares_guidance.arrays import (
    ERROR_PROPELLANT_SHORT,
    ERROR_TARGET_UNREACHABLE,
    FLIP_NEAR,
    LAW_OPTIMAL,
    MONITOR_DEPLETION,
    MONITOR_DIRECTION,
    MONITOR_JETTISON,
    MONITOR_STEERING_RATE,
    MONITOR_TIME_TO_GO,
    MONITOR_WORK,
    PHASE_CUTOFF,
    PHASE_IDLE,
    Onboard,
)
from ares_guidance.kernels.laws.convergence import LAST_PASSES
from ares_guidance.kernels.monitors.engines import present_engine
from ares_guidance.kernels.monitors.shortfall import ROUNDS
from ares_guidance.kernels.prediction.jettison import next_answer, on_board_heating
from ares_models.arrays import BURN, HEATING_LIMIT, MAX_ARCS, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import gravity, heating_rate
from ares_models.kernels.sequence import empty_mass
from ares_models.kernels.steering import copy_steering, is_sound
from ares_models.kernels.throttle import throttle
from ares_models.kernels.vectors import Vector, axpy, cross, dot, load, norm, store, unit

#: Tolerance of a cut-off in the past, s.
NOW = 1e-9
#: Error of the heating estimate at a jettison before the next answer, as a fraction of the limit.
HEATING_SHARE = 2e-3
#: Error of the depletion estimate, s and as a fraction of the remaining burn.
DEPLETION_S, DEPLETION_SHARE = 1.0, 0.02
#: Largest number of searches of one kind in a round of a cycle.
SEARCHES = 10


@kernel
def fastest_turn(steering: Record, begin: float, end: float) -> float:
    """Return the largest turn rate of the commanded direction between two times, rad/s."""
    rate = load(steering.direction_rate)
    square = dot(rate, rate)
    if square == 0.0:
        return 0.0
    direction = load(steering.direction)
    # time at which the linear direction vector is shortest, and turns fastest
    nearest = steering.reference_time - dot(direction, rate) / square
    at = min(max(nearest, begin), end)
    u = axpy(at - steering.reference_time, rate, direction)
    return norm(cross(u, rate)) / dot(u, u)


@kernel
def turns_faster(limit: float, steering: Record, begin: float, end: float) -> bool:
    """Return whether the commanded direction turns faster than ``limit``, rad/s, between two times.

    The direction is a unit vector at the reference time. While it has moved by less than 0.5, it
    turns at no more than twice its rate: a cheap check before :func:`fastest_turn`.
    """
    rate = load(steering.direction_rate)
    square = dot(rate, rate)
    far = max(abs(begin - steering.reference_time), abs(end - steering.reference_time))
    if square * far * far <= 0.25 and 5.0 * square <= limit * limit:
        return False
    return not fastest_turn(steering, begin, end) <= limit


@kernel
def thrust_ahead(mission: MissionRecords, onboard: Onboard) -> Vector:
    """Return the present thrust acceleration along the commanded direction, m/s2."""
    nav = onboard.navigation
    steering = onboard.steering
    arc = mission.arcs[nav.arc]
    if arc.kind != BURN:
        return 0.0, 0.0, 0.0
    ve, mass_flow = present_engine(arc, arc.stage, onboard.state)
    u = unit(
        axpy(
            nav.time - steering.reference_time,
            load(steering.direction_rate),
            load(steering.direction),
        )
    )
    size = throttle(arc, nav.mass) * ve * mass_flow / nav.mass
    return size * u[0], size * u[1], size * u[2]


@kernel
def drops_too_early(mission: MissionRecords, onboard: Onboard) -> bool:
    """Return whether a jettison before the next answer would exceed its heating limit.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance, with the answer.
    """
    nav = onboard.navigation
    settings = onboard.settings
    steering = onboard.steering
    j = steering.jettison
    if j < 0 or mission.jettisons[j].criterion != HEATING_LIMIT:
        return False
    span = max(0.0, steering.jettison_time - nav.time)
    if not span <= next_answer(onboard):
        return False
    r, v = load(nav.position), load(nav.velocity)
    a = axpy(1.0, thrust_ahead(mission, onboard), gravity(r, mission.environment))
    there = axpy(span, axpy(0.5 * span, a, v), r)
    heating = heating_rate(there, axpy(span, a, v), mission.environment, mission.atmosphere)
    ratio = on_board_heating(settings, onboard.state)
    return bool(heating * ratio > mission.jettisons[j].value * (1.0 + HEATING_SHARE))


@kernel
def outlasts_propellant(mission: MissionRecords, onboard: Onboard) -> bool:
    """Return whether the last burn would outlast its propellant without an error code saying so.

    Args: as in :func:`drops_too_early`.
    """
    nav = onboard.navigation
    state = onboard.state
    arc = mission.arcs[nav.arc]
    if nav.arc + 1 < mission.arcs.shape[0] or arc.kind != BURN:
        return False
    if state.error == ERROR_PROPELLANT_SHORT or state.error == ERROR_TARGET_UNREACHABLE:
        return False
    if arc.tabled:
        burns_until = nav.arc_start_time + arc.start_time[arc.start_knots - 1]
        return bool(onboard.steering.cutoff_time > burns_until + DEPLETION_S)
    _, mass_flow = present_engine(arc, arc.stage, state)
    if math.isfinite(arc.max_acceleration):
        mass_flow *= arc.min_throttle
    left = nav.mass - empty_mass(arc, mission.arcs, mission.jettisons, nav.jettisoned)
    longest = (1.0 + DEPLETION_SHARE) * max(0.0, left) / mass_flow + DEPLETION_S
    return bool(onboard.steering.cutoff_time - nav.time > longest)


@kernel
def most_iterations(settings: Record) -> int:
    """Return a bound on the iterations of a cycle that no working law exceeds."""
    of_a_round = SEARCHES * (settings.max_iterations + settings.max_solve_iterations) + LAST_PASSES
    return int((ROUNDS + 1) * of_a_round)


@kernel
def broken_rules(mission: MissionRecords, onboard: Onboard) -> int:
    """Check the present answer and return the violated rules, MONITOR_* bits.

    Args: as in :func:`drops_too_early`.
    """
    nav = onboard.navigation
    settings = onboard.settings
    state = onboard.state
    steering = onboard.steering
    if not is_sound(steering, mission.jettisons.shape[0]):
        return MONITOR_DIRECTION
    flags = 0
    if state.phase < PHASE_CUTOFF and steering.cutoff_time < nav.time - NOW:
        flags |= MONITOR_TIME_TO_GO
    if drops_too_early(mission, onboard):
        flags |= MONITOR_JETTISON
    if outlasts_propellant(mission, onboard):
        flags |= MONITOR_DEPLETION
    if state.iterations > most_iterations(settings):
        flags |= MONITOR_WORK
    end = nav.time + settings.cycle_period
    # a flip is one of the plan, and costs most of what is saved by it if it comes late
    flips = state.law == LAW_OPTIMAL and state.optimal.flip == FLIP_NEAR
    if not flips and turns_faster(settings.steering_rate_limit, steering, nav.time, end):
        flags |= MONITOR_STEERING_RATE
    return flags


@kernel
def steer_along_velocity(nav: Record, steering: Record) -> None:
    """Write a neutral answer: thrust along the velocity, no cut-off, no jettison."""
    steering.reference_time = nav.time
    store(steering.direction, unit(load(nav.velocity)))
    store(steering.direction_rate, (0.0, 0.0, 0.0))
    steering.cutoff_time = math.nan
    steering.jettison = -1
    steering.jettison_time = math.nan
    for k in range(MAX_ARCS):
        steering.arc_end_times[k] = math.nan


@kernel
def hold_good(onboard: Onboard) -> None:
    """Repeat the last good answer, without the parts that would violate the same rules.

    Args:
        onboard: state of guidance. The answer and the last good one are changed.
    """
    nav = onboard.navigation
    settings = onboard.settings
    monitors = onboard.state.monitors
    good = monitors.good
    if monitors.kept == 0:
        steer_along_velocity(nav, good)
    if monitors.flags & MONITOR_JETTISON:
        good.jettison = -1
        good.jettison_time = math.nan
    end = nav.time + settings.cycle_period
    if turns_faster(settings.steering_rate_limit, good, nav.time, end):
        since = nav.time - good.reference_time
        store(good.direction, unit(axpy(since, load(good.direction_rate), load(good.direction))))
        store(good.direction_rate, (0.0, 0.0, 0.0))
        good.reference_time = nav.time
    copy_steering(good, onboard.steering)


@kernel
def watch_answer(mission: MissionRecords, onboard: Onboard) -> None:
    """Pass the present answer, or replace it by the last good one.

    Args: as in :func:`drops_too_early`. The answer and the monitors are changed.
    """
    state = onboard.state
    monitors = state.monitors
    if state.phase == PHASE_IDLE:
        # no command yet
        return
    monitors.flags = broken_rules(mission, onboard)
    if monitors.flags == 0:
        copy_steering(onboard.steering, monitors.good)
        monitors.kept = 1
        return
    monitors.violations += 1
    monitors.violated |= monitors.flags
    if monitors.flags == MONITOR_JETTISON:
        # only the jettison is wrong
        onboard.steering.jettison = -1
        onboard.steering.jettison_time = math.nan
        copy_steering(onboard.steering, monitors.good)
        monitors.kept = 1
        return
    hold_good(onboard)
