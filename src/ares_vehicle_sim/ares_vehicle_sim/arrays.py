# SPDX-License-Identifier: Apache-2.0
"""Structured dtypes of the plant and of a simulated flight."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MAX_JETTISONS, MAX_PIECES, NAVIGATION, STEERING, WIND, Record

#: Capacity for the longest possible sequence of a mission; a test covers it.
MAX_EVENTS = 128

#: Largest number of stages of a variation.
MAX_STAGES = 8

FLIGHT_STARTED = 1
IGNITION = 2
ARC_ENDED = 3
STAGING = 4
JETTISON_DONE = 5
CUTOFF = 6
DEPLETION = 7
FLIGHT_COMPLETE = 8
IMPACT = 9
TIME_LIMIT = 10
# events of the node
GUIDANCE_LOST = 11
GUIDANCE_BACK = 12
# further events of the plant
FAILED = 13
JETTISON_STUCK = 14
OVER_LIMIT = 15

EVENT = np.dtype(
    [
        ("type", np.int64),
        ("index", np.int64),  # arc, stage or jettison, by type
        ("time", np.float64),
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("mass", np.float64),  # after the event
        ("heating_rate", np.float64),
    ],
    align=True,
)

OPTIONS = np.dtype(
    [
        ("max_step", np.float64),  # s, of the integrator
        ("attitude_rate_limit", np.float64),  # rad/s; inf: the thrust follows immediately
        ("navigation_period", np.float64),  # s between navigation states
    ],
    align=True,
)

NAVIGATION_ERRORS = np.dtype(
    [
        ("active", np.int64),  # 0: navigation reports the truth
        # constant in a flight
        ("position_bias", np.float64, (3,)),  # m
        ("velocity_bias", np.float64, (3,)),  # m/s
        ("sensed_delta_v_scale", np.float64, (3,)),  # fraction
        ("mass_scale", np.float64),  # fraction
        ("heating_scale", np.float64),  # fraction
        # one sigma, drawn at every state
        ("position_noise", np.float64),  # m, per axis
        ("velocity_noise", np.float64),  # m/s, per axis
        ("heating_noise", np.float64),  # fraction
        # noise is a function of seed, flight and number of the state
        ("seed", np.uint64),
        ("flight", np.uint64),
    ],
    align=True,
)

#: Differences of the truth of one flight from the mission file. Fractions are added to 1.
VARIATION = np.dtype(
    [
        ("position", np.float64, (3,)),  # m, added to the initial state
        ("velocity", np.float64, (3,)),  # m/s
        ("thrust", np.float64, (MAX_STAGES,)),  # fraction, per stage
        ("specific_impulse", np.float64, (MAX_STAGES,)),
        ("stage_mass", np.float64, (MAX_STAGES,)),  # fraction of the stage's own mass
        ("propellant", np.float64, (MAX_STAGES,)),  # fraction of the loaded propellant
        ("jettison_mass", np.float64, (MAX_JETTISONS,)),
        ("jettison_limit", np.float64, (MAX_JETTISONS,)),  # fraction of the heating limit
        ("log_density", np.float64),  # logarithm of a factor
        ("windy", np.int64),  # 1: the wind is this one, not the mission's
        ("wind", WIND),
        ("start_delay", np.float64, (MAX_STAGES,)),  # s
        ("start_scale", np.float64, (MAX_STAGES,)),  # fraction of the start's duration
        ("latency", np.float64),  # s from navigation state to command in force
        ("errors", NAVIGATION_ERRORS),
        ("ballistic_coefficient", np.float64, (MAX_PIECES,)),  # fraction, per piece
    ],
    align=True,
)

NO_FAILURE = 0
ENGINE_OUT = 1
THRUST_LOW = 2
EARLY_SHUTDOWN = 3
FAILED_IGNITION = 4
STUCK_THROTTLE = 5
STUCK_JETTISON = 6

#: Status of a failure: it has happened; it struck when nothing could fail, such as in a coast.
STRUCK = 1
IN_VAIN = 2

#: Failure of a flight, see `ares_models.failures.Failure`.
FAILURE = np.dtype(
    [
        ("kind", np.int64),  # NO_FAILURE or another of the above
        ("time", np.float64),  # s; inf: the kind has no time
        ("arc", np.int64),  # burn that does not ignite, or with the stuck throttle; -1: none
        ("jettison", np.int64),  # stuck jettison; -1: none
        ("thrust_ratio", np.float64),
        ("flow_ratio", np.float64),
        ("struck", np.int64),  # 0: not yet; STRUCK or IN_VAIN
        # kg, mass at which the stuck throttle's acceleration exceeds its limit; 0: none, or past
        ("over_mass", np.float64),
    ],
    align=True,
)

#: True state of the plant; has the fields of SEQUENCE.
PLANT = np.dtype(
    [
        ("time", np.float64),
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("mass", np.float64),
        ("sensed_delta_v", np.float64, (3,)),
        ("altitude", np.float64),
        ("heating_rate", np.float64),
        ("arc", np.int64),
        ("arc_start_time", np.float64),
        ("ignited_stage", np.int64),  # stage ignited last; -1: none
        ("ignition_time", np.float64),  # of that stage
        ("propellant_used", np.float64),  # kg, by the present stage
        ("tail_arc", np.int64),  # arc in its tail-off; -1: none
        ("tail_start_time", np.float64),
        ("jettisoned", np.int64),  # bit k: jettison k is done
        ("jettison_time", np.float64, (8,)),  # commanded; nan: not yet
        ("complete", np.int64),
        ("inserted", np.int64),  # cut off by command, not by depletion
        ("direction", np.float64, (3,)),  # of the thrust, unit
        ("held_direction", np.float64, (3,)),  # commanded at the ignition of a held burn
        ("command", STEERING),  # in force
        ("latency", np.float64),  # s from a command's arrival to its effect
        ("pending", STEERING),  # command that is not in force yet
        ("pending_time", np.float64),  # time of its effect; inf: none is pending
        ("failure", FAILURE),
        ("errors", NAVIGATION_ERRORS),
        ("measurements", np.uint64),  # navigation states so far
        # since the last heating jettison; 0 before any
        ("peak_heating_after_jettison", np.float64),
        # greatest so far, and as fractions of the limits of the arcs; 0: no air, no limit
        ("most_dynamic_pressure", np.float64),  # Pa
        ("most_q_alpha", np.float64),  # Pa, q times the sine of the angle of attack
        ("dynamic_pressure_share", np.float64),
        ("q_alpha_share", np.float64),
        ("event_count", np.int64),
        ("events", EVENT, (MAX_EVENTS,)),
    ],
    align=True,
)

TRUTH = np.dtype(
    [
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("mass", np.float64),
        ("thrust_direction", np.float64, (3,)),
        ("thrust", np.float64),
        ("mass_flow", np.float64),
        ("altitude", np.float64),
        ("relative_speed", np.float64),
        ("flight_path_angle", np.float64),
        ("inclination", np.float64),
        ("ascending_node", np.float64),
        ("density", np.float64),
        ("dynamic_pressure", np.float64),
        ("mach", np.float64),
        ("angle_of_attack", np.float64),
        ("axial_acceleration", np.float64),
        ("lateral_acceleration", np.float64),
        ("heating_rate", np.float64),
        ("arc", np.int64),
        ("jettisoned", np.int64),
    ],
    align=True,
)


class VehicleArrays(NamedTuple):
    """Hold the arrays of a simulated flight.

    Attributes:
        options: shape (1,), dtype OPTIONS.
        plant: shape (1,), dtype PLANT, the true state.
        navigation: shape (1,), dtype NAVIGATION, the navigated state.
        truth: shape (1,), dtype TRUTH, the true state in the fields of VehicleState.
    """

    options: NDArray[Any]
    plant: NDArray[Any]
    navigation: NDArray[Any]
    truth: NDArray[Any]


class Vehicle(NamedTuple):
    """Hold the records of `VehicleArrays`, as kernels pass them on."""

    options: Record
    plant: Record
    navigation: Record
    truth: Record


def blank_vehicle(options: NDArray[Any]) -> VehicleArrays:
    """Return the arrays of a flight, all zero except the options."""
    return VehicleArrays(options, np.zeros(1, PLANT), np.zeros(1, NAVIGATION), np.zeros(1, TRUTH))
