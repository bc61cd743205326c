"""The vehicle as an object: commands in, navigation states and events out. No ROS."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import NAVIGATION, MissionArrays
from ares_models.mission import Mission
from ares_vehicle_sim.arrays import OPTIONS, VehicleArrays, blank_vehicle
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.draws import Sampler
from ares_vehicle_sim.kernels.entry import advance, begin, command, describe
from ares_vehicle_sim.kernels.plant import UNIT_TOLERANCE
from ares_vehicle_sim.kernels.variation import vary

NANOSECONDS = 1_000_000_000
#: Fields of a navigation state without its time.
MEASURED_FIELDS = tuple(name for name in NAVIGATION.fields or () if name != "time")
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
        record["navigation_period"] = self.navigation_period_s
        return record


#: How campaigns fly, and a flight of theirs that is flown again alone. Steps of 1 s end within
#: 1e-5 kg of steps of 0.1 s.
CAMPAIGN = SimulatorOptions(navigation_period_s=1.0, integration_step_s=1.0)


def nominal_truth(mission: Mission, dispersions: Dispersions) -> MissionArrays:
    """The mission with the gravity field of the truth, before anything is drawn."""
    arrays = mission.arrays()
    if dispersions.j2 is not None:
        arrays.environment["j2"] = dispersions.j2
    return arrays


def room_for_truth(nominal: MissionArrays, atmosphere: NDArray[np.float64]) -> MissionArrays:
    """Arrays for the mission of one flight, to be filled by `kernels.variation.vary`."""
    return nominal._replace(
        environment=nominal.environment.copy(),
        atmosphere=atmosphere,
        arcs=nominal.arcs.copy(),
        jettisons=nominal.jettisons.copy(),
    )


def nominal_vehicle(mission: Mission, options: SimulatorOptions) -> VehicleArrays:
    """The vehicle at the mission's initial state, before anything is drawn."""
    start = mission.start()
    vehicle = blank_vehicle(options.record())
    vehicle.plant["time"] = start.time_s
    vehicle.plant["position"] = start.position
    vehicle.plant["velocity"] = start.velocity
    return vehicle


def true_vehicle(
    mission: Mission,
    options: SimulatorOptions,
    dispersions: Dispersions,
    seed: int,
    flight: int = 0,
) -> tuple[MissionArrays, VehicleArrays]:
    """Draw the mission and the vehicle of one flight, at the begin of it.

    Args:
        mission: what is flown.
        options: how the plant is stepped.
        dispersions: how the truth differs.
        seed: master seed.
        flight: number of the flight among those of the seed.

    Raises:
        DispersionsError: the dispersions do not fit the mission; one line.
    """
    draws = Sampler(mission, dispersions, seed).draw(flight, 1)
    nominal = nominal_truth(mission, dispersions)
    true = room_for_truth(nominal, draws.atmospheres[0])
    vehicle = nominal_vehicle(mission, options)
    vary(draws.variations[0], nominal, true, vehicle.plant[0])
    begin(true, vehicle)
    return true, vehicle


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
        self._mission, self._vehicle = true_vehicle(
            mission, options, dispersions or Dispersions(), seed, flight
        )
        self._start_ns = round(float(self.plant["time"]) * NANOSECONDS)
        self._period_ns = round(options.navigation_period_s * NANOSECONDS)
        self._tick = 0
        self._events_read = 0
        self._no_events = self.plant["events"][:0].copy()
        self._measured = self._vehicle.navigation[list(MEASURED_FIELDS)]

    @property
    def plant(self) -> Any:
        """The true state, record PLANT; read only by custom."""
        return self._vehicle.plant[0]

    @property
    def navigation(self) -> Any:
        """The present navigation state, record NAVIGATION."""
        return self._vehicle.navigation[0]

    @property
    def measured(self) -> Any:
        """The present navigation state in the words of NavState."""
        return self._measured[0]

    @property
    def sequence(self) -> int:
        """Number of the present navigation state, from 0."""
        return self._tick

    @property
    def time_ns(self) -> int:
        """Mission elapsed time of the present state, in whole nanoseconds."""
        plant = self.plant
        if plant["complete"]:
            return round(float(plant["time"]) * NANOSECONDS)
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
        if not command(self._mission, self._vehicle, steering):
            raise CommandRefused(_complaint(steering[0], len(self._mission.jettisons)))

    def advance(self) -> None:
        """Fly to the next navigation state, or to the end of the flight."""
        self._tick += 1
        until = (self._start_ns + self._tick * self._period_ns) / NANOSECONDS
        advance(self._mission, self._vehicle, until)

    def new_events(self) -> NDArray[np.void]:
        """Events since the last call, dtype EVENT."""
        plant = self.plant
        count = int(plant["event_count"])
        if count == self._events_read:
            return self._no_events
        events = plant["events"][self._events_read : count].copy()
        self._events_read = count
        return events

    def truth(self) -> Any:
        """The true state in the words of VehicleState, record TRUTH."""
        describe(self._mission, self._vehicle)
        return self._vehicle.truth[0]


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
    for name in ("cutoff_time", "jettison_time", "arc_end_times"):
        if np.any(np.isinf(command[name])):
            return f"{name} is {command[name]}; expected a time or nan"
    return f"jettison is {command['jettison']}; expected -1 to {jettisons - 1}"
