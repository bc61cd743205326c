# SPDX-License-Identifier: Apache-2.0
"""Steering through large angles: thrust along a primer, its integrals by quadrature.

PEG and IGM expand the thrust for small angles, which holds for turns below a radian. A vehicle that
climbs far at low thrust turns further. Here the thrust follows the primer p in a gravity gradient
that rotates with the vehicle, its integrals are quadratures, and Newton's method meets the target.
Transversality fixes the free quantities: with p' the rate of p and g gravity, C = v x p - r x p'
has no component along the axis of a free rotation (downrange, node), and p . g = p' . v where the
place on an orbit is free.
"""

import math

from ares_guidance.arrays import ERROR_NONE, ERROR_NOT_CONVERGED, TURN_UNKNOWNS, Onboard
from ares_guidance.kernels.laws.start import start_guess
from ares_guidance.kernels.prediction.burn import (
    LinearTangent,
    gravity_effect,
    primer,
    turned_thrust,
)
from ares_guidance.kernels.prediction.jettison import predict_jettisons
from ares_guidance.kernels.prediction.segments import (
    burn_time_to_go,
    note_tail_off,
    plan_segments,
    thrust_integrals,
)
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

#: Range angle, rad, after which the coast that shadows the thrusted path is restarted, in a flight
#: by a plan or after a failure, where burns may be long; and largest number of such pieces.
PIECE = 0.5
MOST_PIECES = 8
#: Largest range angle of a burn without a plan, rad; solutions beyond it are detours that dispersed
#: flights do not find again.
FARTHEST = 2.75
#: Least range angle, rad; an end further behind is reached round the planet.
LEAST_ANGLE = -0.5
#: Sine of the inclination below which the node is undefined.
EQUATORIAL = 1e-6
#: Largest number of Newton steps in one search, and of halvings of a step.
STEPS = 20
HALVINGS = 8
#: Largest scaled residual at convergence: 4 cm/s and 12 m for a burn of 4 km/s over 300 s.
MET = 1e-5
#: The same after a step by the Jacobian of an earlier cycle, which does not converge as fast.
MET_BY_LAST = 1e-7
STEPS_BY_LAST = 3
#: Step of the finite differences of the Jacobian, scaled.
DIFFERENCE = 1e-6
#: Largest fraction of the last burn's mass that a prediction may burn.
MOST_BURNT = 0.98
#: The same at constant acceleration, in time constants of the mass.
MOST_FADED = 4.0
SHORTEST = 0.1  # s
#: Lofts of further initial guesses, rad, and their cost in delta-V per radian, a fraction.
LOFTS = (0.5, 0.9, 1.2)
LOFT_COSTS = 0.3
#: First downrange multiplier, of either sign, to spend surplus delta-V, and iterations on it.
PULL = 0.02
PULL_ROUNDS = 12
#: Largest growth of the multiplier in one iteration, and relative tolerance of its square root law.
MOST_PULL = 3.0
NEAR_PULL = 0.1

#: State at the end of the thrust, and the primer with its rate there.
End = tuple[Vector, Vector, Vector, Vector]


@kernel
def possible_cutoff(state: Record, t: float) -> float:
    """Clip a time to go, s, to the mass of the last segment."""
    last = state.segments[state.segment_count - 1]
    most = MOST_FADED if last.acceleration > 0.0 else MOST_BURNT
    return min(max(t, SHORTEST), last.start + most * last.tau)


@kernel
def steering_of(turn: Record) -> LinearTangent:
    """Convert the unknowns to the primer at the reference."""
    y = turn.unknowns
    rate = scale(1.0 / turn.time_scale, (y[3], y[4], y[5]))
    return LinearTangent((y[0], y[1], y[2]), rate, turn.reference)


@kernel
def predict_end(mission: MissionRecords, onboard: Onboard) -> End:
    """Predict the end of the thrust for the present unknowns.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance, with planned segments.
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
        # velocity and displacement by the thrust of this piece
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
    """Write the residuals of radius, speed, angle and inclination; node and downrange are free."""
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
    """Write the residuals of a state in a given plane; the downrange position is free."""
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
    """Write the residuals of a target by elements: the state aimed at and the named plane elements.

    A plane that is not fully named may rotate about the axes that preserve its named elements.
    """
    target = mission.target
    r, v, direction, rate = end
    speed = norm(v)
    h = unit(cross(r, v))
    c = scale(1.0 / speed, sub(cross(v, direction), cross(r, rate)))
    scaled = speed / turn.speed_scale
    # an equatorial plane has no node
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
    """Compute the scaled residuals of target and transversality.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Row ``column`` of ``state.turn.rows`` is written.
        column: 0 for the unknowns themselves, 1 + k with unknown k perturbed.

    Returns:
        largest residual; inf if one is not finite.
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
    # the length of the primer is arbitrary
    rows[6] = dot(load(turn.unknowns), load(turn.first_direction)) - 1.0
    largest = 0.0
    for i in range(TURN_UNKNOWNS):
        largest = max(largest, abs(rows[i]))
        if not math.isfinite(rows[i]):
            return math.inf
    return largest


@kernel
def solve_step(turn: Record) -> bool:
    """Write Newton's step into ``turn.step``; return False if the Jacobian is singular.

    The first of ``rows`` holds the residuals, the others those with one unknown perturbed each.
    """
    n = TURN_UNKNOWNS
    rows, matrix = turn.rows, turn.matrix
    for i in range(n):
        for k in range(n):
            matrix[i, k] = (rows[k + 1, i] - rows[0, i]) / DIFFERENCE
        turn.step[i] = -rows[0, i]
    turn.factored = 1 if factor(n, matrix, turn.pivots) else 0
    if turn.factored == 0:
        return False
    back_substitute(n, matrix, turn.pivots, turn.step)
    return True


@kernel
def newton_step(mission: MissionRecords, onboard: Onboard, merit: float) -> float:
    """Take a Newton step, halved until the largest residual decreases.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Its unknowns are changed.
        merit: largest residual of the present unknowns; all are in row 0.

    Returns:
        largest residual after the step; inf if no step decreases it.
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
def meets_by_last(mission: MissionRecords, onboard: Onboard, merit: float) -> bool:
    """Take steps by the Jacobian of the last cycle, if they meet the target.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Its unknowns are changed if the target is met.
        merit: largest residual of the present unknowns; all are in row 0.
    """
    turn = onboard.state.turn
    if turn.factored == 0:
        return False
    y, before = turn.unknowns, turn.before
    for k in range(TURN_UNKNOWNS):
        before[k] = y[k]
    for _ in range(STEPS_BY_LAST):
        for k in range(TURN_UNKNOWNS):
            turn.step[k] = -turn.rows[0, k]
        back_substitute(TURN_UNKNOWNS, turn.matrix, turn.pivots, turn.step)
        for k in range(TURN_UNKNOWNS):
            y[k] += turn.step[k]
        y[6] = possible_cutoff(onboard.state, y[6] * turn.time_scale) / turn.time_scale
        after = residuals(mission, onboard, 0)
        if after < MET_BY_LAST:
            return True
        if not after < 0.1 * merit:
            break
        merit = after
    for k in range(TURN_UNKNOWNS):
        y[k] = before[k]
    residuals(mission, onboard, 0)
    return False


@kernel
def set_gradient(solution: Record, r: Vector, t_go: float, mu: float) -> None:
    """Set the mean gravity gradient between the present position and the solution's end.

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
def initialize_unknowns(mission: MissionRecords, onboard: Onboard) -> None:
    """Initialize the unknowns, their scales and the gravity gradient from the present solution."""
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
def write_solution(mission: MissionRecords, onboard: Onboard) -> None:
    """Write the solution from the unknowns."""
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
    """Solve for a large turn, starting from the present solution.

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
    initialize_unknowns(mission, onboard)
    moved = math.inf
    merit = math.inf
    for _ in range(min(STEPS, onboard.settings.max_iterations)):
        if moved > 0.0:
            plan_segments(mission, onboard)
            merit = residuals(mission, onboard, 0)
        if math.isfinite(merit):
            if meets_by_last(mission, onboard, merit):
                merit = MET_BY_LAST
            else:
                merit = newton_step(mission, onboard, merit)
        state.iterations += 1
        solution.miss_speed = merit * state.turn.speed_scale
        if not math.isfinite(merit):
            break
        write_solution(mission, onboard)
        steering = LinearTangent(load(solution.direction), load(solution.direction_rate), 0.0)
        moved = predict_jettisons(mission, onboard, steering)
        if merit < MET and moved < onboard.settings.jettison_time_tolerance:
            angle = solution.primer.gradient * solution.time_to_go
            return ERROR_NONE if angle < FARTHEST or state.leg.count > 0 else ERROR_NOT_CONVERGED
    return ERROR_NOT_CONVERGED


@kernel
def lofted_guess(mission: MissionRecords, onboard: Onboard, loft: float) -> None:
    """Guess a steering from ``loft``, rad, above the horizontal to as much below it at cut-off."""
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
    """Solve for a large turn from guesses of increasing loft; return the error of the last."""
    for loft in LOFTS:
        lofted_guess(mission, onboard, loft)
        if converge_large_turn(mission, onboard) == ERROR_NONE:
            return ERROR_NONE
    return ERROR_NOT_CONVERGED


@kernel
def pull_downrange(mission: MissionRecords, onboard: Onboard, pull: float, least: float) -> bool:
    """Find the downrange multiplier for which the thrust lasts ``least`` s.

    Near the optimum the time to go grows with the square of the multiplier.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance, the optimum in ``shortest`` too. Changed.
        pull: first multiplier.
        least: time to go, s, more than that of the optimum.

    Returns:
        whether the time to go is close to ``least``.
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
    """Solve for a prescribed time to go, ``least`` s, longer than that of the optimum.

    This spends surplus delta-V of the burns before the last. The multiplier of the free downrange
    position becomes an unknown in place of the time.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance, with a solution. Changed.
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
