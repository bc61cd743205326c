# SPDX-License-Identifier: Apache-2.0
"""Settings of a guidance law: its cycle, its tolerances and its gates."""

import math
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance import arrays as layout

HEATING_SOURCES = {"measured": layout.HEATING_MEASURED, "model": layout.HEATING_MODELLED}
BOOST_STEERINGS = {"programme": layout.BOOST_PROGRAMME, "replan": layout.BOOST_REPLAN}
CHOICES = {"heating_source": HEATING_SOURCES, "boost_steering": BOOST_STEERINGS}


def _setting(
    default: Any, description: str, unit: str, minimum: float, maximum: float, option: str = ""
) -> Any:
    return field(
        default=default,
        metadata={
            "description": description,
            "unit": unit,
            "minimum": minimum,
            "maximum": maximum,
            "option": option,
        },
    )


@dataclass(frozen=True)
class LawSettings:
    """Hold the cycle and the gates of a law; a gate accepts or refuses a solution."""

    cycle_period_s: float = _setting(
        1.0, "Flight time between guidance cycles.", "s", 0.001, 100.0, "cycle_period"
    )
    hold_time_s: float = _setting(
        10.0,
        "Time to go from which the steering is held and only the cut-off is refined.",
        "s",
        0.0,
        120.0,
        "hold_time",
    )
    velocity_to_go_tolerance_m_s: float = _setting(
        1.0, "Converged when an iteration changes velocity-to-go by less.", "m/s", 1e-9, 100.0
    )
    jettison_time_tolerance_s: float = _setting(
        0.5, "Converged when an iteration moves the predicted jettison by less.", "s", 1e-6, 100.0
    )
    max_iterations: int = _setting(100, "Iterations allowed in one cycle.", "", 1, 10_000)
    max_solve_iterations: int = _setting(
        30,
        "Newton iterations that law optimal may take in one cycle; then PEG answers.",
        "",
        0,
        1000,
    )
    jettison_hold_time_s: float = _setting(
        50.0,
        "Law peg_thesis: time to the jettison from which the steering of modes 1 and 2 is held.",
        "s",
        0.0,
        120.0,
    )
    passes_per_cycle: int = _setting(
        1, "Law peg_thesis: iterations in one cycle, in place of max_iterations.", "", 1, 10_000
    )
    settled_below_m_s: float = _setting(
        10.0, "Law peg_thesis: in place of velocity_to_go_tolerance_m_s.", "m/s", 1e-9, 100.0
    )
    steering_jump_limit_deg: float = _setting(
        10.0, "A solution that turns the thrust by more is refused.", "deg", 0.0, 180.0
    )
    time_to_go_jump_limit_s: float = _setting(
        20.0, "A solution that moves the cut-off by more is refused.", "s", 0.0, 1e4
    )
    max_stale_cycles: int = _setting(
        3, "Cycles on the last good solution before starting again from nothing.", "", 0, 10_000
    )
    small_turn_limit_deg: float = _setting(
        40.0,
        "Turn of the thrust from its mean beyond which no angle is taken as small.",
        "deg",
        0.0,
        90.0,
    )
    restart_time_s: float = _setting(
        60.0,
        "Time to go below which a lost solution is held instead of starting again.",
        "s",
        0.0,
        1e4,
    )
    heating_source: str = "measured"
    boost_steering: str = "programme"
    heating_margin: float = _setting(
        1e-4, "Fraction of the heating limit that the jettison stays below.", "", 0.0, 0.99
    )

    steering_rate_limit_deg_s: float = _setting(
        90.0, "An answer that turns the thrust faster is not let out.", "deg/s", 1e-3, 1e6
    )
    navigation_gate_sigmas: float = _setting(
        6.0,
        "A navigation state farther from the one before it, carried on to now, is refused.",
        "",
        1.0,
        1e6,
    )
    navigation_position_sigma_m: float = _setting(
        10.0, "Error of a navigated position against another, per axis.", "m", 1e-3, 1e6
    )
    navigation_velocity_sigma_m_s: float = _setting(
        0.2, "Error of a navigated velocity, per axis.", "m/s", 1e-6, 1e4
    )
    navigation_acceleration_sigma_m_s2: float = _setting(
        0.02, "Gravity that the mission's field does not have.", "m/s2", 1e-9, 10.0
    )
    navigation_sensed_sigma: float = _setting(
        1e-3, "Error of the sensed velocity gain, a fraction.", "", 0.0, 0.2
    )
    navigation_mass_sigma: float = _setting(
        2e-4, "Error of a navigated mass against another, a fraction.", "", 1e-9, 0.2
    )
    navigation_load_sigma: float = _setting(
        0.05, "Error of the mission's stage and jettison masses, a fraction.", "", 0.0, 0.2
    )
    navigation_window_s: float = _setting(
        20.0,
        "A drift of navigation is looked for over one to two of these; a refused navigation that "
        "agrees with itself for as long is looked at again.",
        "s",
        0.1,
        1e4,
    )

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            ValueError: naming the setting, its value and what was expected.
        """
        for name, choices in CHOICES.items():
            value = getattr(self, name)
            if value not in choices:
                raise ValueError(f"{name} is {value!r}; expected " + " or ".join(choices))
        for item in fields(self):
            if not item.metadata:
                continue
            value = getattr(self, item.name)
            low, high = item.metadata["minimum"], item.metadata["maximum"]
            if not low <= value <= high:
                raise ValueError(f"{item.name} is {value}; expected {low:g} to {high:g}")

    def record(self) -> NDArray[np.void]:
        """Return the settings for the kernels, shape (1,), dtype GUIDANCE_SETTINGS."""
        record = np.zeros(1, layout.GUIDANCE_SETTINGS)
        record["cycle_period"] = self.cycle_period_s
        record["hold_time"] = self.hold_time_s
        record["velocity_to_go_tolerance"] = self.velocity_to_go_tolerance_m_s
        record["jettison_time_tolerance"] = self.jettison_time_tolerance_s
        record["max_iterations"] = self.max_iterations
        record["max_solve_iterations"] = self.max_solve_iterations
        record["steering_jump_limit"] = math.radians(self.steering_jump_limit_deg)
        record["time_to_go_jump_limit"] = self.time_to_go_jump_limit_s
        record["max_stale_cycles"] = self.max_stale_cycles
        record["restart_time"] = self.restart_time_s
        record["heating_source"] = HEATING_SOURCES[self.heating_source]
        record["boost_steering"] = BOOST_STEERINGS[self.boost_steering]
        record["heating_margin"] = self.heating_margin
        record["small_turn_limit"] = math.radians(self.small_turn_limit_deg)
        record["steering_rate_limit"] = math.radians(self.steering_rate_limit_deg_s)
        record["navigation_gate"] = self.navigation_gate_sigmas
        record["position_sigma"] = self.navigation_position_sigma_m
        record["velocity_sigma"] = self.navigation_velocity_sigma_m_s
        record["acceleration_sigma"] = self.navigation_acceleration_sigma_m_s2
        record["sensed_sigma"] = self.navigation_sensed_sigma
        record["mass_sigma"] = self.navigation_mass_sigma
        record["load_sigma"] = self.navigation_load_sigma
        record["navigation_window"] = self.navigation_window_s
        return record
