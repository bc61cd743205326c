# SPDX-License-Identifier: Apache-2.0
"""Conversion between states, Keplerian elements and insertion quantities.

Source: Bate, Mueller, White, *Fundamentals of Astrodynamics*, chapter 2. Angles come from
two-argument arctangents, which keep all digits for nearly circular and equatorial orbits.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ares_models.kernels import states

Array = NDArray[np.float64]

_TWO_PI = 2.0 * math.pi
# below this an angle is rounding noise and is set by convention
_ROUNDING = 1e-15


@dataclass(frozen=True)
class Elements:
    """Hold Keplerian elements, SI and rad.

    Attributes:
        semi_major_axis: m; negative for a hyperbola.
        eccentricity: 0 or more, not 1.
        inclination: 0..pi.
        ascending_node: from the inertial x axis, 0..2 pi; 0 for an equatorial orbit.
        argument_of_perigee: from the node, 0..2 pi; 0 for a circular orbit.
        true_anomaly: -pi..pi; from the node for a circular orbit.
    """

    semi_major_axis: float
    eccentricity: float
    inclination: float
    ascending_node: float
    argument_of_perigee: float
    true_anomaly: float

    @property
    def semi_latus_rectum(self) -> float:
        """Return the semi-latus rectum a (1 - e^2), m."""
        return self.semi_major_axis * (1.0 - self.eccentricity) * (1.0 + self.eccentricity)

    @property
    def perigee_radius(self) -> float:
        """Return the perigee radius a (1 - e), m."""
        return self.semi_major_axis * (1.0 - self.eccentricity)

    @property
    def apogee_radius(self) -> float:
        """Return the apogee radius a (1 + e), m; inf for a hyperbola."""
        if self.eccentricity > 1.0:
            return math.inf
        return self.semi_major_axis * (1.0 + self.eccentricity)

    def state(self, mu: float) -> tuple[Array, Array]:
        """Return position (m) and velocity (m/s), each shape (3,).

        Args:
            mu: gravitational parameter, m3/s2.

        Raises:
            ValueError: no orbit has these elements, or the anomaly is beyond its asymptotes.
        """
        p = self.semi_latus_rectum
        denominator = 1.0 + self.eccentricity * math.cos(self.true_anomaly)
        if not (p > 0.0 and denominator > 0.0):
            raise ValueError(
                "elements: expected a > 0 with e < 1, or a < 0 with e > 1 and an anomaly "
                f"inside the asymptotes, found a {self.semi_major_axis} m, "
                f"e {self.eccentricity}, true anomaly {self.true_anomaly} rad"
            )
        radius = p / denominator
        cos_node, sin_node = math.cos(self.ascending_node), math.sin(self.ascending_node)
        cos_i, sin_i = math.cos(self.inclination), math.sin(self.inclination)
        node = np.array([cos_node, sin_node, 0.0])
        ahead = np.array([-sin_node * cos_i, cos_node * cos_i, sin_i])
        u = self.argument_of_perigee + self.true_anomaly
        up = math.cos(u) * node + math.sin(u) * ahead
        forward = math.cos(u) * ahead - math.sin(u) * node
        speed = math.sqrt(mu / p)
        radial = speed * self.eccentricity * math.sin(self.true_anomaly)
        return radius * up, radial * up + speed * denominator * forward

    @classmethod
    def from_state(cls, position: ArrayLike, velocity: ArrayLike, mu: float) -> "Elements":
        """Compute the elements of a state.

        Args:
            position: m, shape (3,).
            velocity: m/s, shape (3,).
            mu: gravitational parameter, m3/s2.

        Raises:
            ValueError: the state is rectilinear, exactly parabolic, or not finite.
        """
        r = np.asarray(position, dtype=np.float64)
        v = np.asarray(velocity, dtype=np.float64)
        h = np.cross(r, v)
        radius = float(np.linalg.norm(r))
        momentum = float(np.linalg.norm(h))
        energy = 0.5 * float(v @ v) - mu / radius if radius > 0.0 else math.nan
        if not (math.isfinite(energy) and energy != 0.0 and momentum > 0.0):
            raise ValueError(
                "state: expected a finite elliptic or hyperbolic state that is not on a "
                f"straight line, found r {r.tolist()} m, v {v.tolist()} m/s"
            )
        a = -0.5 * mu / energy
        p = momentum * momentum / mu
        # eccentricity by its components: exact for small e, unlike the root of 1 - p/a
        e_cos = p / radius - 1.0
        e_sin = momentum * float(r @ v) / (radius * mu)
        e = math.hypot(e_cos, e_sin)
        across = math.hypot(h[0], h[1])
        inclination = math.atan2(across, h[2])
        if across > _ROUNDING * momentum:
            node_angle = math.atan2(h[0], -h[1])
        else:
            node_angle = 0.0
            inclination = 0.0 if h[2] > 0.0 else math.pi
        node = np.array([math.cos(node_angle), math.sin(node_angle), 0.0])
        ahead = np.cross(h / momentum, node)
        u = math.atan2(float(r @ ahead), float(r @ node))
        anomaly = math.atan2(e_sin, e_cos)
        if e <= _ROUNDING:
            e, anomaly, perigee = 0.0, u, 0.0
        else:
            perigee = (u - anomaly) % _TWO_PI
        return cls(a, e, inclination, node_angle % _TWO_PI, perigee, anomaly)


@dataclass(frozen=True)
class Insertion:
    """Hold the quantities of an insertion, SI and rad.

    Attributes:
        radius: m.
        speed: inertial, m/s.
        flight_path_angle: rad.
        inclination: 0..pi.
        ascending_node: 0..2 pi, from the inertial x axis.
    """

    radius: float
    speed: float
    flight_path_angle: float
    inclination: float
    ascending_node: float

    @classmethod
    def from_state(cls, position: ArrayLike, velocity: ArrayLike) -> "Insertion":
        """Compute the insertion quantities of position m and velocity m/s, each shape (3,)."""
        r = np.asarray(position, dtype=np.float64)
        v = np.asarray(velocity, dtype=np.float64)
        return cls(
            *states.insertion_quantities(
                (float(r[0]), float(r[1]), float(r[2])), (float(v[0]), float(v[1]), float(v[2]))
            )
        )
