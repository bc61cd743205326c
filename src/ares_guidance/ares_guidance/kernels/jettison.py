"""When the heating will allow a jettison, on the predicted path."""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import (
    HEATING_MEASURED,
)
from ares_guidance.kernels.prediction import gravity_effect, steered_thrust
from ares_guidance.kernels.segments import (
    thrust_integrals,
)
from ares_models.arrays import HEATING_LIMIT, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import gravity, log_heating
from ares_models.kernels.vectors import (
    Vector,
    add,
    axpy,
    load,
    unit,
)

JETTISON_SEARCH_STEPS = 12


@kernel
def predicted_log_heating(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    state: Record,
    direction: Vector,
    rate: Vector,
    reference: float,
    t: float,
) -> tuple[float, float]:
    """Log of the modelled heating on the predicted path, and its slope.

    Args:
        nav: record NAVIGATION.
        environment: record ENVIRONMENT.
        atmosphere: log-density table.
        state: record GUIDANCE_STATE with planned segments.
        direction: unit vector at ``reference``.
        rate: 1/s.
        reference: s from now.
        t: s from now.

    Returns:
        ln(q / (W/m2)) and its rate in 1/s.
    """
    r = load(nav.position)
    v = load(nav.velocity)
    thrust_v, thrust_r = steered_thrust(
        thrust_integrals(state, t, math.inf), direction, rate, reference
    )
    gravity_v, gravity_r = gravity_effect(r, v, thrust_v, thrust_r, t, environment.mu)
    r_t = add(axpy(t, v, r), add(gravity_r, thrust_r))
    v_t = add(v, add(gravity_v, thrust_v))
    acceleration = gravity(r_t, environment)
    for i in range(state.segment_count):
        segment = state.segments[i]
        into = t - segment.start
        if 0.0 <= into <= segment.duration:
            thrust = segment.exhaust_velocity / (segment.tau - into)
            acceleration = axpy(thrust, unit(axpy(t - reference, rate, direction)), acceleration)
            break
    return log_heating(r_t, v_t, environment, atmosphere, acceleration)


@kernel
def heating_crossing(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    state: Record,
    direction: Vector,
    rate: Vector,
    reference: float,
    log_limit: float,
    earliest: float,
    guess: float,
    tolerance: float,
) -> float:
    """Time at which the predicted heating falls to a limit.

    Newton on the log of the heating: it is convex up to the apex, so from the left the
    iteration runs to the first crossing without overshoot.

    Args:
        log_limit: ln of the limit, in the units of the on-board model.
        earliest: s from now.
        guess: s from now.
        tolerance: s.
        Others as in :func:`predicted_log_heating`.

    Returns:
        s from now; inf when the limit is not met before cut-off.
    """
    horizon = state.time_to_go
    falling = earliest
    t = min(max(guess, earliest), horizon)
    for _ in range(JETTISON_SEARCH_STEPS):
        value, slope = predicted_log_heating(
            nav, environment, atmosphere, state, direction, rate, reference, t
        )
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
        if abs(following - t) <= tolerance:
            return following if slope < 0.0 or excess <= 0.0 else math.inf
        t = following
    return math.inf


@kernel
def first_ignition(stage: int, arcs: NDArray[Any], state: Record) -> float:
    """Time from now to the first thrust of a stage in the plan, s; 0 if it is past."""
    for i in range(state.segment_count):
        if arcs[state.segments[i].arc].stage >= stage:
            return state.segments[i].start
    return math.inf


@kernel
def predict_jettisons(
    nav: Record,
    environment: Record,
    atmosphere: NDArray[Any],
    arcs: NDArray[Any],
    jettisons: NDArray[Any],
    settings: Record,
    state: Record,
    direction: Vector,
    rate: Vector,
    reference: float,
) -> float:
    """Move each heating jettison to where the predicted path meets its limit.

    Args:
        reference: s from now; the rest as in :func:`guidance_step`.

    Returns:
        largest change of a predicted time, s; inf when a jettison came into or fell
        out of the plan.
    """
    largest = 0.0
    ratio = 1.0
    if settings.heating_source == HEATING_MEASURED and math.isfinite(state.density_ratio):
        ratio = state.density_ratio
    for j in range(jettisons.shape[0]):
        if (nav.jettisoned >> j) & 1 == 1 or jettisons[j].criterion != HEATING_LIMIT:
            continue
        earliest = first_ignition(jettisons[j].stage, arcs, state)
        before = state.jettison_time[j] - nav.time
        guess = before if math.isfinite(before) else earliest
        log_limit = math.log(jettisons[j].value * (1.0 - settings.heating_margin) / ratio)
        after = heating_crossing(
            nav,
            environment,
            atmosphere,
            state,
            direction,
            rate,
            reference,
            log_limit,
            earliest,
            guess,
            settings.jettison_time_tolerance,
        )
        if math.isfinite(after) != math.isfinite(before):
            largest = math.inf
        elif math.isfinite(after):
            largest = max(largest, abs(after - before))
        state.jettison_time[j] = nav.time + after
    return largest
