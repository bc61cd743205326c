# SPDX-License-Identifier: Apache-2.0
"""Fictitious vehicle for tests only."""

import math
from typing import Any

import numpy as np

from ares_models.arrays import (
    ARC,
    BURN,
    COAST,
    ENVIRONMENT,
    HEATING_LIMIT,
    JETTISON,
    STEERING,
    TARGET,
    MissionArrays,
)
from ares_vehicle_sim.arrays import OPTIONS, blank_vehicle
from ares_vehicle_sim.kernels.entry import advance, begin, command

MU = 3.986e14
VACUUM = np.array([[0.0, -100.0, -1e-5, 0.0, 0.0], [1e6, -110.0, -1e-5, 0.0, 0.0]])


class Craft:
    """Simulate two stages: a burn; a coast, a fixed burn and a free burn."""

    def __init__(
        self,
        mu: float = MU,
        criterion: int = HEATING_LIMIT,
        value: float = 1135.0,
        jettison_stage: int = 1,
    ) -> None:
        """Start above the ground at 50 s with thrust along y and one jettison.

        Args:
            mu: m3/s2.
            criterion: of the jettison.
            value: of the criterion, W/m2 or s.
            jettison_stage: stage whose ignition the jettison follows.
        """
        self.environment = np.zeros(1, ENVIRONMENT)
        self.environment["mu"] = mu
        self.environment["equatorial_radius"] = 6378140.0
        self.environment["polar_radius"] = 6356750.0
        self.environment["density_factor"] = 1.0
        self.arcs = np.zeros(4, ARC)
        self.arcs["kind"] = [BURN, COAST, BURN, BURN]
        self.arcs["stage"] = [0, 1, 1, 1]
        self.arcs["begins_stage"] = [1, 1, 0, 0]
        self.arcs["thrust"] = [5.0e6, 0.0, 9.0e5, 6.0e5]
        self.arcs["exhaust_velocity"] = [4000.0, 1.0, 4300.0, 4300.0]
        self.arcs["mass_flow"] = self.arcs["thrust"] / self.arcs["exhaust_velocity"]
        self.arcs["duration"] = [100.0, 10.0, 60.0, math.inf]
        self.arcs["stack_mass"] = [300e3, 110e3, 110e3, 110e3]
        self.arcs["propellant"] = [125e3, 80e3, 80e3, 80e3]
        self.arcs["longest"] = self.arcs["shortest"] = self.arcs["duration"]
        self.arcs["shortest"][3] = 0.0
        self.arcs["max_acceleration"] = math.inf
        self.jettisons = np.zeros(1, JETTISON)
        self.jettisons["mass"] = 2000.0
        self.jettisons["criterion"] = criterion
        self.jettisons["value"] = value
        self.jettisons["stage"] = jettison_stage
        self.options = np.zeros(1, OPTIONS)
        self.options["max_step"] = 0.1
        self.options["attitude_rate_limit"] = math.inf
        self.carried = blank_vehicle(self.options)
        self.plant = self.carried.plant
        self.plant["time"] = 50.0
        self.plant["position"] = [6.5e6, 0.0, 0.0]
        self.plant["velocity"] = [500.0, 2000.0, 300.0]
        self.steering = np.zeros(1, STEERING)
        self.steering["direction"] = [0.0, 1.0, 0.0]
        self.steering["reference_time"] = 50.0
        self.steering["cutoff_time"] = math.nan
        self.steering["jettison"] = -1
        self.steering["jettison_time"] = math.nan
        self.steering["arc_end_times"] = math.nan

    @property
    def mission(self) -> MissionArrays:
        """Return the mission of the vehicle."""
        return MissionArrays(
            self.environment, VACUUM, self.arcs, self.jettisons, np.zeros(1, TARGET)
        )

    def begin(self) -> None:
        """Begin the flight with the first command."""
        begin(self.mission, self.carried)
        assert command(self.mission, self.carried, self.steering)

    def fly(self, until: float, period: float = 0.1) -> Any:
        """Fly from the start to a time, s, by one command; return record PLANT."""
        self.begin()
        for k in range(1, round((until - 50.0) / period) + 1):
            advance(self.mission, self.carried, 50.0 + k * period)
        return self.plant[0]

    def events(self, kind: int) -> Any:
        """Return the events of a kind so far, dtype EVENT."""
        logged = self.plant[0]["events"][: self.plant[0]["event_count"]]
        return logged[logged["type"] == kind]
