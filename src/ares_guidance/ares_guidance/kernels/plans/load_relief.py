# SPDX-License-Identifier: Apache-2.0
"""Relieve the loads of the boost by the wind that the accelerometers feel.

Across the thrust axis the thrust has no part in what is sensed, and the force of the air is in
proportion to the velocity in the air across that axis (`ares_models/kernels/aerodynamics.py`). That
velocity against the believed one is the wind. The thrust then turns from the programme by a gain
times the angle between the flown velocity in the air and the planned one; the gain is computed off
line (`ares_guidance/load_relief.py`).
"""

from ares_guidance.arrays import Onboard
from ares_models.arrays import MissionRecords
from ares_models.jit import kernel
from ares_models.kernels.aerodynamics import air_at, shares_of_force
from ares_models.kernels.environment import air_velocity, altitude, density, gravity
from ares_models.kernels.steering import steered_direction
from ares_models.kernels.vectors import Vector, add, axpy, dot, load, norm, scale, store, sub, unit

#: Greatest turn from the programme, rad.
MOST_TURN = 0.2
#: Dynamic pressure over the limit of q alpha from which on the wind is estimated.
LEAST_PRESSURE = 2.0
#: Passes in which the speed in the air and the angle of attack of an estimate settle.
PASSES = 3


@kernel
def remember(onboard: Onboard) -> None:
    """Keep the present state and its answer for the next estimate.

    Args:
        onboard: state of guidance. Changed.
    """
    nav = onboard.navigation
    programme = onboard.state.programme
    programme.last_time = nav.time
    programme.last_arc = nav.arc
    programme.last_mass = nav.mass
    store(programme.last_sensed, load(nav.sensed_delta_v))
    programme.sent = onboard.steering


@kernel
def estimate_wind(mission: MissionRecords, onboard: Onboard) -> None:
    """Estimate the wind beyond the mission's across the thrust axis, m/s: ``programme.wind``.

    It is the mean since the last navigation state. Where an arc has begun since, the mass of the
    vehicle is not known, or the air has no force across the axis, the last estimate stays.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance. Changed.
    """
    nav = onboard.navigation
    programme = onboard.state.programme
    environment = mission.environment
    arc = mission.arcs[nav.arc]
    since = nav.time - programme.last_time
    if nav.arc != programme.last_arc or not (since > 0.0 and programme.last_mass > 0.0):
        return
    sensed = scale(1.0 / since, sub(load(nav.sensed_delta_v), load(programme.last_sensed)))
    half = 0.5 * since
    v = axpy(-half, add(sensed, gravity(load(nav.position), environment)), load(nav.velocity))
    r = axpy(-half, v, load(nav.position))
    axis = steered_direction(programme.sent, nav.time - half)
    mass = 0.5 * (programme.last_mass + nav.mass)
    felt = scale(mass, axpy(-dot(sensed, axis), axis, sensed))
    air = air_at(altitude(r, environment), environment, mission.atmosphere)
    believed = air_velocity(r, v, environment)
    along = dot(believed, axis)
    believed_across = axpy(-along, axis, believed)
    across = believed_across
    for _ in range(PASSES):
        speed = norm(axpy(along, axis, across))
        shares = shares_of_force(arc, speed / air.sound, along / speed)
        k = 0.5 * air.density * arc.drag_area * shares.p * speed
        if not k > 0.0:
            return
        across = scale(-1.0 / k, felt)
    store(programme.wind, sub(believed_across, across))


@kernel
def relieved(
    mission: MissionRecords, onboard: Onboard, direction: Vector, gain: float, planned: Vector
) -> Vector:
    """Return the thrust direction of the programme, turned for the wind; unit vector.

    Args:
        mission: as guidance believes it.
        onboard: state of guidance; the estimate of the wind is changed.
        direction: of the thrust by the programme, unit vector.
        gain: turn of the thrust per turn of the velocity in the air.
        planned: direction of the velocity in the air, unit vector.
    """
    nav = onboard.navigation
    environment = mission.environment
    r, v = load(nav.position), load(nav.velocity)
    believed = air_velocity(r, v, environment)
    pressure = 0.5 * density(r, environment, mission.atmosphere) * dot(believed, believed)
    if pressure < LEAST_PRESSURE * mission.arcs[nav.arc].max_q_alpha:
        return direction
    estimate_wind(mission, onboard)
    flown = unit(sub(believed, load(onboard.state.programme.wind)))
    turn = scale(gain, sub(flown, planned))
    much = norm(turn) / MOST_TURN
    if much > 1.0:
        turn = scale(1.0 / much, turn)
    return unit(add(direction, turn))
