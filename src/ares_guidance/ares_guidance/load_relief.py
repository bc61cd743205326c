# SPDX-License-Identifier: Apache-2.0
"""Gains by which the thrust is turned for the wind in the boost."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_guidance.trajectory import OfflineTrajectory
from ares_models.arrays import BURN, MissionArrays
from ares_models.kernels.environment import air_velocity, density, gravity

Array = NDArray[np.float64]

#: Weight of a turn of 1 rad against a q alpha at its limit.
TURN_WEIGHT = 60.0
#: Step of the Riccati equation, s.
STEP_S = 0.1


def plan_relief(trajectory: OfflineTrajectory, arrays: MissionArrays) -> tuple[Array, Array]:
    """Return the direction of the planned velocity in the air, and the relief, at each sample.

    Returns:
        unit vectors, shape (n, 3), and gains, shape (n,), as of :func:`relief_gains`; all 0 where
        no burn has a limit of q alpha.
    """
    count = len(trajectory.sample_time)
    if not np.isfinite(arrays.arcs["max_q_alpha"]).any():
        return np.zeros((count, 3)), np.zeros(count)
    environment = arrays.environment[0]
    flown = zip(trajectory.sample_position, trajectory.sample_velocity, strict=True)
    velocity = np.array([air_velocity(tuple(r), tuple(v), environment) for r, v in flown])
    speed = np.linalg.norm(velocity, axis=1)
    direction = velocity / np.maximum(speed, 1e-3)[:, None]
    return direction, relief_gains(trajectory, arrays, speed)


def relief_gains(trajectory: OfflineTrajectory, arrays: MissionArrays, speed: Array) -> Array:
    """Compute the turn of the thrust per turn of the velocity in the air, at each sample.

    A steady wind W across the path and a turn u of the thrust give the angle of attack x / V + u,
    where x = W less the velocity across the path, and dx/dt = -a u. The gain minimizes the integral
    of (q (x / V + u) / limit)^2 + TURN_WEIGHT u^2: a linear-quadratic regulator, by its Riccati
    equation backward in time. It is negative at first, where the vehicle begins to drift with the
    wind before the pressure is high, and positive later, where it turns towards the air.

    Args:
        trajectory: of the mission.
        arrays: the mission.
        speed: in the air, m/s, shape (n,).

    Returns:
        shape (n,); 0 in coasts, vertical rises and where the stage has no limit of q alpha.
    """
    count = len(trajectory.sample_time)
    weight, thrust, steered = np.zeros(count), np.zeros(count), np.zeros(count, np.bool_)
    for k, start, stop in trajectory.flown():
        arc = arrays.arcs[k]
        if arc["kind"] != BURN or not np.isfinite(arc["max_q_alpha"]):
            continue
        rows = trajectory.rows_between(start, stop)
        thrust[rows] = _thrust_acceleration(trajectory, arrays, rows)
        steered[rows] = arc["vertical"] == 0
        for i in rows:
            r = tuple(trajectory.sample_position[i])
            pressure = density(r, arrays.environment[0], arrays.atmosphere) * speed[i] ** 2 / 2.0
            weight[i] = (pressure / arc["max_q_alpha"]) ** 2
    if not weight.any():
        return weight
    last = int(np.flatnonzero(weight)[-1])
    time = trajectory.sample_time[: last + 1]
    grid = np.arange(time[0], time[-1] + STEP_S, STEP_S)
    at = [np.interp(grid, time, column[: last + 1]) for column in (weight, thrust, speed)]
    gain = np.zeros(len(grid))
    cost = 0.0
    for i in reversed(range(len(grid))):
        q, a, v = (float(column[i]) for column in at)
        if v <= 0.0:
            break
        gain[i] = (q - a * v * cost) / (q + TURN_WEIGHT)
        change = (q * (1.0 - gain[i]) ** 2 + TURN_WEIGHT * gain[i] ** 2) / v**2
        cost += STEP_S * (change + 2.0 * cost * a * gain[i] / v)
    return np.where(steered, np.interp(trajectory.sample_time, grid, gain), 0.0)


def _thrust_acceleration(
    trajectory: OfflineTrajectory, arrays: MissionArrays, rows: NDArray[np.int64]
) -> Array:
    """Return the acceleration without gravity at some samples of one arc, m/s2."""
    sensed = np.zeros(len(rows))
    times, velocities = trajectory.sample_time[rows], trajectory.sample_velocity[rows]
    for n, i in enumerate(rows[:-1]):
        span = times[n + 1] - times[n]
        sensed[n] = sensed[n - 1] if n else 0.0
        if span > 0.0:
            g = gravity(tuple(trajectory.sample_position[i]), arrays.environment[0])
            sensed[n] = math.dist((velocities[n + 1] - velocities[n]) / span, g)
    sensed[-1] = sensed[-2] if len(rows) > 1 else 0.0
    return sensed
