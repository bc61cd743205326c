# SPDX-License-Identifier: Apache-2.0
"""Choose the plane of thrust of an analytic solution."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ares_models.arrays import TARGET_RADIUS_SPEED_ANGLE_PLANE, Record
from ares_thesis.analytic.kernels.plane import Plane, place

Array = NDArray[np.float64]

_TILT_STEP = 0.01  # rad
_TILTS = 60  # steps to either side


def tilted_plane(r: Array, v: Array, mu: float, tilt: float = 0.0) -> Plane:
    """Return the plane of a position and a velocity, rotated about the position.

    Args:
        r: m, shape (3,).
        v: m/s, shape (3,).
        mu: m3/s2.
        tilt: rad, positive towards ``up`` x ``normal``.
    """
    radius = float(np.linalg.norm(r))
    up = r / radius
    normal = np.cross(r, v)
    normal /= np.linalg.norm(normal)
    normal = math.cos(tilt) * normal + math.sin(tilt) * np.cross(up, normal)
    return Plane(
        _vector(up),
        _vector(np.cross(normal, up)),
        _vector(normal),
        float(v @ normal),
        math.sqrt(mu / radius**3),
    )


def _vector(x: Array) -> tuple[float, float, float]:
    return (float(x[0]), float(x[1]), float(x[2]))


def plane_to_target(
    r: Array,
    v: Array,
    mu: float,
    target: Record,
    end: tuple[float, float, float, float],
    time: float,
) -> Plane:
    """Return the least tilted plane in which a planar flight reaches the target's plane.

    Without a node in the target only the inclination counts. If no plane reaches it, return the
    nearest.

    Args:
        r: m, shape (3,).
        v: m/s, shape (3,).
        mu: m3/s2.
        target: record TARGET.
        end: radius m, speed m/s, sin(gamma) and range angle rad at the end of the flight.
        time: duration of the flight, s.
    """

    def off(tilt: float) -> float:
        plane = tilted_plane(r, v, mu, tilt)
        position, velocity = (np.array(x) for x in place(*end, time, plane))
        h = np.cross(position, velocity)
        if target["kind"] == TARGET_RADIUS_SPEED_ANGLE_PLANE:
            node, i = float(target["ascending_node"]), float(target["inclination"])
            wanted = np.array(
                [math.sin(i) * math.sin(node), -math.sin(i) * math.cos(node), math.cos(i)]
            )
            return float(np.cross(wanted, h) @ position)
        return math.atan2(math.hypot(h[0], h[1]), h[2]) - float(target["inclination"])

    best, least = 0.0, abs(off(0.0))
    sides = {1.0: off(0.0), -1.0: off(0.0)}
    for k in range(1, _TILTS + 1):
        for sign, before in sides.items():
            tilt = sign * k * _TILT_STEP
            now = off(tilt)
            if now * before <= 0.0:
                return tilted_plane(r, v, mu, brentq(off, tilt - sign * _TILT_STEP, tilt))
            sides[sign] = now
            if abs(now) < least:
                best, least = tilt, abs(now)
    return tilted_plane(r, v, mu, best)
