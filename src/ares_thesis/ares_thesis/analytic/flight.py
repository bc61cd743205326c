# SPDX-License-Identifier: Apache-2.0
"""Convert flights to their plane, as in chapters 5 and 6 of the thesis, and fit polynomials."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ares_optimizer.solution import OptimizerError, Solution

Array = NDArray[np.float64]

#: Degrees of 5.8 and 5.17, 5.9 and 5.18, and of part two.
THESIS_DEGREES = (2, 1, 2)
_SAME_TIME = 1e-6


@dataclass(frozen=True)
class PlanarFlight:
    """Hold the samples of a planar flight; staging and jettison have two samples.

    Attributes:
        time_s: shape (n,), mission elapsed time.
        radius: shape (n,), m.
        speed: shape (n,), m/s.
        flight_path_angle: shape (n,), rad.
        theta: shape (n,), thrust above the local horizon, rad.
        mass: shape (n,), kg.
    """

    time_s: Array
    radius: Array
    speed: Array
    flight_path_angle: Array
    theta: Array
    mass: Array

    @property
    def alpha(self) -> Array:
        """Return the steering angle theta - gamma, rad: Eq. 5.2."""
        return self.theta - self.flight_path_angle

    @property
    def sin_gamma(self) -> Array:
        """Return sin(gamma), Fig. 5.3."""
        return np.sin(self.flight_path_angle)

    @property
    def cos_alpha(self) -> Array:
        """Return cos(alpha), Fig. 5.4."""
        return np.cos(self.alpha)

    def between(self, start_s: float, end_s: float) -> "PlanarFlight":
        """Return the samples between two times; at events the inner side."""
        inside = np.flatnonzero(
            (self.time_s >= start_s - _SAME_TIME) & (self.time_s <= end_s + _SAME_TIME)
        )
        while len(inside) > 1 and self.time_s[inside[1]] - self.time_s[inside[0]] < _SAME_TIME:
            inside = inside[1:]
        while len(inside) > 1 and self.time_s[inside[-1]] - self.time_s[inside[-2]] < _SAME_TIME:
            inside = inside[:-1]
        return PlanarFlight(
            self.time_s[inside],
            self.radius[inside],
            self.speed[inside],
            self.flight_path_angle[inside],
            self.theta[inside],
            self.mass[inside],
        )


def planar_flight(solution: Solution) -> PlanarFlight:
    """Convert the flight of a solution to the plane of its position and velocity.

    Raises:
        OptimizerError: the solution has no trajectory.
    """
    flight = solution.trajectory
    if flight is None:
        raise OptimizerError("solution.trajectory is missing; expected a sampled flight")
    radius = np.linalg.norm(flight.position, axis=1)
    speed = np.linalg.norm(flight.velocity, axis=1)
    up = flight.position / radius[:, None]
    normal = np.cross(flight.position, flight.velocity)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    ahead = np.cross(normal, up)
    climb = np.sum(up * flight.velocity, axis=1)
    above = np.sum(up * flight.direction, axis=1)
    along = np.sum(ahead * flight.direction, axis=1)
    return PlanarFlight(
        flight.time_s,
        radius,
        speed,
        np.arcsin(climb / speed),
        np.arctan2(above, along),
        flight.mass,
    )


@dataclass(frozen=True)
class KeyFigures:
    """Hold the figures that chapter 6 compares (Tables 6.1 to 6.4).

    Attributes:
        staging_to_jettison_s, jettison_to_cutoff_s: times to go of both parts.
        theta_0_deg, theta_plf_deg, theta_f_deg: thrust above the local horizon at the start,
            just before the jettison, at cut-off.
        gamma_staging_deg: flight-path angle at staging.
    """

    staging_to_jettison_s: float
    jettison_to_cutoff_s: float
    theta_0_deg: float
    theta_plf_deg: float
    theta_f_deg: float
    gamma_staging_deg: float


def key_figures(flight: PlanarFlight, staging_s: float, jettison_s: float) -> KeyFigures:
    """Return the key figures of a whole flight.

    Args:
        flight: from the start of the first stage on.
        staging_s, jettison_s: mission elapsed time.
    """
    first = flight.between(float(flight.time_s[0]), staging_s)
    before = flight.between(float(flight.time_s[0]), jettison_s)
    return KeyFigures(
        jettison_s - staging_s,
        float(flight.time_s[-1]) - jettison_s,
        math.degrees(flight.theta[0]),
        math.degrees(before.theta[-1]),
        math.degrees(flight.theta[-1]),
        math.degrees(first.flight_path_angle[-1]),
    )


@dataclass(frozen=True)
class Fit:
    """Hold a least-squares polynomial of a sampled curve.

    Attributes:
        coefficients: lowest power first, of time in s after the start of the piece.
        worst: largest deviation from the samples, in their unit.
    """

    coefficients: tuple[float, ...]
    worst: float

    def at(self, time: Array) -> Array:
        """Evaluate the polynomial at times in s after the start of the piece."""
        return np.polynomial.polynomial.polyval(time, np.array(self.coefficients))


@dataclass(frozen=True)
class FittedPiece:
    """Hold the polynomials fitted to one burn, the "direct curve fit" of Fig. 6.1.

    Attributes:
        start_s, end_s: mission elapsed time.
        sin_gamma: Eqs. 5.8, 5.9, Fig. 5.3.
        cos_alpha: Eqs. 5.17, 5.18, Fig. 5.4.
        speed: Eqs. 5.23, 5.24, m/s.
    """

    start_s: float
    end_s: float
    sin_gamma: Fit
    cos_alpha: Fit
    speed: Fit


def fit_flight(
    flight: PlanarFlight, staging_s: float, jettison_s: float
) -> tuple[FittedPiece, ...]:
    """Fit the polynomials of the thesis to a flight: quadratic, linear, quadratic.

    Args:
        flight: for example of an optimum.
        staging_s, jettison_s: mission elapsed time.

    Returns:
        start to staging, staging to jettison, jettison to cut-off.

    Raises:
        OptimizerError: the times are not in order within the flight.
    """
    bounds = (float(flight.time_s[0]), staging_s, jettison_s, float(flight.time_s[-1]))
    if not all(a < b for a, b in pairwise(bounds)):
        raise OptimizerError(
            f"staging_s and jettison_s are {staging_s:g} and {jettison_s:g} s; expected times in "
            f"order between {bounds[0]:g} and {bounds[-1]:g} s"
        )
    pieces = []
    for (start, end), degree in zip(pairwise(bounds), THESIS_DEGREES, strict=True):
        piece = flight.between(start, end)
        time = piece.time_s - start
        fits = (_fit(time, y, degree) for y in (piece.sin_gamma, piece.cos_alpha, piece.speed))
        pieces.append(FittedPiece(start, end, *fits))
    return tuple(pieces)


def _fit(time: Array, values: Array, degree: int) -> Fit:
    fitted = np.polynomial.Polynomial.fit(time, values, degree).convert()
    coefficients = tuple(float(c) for c in fitted.coef)
    worst = float(np.abs(fitted(time) - values).max())
    return Fit(coefficients + (0.0,) * (degree + 1 - len(coefficients)), worst)
