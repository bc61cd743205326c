# SPDX-License-Identifier: Apache-2.0
"""How well a flight arrived, for tests; nothing else uses this module."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.mission import Mission
from ares_models.orbits import Insertion
from ares_studies.closed_loop import Flight


def errors(mission: Mission, flight: Flight) -> NDArray[np.float64]:
    """Radius m, speed m/s, flight-path angle deg, inclination deg: flown minus target."""
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
    """Every figure is within its limit, either way."""
    assert np.all(np.abs(found) <= limits), found
