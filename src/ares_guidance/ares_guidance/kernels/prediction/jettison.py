# SPDX-License-Identifier: Apache-2.0
"""Predicted time at which the heating falls to a jettison's limit."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import HEATING_MEASURED, PHASE_CONVERGING, Onboard
from ares_guidance.kernels.prediction.burn import (
    LinearTangent,
    gravity_effect,
    primer,
    steered_thrust,
    turned_thrust,
)
from ares_guidance.kernels.prediction.segments import (
    acceleration_at,
    direction_time,
    thrust_integrals,
)
from ares_models.arrays import MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import gravity, heating_rate, log_heating
from ares_models.kernels.sequence import awaits_heating
from ares_models.kernels.vectors import add, axpy, load, unit

JETTISON_SEARCH_STEPS = 12
#: Tolerance of a jettison before the next cycle, s.
EXACT = 1e-4
#: Longest interval of navigation states that counts as their period, s.
LONGEST_WAIT = 5.0


@kernel
def next_answer(onboard: Onboard) -> float:
    """Return the time to the next cycle, s, or to the next navigation state if that is later."""
    waited = min(onboard.state.navigation.interval, LONGEST_WAIT)
    return max(onboard.settings.cycle_period, waited)


@kernel
def predicted_log_heating(
    mission: MissionRecords, onboard: Onboard, steering: LinearTangent, t: float
) -> tuple[float, float]:
    """Return the logarithm of the modelled heating on the predicted path, and its rate.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance, with planned segments.
        steering: of the prediction.
        t: s from now.

    Returns:
        ln(q / (W/m2)) and its rate in 1/s.
    """
    environment = mission.environment
    nav = onboard.navigation
    state = onboard.state
    r = load(nav.position)
    v = load(nav.velocity)
    # the second-order expansion is inexact at both ends of a turn
    if state.solution.primer.gradient > 0.0 or t <= next_answer(onboard):
        thrust_v, thrust_r = turned_thrust(state, t, math.inf, steering)
    else:
        thrust_v, thrust_r = steered_thrust(thrust_integrals(state, t, math.inf), steering)
    gravity_v, gravity_r = gravity_effect(r, v, thrust_v, thrust_r, t, environment)
    r_t = add(axpy(t, v, r), add(gravity_r, thrust_r))
    v_t = add(v, add(gravity_v, thrust_v))
    acceleration = gravity(r_t, environment)
    for i in range(state.segment_count):
        segment = state.segments[i]
        into = t - segment.start
        if 0.0 <= into <= segment.duration:
            thrust = acceleration_at(segment, into)
            turned, _ = primer(state.solution, steering, direction_time(segment, t))
            acceleration = axpy(thrust, unit(turned), acceleration)
            break
    return log_heating(r_t, v_t, environment, mission.atmosphere, acceleration)


@kernel
def heating_crossing(
    mission: MissionRecords,
    onboard: Onboard,
    steering: LinearTangent,
    log_limit: float,
    earliest: float,
    guess: float,
) -> float:
    """Find the time at which the predicted heating falls to a limit.

    Newton on the log of the heating: it is convex up to the apex, so from the left the
    iteration runs to the first crossing without overshoot.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance, with planned segments.
        steering: of the prediction.
        log_limit: ln of the limit, scaled to the on-board density model.
        earliest: s from now.
        guess: s from now.

    Returns:
        s from now; inf when the limit is not met before cut-off.
    """
    settings = onboard.settings
    horizon = onboard.state.solution.time_to_go
    falling = earliest
    t = min(max(guess, earliest), horizon)
    for _ in range(JETTISON_SEARCH_STEPS):
        value, slope = predicted_log_heating(mission, onboard, steering, t)
        excess = value - log_limit
        if slope < 0.0:
            if excess > 0.0:
                falling = max(falling, t)
                if t >= horizon:
                    return math.inf
            following = min(max(t - excess / slope, earliest), horizon)
        else:
            # past the apex: the crossing, if any, is earlier
            following = 0.5 * (falling + t)
            if t <= earliest:
                return earliest if excess <= 0.0 else math.inf
        # from the left every iterate is above the limit
        near = following <= next_answer(onboard)
        if abs(following - t) <= (EXACT if near else settings.jettison_time_tolerance):
            return following if slope < 0.0 or excess <= 0.0 else math.inf
        t = following
    return math.inf


@kernel
def measure_density(mission: MissionRecords, onboard: Onboard) -> None:
    """Measure the density over that on board from the heating; NaN if it is not measured.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Its density ratio is changed.
    """
    nav = onboard.navigation
    r, v = load(nav.position), load(nav.velocity)
    modelled = heating_rate(r, v, mission.environment, mission.atmosphere)
    ratio = nav.heating_rate / modelled if modelled > 0.0 else math.nan
    onboard.state.density_ratio = ratio if ratio > 0.0 else math.nan


@kernel
def on_board_heating(settings: Record, state: Record) -> float:
    """Return the factor from modelled to measured heating; 1 if it is not measured."""
    if settings.heating_source == HEATING_MEASURED and math.isfinite(state.density_ratio):
        return state.density_ratio
    return 1.0


@kernel
def first_ignition(stage: int, arcs: NDArray[Any], state: Record) -> float:
    """Return the time from now to the first planned thrust of a stage, s; 0 if it burns already."""
    for i in range(state.segment_count):
        if arcs[state.segments[i].arc].stage >= stage:
            return state.segments[i].start
    return math.inf


@kernel
def predict_jettisons(mission: MissionRecords, onboard: Onboard, steering: LinearTangent) -> float:
    """Move each heating jettison to the time at which the predicted path meets its limit.

    In the search for a first solution they stay where the plan has them: with one too late the
    vehicle is heavier, its path lower, and the search may end there.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance, with planned segments. Its jettison times are changed.
        steering: of the prediction.

    Returns:
        largest change of a predicted time, s; inf when a jettison came into or fell
        out of the plan.
    """
    nav = onboard.navigation
    settings = onboard.settings
    state = onboard.state
    jettison_time = state.solution.jettison_time
    jettisons = mission.jettisons
    largest = 0.0
    if state.phase <= PHASE_CONVERGING and state.leg.jettison_time > nav.time:
        return largest
    below = 1.0 - settings.heating_margin
    ratio = on_board_heating(settings, state)
    for j in range(jettisons.shape[0]):
        if not awaits_heating(jettisons, nav.jettisoned, j):
            continue
        earliest = first_ignition(jettisons[j].stage, mission.arcs, state)
        before = jettison_time[j] - nav.time
        guess = before if math.isfinite(before) else earliest
        log_limit = math.log(jettisons[j].value * below / ratio)
        after = heating_crossing(mission, onboard, steering, log_limit, earliest, guess)
        if math.isfinite(after) != math.isfinite(before):
            largest = math.inf
        elif math.isfinite(after):
            largest = max(largest, abs(after - before))
        jettison_time[j] = nav.time + after
    return largest
