# SPDX-License-Identifier: Apache-2.0
"""Transform the planar flight of chapter 5 to space.

Thrust stays in a plane through the start. The velocity across that plane oscillates as in linear
gravity (3.27). The flight begins with its actual velocity, and the tilt of the plane determines the
inclination at the end.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_models.jit import kernel
from ares_models.kernels.environment import heating_rate
from ares_models.kernels.vectors import Vector, add, axpy, norm, scale, store
from ares_thesis.analytic.kernels.burn import cosine_of

Array = NDArray[np.float64]


class Plane(NamedTuple):
    """Hold the plane of thrust.

    Attributes:
        up, ahead, normal: unit vectors: radial and horizontal at the start, up x ahead.
        drift: velocity across the plane at the start, along ``normal``, m/s.
        omega: of linear gravity, 1/s.
    """

    up: Vector
    ahead: Vector
    normal: Vector
    drift: float
    omega: float


@kernel
def place(
    radius: float, speed: float, sine: float, range_angle: float, since: float, plane: Plane
) -> tuple[Vector, Vector]:
    """Return position, m, and velocity, m/s, of a planar state.

    Args:
        radius: m.
        speed: m/s.
        sine: sin(gamma).
        range_angle: rad, from ``up`` towards ``ahead``.
        since: time after the start, s.
        plane: the plane of thrust.
    """
    cos = math.cos(range_angle)
    sin = math.sin(range_angle)
    radial = axpy(cos, plane.up, scale(sin, plane.ahead))
    horizon = axpy(-sin, plane.up, scale(cos, plane.ahead))
    angle = plane.omega * since
    across = plane.drift / plane.omega * math.sin(angle)
    r = axpy(across, plane.normal, scale(radius, radial))
    v = add(scale(speed * sine, radial), scale(speed * cosine_of(sine), horizon))
    v = axpy(plane.drift * math.cos(angle), plane.normal, v)
    # keep radius and speed of the planar state
    return scale(radius / norm(r), r), scale(speed / norm(v), v)


class Track(NamedTuple):
    """Hold samples of a flight in space.

    Attributes:
        position, velocity, direction: shape (n, 3): m, m/s, unit vectors of the thrust.
        rate: shape (n,): free molecular heating, W/m2.
    """

    position: Array
    velocity: Array
    direction: Array
    rate: Array


@kernel
def place_samples(
    samples: Array, since: Array, plane: Plane, mission: MissionArrays, track: Track
) -> None:
    """Transform planar samples to space.

    Args:
        samples: shape (n, 6), see ``burn.sample_burn``; range angles from the start.
        since: shape (n,), time after the start, s.
        plane: the plane of thrust.
        mission: environment and atmosphere are read.
        track: written.
    """
    environment = mission.environment[0]
    for i in range(samples.shape[0]):
        r, v = place(samples[i, 0], samples[i, 1], samples[i, 2], samples[i, 3], since[i], plane)
        cos = math.cos(samples[i, 3])
        sin = math.sin(samples[i, 3])
        along = samples[i, 4] * cos + samples[i, 5] * sin
        above = samples[i, 5] * cos - samples[i, 4] * sin
        store(track.position[i], r)
        store(track.velocity[i], v)
        store(track.direction[i], axpy(above, plane.up, scale(along, plane.ahead)))
        track.rate[i] = heating_rate(r, v, environment, mission.atmosphere)
