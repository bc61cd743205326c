# SPDX-License-Identifier: Apache-2.0
"""Impact-point avoidance: where no orbit is in reach, keep the impact point out of named areas.

The instantaneous impact point of range safety sweeps down-range while there is thrust; wherever
the thrust ends, there the vehicle falls. The rest of the flight is propagated ahead, with the
impact point at every step, once for each option:

- the law's own steering;
- thrust turned to, and held in, the direction that moves the impact point most along one of
  twelve bearings over the ground, by the sensitivity of the impact point to velocity;
- the law's own steering, with cut-off before the impact point enters an area.

The first possible outcome of this list is chosen: never inside an area; across an area in at most
CROSSING s and out of it before depletion; cut-off before the area; out of the area at the end,
after any time; nearest to the edge. Ties go to the smallest turn or the shortest time inside. The
choice is made anew in every cycle and changes only for an option that is better by a margin. A
cut-off is irreversible: it is scheduled, and carried out if no later cycle finds anything better.

Sources: Bate, Mueller, White, *Fundamentals of Astrodynamics* (1971), section 6.3 (how an impact
moves with the velocity at burn-out); 14 CFR 417.213 and 417.217 (flight safety limits, and gates
through which an impact point may pass over land); Bull, Lanzi, "An Autonomous Flight Safety
System", NASA (2007), for limits that are monitored on board. The options, their order and the
margins are this project's own.
"""

import math

from ares_guidance.arrays import (
    AVOID_CLEAR,
    AVOID_CUT,
    AVOID_LOST,
    AVOID_NOTHING,
    AVOID_STEER,
    ERROR_NONE,
    ERROR_PROPELLANT_SHORT,
    PHASE_CUTOFF,
    PHASE_HOLD,
    PHASE_IDLE,
    Onboard,
)
from ares_guidance.kernels.monitors.engines import present_engine
from ares_guidance.kernels.monitors.shortfall import SETTLED, lacking_speed
from ares_guidance.kernels.prediction.burn import LinearTangent, primer
from ares_models.arrays import BURN, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import altitude, gravity
from ares_models.kernels.impact import impact_direction, impact_jacobian, outside_areas
from ares_models.kernels.sequence import arc_after_burnout, empty_mass, mass_at_staging
from ares_models.kernels.steering import copy_steering, steered_direction
from ares_models.kernels.targets import perigee_radius
from ares_models.kernels.throttle import throttle
from ares_models.kernels.vectors import (
    Vector,
    add,
    angle_between,
    axpy,
    cross,
    dot,
    is_finite,
    load,
    norm,
    scale,
    store,
    sub,
    unit,
)

#: Margin of the final impact point to an area's edge, m; half of it for the choice in force.
MARGIN = 25_000.0
#: Margin of the impact point to an area's edge at cut-off, m.
CUT_MARGIN = 10_000.0
#: Accuracy of the final impact point, m; closer to the edge it is not surely outside.
SURE = 5_000.0
#: Longest crossing of an area by the impact point, s.
CROSSING = 20.0
#: Hysteresis: advantage of another choice of the same kind over the one in force: s, m, rad.
BETTER_S, BETTER_M, BETTER_TURN = 5.0, 20_000.0, 0.1
#: Largest slew rate of the thrust, rad/s.
SLEW = math.radians(3.0)
#: Time after a failure that guidance has to find a solution, s.
PATIENCE = 5.0
#: Lack of delta-V, m/s, and of perigee radius, m, beyond which an orbit is out of reach.
LACKING, SLACK = 20.0, 1_000.0
#: Number of bearings over the ground.
BEARINGS = 12
#: Integration step: s, and as a fraction of the time propagated so far.
STEP, STEP_SHARE = 2.0, 0.01
MOST_STEPS = 900
HALVINGS = 14
#: Tolerance of equal times, s.
SAME = 1e-9
#: Delay after depletion of a cut-off that must not take effect, s.
AFTER = 0.5

#: Thrust direction over time, (first, second, angle, reference). With angle < 0: along the primer
#: of direction ``first`` and rate ``second`` at ``reference``. Else: from unit vector ``first``
#: towards the perpendicular ``second``, by at most ``angle``, rad, from time ``reference`` on.
Turn = tuple[Vector, Vector, float, float]


@kernel
def heading(turn: Turn, onboard: Onboard, t: float) -> Vector:
    """Return the unit vector of the thrust at time ``t``, s."""
    first, second, angle, reference = turn
    if angle < 0.0:
        now = onboard.navigation.time
        ahead = LinearTangent(first, second, reference - now)
        direction, _ = primer(onboard.state.solution, ahead, t - now)
        return unit(direction)
    turned = min(angle, min(SLEW, onboard.settings.steering_rate_limit) * max(0.0, t - reference))
    return axpy(math.sin(turned), second, scale(math.cos(turned), first))


@kernel
def turn_to(first: Vector, last: Vector, t: float) -> Turn:
    """Build the turn from one unit vector to another, from time ``t``, s, on."""
    aside = sub(last, scale(dot(first, last), first))
    if norm(aside) < 1e-6:
        # opposite directions: turn about any axis
        aside = cross(first, (1.0, 0.0, 0.0) if abs(first[0]) < 0.7 else (0.0, 1.0, 0.0))
    return first, unit(aside), angle_between(first, last), t


@kernel
def begin_arc(mission: MissionRecords, nav: Record, lookahead: Record, k: int) -> None:
    """Begin arc ``k`` of the propagation; arcs of length 0 ahead are skipped.

    Args:
        mission: with the vehicle as known.
        nav: record NAVIGATION, the present state.
        lookahead: record LOOKAHEAD. Changed.
        k: index of the arc; after the last arc the thrust is over.
    """
    arcs = mission.arcs
    while k < arcs.shape[0] and arcs[k].duration == 0.0 and k != nav.arc:
        # an arc of length 0 stands for a failure that has not happened
        k += 1
    if k >= arcs.shape[0] or (arcs[k].kind != BURN and math.isinf(arcs[k].duration)):
        lookahead.over = 1
        return
    arc = arcs[k]
    begin = lookahead.time
    if k == nav.arc:
        begin = nav.arc_start_time
    elif arc.begins_stage == 1:
        lookahead.mass = mass_at_staging(arc, mission.jettisons, nav.jettisoned)
    lookahead.arc = k
    lookahead.begin = begin
    lookahead.end = begin + arc.duration if arc.duration > 0.0 else math.inf
    lookahead.lit = begin + arc.start_loss if arc.kind == BURN else math.inf
    lookahead.empty = empty_mass(arc, arcs, mission.jettisons, nav.jettisoned)


@kernel
def start_lookahead(mission: MissionRecords, nav: Record, lookahead: Record) -> None:
    """Start the propagation at the present state; arguments as in :func:`begin_arc`."""
    lookahead.time = nav.time
    lookahead.mass = nav.mass
    lookahead.over = 0
    store(lookahead.position, load(nav.position))
    store(lookahead.velocity, load(nav.velocity))
    begin_arc(mission, nav, lookahead, nav.arc)


@kernel
def copy_lookahead(source: Record, destination: Record) -> None:
    """Copy one record LOOKAHEAD to another."""
    destination.time = source.time
    destination.mass = source.mass
    destination.arc = source.arc
    destination.begin = source.begin
    destination.end = source.end
    destination.lit = source.lit
    destination.empty = source.empty
    destination.over = source.over
    store(destination.position, load(source.position))
    store(destination.velocity, load(source.velocity))


@kernel
def advance(mission: MissionRecords, onboard: Onboard, turn: Turn, span: float) -> None:
    """Propagate by a step, or to the next change of thrust: Runge-Kutta-Nystroem, order 4.

    Args:
        mission: with the vehicle as known.
        onboard: state of guidance. Its lookahead is changed.
        turn: thrust direction over time.
        span: longest step, s.
    """
    nav = onboard.navigation
    lookahead = onboard.state.avoid.lookahead
    environment = mission.environment
    arc = mission.arcs[lookahead.arc]
    lit = arc.kind == BURN and lookahead.time >= lookahead.lit - SAME
    limit = lookahead.end - lookahead.time
    ve, flow = present_engine(arc, mission.arcs[nav.arc].stage, onboard.state)
    if lit:
        flow *= throttle(arc, lookahead.mass)
        limit = min(limit, (lookahead.mass - lookahead.empty) / flow)
    else:
        flow = 0.0
        limit = min(limit, lookahead.lit - lookahead.time)
    limit = max(0.0, limit)
    h = min(span, limit)
    r, v = load(lookahead.position), load(lookahead.velocity)
    thrust = ve * flow
    begin, middle = lookahead.time, lookahead.time + 0.5 * h
    mass = lookahead.mass - flow * h
    u = heading(turn, onboard, begin)
    k_1 = axpy(thrust / lookahead.mass, u, gravity(r, environment))
    u = heading(turn, onboard, middle)
    there = axpy(0.5 * h, v, axpy(0.125 * h * h, k_1, r))
    k_2 = axpy(thrust / (lookahead.mass - 0.5 * flow * h), u, gravity(there, environment))
    u = heading(turn, onboard, begin + h)
    there = axpy(h, v, axpy(0.5 * h * h, k_2, r))
    k_3 = axpy(thrust / mass, u, gravity(there, environment))
    store(lookahead.position, axpy(h, v, axpy(h * h / 6.0, axpy(2.0, k_2, k_1), r)))
    store(lookahead.velocity, axpy(h / 6.0, axpy(4.0, k_2, add(k_1, k_3)), v))
    lookahead.time = begin + h
    lookahead.mass = mass
    if h < limit:
        return
    if lookahead.time >= lookahead.end - SAME:
        begin_arc(mission, nav, lookahead, lookahead.arc + 1)
    elif lit:
        begin_arc(mission, nav, lookahead, arc_after_burnout(lookahead.arc, mission.arcs))


@kernel
def outside_on_cutoff(mission: MissionRecords, onboard: Onboard, turn: Turn) -> tuple[float, int]:
    """Return the distance of the impact point from the areas for a cut-off at the lookahead state.

    Args: as in :func:`advance`.

    Returns:
        as in :func:`ares_models.kernels.impact.outside_areas`.
    """
    lookahead = onboard.state.avoid.lookahead
    environment = mission.environment
    velocity = load(lookahead.velocity)
    arc = mission.arcs[lookahead.arc]
    if lookahead.over == 0 and arc.tail_gain > 0.0 and lookahead.time >= lookahead.lit:
        # impulse of the tail-off
        ve, flow = present_engine(arc, mission.arcs[onboard.navigation.arc].stage, onboard.state)
        u = heading(turn, onboard, lookahead.time)
        velocity = axpy(arc.tail_gain * ve * flow / lookahead.mass, u, velocity)
    place = impact_direction(load(lookahead.position), velocity, lookahead.time, environment)
    return outside_areas(place, environment)


@kernel
def time_cutoff_at_edge(mission: MissionRecords, onboard: Onboard, turn: Turn) -> float:
    """Bisect the last step for the cut-off at CUT_MARGIN from an area.

    Args: as in :func:`advance`.

    Returns:
        mission elapsed time, s; inf if no cut-off is possible there.
    """
    avoid = onboard.state.avoid
    lookahead, mark = avoid.lookahead, avoid.mark
    arc = mission.arcs[mark.arc]
    if arc.kind != BURN:
        return math.inf
    low, high = 0.0, lookahead.time - mark.time
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        copy_lookahead(mark, lookahead)
        advance(mission, onboard, turn, middle)
        outside, _ = outside_on_cutoff(mission, onboard, turn)
        if outside >= CUT_MARGIN:
            low = middle
        else:
            high = middle
    at = mark.time + low
    earliest = mark.begin + arc.shortest if math.isinf(arc.duration) else mark.begin
    return at if at >= earliest else math.inf


@kernel
def touch_down(mission: MissionRecords, onboard: Onboard, turn: Turn) -> None:
    """Move the lookahead state back to the ground, which it crossed in its last step.

    Args: as in :func:`advance`. ``mark`` holds the state at the start of the step.
    """
    avoid = onboard.state.avoid
    lookahead, mark = avoid.lookahead, avoid.mark
    above = altitude(load(mark.position), mission.environment)
    below = altitude(load(lookahead.position), mission.environment)
    span = (lookahead.time - mark.time) * above / (above - below)
    copy_lookahead(mark, lookahead)
    advance(mission, onboard, turn, span)


@kernel
def propagate_outlook(
    mission: MissionRecords, onboard: Onboard, turn: Turn, cutoff_time: float
) -> None:
    """Propagate the rest of the flight and write the outlook of the impact point.

    Args: as in :func:`advance`, and the cut-off time of a burn, s; inf or nan: none.
    """
    nav = onboard.navigation
    avoid = onboard.state.avoid
    lookahead, outlook = avoid.lookahead, avoid.outlook
    start_lookahead(mission, nav, lookahead)
    outlook.inside = 0.0
    outlook.grounded = 0
    outlook.cut_time = math.inf
    outlook.cut_inside = 0.0
    outlook.area = -1
    # cut-off outside the areas: 0 not possible yet, 1 possible, 2 no longer possible
    stage = 0
    outside, area = outside_on_cutoff(mission, onboard, turn)
    if 0.0 <= outside < CUT_MARGIN:
        outlook.cut_time = nav.time
    for _ in range(MOST_STEPS):
        if outside < 0.0 and outlook.area < 0:
            outlook.area = area
        if stage == 0 and outside >= CUT_MARGIN:
            stage = 1
            outlook.cut_time = math.inf
            outlook.cut_inside = outlook.inside
        if lookahead.time >= cutoff_time - SAME and mission.arcs[lookahead.arc].kind == BURN:
            lookahead.over = 1
        if altitude(load(lookahead.position), mission.environment) < 0.0:
            outlook.grounded = 1
        if lookahead.over == 1 or outlook.grounded == 1:
            break
        copy_lookahead(lookahead, avoid.mark)
        was = outside
        step = max(STEP, STEP_SHARE * (lookahead.time - nav.time))
        if cutoff_time > lookahead.time:
            step = min(step, cutoff_time - lookahead.time)
        advance(mission, onboard, turn, step)
        outside, area = outside_on_cutoff(mission, onboard, turn)
        share = 0.5 * ((1.0 if was < 0.0 else 0.0) + (1.0 if outside < 0.0 else 0.0))
        outlook.inside += share * (lookahead.time - avoid.mark.time)
        if stage == 1 and outside < CUT_MARGIN:
            stage = 2
            copy_lookahead(lookahead, avoid.kept)
            outlook.cut_time = time_cutoff_at_edge(mission, onboard, turn)
            copy_lookahead(avoid.kept, lookahead)
    if outlook.grounded == 1 and lookahead.time > nav.time:
        touch_down(mission, onboard, turn)
        outside, area = outside_on_cutoff(mission, onboard, turn)
    outlook.outside = outside
    outlook.end_time = lookahead.time
    if outlook.area < 0:
        outlook.area = area


@kernel
def path_perigee(lookahead: Record, mu: float) -> float:
    """Return the perigee radius of the lookahead state, m."""
    r, v = load(lookahead.position), load(lookahead.velocity)
    momentum = cross(r, v)
    parameter = dot(momentum, momentum) / mu
    energy = 0.5 * dot(v, v) - mu / norm(r)
    return parameter / (1.0 + math.sqrt(max(0.0, 1.0 + 2.0 * energy * parameter / mu)))


@kernel
def score(outside: float, inside: float, margin: float, worth: float) -> float:
    """Return the cost of an outcome: its kind in millions, plus a rank within the kind.

    Args:
        outside: final distance from the areas, m.
        inside: time inside an area before that, s.
        margin: sufficient distance, m.
        worth: rank among outcomes that are never inside.
    """
    if outside >= margin:
        if inside == 0.0:
            return worth
        return inside + (1e6 if inside <= CROSSING else 3e6)
    # rank in km
    return (4e6 if outside >= 0.0 else 5e6) - 1e-3 * outside


@kernel
def thrust_along_bearing(
    mission: MissionRecords, nav: Record, own: Vector, bearing: float
) -> Vector:
    """Return the thrust direction that moves the impact point most along a bearing, unit vector.

    Args:
        mission: as guidance believes it.
        nav: record NAVIGATION.
        own: thrust direction of the law, which defines bearing 0.
        bearing: over the ground, rad.
    """
    r, v = load(nav.position), load(nav.velocity)
    place = impact_direction(r, v, nav.time, mission.environment)
    x, y, z = impact_jacobian(r, v, nav.time, mission.environment)
    ahead = add(scale(own[0], x), add(scale(own[1], y), scale(own[2], z)))
    aside = cross(place, ahead)
    c, s = math.cos(bearing), math.sin(bearing)
    if is_finite(aside) and norm(aside) > 0.0:
        along = axpy(c, unit(ahead), scale(s, unit(aside)))
        return unit((dot(x, along), dot(y, along), dot(z, along)))
    # no impact point yet: use the bearing of the ground track
    level = unit(sub(v, scale(dot(v, r) / dot(r, r), r)))
    return axpy(c, level, scale(s, unit(cross(r, level))))


@kernel
def adopt_if_better(
    avoid: Record, mode: int, bad: float, direction: Vector, cutoff_time: float
) -> None:
    """Adopt a choice if its cost is the lowest so far."""
    if not bad < avoid.score:
        return
    avoid.mode = mode
    avoid.score = bad
    avoid.cutoff_time = cutoff_time
    avoid.outside = avoid.outlook.outside
    store(avoid.direction, direction)


@kernel
def choose(mission: MissionRecords, onboard: Onboard, own: Turn) -> None:
    """Evaluate all options and adopt the best.

    Args:
        mission: with the vehicle as known.
        onboard: state of guidance; its outlook is that of the law's own steering. Changed.
        own: the law's own steering.
    """
    nav = onboard.navigation
    avoid = onboard.state.avoid
    outlook = avoid.outlook
    before, held = avoid.mode, load(avoid.direction)
    now = heading(own, onboard, nav.time)
    flown = steered_direction(avoid.flown, nav.time)
    if not is_finite(flown):
        flown = now
    avoid.area = outlook.area
    avoid.score = math.inf
    enough = 0.5 * MARGIN if before == AVOID_CLEAR else MARGIN
    bad = score(outlook.outside, outlook.inside, enough, 0.0)
    clear = bad < 1e6
    if 1e6 <= bad < 4e6:
        bad = max(1e6, bad - BETTER_S)
    avoid.end_time = outlook.end_time
    adopt_if_better(avoid, AVOID_CLEAR, bad, now, math.nan)
    if clear:
        return
    if math.isfinite(outlook.cut_time):
        # the outcome after the cut-off is evaluated again in the cycles before it
        bad = 2e6 if outlook.cut_inside == 0.0 else 3e6 + outlook.cut_inside
        adopt_if_better(avoid, AVOID_CUT, bad, now, max(nav.time, outlook.cut_time))
    first = -1 if before in (AVOID_STEER, AVOID_LOST) else 0
    for k in range(first, BEARINGS):
        if k < 0:
            direction = held
        else:
            bearing = 2.0 * math.pi * k / BEARINGS
            direction = thrust_along_bearing(mission, nav, now, bearing)
        if not is_finite(direction):
            continue
        propagate_outlook(mission, onboard, turn_to(flown, direction, nav.time), math.inf)
        away = angle_between(now, direction)
        bad = score(outlook.outside, outlook.inside, 0.5 * MARGIN if k < 0 else MARGIN, away)
        if k < 0:
            bad -= BETTER_TURN if bad < 1e6 else (BETTER_S if bad < 4e6 else 1e-3 * BETTER_M)
        adopt_if_better(avoid, AVOID_STEER, bad, direction, outlook.end_time + AFTER)
    if not avoid.outside >= SURE and avoid.mode != AVOID_CUT:
        avoid.mode = AVOID_LOST


@kernel
def lacks_safe_orbit(mission: MissionRecords, onboard: Onboard, own: Turn) -> bool:
    """Return whether no safe orbit is in reach, as far as guidance knows.

    Args: as in :func:`choose`; the outlook is written.
    """
    nav = onboard.navigation
    state = onboard.state
    mu = mission.environment.mu
    target = mission.target
    limit = min(target.safe_radius, perigee_radius(target, mu)) - SLACK
    found = state.found
    waits = state.avoid.mode == AVOID_NOTHING and nav.time - found.time < PATIENCE
    if found.count == 0 and state.error != ERROR_PROPELLANT_SHORT:
        return False
    known = False
    solved = state.error == ERROR_NONE
    if state.error == ERROR_PROPELLANT_SHORT:
        known = state.lowered > SETTLED and perigee_radius(state.target, mu) < limit
        solved = not known and lacking_speed(state) < LACKING
    elif waits:
        return False
    propagate_outlook(mission, onboard, own, onboard.steering.cutoff_time)
    if solved:
        # a solution takes no account of the ground
        return bool(state.avoid.outlook.grounded == 1)
    return known or path_perigee(state.avoid.lookahead, mu) < limit


@kernel
def plan(mission: MissionRecords, onboard: Onboard) -> None:
    """Decide once per cycle on impact-point avoidance.

    Args: as in :func:`advance`.
    """
    nav = onboard.navigation
    state = onboard.state
    avoid = state.avoid
    if nav.time < avoid.next_time - SAME:
        return
    avoid.next_time = nav.time + onboard.settings.cycle_period
    if mission.arcs[nav.arc].held == 1:
        return
    law = onboard.steering
    own = (load(law.direction), load(law.direction_rate), -1.0, law.reference_time)
    if lacks_safe_orbit(mission, onboard, own):
        choose(mission, onboard, own)
    else:
        avoid.mode = AVOID_NOTHING


@kernel
def hand_back(onboard: Onboard) -> None:
    """Restore the law's own last answer before its step.

    Args:
        onboard: state of guidance. Its answer and phase are changed.
    """
    state = onboard.state
    avoid = state.avoid
    if avoid.mode == AVOID_NOTHING or state.phase == PHASE_CUTOFF:
        return
    if avoid.mode == AVOID_CUT and onboard.navigation.time >= avoid.cutoff_time - SAME:
        state.phase = PHASE_CUTOFF
        return
    copy_steering(avoid.own, onboard.steering)


@kernel
def keep_out(mission: MissionRecords, onboard: Onboard) -> None:
    """Replace the law's answer where needed to keep the impact point out of the areas.

    Args:
        mission: with the vehicle as known.
        onboard: state of guidance. Its answer may be changed.
    """
    nav = onboard.navigation
    state = onboard.state
    avoid = state.avoid
    steering = onboard.steering
    steers = avoid.mode == AVOID_STEER or avoid.mode == AVOID_LOST
    if steers and state.phase == PHASE_CUTOFF:
        # the law has ended, the thrust continues
        state.phase = PHASE_HOLD
    if state.phase == PHASE_IDLE or state.phase == PHASE_CUTOFF or state.plan.made == 1:
        return
    plan(mission, onboard)
    copy_steering(steering, avoid.own)
    if avoid.mode == AVOID_CUT:
        steering.cutoff_time = max(nav.time, avoid.cutoff_time)
    elif avoid.mode == AVOID_STEER or (
        avoid.mode == AVOID_LOST and math.isfinite(avoid.cutoff_time)
    ):
        last = avoid.flown
        since = nav.time - last.reference_time
        flown = unit(axpy(since, load(last.direction_rate), load(last.direction)))
        first, aside, angle, _ = turn_to(flown, load(avoid.direction), nav.time)
        rate = min(SLEW, onboard.settings.steering_rate_limit)
        rate = min(rate, angle / onboard.settings.cycle_period)
        steering.reference_time = nav.time
        store(steering.direction, first)
        store(steering.direction_rate, scale(rate, aside))
        steering.cutoff_time = max(nav.time, avoid.cutoff_time)
    elif avoid.mode != AVOID_NOTHING and steering.cutoff_time > avoid.end_time + AFTER:
        # a law without a solution cannot predict depletion
        steering.cutoff_time = avoid.end_time + AFTER
    elif steers and steering.cutoff_time <= nav.time:
        # avoidance has just ended, after the law's own cut-off
        steering.cutoff_time = nav.time
        state.phase = PHASE_CUTOFF
    copy_steering(steering, avoid.flown)
