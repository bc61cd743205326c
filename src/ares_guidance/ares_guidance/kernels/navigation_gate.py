# SPDX-License-Identifier: Apache-2.0
"""Whether a navigation state may be steered by: the last accepted one, carried on, against it.

Whatever the engines do, good navigation leaves three sums as they are:

    position - integral of velocity
    velocity - integral of gravity - sensed velocity gain
    ln(mass) + sensed gain / exhaust velocity, roughly: engines fail

A state is refused when it moves one of them by more than so many sigmas since the last accepted
state, or since an anchor one to two windows ago, where a drift adds up.
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

#: m below the figure of the body, where no vehicle is; a dispersed start from the ground is.
DEEPEST = 10_000.0
#: Of the speed of escape, beyond which a state is one of another body.
FASTEST = 2.0
#: s; times closer than this are the same.
SAME_TIME = 1e-6
#: States that repeat the last accepted one, beyond which time stands still.
MOST_REPEATS = 3
#: Of the displacement that the gain would give at once: how far a step's is from that of
#: constant acceleration while one engine burns, and at most.
STEADY, UNSTEADY = 0.1, 1.0
#: Exhaust velocity of a failed engine over the mission's, at least; its inverse at most. Engines
#: that burn may take their full flow all the same, by that much more than the mission's.
WORST_ENGINE, MOST_FLOW = 0.4, 1.2
#: States until the first are known to belong together; and in a row, in place of a window, to
#: begin anew with before that.
FEW = 3
#: How much wider the gate is for navigation that has agreed with itself for a window.
WIDER = 3.0


@kernel
def is_plausible(mission: MissionRecords, nav: Record, settings: Record) -> bool:
    """Whether a state can be one of this mission at all, whatever was before.

    Args:
        mission: as guidance believes it; so the next.
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
    # above the equator's radius is above the ground anywhere
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
    """Whether place and speed are the very numbers of before."""
    for i in range(3):
        if nav.position[i] != fix.position[i] or nav.velocity[i] != fix.velocity[i]:
            return False
    return True


@kernel
def goes_on(nav: Record, before: Record) -> bool:
    """Whether arc and jettisons follow those of before: neither goes back."""
    if nav.arc < before.arc or before.jettisoned & ~nav.jettisoned != 0:
        return False
    if nav.arc == before.arc:
        return bool(abs(nav.arc_start_time - before.arc_start_time) <= SAME_TIME)
    return bool(before.time - SAME_TIME <= nav.arc_start_time <= nav.time + SAME_TIME)


@kernel
def note(mission: MissionRecords, nav: Record, fix: Record) -> None:
    """Write a state into a fix; the sums stay.

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
def begin_sums(fix: Record) -> None:
    """Count from here."""
    store(fix.position_sum, (0.0, 0.0, 0.0))
    store(fix.velocity_sum, (0.0, 0.0, 0.0))
    fix.mass_sum = 0.0
    fix.position_slack = 0.0
    fix.mass_slack = 0.0


@kernel
def last_burn(k: int, arcs: NDArray[Any]) -> int:
    """Index of the last burn up to arc ``k``; before the first, of that."""
    i = k
    while i > 0 and arcs[i].kind != BURN:
        i -= 1
    while i + 1 < arcs.shape[0] and arcs[i].kind != BURN:
        i += 1
    return i


@kernel
def carry_mass(
    mission: MissionRecords, before: Record, after: Record, gain: float, uncertain: float
) -> None:
    """Move the sum of the mass on from one fix to the next.

    Args:
        mission: as guidance believes it.
        before: record NAVIGATION_FIX.
        after: the same, with the state of later. Its ``mass_sum`` and ``mass_slack`` change.
        gain: sensed in between, m/s.
        uncertain: how far a mass of the mission may be off, a fraction.
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
    # the middle of what may have burnt, and how far that is from either end
    after.mass_sum = before.mass_sum + math.log(after.mass / carried) + 0.5 * (least + most)
    after.mass_slack = before.mass_slack + 0.5 * (most - least) + uncertain * loads / carried


@kernel
def carry(mission: MissionRecords, before: Record, after: Record, settings: Record) -> None:
    """Move the sums on from one fix to the next.

    Velocity is integrated by the trapezoidal rule with its end correction for gravity, gravity by
    Simpson's: over 100 s of a coast that is 0.2 m and 1 mm/s off.

    Args:
        mission: as guidance believes it.
        before: record NAVIGATION_FIX.
        after: the same, with the state of later. Its sums are changed.
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
    carry_mass(mission, before, after, gain, uncertain)


@kernel
def within(limit: float, x: Vector) -> bool:
    """Whether a vector is no longer than ``limit``."""
    return dot(x, x) <= limit * limit


@kernel
def position_limit(before: Record, after: Record, settings: Record, sigmas: float) -> float:
    """How far the position's sum may move between two fixes, m; arguments as of `compare`."""
    span = after.time - before.time
    drifted = span * settings.velocity_sigma
    sigma = math.hypot(math.sqrt(2.0) * settings.position_sigma, drifted)
    return sigmas * sigma + after.position_slack - before.position_slack


@kernel
def velocity_limit(before: Record, after: Record, settings: Record, sigmas: float) -> float:
    """How far the velocity's sum may move between two fixes, m/s; arguments as of `compare`."""
    span = after.time - before.time
    gain = norm(sub(load(after.sensed_delta_v), load(before.sensed_delta_v)))
    noise = math.hypot(math.sqrt(2.0) * settings.velocity_sigma, span * settings.acceleration_sigma)
    return sigmas * math.hypot(noise, gain * settings.sensed_sigma)


@kernel
def compare(before: Record, after: Record, settings: Record, sigmas: float) -> int:
    """Which sums have moved too far between two fixes: REFUSED_* bits.

    Args:
        before: record NAVIGATION_FIX.
        after: the same; its sums go on from those of ``before``.
        settings: record GUIDANCE_SETTINGS.
        sigmas: how far is too far.
    """
    reasons = 0
    moved = sub(load(after.position_sum), load(before.position_sum))
    # the noise of two states alone is less than the limit, and mostly says enough
    least = sigmas * math.sqrt(2.0)
    if not (
        within(least * settings.position_sigma, moved)
        or norm(moved) <= position_limit(before, after, settings, sigmas)
    ):
        reasons |= REFUSED_POSITION
    moved = sub(load(after.velocity_sum), load(before.velocity_sum))
    if not (
        within(least * settings.velocity_sigma, moved)
        or norm(moved) <= velocity_limit(before, after, settings, sigmas)
    ):
        reasons |= REFUSED_VELOCITY
    slack = after.mass_slack - before.mass_slack
    mass = math.sqrt(2.0) * settings.mass_sigma
    if not abs(after.mass_sum - before.mass_sum) <= sigmas * mass + slack:
        reasons |= REFUSED_MASS
    return reasons


@kernel
def objections(mission: MissionRecords, onboard: Onboard) -> int:
    """What speaks against a plausible state: REFUSED_* bits; 0: nothing.

    Args:
        mission: as guidance believes it.
        onboard: what is on board. ``now`` of its watch is written.
    """
    nav = onboard.navigation
    settings = onboard.settings
    watch = onboard.state.navigation
    if not nav.time > watch.last.time:
        return REFUSED_TIME
    if is_same(nav, watch.last):
        return REFUSED_FROZEN
    if not goes_on(nav, watch.last):
        return REFUSED_SEQUENCE
    note(mission, nav, watch.now)
    carry(mission, watch.last, watch.now, settings)
    reasons = compare(watch.last, watch.now, settings, settings.navigation_gate)
    if reasons == 0 and compare(watch.anchor, watch.now, settings, settings.navigation_gate) != 0:
        reasons = REFUSED_DRIFT
    return reasons


@kernel
def take(watch: Record, settings: Record) -> None:
    """Accept ``now``.

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
def begin_with(mission: MissionRecords, nav: Record, watch: Record) -> None:
    """Accept a state that nothing is known before.

    Args:
        mission: as guidance believes it.
        nav: record NAVIGATION.
        watch: record NAVIGATION_WATCH. Changed.
    """
    note(mission, nav, watch.now)
    begin_sums(watch.now)
    watch.last = watch.now
    watch.anchor = watch.now
    watch.next_anchor = watch.now
    watch.accepted += 1
    watch.interval = 0.0
    watch.row = 0
    watch.repeats = 0
    watch.agreeing = 0


@kernel
def agree(mission: MissionRecords, onboard: Onboard) -> None:
    """Count how many plausible states in a row agree with one another, though not with the past.

    Args:
        mission: as guidance believes it.
        onboard: what is on board. Its watch is changed.
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
        and goes_on(nav, watch.last_agreeing)
    )
    if follows:
        note(mission, nav, watch.now)
        carry(mission, watch.last_agreeing, watch.now, settings)
        gate = settings.navigation_gate
        follows = (
            compare(watch.last_agreeing, watch.now, settings, gate) == 0
            and compare(watch.first_agreeing, watch.now, settings, gate) == 0
        )
    if not follows:
        watch.agreeing = 0
        note(mission, nav, watch.now)
        begin_sums(watch.now)
        watch.first_agreeing = watch.now
    watch.agreeing += 1
    watch.last_agreeing = watch.now


@kernel
def acquires(mission: MissionRecords, onboard: Onboard) -> bool:
    """Whether to begin anew with a navigation that was refused so far.

    It has agreed with itself for a window and is within a wider gate of what was accepted last;
    or hardly anything was accepted before, and that may have been the wrong one.

    Args:
        mission: as guidance believes it.
        onboard: what is on board. ``now`` of its watch is written.
    """
    nav = onboard.navigation
    settings = onboard.settings
    watch = onboard.state.navigation
    if watch.accepted < FEW:
        return bool(watch.agreeing >= FEW)
    if nav.time - watch.first_agreeing.time < settings.navigation_window:
        return False
    if not (nav.time > watch.last.time and goes_on(nav, watch.last)):
        return False
    note(mission, nav, watch.now)
    carry(mission, watch.last, watch.now, settings)
    return compare(watch.last, watch.now, settings, WIDER * settings.navigation_gate) == 0


@kernel
def refuse(onboard: Onboard, reasons: int) -> None:
    """Count a refused state.

    Args:
        onboard: what is on board. Its watch is changed.
        reasons: REFUSED_* bits.
    """
    nav = onboard.navigation
    watch = onboard.state.navigation
    if watch.row == 0:
        watch.reasons = 0
    if watch.row == 0 or not abs(nav.time - watch.told_time) < onboard.settings.cycle_period:
        watch.told += 1
        watch.told_time = nav.time
    watch.row += 1
    watch.refused += 1
    watch.reasons |= reasons


@kernel
def admit(mission: MissionRecords, onboard: Onboard) -> int:
    """Whether the present navigation state may be steered by.

    Args:
        mission: as guidance believes it.
        onboard: what is on board. Its watch is changed.

    Returns:
        ACCEPTED; REPEATED, the last accepted state again; or REFUSED.
    """
    nav = onboard.navigation
    settings = onboard.settings
    watch = onboard.state.navigation
    if not is_plausible(mission, nav, settings):
        watch.agreeing = 0
        refuse(onboard, REFUSED_IMPLAUSIBLE)
        return REFUSED
    if watch.accepted == 0:
        begin_with(mission, nav, watch)
        return ACCEPTED
    if watch.row == 0 and nav.time == watch.last.time and is_same(nav, watch.last):
        watch.repeats += 1
        if watch.repeats <= MOST_REPEATS:
            return REPEATED
    reasons = objections(mission, onboard)
    if reasons == 0:
        take(watch, settings)
        return ACCEPTED
    agree(mission, onboard)
    if acquires(mission, onboard):
        known = watch.accepted
        watch.acquired += 1
        begin_with(mission, nav, watch)
        if known < FEW:
            watch.accepted = 1
        return ACCEPTED
    refuse(onboard, reasons)
    return REFUSED
