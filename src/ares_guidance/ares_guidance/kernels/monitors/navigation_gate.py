# SPDX-License-Identifier: Apache-2.0
"""Gate that accepts or refuses a navigation state, against the last accepted one propagated to now.

Whatever the engines do, good navigation keeps three sums constant:

    position - integral of velocity
    velocity - integral of gravity - sensed velocity gain
    ln(mass) + sensed gain / exhaust velocity, roughly, as engines may fail

A state is refused if one of them has changed by more than the gate, a number of sigmas, since the
last accepted state, or since an anchor one to two windows ago, where a drift accumulates.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import (
    REFUSED_DRIFT,
    REFUSED_FROZEN,
    REFUSED_IMPLAUSIBLE,
    REFUSED_MASS,
    REFUSED_POSITION,
    REFUSED_SEQUENCE,
    REFUSED_TIME,
    REFUSED_VELOCITY,
    Onboard,
)
from ares_models.arrays import BURN, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import altitude, gravity
from ares_models.kernels.sequence import aboard, loaded_mass
from ares_models.kernels.vectors import (
    Vector,
    add,
    axpy,
    dot,
    is_finite,
    load,
    norm,
    scale,
    store,
    sub,
)

ACCEPTED = 0
REPEATED = 1
REFUSED = 2

#: Largest depth below the ellipsoid, m; a dispersed start from the ground may be below it.
DEEPEST = 10_000.0
#: Largest speed, as a multiple of the escape speed.
FASTEST = 2.0
#: Tolerance of equal times, s.
SAME_TIME = 1e-6
#: Largest number of repetitions of the last accepted state; more are refused as frozen.
MOST_REPEATS = 3
#: Error of a step's displacement, as a fraction of gain times half the step: while one engine
#: burns, and otherwise.
STEADY, UNSTEADY = 0.1, 1.0
#: Exhaust velocity of a failed engine over the mission's: least value, and inverse of the largest.
#: Largest mass flow of a burning engine over the mission's.
WORST_ENGINE, MOST_FLOW = 0.4, 1.2
#: Number of accepted states before which the first ones may themselves be wrong; until then as many
#: consistent states in a row suffice for a reacquisition.
FEW = 3
#: Widening of the gate for navigation that has been consistent with itself for a window.
WIDER = 3.0


@kernel
def is_plausible(mission: MissionRecords, nav: Record, settings: Record) -> bool:
    """Return whether a state is possible in this mission, regardless of earlier states.

    Args:
        mission: as guidance believes it.
        nav: record NAVIGATION.
        settings: record GUIDANCE_SETTINGS.
    """
    arcs = mission.arcs
    r = load(nav.position)
    v = load(nav.velocity)
    finite = (
        is_finite(r)
        and is_finite(v)
        and is_finite(load(nav.sensed_delta_v))
        and math.isfinite(nav.time)
        and math.isfinite(nav.mass)
        and math.isfinite(nav.arc_start_time)
    )
    if not (finite and 0 <= nav.arc < arcs.shape[0] and dot(r, r) > 0.0):
        return False
    if not 0 <= nav.jettisoned < (1 << mission.jettisons.shape[0]):
        return False
    gate = settings.navigation_gate
    environment = mission.environment
    square = dot(r, r)
    # any point above the equatorial radius is above the ellipsoid
    low = square < environment.equatorial_radius * environment.equatorial_radius
    if low and altitude(r, environment) < -DEEPEST - gate * settings.position_sigma:
        return False
    if dot(v, v) * math.sqrt(square) > FASTEST * FASTEST * 2.0 * environment.mu:
        return False
    arc = arcs[nav.arc]
    share = gate * settings.load_sigma
    full = loaded_mass(arc.stage, arcs, mission.jettisons, nav.jettisoned)
    empty = full - arc.propellant
    return nav.mass > 0.0 and (1.0 - share) * empty <= nav.mass <= (1.0 + share) * full


@kernel
def is_same(nav: Record, fix: Record) -> bool:
    """Return whether position and velocity are bit for bit those of a fix."""
    for i in range(3):
        if nav.position[i] != fix.position[i] or nav.velocity[i] != fix.velocity[i]:
            return False
    return True


@kernel
def continues_sequence(nav: Record, before: Record) -> bool:
    """Return whether arc and jettisons do not go back from those of the earlier fix."""
    if nav.arc < before.arc or before.jettisoned & ~nav.jettisoned != 0:
        return False
    if nav.arc == before.arc:
        return bool(abs(nav.arc_start_time - before.arc_start_time) <= SAME_TIME)
    return bool(before.time - SAME_TIME <= nav.arc_start_time <= nav.time + SAME_TIME)


@kernel
def record_fix(mission: MissionRecords, nav: Record, fix: Record) -> None:
    """Copy a navigation state into a fix, except the sums.

    Args:
        mission: as guidance believes it.
        nav: record NAVIGATION.
        fix: record NAVIGATION_FIX. Changed.
    """
    fix.time = nav.time
    store(fix.position, load(nav.position))
    store(fix.velocity, load(nav.velocity))
    store(fix.gravity, gravity(load(nav.position), mission.environment))
    fix.mass = nav.mass
    store(fix.sensed_delta_v, load(nav.sensed_delta_v))
    fix.arc = nav.arc
    fix.arc_start_time = nav.arc_start_time
    fix.jettisoned = nav.jettisoned


@kernel
def reset_sums(fix: Record) -> None:
    """Reset the sums of a fix."""
    store(fix.position_sum, (0.0, 0.0, 0.0))
    store(fix.velocity_sum, (0.0, 0.0, 0.0))
    fix.mass_sum = 0.0
    fix.position_slack = 0.0
    fix.mass_slack = 0.0


@kernel
def last_burn(k: int, arcs: NDArray[Any]) -> int:
    """Return the index of the last burn up to arc ``k``; before the first burn, of the first."""
    i = k
    while i > 0 and arcs[i].kind != BURN:
        i -= 1
    while i + 1 < arcs.shape[0] and arcs[i].kind != BURN:
        i += 1
    return i


@kernel
def advance_mass_sum(
    mission: MissionRecords, before: Record, after: Record, gain: float, uncertain: float
) -> None:
    """Update the mass sum and its bound from one fix to the next.

    Args:
        mission: as guidance believes it.
        before: earlier record NAVIGATION_FIX.
        after: later record. Its ``mass_sum`` and ``mass_slack`` change.
        gain: sensed in between, m/s.
        uncertain: relative error of the mission's masses.
    """
    arcs = mission.arcs
    jettisons = mission.jettisons
    carried = before.mass
    loads = 0.0
    for j in range(jettisons.shape[0]):
        if aboard(before.jettisoned, j) and not aboard(after.jettisoned, j):
            carried -= jettisons[j].mass
            loads += jettisons[j].mass
    burn = arcs[last_burn(before.arc, arcs)]
    exponent = gain / burn.exhaust_velocity
    least, most = WORST_ENGINE * exponent, exponent / WORST_ENGINE
    stage = arcs[after.arc].stage
    if stage != arcs[before.arc].stage:
        carried = loads = loaded_mass(stage, arcs, jettisons, after.jettisoned)
        least = 0.0
    elif arcs[before.arc].kind == BURN:
        full = MOST_FLOW * burn.mass_flow * (after.time - before.time)
        most = max(most, -math.log(max(0.5, 1.0 - full / before.mass)))
    # centre and half width of the interval of possible depletion
    after.mass_sum = before.mass_sum + math.log(after.mass / carried) + 0.5 * (least + most)
    after.mass_slack = before.mass_slack + 0.5 * (most - least) + uncertain * loads / carried


@kernel
def advance_sums(mission: MissionRecords, before: Record, after: Record, settings: Record) -> None:
    """Update the sums from one fix to the next.

    Velocity is integrated by the trapezoidal rule with end correction for gravity, gravity by
    Simpson's rule; the error over 100 s of coast is 0.2 m and 1 mm/s.

    Args:
        mission: as guidance believes it.
        before: earlier record NAVIGATION_FIX.
        after: later record. Its sums are changed.
        settings: record GUIDANCE_SETTINGS.
    """
    dt = after.time - before.time
    r0, v0, g0 = load(before.position), load(before.velocity), load(before.gravity)
    r1, v1, g1 = load(after.position), load(after.velocity), load(after.gravity)
    sensed = sub(load(after.sensed_delta_v), load(before.sensed_delta_v))
    gain = norm(sensed)
    flown = axpy(dt * dt / 12.0, sub(g0, g1), scale(0.5 * dt, add(v0, v1)))
    store(after.position_sum, add(load(before.position_sum), sub(sub(r1, r0), flown)))
    middle = axpy(0.125 * dt, sub(v0, v1), scale(0.5, add(r0, r1)))
    pull = add(add(g0, g1), scale(4.0, gravity(middle, mission.environment)))
    moved = sub(sub(v1, v0), axpy(dt / 6.0, pull, sensed))
    store(after.velocity_sum, add(load(before.velocity_sum), moved))
    steady = before.arc == after.arc and before.jettisoned == after.jettisoned
    share = STEADY if steady else UNSTEADY
    after.position_slack = before.position_slack + share * 0.5 * gain * dt
    uncertain = settings.navigation_gate * settings.load_sigma
    advance_mass_sum(mission, before, after, gain, uncertain)


@kernel
def is_within(limit: float, x: Vector) -> bool:
    """Return whether the length of a vector is at most ``limit``."""
    return dot(x, x) <= limit * limit


@kernel
def position_limit(before: Record, after: Record, settings: Record, sigmas: float) -> float:
    """Return the bound on the change of the position sum, m; arguments as in `compare`."""
    span = after.time - before.time
    drifted = span * settings.velocity_sigma
    sigma = math.hypot(math.sqrt(2.0) * settings.position_sigma, drifted)
    return sigmas * sigma + after.position_slack - before.position_slack


@kernel
def velocity_limit(before: Record, after: Record, settings: Record, sigmas: float) -> float:
    """Return the bound on the change of the velocity sum, m/s; arguments as in `compare`."""
    span = after.time - before.time
    gain = norm(sub(load(after.sensed_delta_v), load(before.sensed_delta_v)))
    noise = math.hypot(math.sqrt(2.0) * settings.velocity_sigma, span * settings.acceleration_sigma)
    return sigmas * math.hypot(noise, gain * settings.sensed_sigma)


@kernel
def compare(before: Record, after: Record, settings: Record, sigmas: float) -> int:
    """Compare the sums of two fixes; return those beyond their bounds, REFUSED_* bits.

    Args:
        before: earlier record NAVIGATION_FIX.
        after: later record, with sums continued from ``before``.
        settings: record GUIDANCE_SETTINGS.
        sigmas: width of the gate.
    """
    reasons = 0
    moved = sub(load(after.position_sum), load(before.position_sum))
    # cheap check first: the noise of two states alone is a lower bound on the limit
    least = sigmas * math.sqrt(2.0)
    if not (
        is_within(least * settings.position_sigma, moved)
        or norm(moved) <= position_limit(before, after, settings, sigmas)
    ):
        reasons |= REFUSED_POSITION
    moved = sub(load(after.velocity_sum), load(before.velocity_sum))
    if not (
        is_within(least * settings.velocity_sigma, moved)
        or norm(moved) <= velocity_limit(before, after, settings, sigmas)
    ):
        reasons |= REFUSED_VELOCITY
    slack = after.mass_slack - before.mass_slack
    mass = math.sqrt(2.0) * settings.mass_sigma
    if not abs(after.mass_sum - before.mass_sum) <= sigmas * mass + slack:
        reasons |= REFUSED_MASS
    return reasons


@kernel
def refusal_reasons(mission: MissionRecords, onboard: Onboard) -> int:
    """Return the reasons to refuse a plausible state, REFUSED_* bits; 0 if there are none.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. ``now`` of its watch is written.
    """
    nav = onboard.navigation
    settings = onboard.settings
    watch = onboard.state.navigation
    if not nav.time > watch.last.time:
        return REFUSED_TIME
    if is_same(nav, watch.last):
        return REFUSED_FROZEN
    if not continues_sequence(nav, watch.last):
        return REFUSED_SEQUENCE
    record_fix(mission, nav, watch.now)
    advance_sums(mission, watch.last, watch.now, settings)
    reasons = compare(watch.last, watch.now, settings, settings.navigation_gate)
    if reasons == 0 and compare(watch.anchor, watch.now, settings, settings.navigation_gate) != 0:
        reasons = REFUSED_DRIFT
    return reasons


@kernel
def accept_state(watch: Record, settings: Record) -> None:
    """Accept the state ``now`` of the watch.

    Args:
        watch: record NAVIGATION_WATCH. Changed.
        settings: record GUIDANCE_SETTINGS.
    """
    watch.interval = watch.now.time - watch.last.time
    watch.last = watch.now
    watch.accepted += 1
    watch.row = 0
    watch.repeats = 0
    watch.agreeing = 0
    if watch.now.time - watch.next_anchor.time >= settings.navigation_window:
        watch.anchor = watch.next_anchor
        watch.next_anchor = watch.now


@kernel
def restart_sums(mission: MissionRecords, nav: Record, watch: Record) -> None:
    """Accept a state without reference to earlier ones and restart all sums.

    Args:
        mission: as guidance believes it.
        nav: record NAVIGATION.
        watch: record NAVIGATION_WATCH. Changed.
    """
    record_fix(mission, nav, watch.now)
    reset_sums(watch.now)
    watch.last = watch.now
    watch.anchor = watch.now
    watch.next_anchor = watch.now
    watch.accepted += 1
    watch.interval = 0.0
    watch.row = 0
    watch.repeats = 0
    watch.agreeing = 0


@kernel
def count_consistent(mission: MissionRecords, onboard: Onboard) -> None:
    """Count consecutive refused states that are consistent with one another.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Its watch is changed.
    """
    nav = onboard.navigation
    settings = onboard.settings
    watch = onboard.state.navigation
    if watch.agreeing > 0 and nav.time == watch.last_agreeing.time:
        return
    follows = (
        watch.agreeing > 0
        and nav.time > watch.last_agreeing.time
        and not is_same(nav, watch.last_agreeing)
        and continues_sequence(nav, watch.last_agreeing)
    )
    if follows:
        record_fix(mission, nav, watch.now)
        advance_sums(mission, watch.last_agreeing, watch.now, settings)
        gate = settings.navigation_gate
        follows = (
            compare(watch.last_agreeing, watch.now, settings, gate) == 0
            and compare(watch.first_agreeing, watch.now, settings, gate) == 0
        )
    if not follows:
        watch.agreeing = 0
        record_fix(mission, nav, watch.now)
        reset_sums(watch.now)
        watch.first_agreeing = watch.now
    watch.agreeing += 1
    watch.last_agreeing = watch.now


@kernel
def reacquires(mission: MissionRecords, onboard: Onboard) -> bool:
    """Return whether to reacquire navigation that was refused so far.

    That is so if it has been consistent with itself for a window and lies within a wider gate
    around the last accepted state, or if fewer than FEW states were accepted before.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. ``now`` of its watch is written.
    """
    nav = onboard.navigation
    settings = onboard.settings
    watch = onboard.state.navigation
    if watch.accepted < FEW:
        return bool(watch.agreeing >= FEW)
    if nav.time - watch.first_agreeing.time < settings.navigation_window:
        return False
    if not (nav.time > watch.last.time and continues_sequence(nav, watch.last)):
        return False
    record_fix(mission, nav, watch.now)
    advance_sums(mission, watch.last, watch.now, settings)
    return compare(watch.last, watch.now, settings, WIDER * settings.navigation_gate) == 0


@kernel
def refuse(onboard: Onboard, reasons: int) -> None:
    """Count a refused state.

    Args:
        onboard: state of guidance. Its watch is changed.
        reasons: REFUSED_* bits.
    """
    nav = onboard.navigation
    watch = onboard.state.navigation
    if watch.row == 0:
        watch.reasons = 0
    if watch.row == 0 or not abs(nav.time - watch.reported_time) < onboard.settings.cycle_period:
        watch.reported += 1
        watch.reported_time = nav.time
    watch.row += 1
    watch.refused += 1
    watch.reasons |= reasons


@kernel
def admit(mission: MissionRecords, onboard: Onboard) -> int:
    """Accept or refuse the present navigation state.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Its watch is changed.

    Returns:
        ACCEPTED; REPEATED, a repetition of the last accepted state; or REFUSED.
    """
    nav = onboard.navigation
    settings = onboard.settings
    watch = onboard.state.navigation
    if not is_plausible(mission, nav, settings):
        watch.agreeing = 0
        refuse(onboard, REFUSED_IMPLAUSIBLE)
        return REFUSED
    if watch.accepted == 0:
        restart_sums(mission, nav, watch)
        return ACCEPTED
    if watch.row == 0 and nav.time == watch.last.time and is_same(nav, watch.last):
        watch.repeats += 1
        if watch.repeats <= MOST_REPEATS:
            return REPEATED
    reasons = refusal_reasons(mission, onboard)
    if reasons == 0:
        accept_state(watch, settings)
        return ACCEPTED
    count_consistent(mission, onboard)
    if reacquires(mission, onboard):
        known = watch.accepted
        watch.acquired += 1
        restart_sums(mission, nav, watch)
        if known < FEW:
            watch.accepted = 1
        return ACCEPTED
    refuse(onboard, reasons)
    return REFUSED
