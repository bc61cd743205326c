# SPDX-License-Identifier: Apache-2.0
"""Figure and rotation of the Earth (Eqs. 2.14 to 2.16)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ares_models.kernels import states


@dataclass(frozen=True)
class LaunchAngles:
    """Hold an inertial state as radius, place, speed, flight-path angle and azimuth.

    Attributes:
        radius: m.
        latitude: geocentric, rad.
        right_ascension: from the inertial x axis, rad.
        speed: inertial, m/s.
        flight_path_angle: of the inertial velocity, rad.
        azimuth: of the inertial velocity, from north towards east, rad.
    """

    radius: float
    latitude: float
    right_ascension: float
    speed: float
    flight_path_angle: float
    azimuth: float

    def state(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return position (m) and velocity (m/s), each shape (3,); Eqs. 2.14 and 2.18."""
        r, v = states.state_from_angles(
            self.radius,
            self.latitude,
            self.right_ascension,
            self.speed,
            self.flight_path_angle,
            self.azimuth,
        )
        return np.array(r), np.array(v)

    @classmethod
    def from_state(cls, position: ArrayLike, velocity: ArrayLike) -> "LaunchAngles":
        """Compute the angles of a state: position m, velocity m/s, each shape (3,)."""
        r = np.asarray(position, dtype=np.float64)
        v = np.asarray(velocity, dtype=np.float64)
        return cls(
            *states.angles_from_state(
                (float(r[0]), float(r[1]), float(r[2])), (float(v[0]), float(v[1]), float(v[2]))
            )
        )


@dataclass(frozen=True)
class Earth:
    """Hold an ellipsoid of revolution that rotates about z.

    Attributes:
        equatorial_radius: m.
        polar_radius: m.
        rotation_rate: rad/s.
        angle_at_zero: right ascension of zero longitude at time 0, rad.
    """

    equatorial_radius: float
    polar_radius: float
    rotation_rate: float
    angle_at_zero: float = 0.0

    @property
    def flattening(self) -> float:
        """Return the flattening, Eq. 2.16."""
        return (self.equatorial_radius - self.polar_radius) / self.equatorial_radius

    def surface_radius(self, latitude: float) -> float:
        """Return the radius of the surface, m, at a geocentric latitude, rad.

        The subtrahend of Eq. 2.15 (with the bracket corrected, see
        :func:`ares_models.kernels.environment.altitude`).
        """
        k = 1.0 - (1.0 - self.flattening) ** 2
        return self.polar_radius / math.sqrt(1.0 - k * math.cos(latitude) ** 2)

    def geodetic_latitude(self, latitude: float) -> float:
        """Convert the geocentric latitude of a surface point to geodetic, both rad."""
        ratio = (1.0 - self.flattening) ** 2
        return math.atan2(math.sin(latitude), ratio * math.cos(latitude))

    def geocentric_latitude(self, geodetic_latitude: float) -> float:
        """Convert the geodetic latitude of a surface point to geocentric, both rad."""
        ratio = (1.0 - self.flattening) ** 2
        return math.atan2(ratio * math.sin(geodetic_latitude), math.cos(geodetic_latitude))

    def latitude_longitude(self, position: ArrayLike, time: float) -> tuple[float, float]:
        """Compute geocentric latitude and longitude of an inertial position.

        Args:
            position: inertial, m, shape (3,).
            time: mission elapsed time, s.

        Returns:
            Latitude in -pi/2..pi/2 and longitude in -pi..pi, rad, east positive.
        """
        x, y, z = (float(c) for c in np.asarray(position, dtype=np.float64))
        longitude = math.atan2(y, x) - self.angle_at_zero - self.rotation_rate * time
        return math.atan2(z, math.hypot(x, y)), math.remainder(longitude, 2.0 * math.pi)

    def position(
        self, latitude: float, longitude: float, radius: float, time: float
    ) -> NDArray[np.float64]:
        """Compute the inertial position over a place, m, shape (3,); Eq. 2.14 times radius.

        Args:
            latitude: geocentric, rad.
            longitude: east positive, rad.
            radius: m.
            time: mission elapsed time, s.
        """
        right_ascension = longitude + self.angle_at_zero + self.rotation_rate * time
        _, _, up = states.east_north_up(latitude, right_ascension)
        return radius * np.array(up)
