# SPDX-License-Identifier: Apache-2.0
"""Collect the data of a flight for all export formats."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_models.earth import Earth
from ares_models.geodesy import Places, geodetic
from ares_studies.flight_page.data import Columns, Recording
from ares_vehicle_sim.falls import Fall

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ExportEvent:
    """Hold an event: mission elapsed time in s, name, inertial state, mass in kg."""

    time_s: float
    name: str
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    mass_kg: float


@dataclass(frozen=True)
class Export:
    """Hold a flight to be exported.

    Attributes:
        recording: states and guidance statuses.
        commands: columns of ThrustCommand, with `time` in s; may have no rows.
        events: in order of time.
        verdict: of the flight, in words.
        falls: of what was dropped.
    """

    recording: Recording
    commands: Columns
    events: Sequence[ExportEvent]
    verdict: str
    falls: Sequence[Fall] = ()

    def places(self) -> Places:
        """Return the geodetic positions of all states, on the mission's ellipsoid."""
        truth = self.recording.truth
        return geodetic(truth["time"], truth["position"], self._earth)

    def event_places(self) -> Places:
        """Return the geodetic positions of the events."""
        times = np.array([event.time_s for event in self.events])
        positions = np.array([event.position for event in self.events]).reshape(-1, 3)
        return geodetic(times, positions, self._earth)

    def fall_places(self, fall: Fall) -> Places:
        """Return the geodetic positions along a fall."""
        return geodetic(fall.track_time_s, fall.track, self._earth)

    @property
    def title(self) -> str:
        """Return mission and law."""
        return f"{self.recording.mission.title}, {self.recording.law}"

    @property
    def _earth(self) -> Earth:
        return self.recording.mission.earth()
