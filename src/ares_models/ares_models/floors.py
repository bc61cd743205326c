# SPDX-License-Identifier: Apache-2.0
"""Floors: least altitude and perigee, arc by arc."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, COAST, MissionArrays
from ares_models.kernels.environment import log_density

#: Density at the edge of the air, kg/m3: US Standard Atmosphere 1976 at 100 km.
THIN = 5.605e-7
_HIGHEST = 1e6  # m


class Floor(NamedTuple):
    """Hold the floor of an arc.

    Attributes:
        arc: index into the mission's arcs.
        altitude_m: least altitude all along the arc; nan: none.
        perigee_m: least perigee radius of the arc's orbit; nan: none.
        said: given by the mission file. A default floor is waived for a coast that begins below.
    """

    arc: int
    altitude_m: float
    perigee_m: float
    said: bool


def edge_of_air(arrays: MissionArrays) -> float:
    """Return the altitude at which a mission's air has the density THIN, m; 0 without air."""
    level = math.log(THIN) - math.log(float(arrays.environment[0]["density_factor"]))
    low, high = 0.0, _HIGHEST
    if log_density(low, arrays.atmosphere)[0] <= level:
        return 0.0
    while high - low > 1.0:
        middle = 0.5 * (low + high)
        if log_density(middle, arrays.atmosphere)[0] > level:
            low = middle
        else:
            high = middle
    return high


def orbits_of(arrays: MissionArrays, start: NDArray[np.void]) -> dict[int, NDArray[np.void]]:
    """Return the prescribed orbits of the coasts ahead: by arc, shape (1,), dtype TARGET.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION. A coast that has begun is not included.
    """
    ahead = range(int(start["arc"][0]) + 1, len(arrays.arcs))
    orbits = {k: arrays.arcs["orbit"][k : k + 1] for k in ahead}
    return {k: orbit for k, orbit in orbits.items() if orbit["named"][0]}


def floors_of(arrays: MissionArrays, start: NDArray[np.void]) -> tuple[Floor, ...]:
    """Return the floors of the arcs from the start on.

    A free coast after a burn stays above the edge of the air unless the file has another floor.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
    """
    floors = []
    burnt = False
    edge = math.nan
    for k in range(int(start["arc"][0]), len(arrays.arcs)):
        arc = arrays.arcs[k]
        altitude = float(arc["min_altitude"])
        perigee = float(arc["min_perigee_radius"]) or math.nan
        if math.isfinite(altitude) or math.isfinite(perigee):
            floors.append(Floor(k, altitude, perigee, said=True))
        elif arc["kind"] == COAST and math.isinf(arc["duration"]) and burnt:
            edge = edge_of_air(arrays) if math.isnan(edge) else edge
            floors.append(Floor(k, edge, math.nan, said=False))
        burnt = burnt or arc["kind"] == BURN
    return tuple(floors)
