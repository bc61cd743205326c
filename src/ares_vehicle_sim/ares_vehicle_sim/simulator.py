"""The vehicle as an object: commands in, navigation states and events out. No ROS."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import NAVIGATION, MissionArrays
from ares_models.mission import Mission
from ares_vehicle_sim.arrays import OPTIONS, PLANT, TRUTH
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.draws import Sampler
from ares_vehicle_sim.kernels.navigation import measure
from ares_vehicle_sim.kernels.plant import (
    UNIT_TOLERANCE,
    accept_command,
    begin_flight,
    command_is_sound,
    describe,
    flight_step,
)
from ares_vehicle_sim.kernels.variation import vary

NANOSECONDS = 1_000_000_000
SHORTEST_PERIOD_S = 1e-3


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

    def __post_init__(self) -> None:
        """Check the times.

        Raises:
            ValueError: naming the option, its value and what was expected.
        """
        for name in ("navigation_period_s", "integration_step_s"):
            value = getattr(self, name)
            if not SHORTEST_PERIOD_S <= value < math.inf:
                raise ValueError(f"{name} is {value}; expected at least {SHORTEST_PERIOD_S:g} s")

    def record(self) -> NDArray[np.void]:
        """The options as the plant's kernel reads them, shape (1,), dtype OPTIONS."""
        record = np.zeros(1, OPTIONS)
        record["max_step"] = self.integration_step_s
        record["attitude_rate_limit"] = self.attitude_rate_limit_rad_s
        return record


#: How campaigns fly, and a flight of theirs that is flown again alone. Steps of 1 s end within
#: 1e-5 kg of steps of 0.1 s.
CAMPAIGN = SimulatorOptions(navigation_period_s=1.0, integration_step_s=1.0)


@dataclass(frozen=True)
class TrueVehicle:
    """The vehicle as it is in one flight, at the begin of it.

    Attributes:
        arrays: the mission as the plant flies it.
        plant: shape (1,), dtype PLANT.
    """

    arrays: MissionArrays
    plant: NDArray[np.void]


def true_environment(mission: Mission, dispersions: Dispersions) -> NDArray[np.void]:
    """The mission's environment with the gravity field of the truth, shape (1,)."""
    environment = mission.arrays().environment
    if dispersions.j2 is not None:
        environment["j2"] = dispersions.j2
    return environment


def true_vehicle(
    mission: Mission, dispersions: Dispersions, seed: int, flight: int = 0
) -> TrueVehicle:
    """Draw the vehicle of one flight.

    Args:
        mission: what is flown.
        dispersions: how it differs.
        seed: master seed.
        flight: number of the flight among those of the seed.

    Raises:
        DispersionsError: the dispersions do not fit the mission; one line.
    """
    draws = Sampler(mission, dispersions, seed).draw(flight, 1)
    start = mission.start()
    nominal = mission.arrays()
    true = MissionArrays(
        nominal.environment.copy(),
        draws.atmospheres[0],
        nominal.arcs.copy(),
        nominal.jettisons.copy(),
        nominal.target,
    )
    plant = np.zeros(1, PLANT)
    plant["time"] = start.time_s
    vary(
        draws.variations[0],
        tuple(start.position.tolist()),
        tuple(start.velocity.tolist()),
        true_environment(mission, dispersions),
        nominal.arcs,
        nominal.jettisons,
        true.environment,
        true.arcs,
        true.jettisons,
        plant[0],
    )
    begin_flight(plant[0], true.environment[0], true.atmosphere, true.arcs, true.jettisons)
    return TrueVehicle(true, plant)


class Simulator:
    """One flight of one vehicle, stepped from navigation state to navigation state."""

    def __init__(
        self,
        mission: Mission,
        options: SimulatorOptions | None = None,
        dispersions: Dispersions | None = None,
        seed: int = 0,
        flight: int = 0,
    ) -> None:
        """Put the vehicle at the mission's initial state.

        Args:
            mission: what is flown.
            options: how it is stepped.
            dispersions: how the truth differs; None flies the mission file exactly.
            seed: master seed of what is drawn.
            flight: number of the flight among those of the seed.

        Raises:
            DispersionsError: the dispersions do not fit the mission; one line.
        """
        options = options or SimulatorOptions()
        vehicle = true_vehicle(mission, dispersions or Dispersions(), seed, flight)
        self._arrays = vehicle.arrays
        self._plant = vehicle.plant
        self._options = options.record()
        self._nav = np.zeros(1, NAVIGATION)
        self._truth = np.zeros(1, TRUTH)
        self._start_ns = round(float(self.plant["time"]) * NANOSECONDS)
        self._period_ns = round(options.navigation_period_s * NANOSECONDS)
        self._tick = 0
        self._events_read = 0
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
        accept_command(self._plant[0], steering[0])

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
        measure(self._plant[0], self._nav[0])


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
