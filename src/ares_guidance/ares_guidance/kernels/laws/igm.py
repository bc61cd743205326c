# SPDX-License-Identifier: Apache-2.0
"""One pass of the Iterative Guidance Mode, the law that flew the Saturn V.

Sources: Chandler and Smith, "Development of the Iterative Guidance Mode with Its
Application to Various Vehicles and Missions", J. Spacecraft 4 (1967); Horn, Chandler and
Buckelew, "Iterative Guidance Applied to Generalized Missions", J. Spacecraft 6 (1969);
Haeussermann, NASA TN D-5869 (1970), section on the guidance equations; the Saturn V
guidance equations of Boeing, D5-15706 (1967), in the groups named below.

Pitch and yaw are linear in time about chi-tilde, the direction that would be optimal were
only velocity constrained. docs/igm.md says where this goes beyond the law as flown.
"""

import math

from ares_guidance.arrays import STEEPEST, Onboard
from ares_guidance.kernels.laws.near import may_release_place
from ares_guidance.kernels.laws.peg import iterate as iterate_by_peg
from ares_guidance.kernels.prediction.burn import LinearTangent
from ares_guidance.kernels.prediction.jettison import predict_jettisons
from ares_guidance.kernels.prediction.segments import (
    Integrals,
    burn_time_to_go,
    note_tail_off,
    thrust_integrals,
)
from ares_models.arrays import MissionRecords, Record
from ares_models.jit import kernel
from ares_models.kernels.environment import gravity
from ares_models.kernels.targets import (
    aim_at_radius,
    desired_state,
    leaves_place_free,
    plane_normal,
    project_to_plane,
)
from ares_models.kernels.vectors import (
    Vector,
    add,
    axpy,
    cross,
    dot,
    load,
    norm,
    scale,
    store,
    sub,
    unit,
)

#: Terminal frame: xi up, eta along the angular momentum, zeta downrange at the cut-off point.
Frame = tuple[Vector, Vector, Vector]


@kernel
def thrust_direction(frame: Frame, pitch: float, yaw: float) -> Vector:
    """Return the unit vector at a pitch above the terminal horizontal and a yaw, both rad."""
    xi, eta, zeta = frame
    ahead = add(scale(math.sin(pitch), xi), scale(math.cos(pitch), zeta))
    return add(scale(math.cos(yaw), ahead), scale(math.sin(yaw), eta))


@kernel
def thrust_turn(
    frame: Frame, pitch: float, yaw: float, pitch_rate: float, yaw_rate: float
) -> Vector:
    """Return the rate of :func:`thrust_direction`, 1/s, normal to it, for rates in rad/s."""
    xi, eta, zeta = frame
    ahead = add(scale(math.sin(pitch), xi), scale(math.cos(pitch), zeta))
    above = sub(scale(math.cos(pitch), xi), scale(math.sin(pitch), zeta))
    aside = sub(scale(math.cos(yaw), eta), scale(math.sin(yaw), ahead))
    return add(scale(pitch_rate * math.cos(yaw), above), scale(yaw_rate, aside))


@kernel
def within_limit(turn: float) -> float:
    """Clip a turn, rad, to the validity of the small-angle expansion."""
    return min(max(turn, -STEEPEST), STEEPEST)


@kernel
def yaw_terms(miss: float, yaw: float, integrals: Integrals) -> tuple[float, float]:
    """Compute the "yaw steering parameters" K3, K4 of chi_y(t) = chi-tilde_y - K3 + K4 t.

    K4 / K3 = L / J, so that to first order they give no velocity.

    Args:
        miss: out-of-plane distance at cut-off under chi-tilde alone, m.
        yaw: chi-tilde_y, rad.
        integrals: of :func:`thrust_integrals`.

    Returns:
        K3 in rad, K4 in rad/s.
    """
    l_sum, j_sum, s_sum, q_sum, _, _ = integrals
    ratio = l_sum / j_sum
    k_3 = within_limit(miss / ((s_sum - ratio * q_sum) * math.cos(yaw)))
    return k_3, ratio * k_3


@kernel
def pitch_integrals(
    yaw: float, k_3: float, k_4: float, integrals: Integrals
) -> tuple[float, float, float]:
    """Project the thrust integrals into the plane, to first order in K3 and K4.

    Args:
        yaw: chi-tilde_y, rad.
        k_3: rad.
        k_4: rad/s.
        integrals: of :func:`thrust_integrals`; its H is what IGM calls P, its P is U.

    Returns:
        S_P in m, Q_P in m s, and K_P = L_P / J_P in 1/s.
    """
    l_sum, j_sum, s_sum, q_sum, u_sum, p_sum = integrals
    c_2 = math.cos(yaw) + k_3 * math.sin(yaw)
    c_4 = k_4 * math.sin(yaw)
    j_p = j_sum * c_2 - p_sum * c_4
    return s_sum * c_2 - q_sum * c_4, q_sum * c_2 - u_sum * c_4, l_sum * math.cos(yaw) / j_p


@kernel
def terminal_frame(mission: MissionRecords, solution: Record) -> tuple[Frame, Vector, Vector]:
    """Compute the "rotation to terminal coordinates", at the cut-off point of the last pass.

    Returns:
        the frame, wanted position m and velocity m/s.
    """
    eta = load(solution.plane_normal)
    point = project_to_plane(load(solution.desired_position), eta)
    wanted_r, wanted_v, zeta = desired_state(mission.target, mission.environment.mu, point, eta)
    return (unit(wanted_r), eta, zeta), wanted_r, wanted_v


@kernel
def estimated_time_to_go(
    state: Record, estimate: float, gain: Vector, mean_gravity: Vector
) -> tuple[Vector, float]:
    """Compute velocity-to-go, m/s, and "estimated time-to-go", s.

    Args:
        state: record GUIDANCE_STATE.
        estimate: time to go of the last pass, s.
        gain: wanted change of the velocity, m/s.
        mean_gravity: m/s2.
    """
    v_go = axpy(-(estimate + state.solution.tail_drift), mean_gravity, gain)
    t_go, _ = burn_time_to_go(state, norm(v_go))
    return axpy(estimate - t_go, mean_gravity, v_go), t_go


@kernel
def chi_tilde(frame: Frame, v_go: Vector) -> tuple[float, float]:
    """Return pitch and yaw of the velocity-to-go, rad."""
    xi, eta, zeta = frame
    up, ahead = dot(v_go, xi), dot(v_go, zeta)
    yaw = math.atan2(dot(v_go, eta), math.sqrt(up * up + ahead * ahead))
    return math.atan2(up, ahead), yaw


@kernel
def store_cutoff(state: Record, r: Vector, v: Vector, normal: Vector) -> None:
    """Store the predicted cut-off, which places the next terminal frame."""
    store(state.solution.desired_position, r)
    store(state.solution.plane_normal, normal)
    store(state.predicted_position, r)
    store(state.predicted_velocity, v)


@kernel
def iterate(mission: MissionRecords, onboard: Onboard) -> tuple[float, float, bool]:
    """Run one pass: terminal frame, time to go, chi-tilde, K1 to K4, range angle.

    Args: as in :func:`ares_guidance.kernels.cycle.guidance_step`.

    Returns:
        change of velocity-to-go m/s, change of the jettison time s, whether the
        target plane passes through the predicted point.
    """
    leg = onboard.state.leg
    if leg.coasting == 1 and leg.time_to_go <= onboard.settings.hold_time:
        # held all along, so short a burn has no turn in which this law would meet the place
        return iterate_by_peg(mission, onboard)
    environment = mission.environment
    target = mission.target
    nav = onboard.navigation
    state = onboard.state
    solution = state.solution
    r = load(nav.position)
    v = load(nav.velocity)
    before = load(solution.velocity_to_go)
    estimate, last = burn_time_to_go(state, norm(before))
    note_tail_off(mission.arcs[state.segments[last].arc], state)

    frame, wanted_r, wanted_v = terminal_frame(mission, solution)
    xi, eta, zeta = frame
    mean_gravity = scale(0.5, add(gravity(r, environment), gravity(wanted_r, environment)))
    v_go, t_go = estimated_time_to_go(state, estimate, sub(wanted_v, v), mean_gravity)
    solution.time_to_go = t_go
    horizon = t_go + solution.tail_drift
    integrals = thrust_integrals(state, horizon, t_go)
    l_sum, j_sum, s_sum = integrals[0], integrals[1], integrals[2]

    pitch, yaw = chi_tilde(frame, v_go)
    # "yaw" and "pitch steering parameters"
    coast = axpy(horizon, v, axpy(0.5 * horizon * horizon, mean_gravity, r))
    k_3, k_4 = yaw_terms(dot(coast, eta) + s_sum * math.sin(yaw), yaw, integrals)
    s_p, q_p, ratio = pitch_integrals(yaw, k_3, k_4, integrals)
    d_p = s_p - ratio * q_p
    risen = dot(coast, xi) + s_p * math.sin(pitch)
    k_1 = within_limit((risen - norm(wanted_r)) / (d_p * math.cos(pitch)))
    k_2 = ratio * k_1
    solution.turn = max(abs(k_1), abs(k_3))
    solution.released = 1 if may_release_place(mission, onboard, abs(k_1), risen) else 0
    if solution.released == 1:
        if leaves_place_free(target):
            aim_at_radius(target, risen)
        else:
            k_1 = k_2 = k_3 = k_4 = 0.0

    # the prediction is expanded about chi-tilde, which the flown chi equals at t = J / L
    middle = thrust_direction(frame, pitch, yaw)
    turn = thrust_turn(frame, pitch, yaw, k_2, k_4)
    moved = predict_jettisons(mission, onboard, LinearTangent(middle, turn, j_sum / l_sum))

    # "range angle": the downrange distance of these integrals places the next terminal frame
    beyond = dot(coast, zeta) + s_p * math.cos(pitch) + d_p * k_1 * math.sin(pitch)
    r_p = axpy(beyond, zeta, wanted_r)
    normal, reachable = plane_normal(target, r_p, cross(r_p, wanted_v))
    store(solution.velocity_to_go, v_go)
    store_cutoff(state, r_p, wanted_v, normal)
    store(solution.direction, thrust_direction(frame, pitch - k_1, yaw - k_3))
    store(solution.direction_rate, thrust_turn(frame, pitch - k_1, yaw - k_3, k_2, k_4))
    solution.reference_time = nav.time
    return norm(sub(v_go, before)), moved, reachable
