# SPDX-License-Identifier: Apache-2.0
"""Failure detection from navigation, and the arcs and jettisons of the remaining vehicle.

Every second the thrust since the last check is compared with that of the same engines before (at a
stage's first check with the mission's), the end of a burn with its expected time, and the parts
aboard with those that should have been dropped. A finding changes the arcs and jettisons that
guidance plans with; no other part of guidance models failures.
"""

import math
from typing import Any

from numpy.typing import NDArray

from ares_guidance.arrays import (
    FLIP_NEAR,
    FOUND_EARLY_END,
    FOUND_ENGINE_LOST,
    FOUND_NO_IGNITION,
    FOUND_STUCK_JETTISON,
    FOUND_STUCK_THROTTLE,
    FOUND_THRUST_LOW,
    JUST_FOUND,
    Onboard,
)
from ares_models.arrays import BURN, HEATING_LIMIT, MISSION_TIME, MissionRecords, Record
from ares_models.jit import inlined, kernel
from ares_models.kernels.aerodynamics import body_force, is_in_air, pressure_loss
from ares_models.kernels.sequence import aboard, drop_time, empty_mass, last_ignition
from ares_models.kernels.steering import steered_direction
from ares_models.kernels.throttle import FULL, LEAST, LIMITED, throttle_regime
from ares_models.kernels.thrust_curve import (
    flow_area,
    start_area,
    start_length,
    start_value,
    tail_length,
)
from ares_models.kernels.vectors import Vector, axpy, load, norm, scale, store, sub, unit
from ares_models.kernels.weakened import shut_down_core, weaken_stage

#: Period of the checks, s.
LOOK = 1.0
ROUNDING = 1e-6
#: Relative change of thrust between two checks beyond that of a sound engine.
CHANGE = 0.02
#: Relative difference from the mission's thrust at a stage's first check beyond that of a sound
#: engine: ten sigma of the standard dispersions.
FOREIGN = 0.1
#: Least thrust ratio that counts as a burn.
BURNS = 0.005
#: Largest delay of full thrust beyond the start transient, s.
LATEST = 3.0
#: A start transient is over if the thrust ratio changes by less than PLATEAU between checks and
#: exceeds LEAST_PLATEAU.
PLATEAU = 0.005
LEAST_PLATEAU = 0.2
#: Relative excess over the acceleration limit that shows a stuck throttle. One that sticks just
#: before a check exceeds it at the check after next; at 3 g by 0.0033.
OVER = 0.003
#: An arc that ends earlier than planned by EARLY s plus this share of its length has failed.
EARLY = 2.0
EARLY_SHARE = 0.02
#: Tolerated delay of a jettison, s.
LATE = 0.75
#: Tolerance of a thrust share against that of a whole number of engines: measured against the same
#: engines before; at a stage's first check, three sigma of the standard dispersions.
SAME_SHARE = 0.005
SAME_SHARE_AT_FIRST = 0.03
#: Error of the time of a knot in a booster's thrust table: s, and share of the time since ignition.
SHIFT = 1.0
SHIFT_SHARE = 0.02


@inlined
def vehicle_left(mission: MissionRecords, state: Record) -> MissionRecords:
    """Return the mission with the remaining vehicle."""
    return MissionRecords(
        mission.environment,
        mission.atmosphere,
        state.left.arcs[: state.left.count],
        state.left.jettisons[: mission.jettisons.shape[0]],
        mission.target,
    )


@kernel
def record_finding(onboard: Onboard, kind: int, index: int, ratio: float) -> None:
    """Record a finding; guidance plans anew at once, without gates, unless the steering is held."""
    state = onboard.state
    found = state.found
    found.kind = kind
    if found.count == 0:
        found.first_kind = kind
        found.first_time = onboard.navigation.time
    found.count += 1
    found.time = onboard.navigation.time
    found.index = index
    found.ratio = ratio
    found.fresh = JUST_FOUND
    state.next_cycle_time = min(state.next_cycle_time, found.time)
    state.optimal.solved = 0
    state.optimal.arcs_from = 0


@kernel
def initialize_left(mission: MissionRecords, state: Record) -> bool:
    """Initialize the remaining vehicle; return False in a flight by a plan of free arcs.

    There guidance keeps the plan's arcs and only takes the measured engine into account.
    """
    if state.plan.made == 1:
        return False
    left = state.left
    if left.count == 0:
        left.count = mission.arcs.shape[0]
        for k in range(left.count):
            left.arcs[k] = mission.arcs[k]
            left.by_clock[k] = left.by_propellant[k] = mission.arcs[k].duration
        for j in range(mission.jettisons.shape[0]):
            left.jettisons[j] = mission.jettisons[j]
    return True


@kernel
def engines_are_lost(arc: Record, found: Record) -> bool:
    """Return whether the stage has lost a whole number of its identical engines.

    The remaining engines then burn all propellant. After any other loss of thrust and mass flow
    the clock ends the burn.
    """
    left = found.total * arc.engines
    count = math.floor(left + 0.5)
    whole = 1 <= count < arc.engines and abs(left - count) <= found.spread * arc.engines
    return whole and abs(found.total - found.total_flow) < CHANGE


@kernel
def end_by(left: Record, stage: int, propellant: bool) -> None:
    """Let either depletion or the clock end the remaining burns of a stage."""
    for k in range(left.count):
        if left.arcs[k].stage == stage:
            left.arcs[k].duration = left.by_propellant[k] if propellant else left.by_clock[k]


@kernel
def weaken_left(
    left: Record, k: int, into: float, ratios: tuple[float, float], propellant: bool
) -> None:
    """Weaken the remaining burns of a stage; keep both lengths for later findings.

    Args:
        left: record LEFT. Changed.
        k: the present arc.
        into: time since its start, s.
        ratios: thrust and mass flow, after over before.
        propellant: depletion ends the burns; else the clock.
    """
    stage = left.arcs[k].stage
    end_by(left, stage, True)
    weaken_stage(left.arcs[: left.count], k, into, ratios, True)
    for i in range(left.count):
        if left.arcs[i].stage == stage:
            left.by_propellant[i] = left.arcs[i].duration
    end_by(left, stage, propellant)


@kernel
def beside_boosters(
    arc: Record, since: float, until: float, thrust: float, consumed: float
) -> tuple[float, float, float, float]:
    """Take the planned part of the boosters out of a measured thrust and mass flow.

    Args:
        arc: record ARC, in which boosters burn beside the stage's own engines.
        since, until: times since its begin between which they are measured, s.
        thrust, consumed: measured over full thrust and mass flow of the arc.

    Returns:
        Thrust and mass flow of the engines alone over their own; factor on errors of the sum;
        error of a change between two checks by a table whose knots come early or late.
    """
    planned = taken = 1.0
    bend = 0.0
    if arc.start_knots > 0:
        planned = (start_area(arc, until) - start_area(arc, since)) / (until - since)
        taken = (flow_area(arc, until) - flow_area(arc, since)) / (until - since)
        shift = SHIFT + SHIFT_SHARE * until
        for i in range(1, arc.start_knots):
            at = arc.start_time[i]
            if since - LOOK - shift < at < until + shift:
                here = start_value(arc, at)
                sides = start_value(arc, at - shift) + start_value(arc, at + shift)
                bend += abs(sides - 2.0 * here)
    factor = arc.thrust / arc.core_thrust
    return (
        1.0 + (thrust - planned) * factor,
        1.0 + (consumed - taken) * arc.mass_flow / arc.core_flow,
        factor,
        bend * factor,
    )


@kernel
def has_burnt_steadily(nav: Record, found: Record, arcs: NDArray[Any], ratio: float) -> bool:
    """Return whether only the present arc has burnt since the last check, without a transient.

    Args:
        nav: record NAVIGATION.
        found: record FOUND.
        arcs: dtype ARC.
        ratio: measured over planned thrust since the last check.
    """
    arc = arcs[nav.arc]
    since = found.seen - nav.arc_start_time
    if nav.arc > 0 and since < tail_length(arcs[nav.arc - 1]):
        return False
    if arc.core_thrust > 0.0:
        return found.before != 0.0
    if since >= start_length(arc) + LATEST:
        return True
    if nav.arc > 0 and arc.start_knots == 0:
        before = arcs[nav.arc - 1]
        if before.kind == BURN and before.stage == arc.stage:
            # the same engines, one arc later
            return since >= 0.0
    if found.before - ratio > CHANGE:
        # thrust never falls in a start transient
        return True
    if arc.start_knots == 0:
        return found.before > BURNS
    return ratio > LEAST_PLATEAU and abs(ratio - found.before) < PLATEAU


@kernel
def check_throttle(mission: MissionRecords, onboard: Onboard, gain: float, flow: float) -> bool:
    """Check a throttled burn; return False if it is at full thrust and needs the common check.

    Args:
        mission: with the vehicle as known.
        onboard: state of guidance. Changed.
        gain: sensed since the last check, m/s.
        flow: mean mass flow since the last check, kg/s.
    """
    nav = onboard.navigation
    found = onboard.state.found
    arc = mission.arcs[nav.arc]
    if not math.isfinite(arc.max_acceleration):
        return False
    thrust, consumed = (found.thrust, found.flow) if found.thrust > 0.0 else (1.0, 1.0)
    engine = (arc.exhaust_velocity * thrust / consumed, arc.mass_flow * consumed)
    kind, _ = throttle_regime(arc, engine, nav.mass)
    earlier, _ = throttle_regime(arc, engine, found.mass)
    if kind == FULL and earlier == FULL:
        return False
    ratio = gain / ((nav.time - found.seen) * arc.max_acceleration)
    if kind == LEAST or earlier == LEAST:
        return True
    exhaust = gain / math.log(found.mass / nav.mass) / engine[0]
    odd = abs(exhaust - 1.0) > (CHANGE if found.thrust > 0.0 else FOREIGN)
    if odd and initialize_left(mission, onboard.state):
        # expected thrust at another exhaust velocity
        into = nav.time - nav.arc_start_time
        weaken_left(onboard.state.left, nav.arc, into, (exhaust, 1.0), False)
        found.total *= exhaust
        record_finding(onboard, FOUND_THRUST_LOW, nav.arc, found.total)
        return True
    if ratio > 1.0 + OVER:
        if initialize_left(mission, onboard.state):
            stuck = onboard.state.left.arcs[nav.arc]
            # model: constant full thrust equal to that of the stuck throttle
            stuck.mass_flow = flow
            stuck.exhaust_velocity = gain / math.log(found.mass / nav.mass)
            stuck.thrust = flow * stuck.exhaust_velocity
            stuck.max_acceleration = math.inf
            found.thrust = found.flow = 1.0
            onboard.state.thrust_ratio = onboard.state.flow_ratio = 1.0
        record_finding(onboard, FOUND_STUCK_THROTTLE, nav.arc, ratio)
    # below the limit although the throttle could open: the engine is weak
    return not (kind == LIMITED and earlier == LIMITED and ratio < 1.0 - CHANGE)


@kernel
def check_thrust(mission: MissionRecords, onboard: Onboard) -> None:
    """Compare the thrust since the last check with the thrust before."""
    nav = onboard.navigation
    state = onboard.state
    found = state.found
    arc = mission.arcs[nav.arc]
    span = nav.time - found.seen
    burnt = found.mass - nav.mass
    beside = arc.core_thrust > 0.0
    skipped = arc.kind != BURN or (arc.tabled == 1 and not beside)
    if skipped or nav.jettisoned != found.jettisoned or not burnt > 0.0:
        found.before = 0.0
        return
    gain = found.gain
    flow = burnt / span
    thrust = gain * flow / math.log(found.mass / nav.mass) / arc.thrust
    consumed = flow / arc.mass_flow
    factor, error = 1.0, 0.0
    if beside:
        since, until = found.seen - nav.arc_start_time, nav.time - nav.arc_start_time
        thrust, consumed, factor, error = beside_boosters(arc, since, until, thrust, consumed)
    known = found.thrust > 0.0
    allowed = (CHANGE if known else FOREIGN) * factor + error
    steady = has_burnt_steadily(nav, found, mission.arcs, thrust)
    found.before = thrust
    if steady and beside and thrust < allowed < 0.5:
        if found.total > 0.0:
            if initialize_left(mission, state):
                shut_down_core(state.left.arcs[: state.left.count], nav.arc)
            found.thrust = found.flow = found.total = found.total_flow = 0.0
            record_finding(onboard, FOUND_EARLY_END, nav.arc, 0.0)
        return
    if not steady or thrust < BURNS or check_throttle(mission, onboard, gain, flow):
        return
    ratio = thrust / found.thrust if known else thrust
    flows = consumed / found.flow if known else consumed
    if abs(ratio - 1.0) > allowed:
        if found.total == 1.0:
            found.spread = SAME_SHARE if found.looks > 1 else SAME_SHARE_AT_FIRST
            found.spread = found.spread * factor + error
            if found.looks == 1:
                # the loss may have happened before the first check
                found.total, found.total_flow = found.thrust, found.flow
        found.total *= ratio
        found.total_flow *= flows
        lost = engines_are_lost(arc, found)
        if initialize_left(mission, state):
            weaken_left(state.left, nav.arc, nav.time - nav.arc_start_time, (ratio, flows), lost)
            if not known:
                found.thrust = found.flow = 1.0
        else:
            found.thrust, found.flow = thrust, consumed
        record_finding(
            onboard, FOUND_ENGINE_LOST if lost else FOUND_THRUST_LOW, nav.arc, found.total
        )
    else:
        found.thrust, found.flow = thrust, consumed
        found.looks += 1
    check_clock(onboard)


@kernel
def check_clock(onboard: Onboard) -> None:
    """Switch to depletion if a weakened burn outlasts its end by the clock."""
    nav = onboard.navigation
    state = onboard.state
    left = state.left
    if left.count == 0 or not left.by_propellant[nav.arc] > left.arcs[nav.arc].duration:
        return
    if nav.time > nav.arc_start_time + left.arcs[nav.arc].duration + LATE:
        end_by(left, left.arcs[nav.arc].stage, True)
        record_finding(onboard, FOUND_ENGINE_LOST, nav.arc, state.found.total)


@kernel
def check_end(mission: MissionRecords, onboard: Onboard) -> None:
    """Check that arcs since the last check ended by the clock or by depletion, not earlier."""
    nav = onboard.navigation
    found = onboard.state.found
    arcs = mission.arcs
    stage = arcs[found.arc].stage
    flow = arcs[found.arc].mass_flow * (found.flow if found.thrust > 0.0 else 1.0)
    empty = math.inf
    if arcs[found.arc].kind == BURN:
        left = found.mass - empty_mass(arcs[found.arc], arcs, mission.jettisons, found.jettisoned)
        empty = found.seen + left / flow
    end = found.arc_start_time
    first_end = math.inf
    longest = 0.0
    for k in range(found.arc, nav.arc + 1):
        if arcs[k].duration == 0.0:
            # an arc of length 0 stands for a failure
            return
        if k == nav.arc:
            break
        if not math.isfinite(arcs[k].duration):
            return
        end += arcs[k].duration
        longest = max(longest, arcs[k].duration)
        if arcs[k].kind == BURN and arcs[k].stage == stage:
            end = min(end, empty)
        if k == found.arc:
            first_end = end
    allowed = EARLY + EARLY_SHARE * longest
    if nav.arc_start_time < end - allowed:
        ended = nav.arc_start_time < first_end - allowed and arcs[found.arc].kind == BURN
        kind = FOUND_EARLY_END if ended else FOUND_NO_IGNITION
        record_finding(onboard, kind, found.arc if ended else nav.arc - 1, 0.0)


@kernel
def check_jettisons(mission: MissionRecords, onboard: Onboard) -> None:
    """Check for jettisons that are overdue."""
    nav = onboard.navigation
    found = onboard.state.found
    steering = onboard.steering
    stage, ignition = last_ignition(nav.arc, nav.arc_start_time, mission.arcs)
    for j in range(mission.jettisons.shape[0]):
        jettison = mission.jettisons[j]
        due = math.inf
        if aboard(nav.jettisoned, j) and jettison.criterion != HEATING_LIMIT:
            due = drop_time(jettison, stage, ignition, nav.time, math.inf)
        elif aboard(nav.jettisoned, j) and steering.jettison == j:
            due = steering.jettison_time if stage >= jettison.stage else math.inf
        if not due <= nav.time:
            found.overdue[j] = math.inf
            continue
        found.overdue[j] = min(found.overdue[j], nav.time)
        if nav.time - found.overdue[j] >= LATE and initialize_left(mission, onboard.state):
            stuck = onboard.state.left.jettisons[j]
            stuck.criterion = MISSION_TIME
            stuck.value = math.inf
            onboard.state.solution.jettison_time[j] = math.inf
            record_finding(onboard, FOUND_STUCK_JETTISON, j, 0.0)


@kernel
def run_checks(mission: MissionRecords, onboard: Onboard) -> None:
    """Run all checks and save the navigation state for the next.

    Args:
        mission: with the vehicle as known.
        onboard: state of guidance. Changed.
    """
    nav = onboard.navigation
    found = onboard.state.found
    arcs = mission.arcs
    refused = onboard.state.navigation.refused
    if found.mass > 0.0:
        if arcs[nav.arc].stage != arcs[found.arc].stage:
            found.thrust = found.flow = 0.0
            found.looks = 0
            found.total = found.total_flow = 1.0
        if refused != found.refused or onboard.state.optimal.flip == FLIP_NEAR:
            # the state at the last check may have been wrong already; half of a turn between two
            # states undoes the other
            found.before = 0.0
        else:
            check_jettisons(mission, onboard)
            if nav.arc == found.arc:
                check_thrust(mission, onboard)
            elif nav.arc > found.arc:
                check_end(mission, onboard)
                found.before = 0.0
                if arcs[found.arc].core_thrust > 0.0 or arcs[nav.arc].core_thrust > 0.0:
                    # an error of the boosters' thrust counted for one of the engines
                    lost = onboard.state.left.count == 0 and found.total != 1.0
                    found.thrust = found.total if lost else 0.0
                    found.flow = found.total_flow if lost else 0.0
                    found.looks = 0
    else:
        found.total = found.total_flow = 1.0
        for j in range(found.overdue.shape[0]):
            found.overdue[j] = math.inf
    found.refused = refused
    found.gain = 0.0
    found.seen = nav.time
    found.mass = nav.mass
    found.arc = nav.arc
    found.arc_start_time = nav.arc_start_time
    found.jettisoned = nav.jettisoned


@kernel
def without_air(mission: MissionRecords, onboard: Onboard, gained: Vector) -> Vector:
    """Return the velocity that the thrust would have gained in vacuum since the last state, m/s.

    The forces of the air are those of the mission's air and tables, at the commanded attitude.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance.
        gained: sensed since the last state, m/s.
    """
    nav = onboard.navigation
    arc = mission.arcs[nav.arc]
    if arc.kind != BURN or not is_in_air(arc) or norm(gained) == 0.0:
        return gained
    r, span, steering = load(nav.position), onboard.state.navigation.interval, onboard.steering
    # before the first command there is none; wings pull the sensed velocity off the thrust
    commanded = norm(load(steering.direction)) > 0.0
    u = steered_direction(steering, nav.time - 0.5 * span) if commanded else unit(gained)
    environment, atmosphere = mission.environment, mission.atmosphere
    lost = pressure_loss(arc, r, environment, atmosphere)
    force = body_force(arc, r, load(nav.velocity), u, environment, atmosphere)
    return axpy(span / nav.mass, sub(scale(lost, u), force), gained)


@kernel
def detect_failures(mission: MissionRecords, onboard: Onboard) -> None:
    """Check for failures once per second.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.
    """
    state = onboard.state
    now = onboard.navigation.time
    sensed = load(onboard.navigation.sensed_delta_v)
    gained = sub(sensed, load(state.found.sensed_delta_v))
    # sum over the states: a turn between two checks is no loss of thrust
    state.found.gain += norm(without_air(mission, onboard, gained))
    store(state.found.sensed_delta_v, sensed)
    if onboard.steering.cutoff_time <= now:
        # the thrust ends now by command
        return
    if state.found.mass > 0.0 and 0.0 <= now - state.found.seen < LOOK - ROUNDING:
        return
    if state.left.count == 0:
        run_checks(mission, onboard)
    else:
        run_checks(vehicle_left(mission, state), onboard)
