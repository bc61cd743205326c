# SPDX-License-Identifier: Apache-2.0
"""Convert a flight's columns to series for charts and the globe. SI; degrees for people."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_guidance.arrays import PHASE_BOOST
from ares_models.mission import Mission
from ares_models.orbits import Elements
from ares_models.passage import THIN_AIR_PA
from ares_models.plans import flies_in_air
from ares_studies.flight_page.budget import Budget, make_budget, propellant_left
from ares_studies.flight_page.geometry import (
    GroundTrack,
    attitude,
    ground_range,
    ground_track,
    impact_track,
)

Array = NDArray[np.float64]
Columns = Mapping[str, NDArray[Any]]

#: Most states of a flight on the page.
MAX_STATES = 1500
#: Most impact points of a flight.
MAX_IMPACTS = 300
#: Navigation error below which navigation equals the truth, m and m/s.
_NO_ERROR = 1e-9


@dataclass(frozen=True)
class Optimality:
    """Hold the optimality conditions along an optimum, shape (n,) each.

    Attributes:
        time_s: mission elapsed time; repeated at an event.
        primer: norm of the primer vector, the costate of the velocity; 1 at the start.
        primer_up, primer_ahead, primer_right: its components upwards as the pitch has it, along the
            horizontal velocity, and to the right of it.
        switching: switching function, kg of final mass per kg of propellant; nan: the length of the
            burn is fixed.
        hamiltonian_m_s2: with mass costate and propellant multiplier.
    """

    time_s: Array
    primer: Array
    primer_up: Array
    primer_ahead: Array
    primer_right: Array
    switching: Array
    hamiltonian_m_s2: Array


@dataclass(frozen=True)
class Recording:
    """Hold a flight as recorded in a bag.

    Attributes:
        name: of the bag.
        law: guidance law.
        mission: flown mission.
        truth: columns of VehicleState, with `time` in s; at least one row.
        navigation: columns of NavState, with `time` in s; without rows, only `time`.
        status: columns of GuidanceStatus, with `time` in s; without rows, only `time`.
        optimality: of an optimum; None: a flown flight.
    """

    name: str
    law: str
    mission: Mission
    truth: Columns
    navigation: Columns
    status: Columns
    optimality: Optimality | None = None


@dataclass(frozen=True)
class Phase:
    """Hold an interval of the flight: its name, whether an engine burns, first and last state."""

    name: str
    burns: bool
    first: int
    last: int


@dataclass(frozen=True)
class States:
    """Hold the truth, shape (n,) each: at most MAX_STATES rows, with all changes of phase.

    Attributes:
        time_s: mission elapsed time.
        altitude_m: as defined by the mission.
        speed_m_s, relative_speed_m_s: inertial, and relative to the rotating air.
        flight_path_angle_deg: of the inertial velocity.
        pitch_deg, yaw_deg, azimuth_deg: of the thrust, see `attitude`; nan in the first state of a
            flight too, which precedes the first command, as are the angle of attack and what it
            makes.
        mass_kg, thrust_n: of the vehicle.
        acceleration_m_s2: along the thrust, by thrust and air, as sensed by accelerometers.
        lateral_acceleration_m_s2: the same across the thrust; nan: unknown.
        dynamic_pressure_pa, mach: of the speed relative to the air; nan: unknown.
        angle_of_attack_deg: from the velocity relative to the air to the thrust; nan: unknown.
        q_alpha_pa_rad: dynamic pressure times sine of the angle of attack; nan: unknown.
        heating_w_m2: free molecular heating.
        perigee_m, apogee_m: of the osculating orbit above the equatorial radius; nan: none.
        inclination_deg, eccentricity: of the osculating orbit.
        range_m: length of the ground track.
        track: the ground track.
    """

    time_s: Array
    altitude_m: Array
    speed_m_s: Array
    relative_speed_m_s: Array
    flight_path_angle_deg: Array
    pitch_deg: Array
    yaw_deg: Array
    azimuth_deg: Array
    mass_kg: Array
    thrust_n: Array
    acceleration_m_s2: Array
    lateral_acceleration_m_s2: Array
    dynamic_pressure_pa: Array
    mach: Array
    angle_of_attack_deg: Array
    q_alpha_pa_rad: Array
    heating_w_m2: Array
    perigee_m: Array
    apogee_m: Array
    inclination_deg: Array
    eccentricity: Array
    range_m: Array
    track: GroundTrack


@dataclass(frozen=True)
class AirLimit:
    """Hold a limit of the mission in the air: a column of States, its limit, its greatest value."""

    column: str
    limit: float
    most: float


@dataclass(frozen=True)
class AirPart:
    """Hold the part of a flight in the air.

    Attributes:
        until_s: its last instant, mission elapsed time.
        max_q_pa, max_q_alpha_pa_rad: greatest dynamic pressure, and times angle of attack.
        limits: those of the mission.
    """

    until_s: float
    max_q_pa: float
    max_q_alpha_pa_rad: float
    limits: tuple[AirLimit, ...]


@dataclass(frozen=True)
class Guidance:
    """Hold the guidance status, a row per cycle, shape (n,) each; nan: unknown."""

    time_s: Array
    time_to_go_s: Array
    iterations: Array
    cutoff_s: Array
    jettison_s: Array


@dataclass(frozen=True)
class NavigationDeviation:
    """Hold navigation minus truth: distances, shape (n,) each."""

    time_s: Array
    position_m: Array
    velocity_m_s: Array


#: Law name of an optimum.
OPTIMUM = "optimum"


@dataclass(frozen=True)
class DrawnFlight:
    """Hold a flight, ready to be drawn.

    Attributes:
        name: of its bag.
        law: guidance law.
        mission: flown mission.
        states: the truth.
        phases: of the states, in order.
        guidance: None without a status.
        navigation: None if it equals the truth.
        impact_time_s: times of the impact points, shape (m,).
        impact: instantaneous impact points.
        heating_limit_w_m2: lowest limit of the mission; None: none.
        air: its part in the air; None: it is above the air all the time.
        propellant_kg: left in the running stage, per state, from the mission's masses.
        budget: delta-V budget.
        optimality: of an optimum; None: a flown flight.
    """

    name: str
    law: str
    mission: Mission
    states: States
    phases: tuple[Phase, ...]
    guidance: Guidance | None
    navigation: NavigationDeviation | None
    impact_time_s: Array
    impact: GroundTrack
    heating_limit_w_m2: float | None
    air: AirPart | None
    propellant_kg: Array
    budget: Budget
    optimality: Optimality | None


def make_flight(recording: Recording) -> DrawnFlight:
    """Convert a recording to series."""
    mission, truth = recording.mission, recording.truth
    rows = chosen(truth)
    picked = {name: values[rows] for name, values in truth.items()}
    states = states_from_start(picked, mission)
    falls = rows[_spread(len(rows), MAX_IMPACTS)]
    limits = [part.heating_limit_w_m2 for part in mission.jettisons if part.heating_limit_w_m2]
    left = propellant_left(truth["mass"], truth["arc"], truth["jettisoned"], mission.arrays())
    return DrawnFlight(
        name=recording.name,
        law=recording.law,
        mission=mission,
        states=states,
        phases=phases_of(picked, mission),
        guidance=_guidance(recording.status),
        navigation=_navigation_deviation(recording.navigation, truth),
        impact_time_s=truth["time"][falls],
        impact=impact_track(
            truth["time"][falls],
            truth["position"][falls],
            truth["velocity"][falls],
            mission.environment_array()[0],
            mission.earth(),
        ),
        heating_limit_w_m2=min(limits, default=None),
        air=_air_part(truth, recording.status, mission),
        propellant_kg=left[rows],
        budget=make_budget(truth, left, mission),
        optimality=recording.optimality,
    )


def _air_part(truth: Columns, status: Columns, mission: Mission) -> AirPart | None:
    """Find the part of a flight in the air, with the boost programme that is flown there."""
    arcs = mission.arrays().arcs
    if "dynamic_pressure" not in truth or not flies_in_air(arcs):
        return None
    pressure = truth["dynamic_pressure"]
    thick = np.flatnonzero(pressure >= THIN_AIR_PA)
    if not len(thick):
        return None
    values = {
        "dynamic_pressure_pa": pressure,
        "q_alpha_pa_rad": pressure * np.sin(truth["angle_of_attack"]),
    }
    running = np.minimum(truth["arc"], len(arcs) - 1)
    limits = [
        AirLimit(column, limit, float(np.max(values[column][arcs[key][running] == limit])))
        for key, column in (
            ("max_dynamic_pressure", "dynamic_pressure_pa"),
            ("max_q_alpha", "q_alpha_pa_rad"),
        )
        for limit in np.unique(arcs[key][running]).tolist()
        if math.isfinite(limit)
    ]
    until = truth["time"][thick[-1]]
    boosts = np.flatnonzero(status["phase"] == PHASE_BOOST) if "phase" in status else np.empty(0)
    if len(boosts):
        until = max(until, status["time"][min(int(boosts[-1]) + 1, len(status["time"]) - 1)])
    most = {column: float(np.max(of)) for column, of in values.items()}
    return AirPart(float(until), most["dynamic_pressure_pa"], most["q_alpha_pa_rad"], tuple(limits))


def _spread(count: int, most: int) -> NDArray[np.intp]:
    """Return at most `most` indices, evenly spread, ends included."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, most).round().astype(np.intp))


def chosen(truth: Columns) -> NDArray[np.intp]:
    """Select the rows to show: evenly spread ones, and both sides of each change of phase."""
    edges = _edges(truth)
    return np.unique(np.concatenate((_spread(len(truth["time"]), MAX_STATES), edges - 1, edges)))


def _edges(truth: Columns) -> NDArray[np.intp]:
    """Return the first rows of all phases except the first."""
    changed = np.diff(truth["arc"]) != 0
    changed |= np.diff(truth["jettisoned"]) != 0
    return np.flatnonzero(changed) + 1


def phases_of(truth: Columns, mission: Mission) -> tuple[Phase, ...]:
    """Divide a flight into phases: a new one at each arc and after each jettison."""
    starts = [0, *_edges(truth).tolist()]
    ends = [*(start - 1 for start in starts[1:]), len(truth["time"]) - 1]
    found = []
    for first, last in zip(starts, ends, strict=True):
        name = phase_name(int(truth["arc"][last]), int(truth["jettisoned"][last]), mission)
        burns = bool(np.any(truth["thrust"][first : last + 1] > 0.0))
        found.append(Phase(name, burns, first, last))
    return tuple(found)


def phase_name(arc: int, gone: int, mission: Mission) -> str:
    """Name a phase: its arc, and the last part dropped that is no booster.

    Args:
        arc: its index.
        gone: bit k is set when jettison k is done.
        mission: flown mission.
    """
    names = mission.arc_names
    name = names[arc] if arc < len(names) else f"arc {arc}"
    # boosters that burn are in the name of the arc
    dropped = [part.name for k, part in enumerate(mission.jettisons) if gone >> k & 1]
    return f"{name}, after {dropped[-1]}" if dropped else name


def states_from_start(truth: Columns, mission: Mission) -> States:
    """Compute the states of a whole flight; the first precedes any command and has no attitude."""
    states = states_of(truth, mission)
    if len(states.time_s) > 1:
        for values in attitude_of(states):
            values[0] = math.nan
    return states


def attitude_of(states: States) -> tuple[Array, ...]:
    """Return what is unknown of a state that precedes any command."""
    return (
        states.pitch_deg,
        states.yaw_deg,
        states.azimuth_deg,
        states.angle_of_attack_deg,
        states.q_alpha_pa_rad,
    )


def states_of(truth: Columns, mission: Mission) -> States:
    """Compute the quantities shown of some states.

    Args:
        truth: columns of VehicleState, with `time` in s.
        mission: flown mission.
    """
    position, velocity = truth["position"], truth["velocity"]
    pitch, yaw, azimuth = attitude(truth, mission.environment_array()[0])
    earth = mission.earth()
    track = ground_track(truth["time"], position, earth)
    # bags of old do not tell of the air
    unknown = np.full(len(position), math.nan)
    pressure, attack = (truth.get(k, unknown) for k in ("dynamic_pressure", "angle_of_attack"))
    orbit = np.array(
        [
            _orbit(r, v, mission.environment.mu_m3_s2)
            for r, v in zip(position, velocity, strict=True)
        ]
    )
    return States(
        time_s=truth["time"],
        altitude_m=truth["altitude"],
        speed_m_s=np.linalg.norm(velocity, axis=1),
        relative_speed_m_s=truth["relative_speed"],
        flight_path_angle_deg=np.degrees(truth["flight_path_angle"]),
        pitch_deg=pitch,
        yaw_deg=yaw,
        azimuth_deg=azimuth,
        mass_kg=truth["mass"],
        thrust_n=truth["thrust"],
        acceleration_m_s2=truth.get("axial_acceleration", truth["thrust"] / truth["mass"]),
        lateral_acceleration_m_s2=truth.get("lateral_acceleration", unknown),
        dynamic_pressure_pa=pressure,
        mach=truth.get("mach", unknown),
        angle_of_attack_deg=np.degrees(attack),
        q_alpha_pa_rad=pressure * np.sin(attack),
        heating_w_m2=truth["heating_rate"],
        perigee_m=orbit[:, 0] - earth.equatorial_radius,
        apogee_m=orbit[:, 1] - earth.equatorial_radius,
        inclination_deg=np.degrees(truth["inclination"]),
        eccentricity=orbit[:, 2],
        range_m=ground_range(track, earth.equatorial_radius),
        track=track,
    )


def _orbit(position: Array, velocity: Array, mu: float) -> tuple[float, float, float]:
    """Compute radii of perigee and apogee, m, and eccentricity; nan without an orbit."""
    try:
        elements = Elements.from_state(position, velocity, mu)
    except ValueError:
        return math.nan, math.nan, math.nan
    apogee = elements.apogee_radius
    return elements.perigee_radius, apogee if apogee < math.inf else math.nan, elements.eccentricity


def _guidance(status: Columns) -> Guidance | None:
    if not len(status["time"]):
        return None
    return Guidance(
        time_s=status["time"],
        time_to_go_s=status["time_to_go"],
        iterations=status["iterations"].astype(float),
        cutoff_s=status["cutoff_time"],
        jettison_s=status["jettison_time"],
    )


def _navigation_deviation(navigation: Columns, truth: Columns) -> NavigationDeviation | None:
    """Compare navigation with the truth of the same sequence number."""
    if not len(navigation["time"]):
        return None
    _, ours, theirs = np.intersect1d(
        navigation["sequence"], truth["sequence"], assume_unique=False, return_indices=True
    )
    position = np.linalg.norm(navigation["position"][ours] - truth["position"][theirs], axis=1)
    velocity = np.linalg.norm(navigation["velocity"][ours] - truth["velocity"][theirs], axis=1)
    if not (np.any(position > _NO_ERROR) or np.any(velocity > _NO_ERROR)):
        return None
    return NavigationDeviation(navigation["time"][ours], position, velocity)


def span_of(flights: Sequence[DrawnFlight]) -> tuple[float, float]:
    """Return first and last time of some flights, s."""
    return (
        min(float(flight.states.time_s[0]) for flight in flights),
        max(float(flight.states.time_s[-1]) for flight in flights),
    )
