# SPDX-License-Identifier: Apache-2.0
"""Tabulate the quantities along a flight, flown in closed loop or optimal.

Angles are in degrees: these columns are for people.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_guidance.law import Law
from ares_models.arrays import MissionArrays
from ares_models.kernels.environment import altitude
from ares_models.kernels.states import insertion_quantities
from ares_models.mission import Mission
from ares_models.units import NANOSECONDS
from ares_optimizer.solution import Solution
from ares_studies.closed_loop import Flight
from ares_vehicle_sim.simulator import Simulator

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FlightHistory:
    """Hold the columns of one flight, shape (n,) each.

    Attributes:
        time_s: mission elapsed time; may repeat at an event, before and after.
        radius_m: from the Earth's centre.
        altitude_m: above the ground as defined by the mission (Eq. 2.15).
        speed_m_s: inertial.
        flight_path_angle_deg: of the inertial velocity.
        mass_kg, thrust_n: of the vehicle.
        pitch_deg: thrust above the horizon, in the vertical plane of the velocity (Fig. 4.8).
        heating_w_m2: free molecular heating.
        inclination_deg, ascending_node_deg: of the orbital plane, node from the inertial x axis.
    """

    time_s: Array
    radius_m: Array
    altitude_m: Array
    speed_m_s: Array
    flight_path_angle_deg: Array
    mass_kg: Array
    thrust_n: Array
    pitch_deg: Array
    heating_w_m2: Array
    inclination_deg: Array
    ascending_node_deg: Array


@dataclass(frozen=True)
class History(FlightHistory):
    """Hold a flown closed-loop flight.

    Attributes:
        predicted_jettison_s: guidance's prediction of the next timed jettison; nan: none.
        predicted_cutoff_s: guidance's prediction of the cut-off; nan: unknown.
        flight: its end.
    """

    predicted_jettison_s: Array
    predicted_cutoff_s: Array
    flight: Flight


def pitch_deg(position: Array, velocity: Array, direction: Array) -> Array:
    """Compute the pitch of the thrust: above the horizon, projected into the vertical plane.

    Args:
        position: shape (n, 3), m.
        velocity: shape (n, 3), m/s; spans the plane with the position.
        direction: shape (n, 3), unit vectors.

    Returns:
        Shape (n,), deg.
    """
    up = position / np.linalg.norm(position, axis=1, keepdims=True)
    along = velocity - np.sum(velocity * up, axis=1, keepdims=True) * up
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.degrees(np.arctan2(np.sum(direction * up, axis=1), np.sum(direction * along, axis=1)))


def _columns(arrays: MissionArrays, position: Array, velocity: Array) -> dict[str, Array]:
    """Compute the columns that follow from position (n, 3) and velocity (n, 3) alone."""
    environment = arrays.environment[0]
    pairs = zip(position.tolist(), velocity.tolist(), strict=True)
    insertion = np.array([insertion_quantities(tuple(r), tuple(v)) for r, v in pairs])
    return {
        "radius_m": insertion[:, 0],
        "altitude_m": np.array([altitude(tuple(r), environment) for r in position.tolist()]),
        "speed_m_s": insertion[:, 1],
        "flight_path_angle_deg": np.degrees(insertion[:, 2]),
        "inclination_deg": np.degrees(insertion[:, 3]),
        "ascending_node_deg": np.degrees(insertion[:, 4]),
    }


def profile_of(mission: Mission, solution: Solution) -> FlightHistory:
    """Tabulate an optimal ascent.

    Args:
        mission: solved, from its own start.
        solution: with a trajectory.

    Raises:
        ValueError: the solution has no trajectory.
    """
    track = solution.trajectory
    if track is None:
        raise ValueError(f"{solution.method} has no trajectory: {solution.reason}")
    arrays = mission.arrays()
    return FlightHistory(
        time_s=track.time_s,
        mass_kg=track.mass,
        thrust_n=track.thrust,
        pitch_deg=pitch_deg(track.position, track.velocity, track.direction),
        heating_w_m2=track.heating_rate,
        **_columns(arrays, track.position, track.velocity),
    )


def record_flight(mission: Mission, law: Law) -> History:
    """Fly a mission with perfect navigation through the objects that the nodes use.

    Args:
        mission: to be flown.
        law: unused, made for this mission.

    Returns:
        A row per navigation state, with the command that answered it, and one for the end.
    """
    simulator = Simulator(mission)
    rows = []
    predictions = []
    while True:
        if not simulator.complete:
            law.step(simulator.navigation)
            simulator.command(law.steering)
        command = law.steering[0]
        time = simulator.time_ns / NANOSECONDS
        truth = simulator.truth()
        direction = command["direction"] + command["direction_rate"] * (
            time - command["reference_time"]
        )
        rows.append(
            np.concatenate(
                (
                    truth["position"],
                    truth["velocity"],
                    direction,
                    [time, truth["mass"], truth["thrust"], truth["heating_rate"]],
                )
            )
        )
        predictions.append((float(command["jettison_time"]), float(command["cutoff_time"])))
        if simulator.complete:
            break
        simulator.advance()
    table = np.array(rows)
    return History(
        time_s=table[:, 9],
        mass_kg=table[:, 10],
        thrust_n=table[:, 11],
        pitch_deg=pitch_deg(table[:, :3], table[:, 3:6], table[:, 6:9]),
        heating_w_m2=table[:, 12],
        **_columns(mission.arrays(), table[:, :3], table[:, 3:6]),
        predicted_jettison_s=np.array([jettison for jettison, _ in predictions]),
        predicted_cutoff_s=np.array([cutoff for _, cutoff in predictions]),
        flight=Flight(simulator.plant, law.state),
    )
