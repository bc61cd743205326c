# SPDX-License-Identifier: Apache-2.0
"""The last resort: where no orbit is in reach, the impact point is kept out of the named areas.

As range safety sees it the instantaneous impact point sweeps down-range as long as there is thrust,
and wherever the thrust ends, by itself or by command, there the vehicle falls. So the rest of the
flight is flown ahead, once for each thing that can be done, with the impact point at every step:

- as guidance steers anyway;
- with the thrust turned to where it moves the impact point in one of twelve directions over the
  ground, by the sensitivity of the impact point to velocity, and held there;
- as guidance steers, with the engines cut off before the impact point enters an area.

Taken is the first of: never inside an area; across one in at most CROSSING s and out of it before
the propellant is gone; cut off before; out of it in the end however long it takes; nearest to the
edge. Among several of a kind the one that turns least, or is inside the shortest. All of it is
done anew in every cycle, and what is flown is left only for what is better by more than a margin.
A cut-off cannot be taken back: it is ordered for its time, and comes when no cycle until then has
found anything better.

Sources: Bate, Mueller, White, *Fundamentals of Astrodynamics* (1971), section 6.3 (how an impact
moves with the velocity at burn-out); 14 CFR 417.213 and 417.217 (flight safety limits, and gates
through which an impact point may pass over land); Bull, Lanzi, "An Autonomous Flight Safety
System", NASA (2007), for limits that are watched on board. The choice among the ways, its order
and its margins are this project's own.
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
from ares_guidance.kernels.engines import present_engine
from ares_guidance.kernels.prediction import LinearTangent, primer
from ares_guidance.kernels.shortfall import SETTLED, lacking_speed
from ares_models.arrays import BURN, MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import altitude, gravity
from ares_models.kernels.impact import impact_direction, impact_moves, outside_areas
from ares_models.kernels.sequence import arc_after_burnout, empty_mass, mass_at_staging
from ares_models.kernels.steering import copy_steering
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

#: m from the edge of an area that the end of a flight keeps; half of it for what is flown already.
MARGIN = 25_000.0
#: m from the edge at which the engines are cut off.
CUT_MARGIN = 10_000.0
#: m from the edge below which an end is not known to be outside.
SURE = 5_000.0
#: s for which the impact point may be inside an area on its way across.
CROSSING = 20.0
#: s, m and rad by which another choice of the same kind is better than what is flown.
BETTER_S, BETTER_M, BETTER_TURN = 5.0, 20_000.0, 0.1
#: rad/s at which the thrust is turned, at most.
SLEW = math.radians(3.0)
#: s after a failure before guidance without a solution is taken to have none.
PATIENCE = 5.0
#: m/s that a plan lacks, and m of perigee, beyond which the orbit aimed at is not in reach.
LACKING, SLACK = 20.0, 1_000.0
#: Directions over the ground.
BEARINGS = 12
#: s, and as a part of the time flown ahead: a step.
STEP, STEP_SHARE = 2.0, 0.01
MOST_STEPS = 900
HALVINGS = 14
#: s; what is closer falls on the same instant.
SAME = 1e-9
#: s after the propellant is gone, for which a cut-off that is not to come is timed.
AFTER = 0.5

#: How the thrust points: along the primer of (direction, rate, reference), turn < 0; or from a
#: direction towards another one at right angles, by the angle ``turn`` at most, from ``reference``
#: on.
Turn = tuple[Vector, Vector, float, float]


@kernel
def heading(turn: Turn, onboard: Onboard, t: float) -> Vector:
    """Unit vector of the thrust at a time, s."""
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
    """From one unit vector to another, from a time on."""
    aside = sub(last, scale(dot(first, last), first))
    if norm(aside) < 1e-6:
        # it does not matter which way round
        aside = cross(first, (1.0, 0.0, 0.0) if abs(first[0]) < 0.7 else (0.0, 1.0, 0.0))
    return first, unit(aside), angle_between(first, last), t


@kernel
def enter(mission: MissionRecords, nav: Record, way: Record, k: int) -> None:
    """Begin arc ``k``, or the next that has a length, now; the present one began when it did.

    Args:
        mission: with the vehicle as it is known.
        nav: record NAVIGATION, the present state.
        way: record WAY. Changed.
        k: index of the arc; the number of arcs: the thrust is over.
    """
    arcs = mission.arcs
    while k < arcs.shape[0] and arcs[k].duration == 0.0 and k != nav.arc:
        # a failure that is an arc of its own, and has not happened
        k += 1
    if k >= arcs.shape[0] or (arcs[k].kind != BURN and math.isinf(arcs[k].duration)):
        way.over = 1
        return
    arc = arcs[k]
    begin = way.time
    if k == nav.arc:
        begin = nav.arc_start_time
    elif arc.begins_stage == 1:
        way.mass = mass_at_staging(arc, mission.jettisons, nav.jettisoned)
    way.arc = k
    way.begin = begin
    way.end = begin + arc.duration if arc.duration > 0.0 else math.inf
    way.lit = begin + arc.start_loss if arc.kind == BURN else math.inf
    way.empty = empty_mass(arc, arcs, mission.jettisons, nav.jettisoned)


@kernel
def stand(mission: MissionRecords, nav: Record, way: Record) -> None:
    """Put a way ahead to where the vehicle is. Args: as of :func:`enter`."""
    way.time = nav.time
    way.mass = nav.mass
    way.over = 0
    store(way.position, load(nav.position))
    store(way.velocity, load(nav.velocity))
    enter(mission, nav, way, nav.arc)


@kernel
def copy_way(source: Record, destination: Record) -> None:
    """Copy a record WAY over another."""
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
    """Fly ahead for a step or to the next change of the thrust: Runge-Kutta-Nystroem, order 4.

    Args:
        mission: with the vehicle as it is known.
        onboard: what is on board. Its way is changed.
        turn: how the thrust points.
        span: s, at most.
    """
    nav = onboard.navigation
    way = onboard.state.avoid.way
    environment = mission.environment
    arc = mission.arcs[way.arc]
    lit = arc.kind == BURN and way.time >= way.lit - SAME
    limit = way.end - way.time
    ve, flow = present_engine(arc, mission.arcs[nav.arc].stage, onboard.state)
    if lit:
        flow *= throttle(arc, way.mass)
        limit = min(limit, (way.mass - way.empty) / flow)
    else:
        flow = 0.0
        limit = min(limit, way.lit - way.time)
    limit = max(0.0, limit)
    h = min(span, limit)
    r, v = load(way.position), load(way.velocity)
    thrust = ve * flow
    begin, middle = way.time, way.time + 0.5 * h
    mass = way.mass - flow * h
    u = heading(turn, onboard, begin)
    k_1 = axpy(thrust / way.mass, u, gravity(r, environment))
    u = heading(turn, onboard, middle)
    there = axpy(0.5 * h, v, axpy(0.125 * h * h, k_1, r))
    k_2 = axpy(thrust / (way.mass - 0.5 * flow * h), u, gravity(there, environment))
    u = heading(turn, onboard, begin + h)
    there = axpy(h, v, axpy(0.5 * h * h, k_2, r))
    k_3 = axpy(thrust / mass, u, gravity(there, environment))
    store(way.position, axpy(h, v, axpy(h * h / 6.0, axpy(2.0, k_2, k_1), r)))
    store(way.velocity, axpy(h / 6.0, axpy(4.0, k_2, add(k_1, k_3)), v))
    way.time = begin + h
    way.mass = mass
    if h < limit:
        return
    if way.time >= way.end - SAME:
        enter(mission, nav, way, way.arc + 1)
    elif lit:
        enter(mission, nav, way, arc_after_burnout(way.arc, mission.arcs))


@kernel
def outside_on_way(mission: MissionRecords, onboard: Onboard, turn: Turn) -> tuple[float, int]:
    """How far the impact point is from the areas if the thrust ended here by command.

    Args: as of :func:`advance`.

    Returns:
        as :func:`ares_models.kernels.impact.outside_areas`.
    """
    way = onboard.state.avoid.way
    environment = mission.environment
    velocity = load(way.velocity)
    arc = mission.arcs[way.arc]
    if way.over == 0 and arc.tail_gain > 0.0 and way.time >= way.lit:
        # what the tail-off still gives
        ve, flow = present_engine(arc, mission.arcs[onboard.navigation.arc].stage, onboard.state)
        u = heading(turn, onboard, way.time)
        velocity = axpy(arc.tail_gain * ve * flow / way.mass, u, velocity)
    place = impact_direction(load(way.position), velocity, way.time, environment)
    return outside_areas(place, environment)


@kernel
def time_cut(mission: MissionRecords, onboard: Onboard, turn: Turn) -> float:
    """When the engines are to be cut off, between the way's mark and where it is, s.

    Args: as of :func:`advance`.

    Returns:
        mission elapsed time; inf: they cannot be cut off there.
    """
    avoid = onboard.state.avoid
    way, mark = avoid.way, avoid.mark
    arc = mission.arcs[mark.arc]
    if arc.kind != BURN:
        return math.inf
    low, high = 0.0, way.time - mark.time
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        copy_way(mark, way)
        advance(mission, onboard, turn, middle)
        outside, _ = outside_on_way(mission, onboard, turn)
        if outside >= CUT_MARGIN:
            low = middle
        else:
            high = middle
    at = mark.time + low
    earliest = mark.begin + arc.shortest if math.isinf(arc.duration) else mark.begin
    return at if at >= earliest else math.inf


@kernel
def touch_down(mission: MissionRecords, onboard: Onboard, turn: Turn) -> None:
    """Put a way that went below the ground in its last step to where it met it.

    Args: as of :func:`advance`. The way's mark is where that step began.
    """
    avoid = onboard.state.avoid
    way, mark = avoid.way, avoid.mark
    above = altitude(load(mark.position), mission.environment)
    below = altitude(load(way.position), mission.environment)
    span = (way.time - mark.time) * above / (above - below)
    copy_way(mark, way)
    advance(mission, onboard, turn, span)


@kernel
def look_along(mission: MissionRecords, onboard: Onboard, turn: Turn, cutoff_time: float) -> None:
    """Fly the rest of the flight ahead and write what becomes of the impact point.

    Args: as of :func:`advance`, and when a burn is cut off, s; inf or nan: it is not.
    """
    nav = onboard.navigation
    avoid = onboard.state.avoid
    way, seen = avoid.way, avoid.outlook
    stand(mission, nav, way)
    seen.inside = 0.0
    seen.grounded = 0
    seen.cut_time = math.inf
    seen.cut_inside = 0.0
    seen.area = -1
    # whether the engines could be cut off: not yet, now, not any more
    stage = 0
    outside, area = outside_on_way(mission, onboard, turn)
    if 0.0 <= outside < CUT_MARGIN:
        seen.cut_time = nav.time
    for _ in range(MOST_STEPS):
        if outside < 0.0 and seen.area < 0:
            seen.area = area
        if stage == 0 and outside >= CUT_MARGIN:
            stage = 1
            seen.cut_time = math.inf
            seen.cut_inside = seen.inside
        if way.time >= cutoff_time - SAME and mission.arcs[way.arc].kind == BURN:
            way.over = 1
        if altitude(load(way.position), mission.environment) < 0.0:
            seen.grounded = 1
        if way.over == 1 or seen.grounded == 1:
            break
        copy_way(way, avoid.mark)
        was = outside
        step = max(STEP, STEP_SHARE * (way.time - nav.time))
        if cutoff_time > way.time:
            step = min(step, cutoff_time - way.time)
        advance(mission, onboard, turn, step)
        outside, area = outside_on_way(mission, onboard, turn)
        share = 0.5 * ((1.0 if was < 0.0 else 0.0) + (1.0 if outside < 0.0 else 0.0))
        seen.inside += share * (way.time - avoid.mark.time)
        if stage == 1 and outside < CUT_MARGIN:
            stage = 2
            copy_way(way, avoid.kept)
            seen.cut_time = time_cut(mission, onboard, turn)
            copy_way(avoid.kept, way)
    if seen.grounded == 1 and way.time > nav.time:
        touch_down(mission, onboard, turn)
        outside, area = outside_on_way(mission, onboard, turn)
    seen.outside = outside
    seen.end_time = way.time
    if seen.area < 0:
        seen.area = area


@kernel
def path_perigee(way: Record, mu: float) -> float:
    """Perigee at the end of a way, m from the centre."""
    r, v = load(way.position), load(way.velocity)
    momentum = cross(r, v)
    parameter = dot(momentum, momentum) / mu
    energy = 0.5 * dot(v, v) - mu / norm(r)
    return parameter / (1.0 + math.sqrt(max(0.0, 1.0 + 2.0 * energy * parameter / mu)))


@kernel
def score(outside: float, inside: float, margin: float, worth: float) -> float:
    """How bad an end is: its kind in millions, then what tells those of a kind apart.

    Args:
        outside: m from the areas in the end.
        inside: s within one on the way.
        margin: m that is enough.
        worth: of the choice among those that are never inside.
    """
    if outside >= margin:
        if inside == 0.0:
            return worth
        return inside + (1e6 if inside <= CROSSING else 3e6)
    # by km
    return (4e6 if outside >= 0.0 else 5e6) - 1e-3 * outside


@kernel
def turned_ahead(mission: MissionRecords, nav: Record, own: Vector, bearing: float) -> Vector:
    """Where the thrust moves the impact point most in a direction over the ground, unit vector.

    Args:
        mission: as guidance believes it.
        nav: record NAVIGATION.
        own: thrust direction as guidance has it, which moves it ahead.
        bearing: rad from there.
    """
    r, v = load(nav.position), load(nav.velocity)
    place = impact_direction(r, v, nav.time, mission.environment)
    x, y, z = impact_moves(r, v, nav.time, mission.environment)
    ahead = add(scale(own[0], x), add(scale(own[1], y), scale(own[2], z)))
    aside = cross(place, ahead)
    c, s = math.cos(bearing), math.sin(bearing)
    if is_finite(aside) and norm(aside) > 0.0:
        along = axpy(c, unit(ahead), scale(s, unit(aside)))
        return unit((dot(x, along), dot(y, along), dot(z, along)))
    # it falls nowhere yet: over the ground below
    level = unit(sub(v, scale(dot(v, r) / dot(r, r), r)))
    return axpy(c, level, scale(s, unit(cross(r, level))))


@kernel
def take(avoid: Record, mode: int, bad: float, direction: Vector, cutoff_time: float) -> None:
    """Make a choice the one to fly, if it is the best so far."""
    if not bad < avoid.score:
        return
    avoid.mode = mode
    avoid.score = bad
    avoid.cutoff_time = cutoff_time
    avoid.outside = avoid.outlook.outside
    store(avoid.direction, direction)


@kernel
def choose(mission: MissionRecords, onboard: Onboard, own: Turn) -> None:
    """Look at all that can be done, and note the best.

    Args:
        mission: with the vehicle as it is known.
        onboard: what is on board; its outlook is that of the flight as guidance steers it.
        own: how it does.
    """
    nav = onboard.navigation
    avoid = onboard.state.avoid
    seen = avoid.outlook
    before, held = avoid.mode, load(avoid.direction)
    now = heading(own, onboard, nav.time)
    last = avoid.flown
    flown = unit(
        axpy(nav.time - last.reference_time, load(last.direction_rate), load(last.direction))
    )
    if not is_finite(flown):
        flown = now
    avoid.area = seen.area
    avoid.score = math.inf
    enough = 0.5 * MARGIN if before == AVOID_CLEAR else MARGIN
    bad = score(seen.outside, seen.inside, enough, 0.0)
    clear = bad < 1e6
    if 1e6 <= bad < 4e6:
        bad = max(1e6, bad - BETTER_S)
    avoid.end_time = seen.end_time
    take(avoid, AVOID_CLEAR, bad, now, math.nan)
    if clear:
        return
    if math.isfinite(seen.cut_time):
        # what comes next is looked at anew before
        bad = 2e6 if seen.cut_inside == 0.0 else 3e6 + seen.cut_inside
        take(avoid, AVOID_CUT, bad, now, max(nav.time, seen.cut_time))
    first = -1 if before in (AVOID_STEER, AVOID_LOST) else 0
    for k in range(first, BEARINGS):
        if k < 0:
            direction = held
        else:
            bearing = 2.0 * math.pi * k / BEARINGS
            direction = turned_ahead(mission, nav, now, bearing)
        if not is_finite(direction):
            continue
        look_along(mission, onboard, turn_to(flown, direction, nav.time), math.inf)
        away = angle_between(now, direction)
        bad = score(seen.outside, seen.inside, 0.5 * MARGIN if k < 0 else MARGIN, away)
        if k < 0:
            bad -= BETTER_TURN if bad < 1e6 else (BETTER_S if bad < 4e6 else 1e-3 * BETTER_M)
        take(avoid, AVOID_STEER, bad, direction, seen.end_time + AFTER)
    if not avoid.outside >= SURE and avoid.mode != AVOID_CUT:
        avoid.mode = AVOID_LOST


@kernel
def is_short(mission: MissionRecords, onboard: Onboard, own: Turn) -> bool:
    """Whether no orbit is in reach that is safe, as far as guidance knows; looks ahead.

    Args: as of :func:`choose`; the outlook is written.
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
    look_along(mission, onboard, own, onboard.steering.cutoff_time)
    if solved:
        # a solution knows of no ground
        return bool(state.avoid.outlook.grounded == 1)
    return known or path_perigee(state.avoid.way, mu) < limit


@kernel
def plan(mission: MissionRecords, onboard: Onboard) -> None:
    """Decide, once a cycle, whether the impact point is all that is left, and what to do with it.

    Args: as of :func:`advance`.
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
    if is_short(mission, onboard, own):
        choose(mission, onboard, own)
    else:
        avoid.mode = AVOID_NOTHING


@kernel
def hand_back(onboard: Onboard) -> None:
    """Before a step of the law: what it sees as its last answer is its own.

    Args:
        onboard: what is on board. Its answer and phase are changed.
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
    """After a step of the law: where no orbit is in reach, keep the impact point out of the areas.

    Args:
        mission: with the vehicle as it is known.
        onboard: what is on board. The answer is changed where that is called for.
    """
    nav = onboard.navigation
    state = onboard.state
    avoid = state.avoid
    steering = onboard.steering
    steers = avoid.mode == AVOID_STEER or avoid.mode == AVOID_LOST
    if steers and state.phase == PHASE_CUTOFF:
        # the law is done, the thrust is not
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
        # a law without a solution does not know when the propellant is gone
        steering.cutoff_time = avoid.end_time + AFTER
    elif steers and steering.cutoff_time <= nav.time:
        # turned away until now, and past what the law wanted
        steering.cutoff_time = nav.time
        state.phase = PHASE_CUTOFF
    copy_steering(steering, avoid.flown)
