# SPDX-License-Identifier: Apache-2.0
"""Judge and measure the ends of flights, for tests and benchmarks only."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import Record
from ares_models.judge import Judgement, judge
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


def judged(mission: Mission, plant: Record) -> Judgement:
    """Judge the end of a flight by the mission's target.

    Args:
        mission: what was flown.
        plant: record PLANT at the end.
    """
    environment = mission.arrays().environment[0]
    return judge(
        plant["position"],
        plant["velocity"],
        mission.arrays().target[0],
        float(environment["mu"]),
        float(environment["equatorial_radius"]),
    )


def assert_inserted(
    mission: Mission, flight: Flight, limits: Sequence[float] = (10.0, 0.05, 1e-3, 1e-3)
) -> None:
    """Assert an insertion with every error within its limit, see `errors`."""
    assert flight.plant["inserted"] == 1
    assert_within(errors(mission, flight), limits)


def assert_within(found: NDArray[np.float64], limits: Sequence[float]) -> None:
    """Assert that every error is within its limit, in absolute value."""
    assert np.all(np.abs(found) <= limits), found
