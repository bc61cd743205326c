# SPDX-License-Identifier: Apache-2.0
"""Hold what is seen of a flight: events, guidance status, diagnostics. No ROS."""

from dataclasses import dataclass

from ares_bags.errors import printable

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Event:
    """Hold a flight event, as in FlightEvent: SI, ares_eci."""

    type: int
    index: int
    time: float
    position: Vector
    velocity: Vector
    mass: float


@dataclass(frozen=True)
class Diagnostic:
    """Hold a warning or an error of a node; `time` is mission elapsed time in s."""

    time: float
    node: str
    level: str
    message: str

    def __str__(self) -> str:
        """Format it as one line."""
        return printable(f"t {self.time:.2f} s  {self.level}  {self.node}: {self.message}")


@dataclass(frozen=True)
class GuidanceSample:
    """Hold the fields of GuidanceStatus that the summary uses; boosts: its phase is PHASE_BOOST."""

    time: float
    cycle: int
    converged: bool
    total_iterations: int
    stale_cycles: int
    law: int
    cutoff_time: float
    predicted_position: Vector
    predicted_velocity: Vector
    boosts: bool = False
