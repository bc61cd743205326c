# SPDX-License-Identifier: Apache-2.0
"""Complete an orbit from the elements of size and shape that are given."""

import math
from collections.abc import Mapping
from typing import NamedTuple


class Conic(NamedTuple):
    """Hold size and shape of the orbit aimed at.

    Attributes:
        perigee: radius, m.
        eccentricity: 0 or more; negative if the given apogee is below the perigee.
        c3: twice the energy, m2/s2.
    """

    perigee: float
    eccentricity: float
    c3: float

    @property
    def apogee(self) -> float:
        """Return the apogee radius, m; inf for an escape."""
        if self.eccentricity >= 1.0:
            return math.inf
        return self.perigee * (1.0 + self.eccentricity) / (1.0 - self.eccentricity)


def complete(named: Mapping[str, float], mu: float, start: float) -> Conic:
    """Complete an orbit from one or two elements of size and shape.

    A perigee alone means a circle; an apogee or an energy alone is completed by a perigee at
    ``start``, or by a circle if the orbit lies below that.

    Args:
        named: perigee_radius, apogee_radius, semi_major_axis (m), eccentricity, c3 (m2/s2).
        mu: m3/s2.
        start: initial radius of the flight, m.
    """
    perigee, apogee = named.get("perigee_radius"), named.get("apogee_radius")
    e, c3 = named.get("eccentricity"), named.get("c3")
    if "semi_major_axis" in named:
        c3 = -mu / named["semi_major_axis"]
    if perigee is None and apogee is not None:
        if c3 is not None:
            perigee = -2.0 * mu / c3 - apogee
        elif e is not None:
            perigee = apogee * (1.0 - e) / (1.0 + e)
        else:
            perigee = min(start, apogee)
    elif perigee is None and c3 is not None:
        if e is not None:
            perigee = mu * (e - 1.0) / c3
        else:
            perigee = min(start, -mu / c3) if c3 < 0.0 else start
    if perigee is None:
        raise AssertionError("an orbit has a size")
    if e is None:
        if c3 is not None:
            e = 1.0 + perigee * c3 / mu
        else:
            e = 0.0 if apogee is None else (apogee - perigee) / (apogee + perigee)
    return Conic(perigee, e, mu * (e - 1.0) / perigee if c3 is None else c3)
