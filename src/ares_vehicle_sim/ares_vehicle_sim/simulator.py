"""The vehicle as an object: commands in, navigation states and events out. No ROS."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import NAVIGATION, MissionArrays
from ares_models.mission import Mission
from ares_vehicle_sim.arrays import OPTIONS, PLANT, TRUTH
from ares_vehicle_sim.dispersions import Dispersions, NavigationErrorModel, disperse
from ares_vehicle_sim.kernels import (
    UNIT_TOLERANCE,
    accept_command,
    begin_flight,
    command_is_sound,
    describe,
    flight_step,
    measure,
)

NANOSECONDS = 1_000_000_000


class CommandRefused(ValueError):
    """A steering command cannot be flown; the text is one line that says why."""


@dataclass(frozen=True)
class SimulatorOptions:
    """How the plant is stepped.

    Attributes:
        navigation_period_s: time between navigation states.
        integration_step_s: longest Runge-Kutta step.
        attitude_rate_limit_rad_s: inf lets the thrust follow the command at once.
    """

    navigation_period_s: float = 0.1
    integration_step_s: float = 0.1
    attitude_rate_limit_rad_s: float = math.inf


class Simulator:
    """One flight of one vehicle, stepped from navigation state to navigation state."""

    def __init__(
        self,
        mission: Mission,
        options: SimulatorOptions | None = None,
        dispersions: Dispersions | None = None,
        seed: int = 0,
    ) -> None:
        """Put the vehicle at the mission's initial state.

        Args:
            mission: what is flown.
            options: how it is stepped.
            dispersions: one-sigma values; None flies the mission file exactly.
            seed: seed of the flight's random streams.
        """
        options = options or SimulatorOptions()
        dispersions = dispersions or Dispersions()
        start = mission.start()
        vehicle = disperse(mission.arrays(), start.position, start.velocity, dispersions, seed)
        self._arrays: MissionArrays = vehicle.arrays
        self._errors = NavigationErrorModel(dispersions.navigation, seed)
        self._options = np.zeros(1, OPTIONS)
        self._options["max_step"] = options.integration_step_s
        self._options["attitude_rate_limit"] = options.attitude_rate_limit_rad_s
        self._plant = np.zeros(1, PLANT)
        self._plant["time"] = start.time_s
        self._plant["position"] = vehicle.position
        self._plant["velocity"] = vehicle.velocity
        self._nav = np.zeros(1, NAVIGATION)
        self._truth = np.zeros(1, TRUTH)
        self._start_ns = round(start.time_s * NANOSECONDS)
        self._period_ns = round(options.navigation_period_s * NANOSECONDS)
        self._tick = 0
        self._events_read = 0
        arrays = self._arrays
        begin_flight(
            self._plant[0],
            arrays.environment[0],
            arrays.atmosphere,
            arrays.arcs,
            arrays.jettisons,
        )
        self._measure()

    @property
    def plant(self) -> Any:
        """The true state, record PLANT; read only by custom."""
        return self._plant[0]

    @property
    def navigation(self) -> Any:
        """The present navigation state, record NAVIGATION."""
        return self._nav[0]

    @property
    def sequence(self) -> int:
        """Number of the present navigation state, from 0."""
        return self._tick

    @property
    def time_ns(self) -> int:
        """Mission elapsed time of the present state, in whole nanoseconds."""
        if self.complete:
            return round(float(self.plant["time"]) * NANOSECONDS)
        return self._start_ns + self._tick * self._period_ns

    @property
    def complete(self) -> bool:
        """The flight is over."""
        return bool(self.plant["complete"])

    @property
    def ended_well(self) -> bool:
        """The flight is over, and by a cut-off command."""
        return self.complete and bool(self.plant["inserted"])

    def command(self, steering: NDArray[np.void]) -> None:
        """Put a command in force.

        Args:
            steering: shape (1,), dtype STEERING.

        Raises:
            CommandRefused: the command cannot be flown; the last good one stays.
        """
        if not command_is_sound(steering[0], self._arrays.jettisons):
            raise CommandRefused(_complaint(steering[0], len(self._arrays.jettisons)))
        accept_command(self._plant[0], steering[0], self._arrays.jettisons)

    def advance(self) -> None:
        """Fly to the next navigation state, or to the end of the flight."""
        self._tick += 1
        arrays = self._arrays
        flight_step(
            self._plant[0],
            arrays.environment[0],
            arrays.atmosphere,
            arrays.arcs,
            arrays.jettisons,
            self._options[0],
            (self._start_ns + self._tick * self._period_ns) / NANOSECONDS,
        )
        self._measure()

    def new_events(self) -> NDArray[np.void]:
        """Events since the last call, dtype EVENT."""
        count = int(self.plant["event_count"])
        events = self.plant["events"][self._events_read : count].copy()
        self._events_read = count
        return events

    def truth(self) -> Any:
        """The true state in the words of VehicleState, record TRUTH."""
        arrays = self._arrays
        describe(
            self._plant[0],
            arrays.environment[0],
            arrays.atmosphere,
            arrays.arcs,
            self._truth[0],
        )
        return self._truth[0]

    def _measure(self) -> None:
        arrays = self._arrays
        measure(self._plant[0], arrays.environment[0], arrays.atmosphere, self._nav[0])
        self._errors.corrupt(self._nav)


def _complaint(command: Any, jettisons: int) -> str:
    """Which field of an unsound command is wrong, its value, and what was expected."""
    for name in ("reference_time", "direction", "direction_rate"):
        if not np.all(np.isfinite(command[name])):
            value = np.array2string(np.asarray(command[name]), separator=", ")
            return f"{name} is {value}; expected finite numbers"
    length = float(np.linalg.norm(command["direction"]))
    if abs(length - 1.0) > UNIT_TOLERANCE:
        return (
            f"direction has length {length:.9g}; expected a unit vector within {UNIT_TOLERANCE:g}"
        )
    for name in ("cutoff_time", "jettison_time"):
        if math.isinf(command[name]):
            return f"{name} is {command[name]}; expected a time or nan"
    return f"jettison is {command['jettison']}; expected -1 to {jettisons - 1}"
