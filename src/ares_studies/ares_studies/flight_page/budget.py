# SPDX-License-Identifier: Apache-2.0
"""Compute the delta-V budget of a flight, and the propellant left."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_models.kernels.aerodynamics import body_force, pressure_loss
from ares_models.kernels.environment import density, gravity
from ares_models.kernels.sequence import loaded_mass
from ares_models.mission import Mission
from ares_models.plans import flies_in_air

Array = NDArray[np.float64]

#: Thrust, N, below which both ends of a time step make it a coast, which adds no delta-V.
_NO_THRUST_N = 1e-6


@dataclass(frozen=True)
class Budget:
    """Hold a delta-V budget, m/s; all except `left_m_s` are sums over the flight.

    The speed gained is ideal minus gravity minus steering minus drag minus pressure.

    Attributes:
        ideal_m_s: integral of the thrust acceleration in vacuum.
        gravity_m_s: integral of gravity against the inertial velocity.
        steering_m_s: integral of the thrust acceleration times 1 - cos(angle to the velocity).
        drag_m_s: integral of the drag acceleration against the inertial velocity.
        pressure_m_s: integral of the acceleration that ambient pressure takes from the thrust.
        gained_m_s: inertial speed at the end minus that at the begin.
        left_m_s: delta-V of the propellant left in the last stage; nan: unknown.
        left_kg: that propellant; nan: unknown.
    """

    ideal_m_s: float
    gravity_m_s: float
    steering_m_s: float
    drag_m_s: float
    pressure_m_s: float
    gained_m_s: float
    left_m_s: float
    left_kg: float

    @property
    def open_m_s(self) -> float:
        """Return the residual of the sum: the error of the quadrature."""
        losses = self.gravity_m_s + self.steering_m_s + self.drag_m_s + self.pressure_m_s
        return self.ideal_m_s - losses - self.gained_m_s


def propellant_left(
    mass: Array, arc: NDArray[np.integer], jettisoned: NDArray[np.integer], arrays: MissionArrays
) -> Array:
    """Compute the propellant left in the running stage from the mission's masses, kg.

    Args:
        mass: shape (n,), kg.
        arc: shape (n,), index of the arc.
        jettisoned: shape (n,), bit k is set when jettison k is done.
        arrays: of the mission.

    Returns:
        Shape (n,); nan in an arc that the mission does not have.
    """
    arcs, jettisons = arrays.arcs, arrays.jettisons
    empty = {}
    for k, gone in set(zip(arc.tolist(), jettisoned.tolist(), strict=True)):
        if k < len(arcs):
            loaded = loaded_mass(int(arcs[k]["stage"]), arcs, jettisons, gone)
            empty[k, gone] = float(loaded) - float(arcs[k]["propellant"])
    pairs = zip(arc.tolist(), jettisoned.tolist(), strict=True)
    return mass - np.array([empty.get(pair, math.nan) for pair in pairs])


def make_budget(truth: Mapping[str, NDArray[Any]], left: Array, mission: Mission) -> Budget:
    """Integrate the delta-V budget.

    Between two states position is the cubic through both, gravity is integrated by Simpson's rule,
    and the remaining change of velocity is due to thrust and drag. The drag is linear between two
    states.

    Args:
        truth: columns of VehicleState, with `time` in s, n rows.
        left: propellant left in the running stage, shape (n,), kg.
        mission: source of the gravity model.
    """
    time, thrust = truth["time"], truth["thrust"]
    position, velocity = truth["position"], truth["velocity"]
    arrays = mission.arrays()
    mass, exhaust = float(truth["mass"][-1]), float(arrays.arcs[-1]["exhaust_velocity"])
    environment = arrays.environment[0]
    step = np.diff(time)[:, None]
    moved = step[:, 0] > 0.0
    step, r, v = step[moved], position[:-1][moved], velocity[:-1][moved]
    r_next, v_next = position[1:][moved], velocity[1:][moved]
    middle = 0.5 * (r + r_next) + step / 8.0 * (v - v_next)
    v_middle = 1.5 * (r_next - r) / step - 0.25 * (v + v_next)
    pulls = [
        np.array([gravity(tuple(place), environment) for place in places.tolist()]).reshape(-1, 3)
        for places in (r, middle, r_next)
    ]
    pulled = step / 6.0 * (pulls[0] + 4.0 * pulls[1] + pulls[2])
    dragged, pressed = _air(truth, arrays)
    slowed = 0.5 * step * (dragged[:-1][moved] + dragged[1:][moved])
    pushed = v_next - v - pulled - slowed
    burns = np.maximum(thrust[:-1][moved], thrust[1:][moved]) > _NO_THRUST_N
    along = [_unit(x) for x in (v, v_middle, v_next)]
    down = [np.sum(g * u, axis=1) for g, u in zip(pulls, along, strict=True)]
    given = np.where(burns, np.linalg.norm(pushed, axis=1), 0.0)
    useful = np.where(burns, np.sum(pushed * along[1], axis=1), 0.0)
    dry = mass - float(left[-1])
    pressure = float(np.sum(0.5 * step[:, 0] * (pressed[:-1][moved] + pressed[1:][moved])))
    return Budget(
        ideal_m_s=float(np.sum(given)) + pressure,
        gravity_m_s=-float(np.sum(step[:, 0] / 6.0 * (down[0] + 4.0 * down[1] + down[2]))),
        steering_m_s=float(np.sum(given - useful)),
        drag_m_s=-float(np.sum(slowed * along[1])),
        pressure_m_s=pressure,
        gained_m_s=float(np.linalg.norm(velocity[-1]) - np.linalg.norm(velocity[0])),
        left_m_s=exhaust * math.log(mass / dry) if dry > 0.0 else math.nan,
        left_kg=float(left[-1]),
    )


def _air(truth: Mapping[str, NDArray[Any]], arrays: MissionArrays) -> tuple[Array, Array]:
    """Return the accelerations of the air, m/s2, by the mission's model at the true density.

    Args:
        truth: columns of VehicleState, n rows; without ``density`` it is that of the model.
        arrays: of the mission.

    Returns:
        by drag, shape (n, 3), and by the pressure on the nozzles under thrust, shape (n,).
    """
    mass = truth["mass"]
    dragged, pressed = np.zeros((len(mass), 3)), np.zeros(len(mass))
    if not flies_in_air(arrays.arcs):
        return dragged, pressed
    surroundings = arrays.environment[0], arrays.atmosphere
    columns = ("arc", "position", "velocity", "thrust_direction")
    for i, (k, r, v, u) in enumerate(zip(*(truth[name].tolist() for name in columns), strict=True)):
        arc, place = arrays.arcs[min(k, len(arrays.arcs) - 1)], tuple(r)
        dragged[i] = body_force(arc, place, tuple(v), tuple(u), *surroundings)
        if "density" in truth:
            dragged[i] *= truth["density"][i] / density(place, *surroundings)
        if truth["thrust"][i] > _NO_THRUST_N:
            pressed[i] = pressure_loss(arc, place, *surroundings)
    return dragged / mass[:, None], pressed / mass


def _unit(vectors: Array) -> Array:
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(size > 0.0, size, 1.0))
