# SPDX-License-Identifier: Apache-2.0
"""What a flight's columns say, as series for charts and for the globe. SI; degrees for people."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.mission import Mission
from ares_models.orbits import Elements
from ares_studies.flight_page.budget import Budget, make_budget, propellant_left
from ares_studies.flight_page.geometry import (
    Track,
    ground_range,
    ground_track,
    impact_track,
    thrust_angles,
)

Array = NDArray[np.float64]
Columns = Mapping[str, NDArray[Any]]

#: States of a flight that are looked at; the page cannot show more.
MAX_STATES = 1500
#: Impact points of a flight.
MAX_IMPACTS = 300
#: Navigation that is nearer to the truth is the truth: m, m/s.
_NO_ERROR = 1e-9


@dataclass(frozen=True)
class Optimality:
    """Hold what proves an optimum along its way, shape (n,) each.

    Attributes:
        time_s: mission elapsed time; an event stands twice.
        primer: size of the primer vector, the costate of the velocity; 1 at the start.
        primer_up, primer_ahead, primer_right: its parts along the radius, along the horizontal
            velocity, and to the right of it.
        switching: switching function, kg of final mass per kg of propellant; nan: the burn has a
            given length.
        hamiltonian_m_s2: with mass costate and price of propellant.
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
    """A flight as its bag has it.

    Attributes:
        name: of the bag.
        law: that steered.
        mission: that was flown.
        truth: columns of VehicleState; all with `time` in s. At least one row.
        navigation: columns of NavState; may have no rows, then only `time`.
        status: columns of GuidanceStatus; the same.
        optimality: of an optimum; None: it was flown.
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
    """A stretch of the flight: its name, whether an engine burns, its first and last state."""

    name: str
    burns: bool
    first: int
    last: int


@dataclass(frozen=True)
class States:
    """The truth, shape (n,) each: at most MAX_STATES rows, changes of phase always among them.

    Attributes:
        time_s: mission elapsed time.
        altitude_m: by the mission's rule.
        speed_m_s, relative_speed_m_s: inertial, and against the air that turns.
        flight_path_angle_deg: of the inertial velocity.
        pitch_deg, yaw_deg: see `thrust_angles`; nan in the first state of a flight, which
            stands before the first command.
        mass_kg, thrust_n: of the vehicle.
        acceleration_m_s2: thrust over mass, what accelerometers sense.
        heating_w_m2: free molecular heating.
        perigee_m, apogee_m: of the osculating orbit above the equatorial radius; nan: none.
        inclination_deg, eccentricity: of the osculating orbit.
        range_m: way along the ground track.
        track: the places below.
    """

    time_s: Array
    altitude_m: Array
    speed_m_s: Array
    relative_speed_m_s: Array
    flight_path_angle_deg: Array
    pitch_deg: Array
    yaw_deg: Array
    mass_kg: Array
    thrust_n: Array
    acceleration_m_s2: Array
    heating_w_m2: Array
    perigee_m: Array
    apogee_m: Array
    inclination_deg: Array
    eccentricity: Array
    range_m: Array
    track: Track


@dataclass(frozen=True)
class Guidance:
    """What guidance said, a row per cycle, shape (n,) each; nan: unknown."""

    time_s: Array
    time_to_go_s: Array
    iterations: Array
    cutoff_s: Array
    jettison_s: Array


@dataclass(frozen=True)
class NavigationErrors:
    """Navigation minus truth: distances, shape (n,) each."""

    time_s: Array
    position_m: Array
    velocity_m_s: Array


@dataclass(frozen=True)
class Flight:
    """A flight, ready to be drawn.

    Attributes:
        name: of its bag.
        law: that steered.
        mission: that was flown.
        states: the truth.
        phases: all states in turn.
        guidance: None if it said nothing.
        navigation: None where it does not differ from the truth.
        impact_time_s: of the impact points, shape (m,).
        impact: where the vehicle would have fallen.
        heating_limit_w_m2: the least of the mission's; None: none.
        propellant_kg: left in the running stage, by the masses of the mission, a number a state.
        budget: what the thrust went into.
        optimality: of an optimum; None: it was flown.
    """

    name: str
    law: str
    mission: Mission
    states: States
    phases: tuple[Phase, ...]
    guidance: Guidance | None
    navigation: NavigationErrors | None
    impact_time_s: Array
    impact: Track
    heating_limit_w_m2: float | None
    propellant_kg: Array
    budget: Budget
    optimality: Optimality | None


def make_flight(recording: Recording) -> Flight:
    """The series of a flight."""
    mission, truth = recording.mission, recording.truth
    rows = chosen(truth)
    picked = {name: values[rows] for name, values in truth.items()}
    states = states_from_start(picked, mission)
    falls = rows[_spread(len(rows), MAX_IMPACTS)]
    limits = [part.heating_limit_w_m2 for part in mission.jettisons if part.heating_limit_w_m2]
    left = propellant_left(truth["mass"], truth["arc"], truth["jettisoned"], mission.arrays())
    return Flight(
        name=recording.name,
        law=recording.law,
        mission=mission,
        states=states,
        phases=phases_of(picked, mission),
        guidance=_guidance(recording.status),
        navigation=_navigation_errors(recording.navigation, truth),
        impact_time_s=truth["time"][falls],
        impact=impact_track(
            truth["time"][falls],
            truth["position"][falls],
            truth["velocity"][falls],
            mission.environment_array()[0],
            mission.earth(),
        ),
        heating_limit_w_m2=min(limits, default=None),
        propellant_kg=left[rows],
        budget=make_budget(truth, left, mission),
        optimality=recording.optimality,
    )


def _spread(count: int, most: int) -> NDArray[np.intp]:
    """At most so many indices, evenly spread, ends included."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, most).round().astype(np.intp))


def chosen(truth: Columns) -> NDArray[np.intp]:
    """Rows that are looked at: evenly spread ones, and both sides of each change of phase."""
    edges = _edges(truth)
    return np.unique(np.concatenate((_spread(len(truth["time"]), MAX_STATES), edges - 1, edges)))


def _edges(truth: Columns) -> NDArray[np.intp]:
    """First rows of the phases but the first."""
    changed = np.diff(truth["arc"]) != 0
    changed |= np.diff(truth["jettisoned"]) != 0
    return np.flatnonzero(changed) + 1


def phases_of(truth: Columns, mission: Mission) -> tuple[Phase, ...]:
    """The phases of a flight: arc by arc, and anew after each jettison."""
    starts = [0, *_edges(truth).tolist()]
    ends = [*(start - 1 for start in starts[1:]), len(truth["time"]) - 1]
    found = []
    for first, last in zip(starts, ends, strict=True):
        name = phase_name(int(truth["arc"][last]), int(truth["jettisoned"][last]), mission)
        burns = bool(np.any(truth["thrust"][first : last + 1] > 0.0))
        found.append(Phase(name, burns, first, last))
    return tuple(found)


def phase_name(arc: int, gone: int, mission: Mission) -> str:
    """A phase in words: its arc, and what was dropped last.

    Args:
        arc: its number.
        gone: bit k is set when jettison k is done.
        mission: that is flown.
    """
    names = mission.arc_names
    name = names[arc] if arc < len(names) else f"arc {arc}"
    dropped = [part for k, part in enumerate(mission.jettison_names) if gone >> k & 1]
    return f"{name}, after {dropped[-1]}" if dropped else name


def states_from_start(truth: Columns, mission: Mission) -> States:
    """What is shown of a flight; its first state was before any command, and points nowhere."""
    states = states_of(truth, mission)
    if len(states.time_s) > 1:
        states.pitch_deg[0] = states.yaw_deg[0] = math.nan
    return states


def states_of(truth: Columns, mission: Mission) -> States:
    """What is shown of some states.

    Args:
        truth: columns of VehicleState, with `time` in s.
        mission: that was flown.
    """
    position, velocity = truth["position"], truth["velocity"]
    pitch, yaw = thrust_angles(position, velocity, truth["thrust_direction"])
    earth = mission.earth()
    track = ground_track(truth["time"], position, earth)
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
        mass_kg=truth["mass"],
        thrust_n=truth["thrust"],
        acceleration_m_s2=truth["thrust"] / truth["mass"],
        heating_w_m2=truth["heating_rate"],
        perigee_m=orbit[:, 0] - earth.equatorial_radius,
        apogee_m=orbit[:, 1] - earth.equatorial_radius,
        inclination_deg=np.degrees(truth["inclination"]),
        eccentricity=orbit[:, 2],
        range_m=ground_range(track, earth.equatorial_radius),
        track=track,
    )


def _orbit(position: Array, velocity: Array, mu: float) -> tuple[float, float, float]:
    """Radii of perigee and apogee, m, and eccentricity; nan where there is none."""
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


def _navigation_errors(navigation: Columns, truth: Columns) -> NavigationErrors | None:
    """Navigation against the truth of the same number."""
    if not len(navigation["time"]):
        return None
    _, ours, theirs = np.intersect1d(
        navigation["sequence"], truth["sequence"], assume_unique=False, return_indices=True
    )
    position = np.linalg.norm(navigation["position"][ours] - truth["position"][theirs], axis=1)
    velocity = np.linalg.norm(navigation["velocity"][ours] - truth["velocity"][theirs], axis=1)
    if not (np.any(position > _NO_ERROR) or np.any(velocity > _NO_ERROR)):
        return None
    return NavigationErrors(navigation["time"][ours], position, velocity)


def span_of(flights: Sequence[Flight]) -> tuple[float, float]:
    """First and last time of some flights, s."""
    return (
        min(float(flight.states.time_s[0]) for flight in flights),
        max(float(flight.states.time_s[-1]) for flight in flights),
    )
