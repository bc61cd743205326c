# SPDX-License-Identifier: Apache-2.0
"""Simulator of a flight: commands in, navigation states and events out. No ROS."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import HEATING_LIMIT, NAVIGATION, MissionArrays
from ares_models.failures import Failure, FailureKind, check_failure
from ares_models.kernels.steering import UNIT_TOLERANCE
from ares_models.mission import Mission
from ares_models.mission_warnings import FAR_ABOVE
from ares_models.units import NANOSECONDS
from ares_vehicle_sim import arrays as layout
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.draws import Sampler
from ares_vehicle_sim.kernels.entry import advance, begin, command, describe, next_tick
from ares_vehicle_sim.kernels.variation import vary

#: Fields of a navigation state without its time.
MEASURED_FIELDS = tuple(name for name in NAVIGATION.fields or () if name != "time")
SHORTEST_PERIOD_S = 1e-3
#: Dynamic pressure and q alpha, over their limits, from which on it is told at the end.
PASSED = 1.05
#: Largest measured heating, over the limit, at the last navigation state before a heating jettison;
#: a hotter one is refused. A jettison timed by the on-board model may be early: by a factor of at
#: most 1.05 in standard dispersed flights with a state each second.
MOST_HEATING = 2.0

#: Codes of the kernels for the kinds of failure, which have the same names there.
FAILURE_CODES: dict[FailureKind, int] = {kind: getattr(layout, kind.name) for kind in FailureKind}
FAILURE_KINDS = {code: kind for kind, code in FAILURE_CODES.items()}

#: Largest time, s, and rate, 1/s, of a command: beyond any flight, without overflow.
MOST_TIME = 1e9
MOST_RATE = 1e3


class CommandRefused(ValueError):
    """Report a command that cannot be flown; the text is the reason in one line."""


@dataclass(frozen=True)
class SimulatorOptions:
    """Hold the time steps and the attitude rate limit of the plant.

    Attributes:
        navigation_period_s: time between navigation states.
        integration_step_s: longest Runge-Kutta step.
        attitude_rate_limit_rad_s: with inf the thrust follows the command immediately.
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
        """Return the options for the kernels, shape (1,), dtype OPTIONS."""
        record = np.zeros(1, layout.OPTIONS)
        record["max_step"] = self.integration_step_s
        record["attitude_rate_limit"] = self.attitude_rate_limit_rad_s
        record["navigation_period"] = self.navigation_period_s
        return record


#: Options of campaigns and of their flights flown again alone. With steps of 1 s the final mass is
#: within 1e-5 kg of that with 0.1 s.
CAMPAIGN = SimulatorOptions(navigation_period_s=1.0, integration_step_s=1.0)


def nominal_truth(mission: Mission, dispersions: Dispersions) -> MissionArrays:
    """Compile the mission with the true gravity field, before the draws."""
    arrays = mission.arrays()
    if dispersions.j2 is not None:
        arrays.environment["j2"] = dispersions.j2
    return arrays


def room_for_truth(nominal: MissionArrays, atmosphere: NDArray[np.float64]) -> MissionArrays:
    """Allocate the mission arrays of one flight, for `kernels.variation.vary` to fill."""
    return nominal._replace(
        environment=nominal.environment.copy(),
        atmosphere=atmosphere,
        arcs=nominal.arcs.copy(),
        jettisons=nominal.jettisons.copy(),
    )


def nominal_vehicle(mission: Mission, options: SimulatorOptions) -> layout.VehicleArrays:
    """Return the vehicle at the mission's initial state, before the draws."""
    start = mission.start()
    vehicle = layout.blank_vehicle(options.record())
    vehicle.plant["time"] = start.time_s
    vehicle.plant["position"] = start.position
    vehicle.plant["velocity"] = start.velocity
    return vehicle


def failure_record(failure: Failure) -> NDArray[Any]:
    """Compile a failure that has not happened yet, shape (1,), dtype FAILURE."""
    record = np.zeros(1, layout.FAILURE)
    record["kind"] = FAILURE_CODES[failure.kind]
    record["time"] = failure.time_s if math.isfinite(failure.time_s) else math.inf
    record["arc"] = failure.arc
    record["jettison"] = failure.jettison
    record["thrust_ratio"] = failure.thrust_ratio
    lost = failure.kind is FailureKind.ENGINE_OUT
    record["flow_ratio"] = failure.thrust_ratio if lost else failure.flow_ratio
    return record


def true_vehicle(
    mission: Mission,
    options: SimulatorOptions,
    dispersions: Dispersions,
    seed: int,
    flight: int = 0,
    failure: Failure | None = None,
) -> tuple[MissionArrays, layout.VehicleArrays]:
    """Draw the true mission and the vehicle of one flight, at its start.

    Args:
        mission: the mission.
        options: time steps of the plant.
        dispersions: of the truth.
        seed: master seed.
        flight: number of the flight within the seed.
        failure: of the flight, or None.

    Raises:
        DispersionsError: the dispersions do not fit the mission; one line.
        FailureError: the failure does not fit the mission; one line.
    """
    draws = Sampler(mission, dispersions, seed).draw(flight, 1)
    nominal = nominal_truth(mission, dispersions)
    true = room_for_truth(nominal, draws.atmospheres[0])
    vehicle = nominal_vehicle(mission, options)
    vary(draws.variations[0], nominal, true, vehicle.plant[0])
    if failure is not None:
        check_failure(failure, mission)
        vehicle.plant["failure"] = failure_record(failure)
    begin(true, vehicle)
    return true, vehicle


class Simulator:
    """Fly one flight, stepped from navigation state to navigation state."""

    def __init__(
        self,
        mission: Mission,
        options: SimulatorOptions | None = None,
        dispersions: Dispersions | None = None,
        seed: int = 0,
        flight: int = 0,
        failure: Failure | None = None,
    ) -> None:
        """Put the vehicle at the mission's initial state.

        Args:
            mission: the mission.
            options: time steps of the plant.
            dispersions: of the truth; None flies the mission file exactly.
            seed: master seed of the draws.
            flight: number of the flight within the seed.
            failure: of the flight, or None.

        Raises:
            DispersionsError: the dispersions do not fit the mission; one line.
            FailureError: the failure does not fit the mission; one line.
        """
        options = options or SimulatorOptions()
        self._mission, self._vehicle = true_vehicle(
            mission, options, dispersions or Dispersions(), seed, flight, failure
        )
        self._start_ns = round(float(self.plant["time"]) * NANOSECONDS)
        self._period_ns = round(options.navigation_period_s * NANOSECONDS)
        self._tick = self._sequence = 0
        self._events_read = 0
        self._no_events = self.plant["events"][:0].copy()
        self._measured = self._vehicle.navigation[list(MEASURED_FIELDS)]
        jettisons = self._mission.jettisons
        self._hottest = {
            int(j): MOST_HEATING * float(jettisons["value"][j])
            for j in np.flatnonzero(jettisons["criterion"] == HEATING_LIMIT)
        }

    @property
    def plant(self) -> Any:
        """Return the true state, record PLANT; callers only read it."""
        return self._vehicle.plant[0]

    @property
    def navigation(self) -> Any:
        """Return the present navigation state, record NAVIGATION."""
        return self._vehicle.navigation[0]

    @property
    def measured(self) -> Any:
        """Return the present navigation state in the fields of NavState."""
        return self._measured[0]

    @property
    def sequence(self) -> int:
        """Return the number of the present navigation state, from 0."""
        return self._sequence

    @property
    def time_ns(self) -> int:
        """Return the mission elapsed time of the present state, ns."""
        plant = self.plant
        if plant["complete"]:
            return round(float(plant["time"]) * NANOSECONDS)
        return self._start_ns + self._tick * self._period_ns

    @property
    def complete(self) -> bool:
        """Return whether the flight is over."""
        return bool(self.plant["complete"])

    @property
    def ended_well(self) -> bool:
        """Return whether the flight has ended by a cut-off command."""
        return self.complete and bool(self.plant["inserted"])

    @property
    def escaped(self) -> str:
        """Return the reason why the requested failure did not happen, one line, or ""."""
        failure = self.plant["failure"]
        if failure["kind"] == layout.NO_FAILURE or failure["struck"] == layout.STRUCK:
            return ""
        kind = FAILURE_KINDS[int(failure["kind"])]
        vain = "no throttle" if failure["kind"] == layout.STUCK_THROTTLE else "a coast"
        why = (
            f"it struck {vain}" if failure["struck"] == layout.IN_VAIN else "its time did not come"
        )
        return f"failure {kind}: {why}, nothing failed"

    @property
    def overloads(self) -> tuple[str, ...]:
        """Return what passed its limit by far up to now, one line each."""
        lines = []
        jettisons = self._mission.jettisons
        limits = jettisons["value"][jettisons["criterion"] == HEATING_LIMIT]
        peak = float(self.plant["peak_heating_after_jettison"])
        if len(limits) and peak > FAR_ABOVE * limits.min():
            times = peak / limits.min()
            lines.append(
                f"heating after the jettison reached {peak:,.0f} W/m2, {times:,.0f} times its limit"
            )
        for name, share in (("dynamic pressure", "dynamic_pressure"), ("q alpha", "q_alpha")):
            reached = float(self.plant[f"{share}_share"])
            if reached > PASSED:
                lines.append(f"{name} reached {reached:.2f} times its limit")
        return tuple(lines)

    def command(self, steering: NDArray[np.void]) -> None:
        """Accept a command.

        Args:
            steering: shape (1,), dtype STEERING.

        Raises:
            CommandRefused: the command cannot be flown; the last good one stays in force.
        """
        too_much = _beyond(steering[0])
        if too_much:
            raise CommandRefused(too_much)
        cutoff_time = float(steering[0]["cutoff_time"])
        past = self._time_at(self._tick - 1)
        if cutoff_time < past and not self.plant["inserted"]:
            raise CommandRefused(
                f"cutoff_time is {cutoff_time:.9g} s; expected {past:.9g} s or later, or nan"
            )
        jettison = int(steering[0]["jettison"])
        self._check_heating(jettison, float(steering[0]["jettison_time"]))
        if not command(self._mission, self._vehicle, steering):
            raise CommandRefused(_complaint(steering[0], len(self._mission.jettisons)))

    def withhold_jettison(self) -> None:
        """Cancel a jettison that is due before the next navigation state while it is too hot.

        Raises:
            CommandRefused: a jettison was cancelled.
        """
        for jettison in self._hottest:
            due = self.plant["jettison_time"]
            try:
                self._check_heating(jettison, float(due[jettison]))
            except CommandRefused:
                due[jettison] = math.nan
                raise

    def _check_heating(self, jettison: int, due: float) -> None:
        """Check the heating at a jettison (index; time, s) before the next navigation state.

        Raises:
            CommandRefused: it is too hot.
        """
        hottest = self._hottest.get(jettison, math.inf)
        heating = float(self.navigation["heating_rate"])
        if heating > hottest and due <= self._time_at(self._tick + 1):
            raise CommandRefused(
                f"jettison is {jettison}, due with a heating of {heating:.6g} W/m2; expected "
                f"{hottest:.6g} W/m2 at most"
            )

    def _time_at(self, tick: int) -> float:
        """Return the mission elapsed time of a navigation state by its number, s."""
        return (self._start_ns + tick * self._period_ns) / NANOSECONDS

    def advance(self, each_period: bool = False) -> None:
        """Fly to the next navigation state, or to the end of the flight.

        Args:
            each_period: a navigation state each period in long coasts too.
        """
        self._sequence += 1
        ahead = self._tick + 1
        self._tick = ahead if each_period else next_tick(self._mission, self._vehicle, self._tick)
        advance(self._mission, self._vehicle, self._time_at(self._tick))

    def new_events(self) -> NDArray[np.void]:
        """Return the events since the last call, dtype EVENT."""
        plant = self.plant
        count = int(plant["event_count"])
        if count == self._events_read:
            return self._no_events
        events = plant["events"][self._events_read : count].copy()
        self._events_read = count
        return events

    def truth(self) -> Any:
        """Return the true state in the fields of VehicleState, record TRUTH."""
        describe(self._mission, self._vehicle)
        return self._vehicle.truth[0]


def _beyond(command: Any) -> str:
    """Return the problem of a number that is too large to compute with, or ""."""
    time, rate = float(command["reference_time"]), command["direction_rate"].tolist()
    # NaN passes here: another check reports it
    if abs(time) > MOST_TIME:
        return f"reference_time is {time:g} s; expected {MOST_TIME:g} s at most"
    if max(map(abs, rate)) > MOST_RATE:
        return f"direction_rate is {rate}; expected {MOST_RATE:g} 1/s at most"
    return ""


def _complaint(command: Any, jettisons: int) -> str:
    """Describe the wrong field of an invalid command, its value and the expected one."""
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
