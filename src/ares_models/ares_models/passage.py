# SPDX-License-Identifier: Apache-2.0
"""Find Mach 1 and the greatest dynamic pressure of a climb, state by state."""

import json
import math
from collections.abc import Mapping
from dataclasses import astuple, dataclass, fields
from typing import Any

from numpy.typing import NDArray

#: Dynamic pressure, Pa, below which a flight has left the air.
THIN_AIR_PA = 50.0


@dataclass(frozen=True)
class AirState:
    """Hold a state in the air.

    Attributes:
        time_s: mission elapsed time.
        altitude_m: as defined by the mission.
        mass_kg: of the vehicle.
        dynamic_pressure_pa: 0.5 rho V^2.
        mach: Mach number.
    """

    time_s: float
    altitude_m: float
    mass_kg: float
    dynamic_pressure_pa: float
    mach: float


class Passage:
    """Follow a climb through the air; what happens on a fall back does not count.

    Attributes:
        mach_1: where the vehicle became faster than sound; None before.
        max_q: the state of greatest dynamic pressure so far; None as long as it is the first.
        beyond_max_q: the dynamic pressure has fallen below 0.9 of its greatest.
        left_s: when the vehicle left the air, mission elapsed time; None as long as it is in it, at
            rest or slow too.
    """

    def __init__(self) -> None:
        """Start before the first state."""
        self.mach_1: AirState | None = None
        self.max_q: AirState | None = None
        self.beyond_max_q = False
        self.left_s: float | None = None
        self._before: AirState | None = None
        self._most = 0.0

    def add(self, now: AirState) -> None:
        """Take the next state."""
        before, self._before = self._before, now
        if now.dynamic_pressure_pa >= THIN_AIR_PA:
            self.left_s = None
        elif self.left_s is None and now.mach >= 1.0:
            self.left_s = now.time_s
        if before is None:
            self._most = now.dynamic_pressure_pa
            return
        if now.altitude_m < before.altitude_m:
            return
        if now.dynamic_pressure_pa > self._most:
            self._most = now.dynamic_pressure_pa
            self.max_q = now
        self.beyond_max_q = now.dynamic_pressure_pa < 0.9 * self._most
        if self.mach_1 is None and before.mach < 1.0 <= now.mach:
            self.mach_1 = _between(before, now, (1.0 - before.mach) / (now.mach - before.mach))

    def as_text(self) -> str:
        """Return Mach 1 and the greatest dynamic pressure as JSON."""
        return json.dumps([state and astuple(state) for state in (self.mach_1, self.max_q)])

    @classmethod
    def from_text(cls, text: str) -> "Passage | None":
        """Return the passage that a JSON text describes; None: it describes none."""
        passage = cls()
        try:
            passage.mach_1, passage.max_q = (
                None if numbers is None else AirState(*map(float, numbers))
                for numbers in json.loads(text)
            )
        except (ValueError, TypeError):
            return None
        known = [state for state in (passage.mach_1, passage.max_q) if state is not None]
        finite = all(math.isfinite(number) for state in known for number in astuple(state))
        return passage if finite else None


def passage_of(truth: Mapping[str, NDArray[Any]]) -> Passage:
    """Follow a whole climb.

    Args:
        truth: columns of VehicleState, with `time` in s.
    """
    passage = Passage()
    names = ("time", "altitude", "mass", "dynamic_pressure", "mach")
    for numbers in zip(*(truth[name].tolist() for name in names), strict=True):
        passage.add(AirState(*numbers))
    return passage


def _between(one: AirState, two: AirState, share: float) -> AirState:
    """Interpolate linearly; share 0 is the first state."""
    values = [(getattr(one, item.name), getattr(two, item.name)) for item in fields(AirState)]
    return AirState(*(a + share * (b - a) for a, b in values))
