# SPDX-License-Identifier: Apache-2.0
"""Build the wind of the kernels from knots of altitude, east and north component.

The components are monotone cubics between the knots and constant below the first. Above the last
they fade to zero within ``FADE_M``, so that the two-point problem, which is solved above the air,
has none.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ares_models.kernels.environment import table_at
from ares_models.splines import hermite_table, monotone_slopes

Array = NDArray[np.float64]

#: Difference of altitudes below which two knots are one, m.
SAME_M = 1e-3
#: Climb over which the wind fades to zero above the last knot, m.
FADE_M = 20e3


class WindProfile(NamedTuple):
    """Hold a wind by altitude.

    Attributes:
        altitude: of the knots, m, shape (n,); the last is where the wind has faded.
        value: east and north component, m/s, shape (2, n).
        slope: of these by altitude, 1/s, shape (2, n); 0 at both ends.
    """

    altitude: Array
    value: Array
    slope: Array

    @property
    def cubic(self) -> Array:
        """Return the cubics above each knot as in dtype WIND, shape (2, n, 4)."""
        return hermite_table(self.altitude, self.value, self.slope)[..., 1:]

    def refined(self, altitude: Array) -> "WindProfile":
        """Return the same wind by other knots, which include its own within SAME_M, m."""
        cubic = self.cubic
        found = np.array(
            [
                [table_at(h, self.altitude, part, len(self.altitude)) for h in altitude.tolist()]
                for part in cubic
            ]
        )
        return WindProfile(altitude, found[..., 0], found[..., 1])

    def write(self, record: Any) -> None:
        """Write the table into a record WIND."""
        knots = len(self.altitude)
        record["knots"] = knots
        record["altitude"][:knots] = self.altitude
        record["cubic"][:, :knots] = self.cubic


def wind_profile(knots: Sequence[ArrayLike]) -> WindProfile:
    """Interpolate knots [altitude m, east m/s, north m/s]."""
    table = np.array(knots, dtype=np.float64)
    end = [table[-1, 0] + FADE_M, 0.0, 0.0]
    altitude, *components = np.vstack((table, end)).T
    value = np.array(components)
    slope = np.zeros_like(value)
    if len(altitude) > 2:
        slope[:, 1:-1] = monotone_slopes(altitude, value)[:, 1:-1]
    return WindProfile(altitude, value, slope)


def together(winds: Sequence[WindProfile], more: ArrayLike = ()) -> list[WindProfile]:
    """Return winds by the knots of all, and more of them, m."""
    altitude = np.unique(np.concatenate((*(wind.altitude for wind in winds), np.asarray(more))))
    altitude = altitude[np.diff(altitude, prepend=-np.inf) > SAME_M]
    return [wind.refined(altitude) for wind in winds]
