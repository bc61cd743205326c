# SPDX-License-Identifier: Apache-2.0
"""Falls of what a flight drops: stages, boosters, fairing."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import FALL
from ares_models.impacts import Impact, impact_at
from ares_models.kernels.falling import come_down
from ares_models.kernels.impact import ground_direction
from ares_models.kernels.vectors import angle_between
from ares_models.mission import Mission
from ares_models.mission_pieces import piece_array
from ares_vehicle_sim.kernels.separations import follow

Array = NDArray[np.float64]

#: Points of the track of a fall.
_POINTS = 60


@dataclass(frozen=True)
class Fall:
    """Hold the fall of a piece, in the air and the wind of the mission.

    Attributes:
        name: of the stage, the boosters or the jettison.
        count: pieces of this kind, all on the same way.
        time_s: mission elapsed time of the separation.
        mass_kg: of all of this kind.
        coefficient_kg_m2: ballistic coefficient; inf: without drag.
        impact: None: it does not come down within a revolution.
        downrange_m: over the ground from the start of the mission; nan without an impact.
        speed_m_s: relative to the ground at the impact; nan without one.
        track_time_s: mission elapsed time of the points of its way, shape (n,); empty without an
            impact.
        track: inertial positions of these, m, shape (n, 3).
    """

    name: str
    count: int
    time_s: float
    mass_kg: float
    coefficient_kg_m2: float
    impact: Impact | None
    downrange_m: float
    speed_m_s: float
    track_time_s: Array
    track: Array

    @property
    def title(self) -> str:
        """Return the name, with the number of several."""
        return f"{self.name}, {self.count} pieces" if self.count > 1 else self.name

    @property
    def words(self) -> str:
        """Describe where and when it comes down."""
        drag = ", without drag" if math.isinf(self.coefficient_kg_m2) else ""
        if self.impact is None:
            return f"{'do' if self.count > 1 else 'does'} not come down within a revolution{drag}"
        where = f", in {self.impact.area}" if self.impact.area else ""
        verb = "come" if self.count > 1 else "comes"
        return (
            f"{verb} down at {self.impact.place}, {self.downrange_m / 1e3:,.0f} km downrange, "
            f"at {self.impact.time_s:,.0f} s{drag}{where}"
        )


def find_falls(mission: Mission, events: NDArray[np.void]) -> tuple[Fall, ...]:
    """Find where the pieces that a flight has dropped come down, in the order of separation.

    Args:
        mission: flown mission.
        events: of the flight, dtype EVENT.
    """
    pieces = mission.pieces
    falls = np.zeros(len(pieces), FALL)
    if not len(pieces):
        return ()
    arrays, start = mission.arrays(), mission.start()
    follow(arrays, events, piece_array(pieces), np.zeros(len(pieces)), falls)
    environment = arrays.environment[0]
    r = start.position.tolist()
    pad = ground_direction((r[0], r[1], r[2]), start.time_s, environment)
    found = []
    for piece, fall in zip(pieces, falls, strict=True):
        if not fall["dropped"]:
            continue
        impact, away = None, math.nan
        if math.isfinite(fall["down_time"]):
            place = tuple(fall["place"].tolist())
            impact = impact_at(float(fall["down_time"]), place, environment, mission.area_names)
            away = float(environment["equatorial_radius"] * angle_between(pad, place))
        found.append(
            Fall(
                piece.name,
                piece.count,
                float(fall["time"]),
                float(fall["mass"]),
                float(fall["coefficient"]),
                impact,
                away,
                float(fall["speed"]),
                *_track(fall, environment, arrays.atmosphere),
            )
        )
    return tuple(sorted(found, key=lambda fall: fall.time_s))


def _track(fall: np.void, environment: np.void, atmosphere: Array) -> tuple[Array, Array]:
    """Return times and inertial positions along a fall."""
    if not math.isfinite(fall["down_time"]):
        return np.empty(0), np.empty((0, 3))
    times = np.linspace(fall["time"], fall["down_time"], _POINTS)
    r, v = tuple(fall["position"].tolist()), tuple(fall["velocity"].tolist())
    positions = [r]
    for span in np.diff(times).tolist():
        _, r, v = come_down(r, v, float(fall["coefficient"]), span, environment, atmosphere)
        positions.append(r)
    return times, np.array(positions)
