# SPDX-License-Identifier: Apache-2.0
"""Steering through large angles: thrust along a primer, its integrals by quadrature.

PEG expands the thrust about its mean direction, other laws their angles; that holds for
turns below a radian. A vehicle that climbs far at little thrust turns further. Here the thrust
follows the primer p of a flight in a gravity gradient that turns with it, its integrals are
quadratures, and the end is met by Newton's method. What the target leaves free is chosen by
transversality: with p' its rate and g the pull, C = v x p - r x p' has no part along the axis of a
rotation that is free (downrange, the node), and p . g = p' . v where the place on an orbit is free.
"""

import math

from ares_guidance.arrays import ERROR_NONE, ERROR_NOT_CONVERGED, TURN_UNKNOWNS, Onboard
from ares_guidance.kernels.jettison import predict_jettisons
from ares_guidance.kernels.prediction import LinearTangent, gravity_effect, primer, turned_thrust
from ares_guidance.kernels.segments import (
    burn_time_to_go,
    note_tail_off,
    plan_segments,
    thrust_integrals,
)
from ares_guidance.kernels.start import start_guess
from ares_models.arrays import (
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_ASCENDING_NODE,
    NAMES_INCLINATION,
    NAMES_TRUE_ANOMALY,
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    MissionRecords,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.environment import gravity
from ares_models.kernels.linear import back_substitute, factor
from ares_models.kernels.targets import (
    desired_state,
    named_plane,
    names,
    plane_is_named,
    plane_normal,
    project_to_plane,
)
from ares_models.kernels.vectors import (
    Vector,
    add,
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

#: rad; in a flight by a plan, or after a failure, whose burns may go far round the planet, the
#: coast that shadows the thrusted path is begun anew after so much of it.
PIECE = 0.5
MOST_PIECES = 8
#: rad round the planet in one burn, without a plan to start from: what is found beyond is a detour
#: that dispersed flights do not find again.
FARTHEST = 2.75
#: rad; an end that lies further behind is reached the other way round.
LEAST_ANGLE = -0.5
#: Sine of the inclination below which the node has no meaning.
EQUATORIAL = 1e-6
#: Newton steps in one search, and halvings of one of them.
STEPS = 20
HALVINGS = 8
#: Scaled residual at which the end is met: of 4 km/s over 300 s, 4 cm/s and 12 m.
MET = 1e-5
#: Move of an unknown that the Jacobian is differenced over.
DIFFERENCE = 1e-6
#: Part of the last burn's mass that may be burnt in a prediction.
MOST_BURNT = 0.98
#: The same where the acceleration stays, in times by which the mass fades to 1 / e.
MOST_FADED = 4.0
SHORTEST = 0.1  # s
#: Guesses where the first does not do, rad, and the velocity that a radian costs, as a part.
LOFTS = (0.5, 0.9, 1.2)
LOFT_COSTS = 0.3
#: First pull downrange that is tried to spend what the target does not need, either way, and
#: rounds in which it is fitted.
PULL = 0.02
PULL_ROUNDS = 12
#: Share of the last pull by which the next may be larger, and may differ where it is good enough.
MOST_PULL = 3.0
NEAR_PULL = 0.1

#: State at the end of the thrust, and the primer with its rate there.
End = tuple[Vector, Vector, Vector, Vector]


@kernel
def possible_cutoff(state: Record, t: float) -> float:
    """The time to go nearest to ``t`` that there is mass for, s."""
    last = state.segments[state.segment_count - 1]
    most = MOST_FADED if last.acceleration > 0.0 else MOST_BURNT
    return min(max(t, SHORTEST), last.start + most * last.tau)


@kernel
def steering_of(turn: Record) -> LinearTangent:
    """The primer that the unknowns stand for."""
    y = turn.unknowns
    rate = scale(1.0 / turn.time_scale, (y[3], y[4], y[5]))
    return LinearTangent((y[0], y[1], y[2]), rate, turn.reference)


@kernel
def predict_end(mission: MissionRecords, onboard: Onboard) -> End:
    """Where the unknowns lead.

    Args:
        mission: as guidance believes it; so the next.
        onboard: what is on board, with planned segments.
    """
    state = onboard.state
    turn = state.turn
    r = load(onboard.navigation.position)
    v = load(onboard.navigation.velocity)
    t_go = turn.unknowns[6] * turn.time_scale
    horizon = t_go + state.solution.tail_drift
    steering = steering_of(turn)
    pieces = 1
    if state.leg.count > 0 or state.found.count > 0:
        angle = state.solution.primer.gradient * horizon
        pieces = min(MOST_PIECES, 1 + int(max(0.0, angle) / PIECE))
    span = horizon / pieces
    before_v, before_r = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(pieces):
        until = horizon if i + 1 == pieces else (i + 1) * span
        thrust_v, thrust_r = turned_thrust(state, until, t_go, steering)
        # what the thrust of this piece gives
        gain_v = sub(thrust_v, before_v)
        gain_r = sub(thrust_r, axpy(span, before_v, before_r))
        gravity_v, gravity_r = gravity_effect(r, v, gain_v, gain_r, span, mission.environment)
        r = add(axpy(span, v, r), add(gravity_r, gain_r))
        v = add(v, add(gravity_v, gain_v))
        before_v, before_r = thrust_v, thrust_r
    direction, rate = primer(state.solution, steering, t_go)
    return r, v, direction, rate


@kernel
def miss_free_node(target: Record, turn: Record, end: End, rows: Record) -> None:
    """Residuals of radius, speed, angle, inclination; node and downrange are free."""
    r, v, direction, rate = end
    radius, speed = norm(r), norm(v)
    h = cross(r, v)
    c = sub(cross(v, direction), cross(r, rate))
    sine = dot(r, v) / (radius * speed)
    scaled = speed / turn.speed_scale
    rows[0] = (radius - target.radius) / turn.length_scale
    rows[1] = (speed - target.speed) / turn.speed_scale
    rows[2] = (sine - math.sin(target.flight_path_angle)) * scaled
    rows[3] = (h[2] / norm(h) - math.cos(target.inclination)) * scaled
    rows[4] = c[2] / speed
    rows[5] = dot(c, unit(h)) / speed


@kernel
def miss_named_plane(mission: MissionRecords, turn: Record, end: End, rows: Record) -> None:
    """Residuals of a state in a named plane; the place in it is free."""
    target = mission.target
    r, v, direction, rate = end
    normal = named_plane(target)
    wanted_r, wanted_v, _ = desired_state(
        target, mission.environment.mu, project_to_plane(r, normal), normal
    )
    store(rows, scale(1.0 / turn.speed_scale, sub(v, wanted_v)))
    rows[3] = (norm(r) - norm(wanted_r)) / turn.length_scale
    rows[4] = dot(r, normal) / turn.length_scale
    if target.kind == TARGET_KEPLERIAN:
        pull = gravity(r, mission.environment)
        rows[5] = (dot(direction, pull) - dot(rate, v)) * turn.time_scale / turn.speed_scale
    else:
        rows[5] = dot(sub(cross(v, direction), cross(r, rate)), normal) / norm(v)


@kernel
def miss_elements(mission: MissionRecords, turn: Record, end: End, rows: Record) -> None:
    """Residuals of a target by elements: the state aimed at, and what is named of its plane.

    A plane that is not named may turn about the axes that keep what is named of it.
    """
    target = mission.target
    r, v, direction, rate = end
    speed = norm(v)
    h = unit(cross(r, v))
    c = scale(1.0 / speed, sub(cross(v, direction), cross(r, rate)))
    scaled = speed / turn.speed_scale
    # in the plane of the equator there is no node to turn
    flat = names(target, NAMES_INCLINATION) and math.sin(target.inclination) <= EQUATORIAL
    held = flat or plane_is_named(target)
    normal, reachable = plane_normal(target, r, h)
    if flat:
        normal = named_plane(target)
    elif not reachable:
        normal = h
    radial = project_to_plane(r, normal)
    wanted_r, wanted_v, ahead = desired_state(target, mission.environment.mu, radial, normal)
    miss = scale(1.0 / turn.speed_scale, sub(v, wanted_v))
    rows[0] = (norm(r) - norm(wanted_r)) / turn.length_scale
    rows[1] = dot(miss, radial)
    rows[2] = dot(miss, ahead)
    if held:
        rows[3] = dot(miss, normal)
        rows[4] = dot(r, normal) / turn.length_scale
    elif names(target, NAMES_INCLINATION):
        rows[3] = dot(miss, normal)
        if not reachable:
            rows[3] = (h[2] - math.cos(target.inclination)) * scaled
        rows[4] = c[2]
    elif names(target, NAMES_ASCENDING_NODE):
        node = (math.cos(target.ascending_node), math.sin(target.ascending_node), 0.0)
        rows[3] = dot(miss, normal)
        rows[4] = dot(c, node)
    else:
        rows[3] = dot(c, radial)
        rows[4] = dot(c, ahead)
    if names(target, NAMES_ARGUMENT_OF_PERIGEE) and not names(target, NAMES_TRUE_ANOMALY):
        pull = gravity(r, mission.environment)
        rows[5] = (dot(direction, pull) - dot(rate, v)) * turn.time_scale / turn.speed_scale
    else:
        rows[5] = dot(c, h)


@kernel
def residuals(mission: MissionRecords, onboard: Onboard, column: int) -> float:
    """By how much the unknowns miss the target and transversality, scaled.

    Args:
        mission: as in :func:`predict_end`; so the next.
        onboard: what is on board. Column of ``state.turn.rows`` is written.
        column: which.

    Returns:
        largest of them; inf when one is no number.
    """
    turn = onboard.state.turn
    target = mission.target
    rows = turn.rows[column]
    end = predict_end(mission, onboard)
    node_is_free = target.kind == TARGET_RADIUS_SPEED_ANGLE_INCLINATION
    if target.kind == TARGET_ELEMENTS:
        miss_elements(mission, turn, end, rows)
    elif node_is_free and math.sin(target.inclination) > EQUATORIAL:
        miss_free_node(target, turn, end, rows)
    else:
        miss_named_plane(mission, turn, end, rows)
    rows[5] -= turn.pull
    if turn.held > 0.0:
        rows[5] = turn.unknowns[6] - turn.held / turn.time_scale
    # the length of the primer has no meaning
    rows[6] = dot(load(turn.unknowns), load(turn.first_direction)) - 1.0
    largest = 0.0
    for i in range(TURN_UNKNOWNS):
        largest = max(largest, abs(rows[i]))
        if not math.isfinite(rows[i]):
            return math.inf
    return largest


@kernel
def solve_step(turn: Record) -> bool:
    """Newton's step into ``turn.step``; False if there is none.

    The first column of ``rows`` holds the residuals, the others the same with one unknown
    moved each.
    """
    n = TURN_UNKNOWNS
    rows, matrix = turn.rows, turn.matrix
    for i in range(n):
        for k in range(n):
            matrix[i, k] = (rows[k + 1, i] - rows[0, i]) / DIFFERENCE
        turn.step[i] = -rows[0, i]
    if not factor(n, matrix, turn.pivots):
        return False
    back_substitute(n, matrix, turn.pivots, turn.step)
    return True


@kernel
def newton_step(mission: MissionRecords, onboard: Onboard, merit: float) -> float:
    """One step of Newton's method, halved until the end comes nearer.

    Args:
        mission: as in :func:`predict_end`; so the next.
        onboard: what is on board. Its unknowns are moved.
        merit: largest residual of the unknowns, which stand in column 0.

    Returns:
        largest residual after it; inf when no step leads nearer.
    """
    turn = onboard.state.turn
    y, before = turn.unknowns, turn.before
    for k in range(TURN_UNKNOWNS):
        before[k] = y[k]
        y[k] += DIFFERENCE
        residuals(mission, onboard, k + 1)
        y[k] = before[k]
    if not solve_step(turn):
        return math.inf
    part = 1.0
    for _ in range(HALVINGS):
        for k in range(TURN_UNKNOWNS):
            y[k] = before[k] + part * turn.step[k]
        y[6] = possible_cutoff(onboard.state, y[6] * turn.time_scale) / turn.time_scale
        after = residuals(mission, onboard, 0)
        if after < MET or after < (1.0 - 0.1 * part) * merit:
            return after
        part *= 0.5
    return math.inf


@kernel
def set_gradient(solution: Record, r: Vector, t_go: float, mu: float) -> None:
    """The gravity gradient between here and the end of the solution on board.

    Args:
        solution: record SOLUTION. Changed.
        r: position, m.
        t_go: s.
        mu: m3/s2.
    """
    field = solution.primer
    end = load(solution.desired_position)
    normal = load(solution.plane_normal)
    axis = unit(axpy(-dot(normal, r), normal, r))
    angle = math.atan2(dot(cross(normal, axis), end), dot(axis, end))
    if angle < LEAST_ANGLE:
        angle += 2.0 * math.pi
    radius = 0.5 * (norm(r) + norm(end))
    field.gradient = math.sqrt(mu / radius**3)
    field.turning = max(angle, 0.0) / t_go
    store(field.axis, axis)
    store(field.normal, normal)


@kernel
def begin(mission: MissionRecords, onboard: Onboard) -> None:
    """Unknowns, their scales and the linear gravity, from the solution on board."""
    state = onboard.state
    solution = state.solution
    turn = state.turn
    r = load(onboard.navigation.position)
    t_go = possible_cutoff(state, solution.time_to_go)
    l_sum, j_sum, _, _, _, _ = thrust_integrals(state, t_go, t_go)
    turn.reference = j_sum / l_sum
    turn.time_scale = t_go
    turn.speed_scale = l_sum
    turn.length_scale = l_sum * t_go
    steering = LinearTangent(
        load(solution.direction),
        load(solution.direction_rate),
        solution.reference_time - onboard.navigation.time,
    )
    set_gradient(solution, r, t_go, mission.environment.mu)
    middle, rate = primer(solution, steering, turn.reference)
    size = norm(middle)
    store(turn.first_direction, scale(1.0 / size, middle))
    store(turn.unknowns, scale(1.0 / size, middle))
    store(turn.unknowns[3:], scale(t_go / size, rate))
    turn.unknowns[6] = 1.0


@kernel
def take(mission: MissionRecords, onboard: Onboard) -> None:
    """Put what the unknowns stand for into the solution on board."""
    state = onboard.state
    solution = state.solution
    r_p, v_p, _, _ = predict_end(mission, onboard)
    t_go = state.turn.unknowns[6] * state.turn.time_scale
    direction, rate = primer(solution, steering_of(state.turn), 0.0)
    size = norm(direction)
    l_sum, _, _, _, _, _ = thrust_integrals(state, t_go, t_go)
    solution.time_to_go = t_go
    store(solution.direction, scale(1.0 / size, direction))
    store(solution.direction_rate, scale(1.0 / size, rate))
    solution.reference_time = onboard.navigation.time
    store(solution.velocity_to_go, scale(l_sum / size, direction))
    store(solution.desired_position, r_p)
    store(solution.plane_normal, unit(cross(r_p, v_p)))
    store(state.predicted_position, r_p)
    store(state.predicted_velocity, v_p)


@kernel
def converge_large_turn(mission: MissionRecords, onboard: Onboard) -> int:
    """A solution that may turn far, from the one on board.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.

    Returns:
        ERROR_NONE or ERROR_NOT_CONVERGED.
    """
    state = onboard.state
    solution = state.solution
    plan_segments(mission, onboard)
    if state.segment_count == 0 or not is_finite(load(solution.direction)):
        return ERROR_NOT_CONVERGED
    note_tail_off(mission.arcs[state.segments[state.segment_count - 1].arc], state)
    begin(mission, onboard)
    moved = math.inf
    merit = math.inf
    for _ in range(min(STEPS, onboard.settings.max_iterations)):
        if moved > 0.0:
            plan_segments(mission, onboard)
            merit = residuals(mission, onboard, 0)
        if math.isfinite(merit):
            merit = newton_step(mission, onboard, merit)
        state.iterations += 1
        solution.miss_speed = merit * state.turn.speed_scale
        if not math.isfinite(merit):
            break
        take(mission, onboard)
        steering = LinearTangent(load(solution.direction), load(solution.direction_rate), 0.0)
        moved = predict_jettisons(mission, onboard, steering)
        if merit < MET and moved < onboard.settings.jettison_time_tolerance:
            angle = solution.primer.gradient * solution.time_to_go
            return ERROR_NONE if angle < FARTHEST or state.leg.count > 0 else ERROR_NOT_CONVERGED
    return ERROR_NOT_CONVERGED


@kernel
def lofted_guess(mission: MissionRecords, onboard: Onboard, loft: float) -> None:
    """Steering from ``loft``, rad, above the horizontal to as much below it at cut-off."""
    start_guess(mission, onboard)
    nav = onboard.navigation
    state = onboard.state
    solution = state.solution
    up = unit(load(nav.position))
    v = load(nav.velocity)
    ahead = unit(axpy(-dot(v, up), up, v))
    t_go, _ = burn_time_to_go(
        state, (1.0 + LOFT_COSTS * loft) * norm(load(solution.velocity_to_go))
    )
    solution.time_to_go = t_go
    store(solution.direction, ahead)
    store(solution.direction_rate, scale(-2.0 * math.tan(loft) / t_go, up))
    solution.reference_time = nav.time + 0.5 * t_go


@kernel
def converge_lofted(mission: MissionRecords, onboard: Onboard) -> int:
    """As :func:`converge_large_turn`, from guesses that climb ever more steeply."""
    for loft in LOFTS:
        lofted_guess(mission, onboard, loft)
        if converge_large_turn(mission, onboard) == ERROR_NONE:
            return ERROR_NONE
    return ERROR_NOT_CONVERGED


@kernel
def pull_downrange(mission: MissionRecords, onboard: Onboard, pull: float, least: float) -> bool:
    """Find a pull downrange, from a first one, by which the thrust lasts for ``least`` s.

    Around the optimum the time that a flight takes grows with the square of the pull.

    Args:
        mission: as in :func:`converge_large_turn`; so the next.
        onboard: what is on board, the optimum in ``shortest`` too. Changed.
        pull: the first.
        least: s to go, more than the optimum takes.

    Returns:
        whether the solution is near.
    """
    state = onboard.state
    shortest = state.shortest.time_to_go
    good = 0.0
    for _ in range(PULL_ROUNDS):
        state.turn.pull = pull
        error = converge_large_turn(mission, onboard)
        more = state.solution.time_to_go - shortest
        if error != ERROR_NONE or not more > 0.0:
            state.solution = state.shortest
            pull = 0.5 * (pull + good)
            continue
        good = pull
        share = math.sqrt((least - shortest) / more)
        if abs(share - 1.0) < NEAR_PULL:
            return True
        pull *= min(MOST_PULL, share)
    return False


@kernel
def converge_held(mission: MissionRecords, onboard: Onboard, least: float) -> int:
    """Find a flight to the target that lasts for ``least`` s, where the optimum takes less.

    What the burns before the last give beyond the target's need is spent on the way: the time is
    given, and downrange, which is free, pulls at the thrust.

    Args:
        mission: as in :func:`converge_large_turn`; so the next.
        onboard: what is on board, with a solution. Changed.
        least: s to go.

    Returns:
        ERROR_NONE or ERROR_NOT_CONVERGED.
    """
    state = onboard.state
    turn = state.turn
    if turn.held > 0.0:
        turn.held = least
        return converge_large_turn(mission, onboard)
    state.shortest = state.solution
    near = False
    for k in range(2):
        state.solution = state.shortest
        near = near or pull_downrange(mission, onboard, PULL - 2.0 * k * PULL, least)
        if near:
            break
    turn.pull = 0.0
    turn.held = least
    error = ERROR_NOT_CONVERGED
    if near:
        error = converge_large_turn(mission, onboard)
    if error != ERROR_NONE:
        turn.held = 0.0
        state.solution = state.shortest
    return error
