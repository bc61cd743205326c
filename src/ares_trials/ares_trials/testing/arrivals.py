# SPDX-License-Identifier: Apache-2.0
"""Measure insertion errors, for tests only."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.mission import Mission
from ares_models.orbits import Insertion
from ares_studies.closed_loop import Flight


def errors(mission: Mission, flight: Flight) -> NDArray[np.float64]:
    """Return radius, m, speed, m/s, flight-path angle, deg, inclination, deg: flown - target."""
    flown = Insertion.from_state(flight.plant["position"], flight.plant["velocity"])
    target = mission.arrays().target[0]
    return np.array(
        [
            flown.radius - target["radius"],
            flown.speed - target["speed"],
            math.degrees(flown.flight_path_angle - target["flight_path_angle"]),
            math.degrees(flown.inclination - target["inclination"]),
        ]
    )


def assert_within(found: NDArray[np.float64], limits: list[float]) -> None:
    """Assert that every error is within its limit, in absolute value."""
    assert np.all(np.abs(found) <= limits), found
