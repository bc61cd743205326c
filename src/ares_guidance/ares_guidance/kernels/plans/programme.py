# SPDX-License-Identifier: Apache-2.0
"""Fly the air by an attitude programme until the forces of the air are small.

The programme of the mission file, if it has one, is flown as it stands there. The other is the
optimizer's thrust direction over the speed over the ground, not over time, so that
a thrust that differs from the planned one moves the turn with it, as on the Space Shuttle and SLS.
Where a stage has a limit of q alpha, winds turn it from there (`load_relief.py`).
The law of the flight takes over at the last knot, or where an arc after it begins.
"""

import math

from ares_guidance.arrays import Onboard
from ares_guidance.kernels.plans.load_relief import relieved
from ares_models.arrays import BURN, MAX_ARCS, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.boost import PAST_PEAK, boost_direction, is_over
from ares_models.kernels.environment import gravity, heating_rate, relative_velocity
from ares_models.kernels.sequence import awaits_heating
from ares_models.kernels.vectors import Vector, add, axpy, dot, load, norm, scale, store, sub, unit

#: Time beyond the plan by which a burn stays in the programme, as a share of the burn.
LATE_SHARE = 0.1
#: Time over which the rate of the mission's programme is taken, s.
RATE_STEP = 0.01
#: Difference of the thrust direction at the next navigation state from that by the present rate
#: from which on the programme jumps before, and instants of which the mean is then taken.
JUMP = 1e-3
JUMP_SAMPLES = 32


@kernel
def knots_of(programme: Record, arc: int) -> tuple[int, int]:
    """Return the first and last knot of an arc; without any, the first of the next, twice."""
    first = 0
    while first + 1 < programme.count and programme.arc[first] < arc:
        first += 1
    last = first
    while last + 1 < programme.count and programme.arc[last + 1] == arc:
        last += 1
    return first, last


@kernel
def planned_time(
    programme: Record, first: int, last: int, nav: Record, speed: float, burns: bool
) -> float:
    """Return the planned time of a speed over the ground, s; in a coast that since its begin.

    A weak stage may lose speed first: until it has regained it, time counts there too.

    Args:
        programme: record PROGRAMME.
        first: knot at the begin of the present arc.
        last: knot at its end.
        nav: record NAVIGATION.
        speed: over the ground, m/s.
        burns: the arc is a burn.
    """
    by_time = programme.time[first] + nav.time - nav.arc_start_time
    k = first
    while k < last and programme.speed[k + 1] <= programme.speed[first]:
        k += 1
    if not burns or by_time < programme.time[k]:
        return float(by_time)
    if speed <= programme.speed[k]:
        return float(programme.time[k])
    while k < last and programme.speed[k + 1] <= speed:
        k += 1
    if k == last:
        return float(programme.time[last])
    rise = programme.speed[k + 1] - programme.speed[k]
    part = (speed - programme.speed[k]) / rise if rise > 0.0 else 1.0
    return float(programme.time[k] + part * (programme.time[k + 1] - programme.time[k]))


@kernel
def hands_over(
    programme: Record, first: int, last: int, nav: Record, speed: float, burns: bool
) -> bool:
    """Return whether the law takes over from the programme.

    Args: as in :func:`planned_time`.
    """
    end = programme.count - 1
    if nav.arc != programme.arc[end]:
        return bool(nav.arc > programme.arc[end])
    length = programme.time[end] - programme.time[first]
    since = nav.time - nav.arc_start_time
    if not burns:
        return bool(since >= length)
    at = planned_time(programme, first, last, nav, speed, burns)
    # a weak engine may never reach the speed
    return bool(at >= programme.time[end] or since > (1.0 + LATE_SHARE) * length)


@kernel
def command_ends(mission: MissionRecords, onboard: Onboard) -> None:
    """Command the planned ends of the free arcs ahead, before the last.

    Args: as in :func:`flies_programme`.
    """
    nav = onboard.navigation
    arcs = mission.arcs
    end = nav.arc_start_time
    for k in range(MAX_ARCS):
        onboard.steering.arc_end_times[k] = math.nan
    for k in range(nav.arc, arcs.shape[0] - 1):
        free = math.isinf(arcs[k].duration)
        end += onboard.state.plan.length[k] if free else arcs[k].duration
        if free:
            onboard.steering.arc_end_times[k] = end


@kernel
def command_jettison(mission: MissionRecords, onboard: Onboard) -> None:
    """Command a heating jettison that is due, once the heating is below its limit.

    It is due by the plan, or in the programme of the mission file after the peak of the heating.

    Args: as in :func:`flies_programme`.
    """
    nav = onboard.navigation
    steering = onboard.steering
    programme = onboard.state.programme
    steering.jettison = -1
    steering.jettison_time = math.nan
    rate = nav.heating_rate
    if math.isnan(rate):
        position, velocity = load(nav.position), load(nav.velocity)
        rate = heating_rate(position, velocity, mission.environment, mission.atmosphere)
    due = nav.time >= onboard.state.plan.jettison_time
    if programme.given_over == 0:
        programme.hottest = max(programme.hottest, rate)
        due = rate < PAST_PEAK * programme.hottest
    if not due:
        return
    for j in range(mission.jettisons.shape[0]):
        if awaits_heating(mission.jettisons, nav.jettisoned, j):
            begun = mission.arcs[nav.arc].stage >= mission.jettisons[j].stage
            if begun and rate <= mission.jettisons[j].value:
                steering.jettison = j
                steering.jettison_time = nav.time


@kernel
def direction_after(
    span: float, t: float, state: tuple[Vector, Vector], acceleration: Vector, environment: Record
) -> Vector:
    """Return the thrust direction of the mission's programme after a steady acceleration.

    Args:
        span: s from now.
        t: now, s.
        state: position, m, and velocity, m/s, now.
        acceleration: m/s2.
        environment: record ENVIRONMENT.
    """
    r, v = state
    moved = axpy(span, axpy(0.5 * span, acceleration, v), r)
    return boost_direction(t + span, moved, axpy(span, acceleration, v), environment)


@kernel
def given_attitude(mission: MissionRecords, onboard: Onboard) -> tuple[Vector, Vector]:
    """Return direction and rate, 1/s, of the thrust by the programme of the mission file.

    The rate is that of the motion under gravity and what was sensed since the last state. Where the
    programme jumps before the next state, the mean direction until then is held.

    Args: as in :func:`flies_programme`.
    """
    nav = onboard.navigation
    programme = onboard.state.programme
    environment = mission.environment
    t, r, v = nav.time, load(nav.position), load(nav.velocity)
    now = boost_direction(t, r, v, environment)
    acceleration = gravity(r, environment)
    since = t - programme.last_time
    if programme.cycle == 0 or since <= 0.0:
        since = 0.0
    else:
        # along the present direction: that of the last state is behind
        gained = dot(sub(load(nav.sensed_delta_v), load(programme.last_sensed)), now)
        acceleration = axpy(gained / since, now, acceleration)
    then = direction_after(RATE_STEP, t, (r, v), acceleration, environment)
    rate = scale(1.0 / RATE_STEP, sub(then, now))
    ahead = direction_after(since, t, (r, v), acceleration, environment)
    if norm(sub(ahead, axpy(since, rate, now))) < JUMP:
        return now, rate
    mean = (0.0, 0.0, 0.0)
    for k in range(JUMP_SAMPLES):
        part = (k + 0.5) / JUMP_SAMPLES * since
        mean = add(mean, direction_after(part, t, (r, v), acceleration, environment))
    return unit(mean), (0.0, 0.0, 0.0)


@kernel
def planned_attitude(
    mission: MissionRecords, onboard: Onboard, first: int, last: int, at: float
) -> tuple[Vector, Vector]:
    """Return direction and rate, 1/s, of the thrust as planned off line, with its load relief.

    Args:
        mission, onboard: as in :func:`flies_programme`.
        first, last: knots at the begin and end of the present arc.
        at: planned time, s.
    """
    programme = onboard.state.programme
    k = first
    while k + 1 < last and programme.time[k + 1] <= at:
        k += 1
    n = min(k + 1, last)
    begin, end = load(programme.direction[k]), load(programme.direction[n])
    span = programme.time[n] - programme.time[k]
    part, rate = 0.0, (0.0, 0.0, 0.0)
    if span > 0.0:
        part, rate = (at - programme.time[k]) / span, scale(1.0 / span, sub(end, begin))
    direction = unit(add(begin, scale(at - programme.time[k], rate)))
    relief = programme.relief[k] + part * (programme.relief[n] - programme.relief[k])
    if relief == 0.0:
        return direction, rate
    before, after = load(programme.air_direction[k]), load(programme.air_direction[n])
    planned = unit(axpy(part, sub(after, before), before))
    return relieved(mission, onboard, direction, relief, planned), rate


@kernel
def flies_programme(mission: MissionRecords, onboard: Onboard) -> bool:
    """Answer one navigation state by the programme; return False if the law is to answer.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance: its programme and its steering are changed.
    """
    nav = onboard.navigation
    programme = onboard.state.programme
    programme.active = 0
    if programme.over == 1:
        return False
    r, v = load(nav.position), load(nav.velocity)
    if programme.given_over == 0 and is_over(nav.time, r, v, nav.arc, mission.environment):
        programme.given_over = 1
    if programme.given_over == 0:
        direction, rate = given_attitude(mission, onboard)
    else:
        speed = norm(relative_velocity(r, v, mission.environment))
        first, last = knots_of(programme, nav.arc)
        burns = mission.arcs[nav.arc].kind == BURN
        if programme.count == 0 or hands_over(programme, first, last, nav, speed, burns):
            programme.over = 1
            return False
        at = planned_time(programme, first, last, nav, speed, burns)
        direction, rate = planned_attitude(mission, onboard, first, last, at)
    programme.active = 1
    steering = onboard.steering
    steering.reference_time = nav.time
    store(steering.direction, direction)
    store(steering.direction_rate, rate)
    steering.cutoff_time = math.nan
    command_ends(mission, onboard)
    command_jettison(mission, onboard)
    if nav.time >= programme.next_cycle_time - 1e-9:
        programme.cycle += 1
        programme.next_cycle_time = nav.time + onboard.settings.cycle_period
    return True
