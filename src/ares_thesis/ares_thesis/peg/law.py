# SPDX-License-Identifier: Apache-2.0
"""Law `peg_thesis`: PEG as the thesis flew it (section 6.4)."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ares_guidance.law import Law, LawKind, name_free_arcs
from ares_guidance.plan import plan_of
from ares_guidance.settings import LawSettings
from ares_guidance.trajectory import OfflineTrajectory
from ares_models.arrays import (
    BURN,
    HEATING_LIMIT,
    NAMES_INCLINATION,
    TARGET_ELEMENTS,
    MissionArrays,
)
from ares_models.kernels.targets import names
from ares_models.plans import LONG_COAST_S, coasts_long, leaves_arcs_free, needs_plan
from ares_thesis.peg.arrays import (
    LAW_PEG_THESIS,
    PLANE_FREE,
    PLANE_OF_FLIGHT,
    PLANE_OF_MODE,
    THESIS_MEMORY,
)
from ares_thesis.peg.kernels import step_by_modes
from ares_thesis.peg.plan import JettisonPlan

#: Planes that modes 1 and 2 can hold.
PLANES = {"mode": PLANE_OF_MODE, "flight": PLANE_OF_FLIGHT, "free": PLANE_FREE}


@dataclass(frozen=True)
class Pins:
    """Select constraints of the thesis' architecture; all hold by default.

    Attributes:
        plane: constraint of modes 1 and 2: ``mode``, the plane at the start of each mode (this
            pins node and inclination at staging and at the jettison); ``flight``, the plane at
            the start of the flight; ``free``, the inclination alone.
        split_at_staging: mode 2 begins at staging. False: mode 1 lasts to the jettison.
    """

    plane: str = "mode"
    split_at_staging: bool = True

    def __post_init__(self) -> None:
        """Check the plane.

        Raises:
            ValueError: there is no such plane.
        """
        if self.plane not in PLANES:
            raise ValueError(f"plane is {self.plane!r}; expected one of {', '.join(PLANES)}")


class ThesisPeg(Law):
    """Fly modes 1, 2 and 3, each to a target of its own.

    The law needs the planned jettison before it starts (`follow`); without it, it is plain
    multi-stage PEG.
    """

    def __init__(
        self,
        arrays: MissionArrays,
        settings: LawSettings | None = None,
        pins: Pins | None = None,
    ) -> None:
        """Prepare for a plan.

        Args:
            arrays: the mission as guidance believes it.
            settings: cycle and gates.
            pins: constraints that hold; default all.

        Raises:
            ValueError: free arcs before the last, long coasts, throttled burns, other than two
                stages with one heating jettison in the second, or a target without an inclination.
        """
        if leaves_arcs_free(arrays.arcs):
            raise ValueError(
                "law is 'peg_thesis'; expected peg, igm or optimal, which fly arcs before the last "
                f"that are free, as {name_free_arcs(arrays)}"
            )
        if coasts_long(arrays.arcs):
            raise ValueError(
                "law is 'peg_thesis'; expected peg, igm or optimal, which fly coasts of more than "
                f"{LONG_COAST_S:g} s between burns"
            )
        throttled = (arrays.arcs["kind"] == BURN) & np.isfinite(arrays.arcs["max_acceleration"])
        if throttled.any():
            raise ValueError(
                "law is 'peg_thesis'; expected peg, igm or optimal, which fly burns with "
                f"max_acceleration_m_s2, as arc {int(np.argmax(throttled))}"
            )
        stages = int(arrays.arcs["stage"][-1]) + 1
        jettisons = arrays.jettisons
        if (
            stages != 2
            or len(jettisons) != 1
            or jettisons["criterion"][0] != HEATING_LIMIT
            or jettisons["stage"][0] != 1
        ):
            heating = int(np.sum(jettisons["criterion"] == HEATING_LIMIT))
            raise ValueError(
                f"law is 'peg_thesis', which flies two stages with one jettison by "
                f"heating_limit_w_m2 in the second; here are {stages} stages and {len(jettisons)} "
                f"jettisons, {heating} by heating: use peg, igm or optimal"
            )
        target = arrays.target[0]
        if target["kind"] == TARGET_ELEMENTS and not names(target, NAMES_INCLINATION):
            raise ValueError(
                "the mission's target leaves the inclination free; law peg_thesis holds one"
            )
        self._early, self._late = _rules(settings or LawSettings())
        self._pins = pins or Pins()
        self._plan: JettisonPlan | None = None
        super().__init__(arrays, settings, LAW)

    def follow(self, plan: JettisonPlan) -> None:
        """Fly the next flight to this jettison."""
        self._plan = plan
        self.reset()

    def start_from(self, trajectory: OfflineTrajectory) -> None:
        """Fly the next flight to the jettison of a trajectory.

        Raises:
            ValueError: the trajectory has none.
        """
        self._plan = JettisonPlan.from_trajectory(trajectory)
        if needs_plan(self._arrays.arcs, self._arrays.target[0], self._arrays.environment[0]):
            self.follow_arcs(plan_of(trajectory, self._arrays))
        else:
            self.reset()

    def _begin(self) -> None:
        """Initialize the arrays of guidance for a flight, with both plans."""
        super()._begin()
        plan = self._plan
        if plan is None:
            return
        arrays = self._arrays
        memory = self.memory
        memory["planned"] = 1
        memory["part_two"] = plan.cutoff_time_s - plan.jettison_time_s
        memory["delta_v"] = plan.delta_v_m_s
        memory["plane"] = PLANES[self._pins.plane]
        memory["split_at_staging"] = self._pins.split_at_staging
        memory["early_rules"], memory["late_rules"] = self._early, self._late
        memory["early_arcs"][: len(arrays.arcs)] = arrays.arcs
        last = memory["early_arcs"][len(arrays.arcs) - 1]
        last["tail_knots"] = 0
        last["tail_gain"] = 0.0
        target = memory["target"]
        target["inclination"] = arrays.target["inclination"][0]
        target["radius"] = plan.radius_m
        target["speed"] = plan.speed_m_s
        target["flight_path_angle"] = plan.flight_path_angle_rad


def _rules(settings: LawSettings) -> tuple[Any, Any]:
    """Return the settings of modes 1 and 2 and those of mode 3, records GUIDANCE_SETTINGS."""
    rules = np.repeat(settings.record(), 2)
    rules["max_iterations"] = settings.passes_per_cycle
    rules["velocity_to_go_tolerance"] = settings.settled_below_m_s
    rules["small_turn_limit"] = math.inf
    early, late = rules
    early["hold_time"] = settings.jettison_hold_time_s
    return early, late


LAW = LawKind(
    "peg_thesis",
    LAW_PEG_THESIS,
    step_by_modes,
    ThesisPeg,
    trajectory_method="analytic",
    memory=THESIS_MEMORY,
)
