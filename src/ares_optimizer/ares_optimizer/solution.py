# SPDX-License-Identifier: Apache-2.0
"""Define the result that every method of the optimizer returns.

Times are mission elapsed time in s; vectors are in the frame ``ares_eci``.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.judge import End

Array = NDArray[np.float64]


class Status(StrEnum):
    """List the outcomes of a request."""

    #: optimal, proven unless ``verify`` is False; ``analytic``: its iteration converged
    CONVERGED = "converged"
    #: the flight meets every constraint, but is not proven optimal
    FEASIBLE = "feasible"
    #: the target or a limit on the way cannot be met
    INFEASIBLE = "infeasible"
    #: stationary, but not optimal: a saddle, a detour, or worse than another flight
    NOT_OPTIMAL = "not_optimal"
    #: the iterations ran out
    ITERATION_LIMIT = "iteration_limit"
    #: the search made no progress, for no known cause
    STALLED = "stalled"
    #: the time limit passed
    TIME_LIMIT = "time_limit"
    #: no timetable exists from the start
    ILLEGAL_START = "illegal_start"


class Cause(NamedTuple):
    """Hold the status of a request and its reason in one line."""

    status: Status
    reason: str


OPTIMAL = Cause(Status.CONVERGED, "optimal")
#: Tolerance of equal times, s.
_SAME_S = 1e-6
#: Reason why a flight without free burns is not called optimal.
NOTHING_SAVED = "no burn is free, so the mass at cut-off is given and nothing is left to optimize"
#: What to do where the free burns take nothing, and how the rest is wasted is not found exactly.
TOO_MUCH = (
    "the burns of fixed length reach the target without the free ones: give the last one a longer "
    "least length (min_s), or add payload"
)
OUT_OF_TIME = Cause(Status.TIME_LIMIT, "the time limit passed before the search ended")


def infeasible(line: str) -> Cause | None:
    """Return the cause INFEASIBLE with a line; None for an empty line."""
    return Cause(Status.INFEASIBLE, line) if line else None


class Check(StrEnum):
    """List the subjects of constraint checks; elements of the target by their field of TARGET."""

    RADIUS = "radius"
    SPEED = "speed"
    FLIGHT_PATH_ANGLE = "flight_path_angle"
    INCLINATION = "inclination"
    ASCENDING_NODE = "ascending_node"
    SEMI_MAJOR_AXIS = "semi_major_axis"
    ECCENTRICITY = "eccentricity"
    ARGUMENT_OF_PERIGEE = "argument_of_perigee"
    PERIGEE_RADIUS = "perigee_radius"
    APOGEE_RADIUS = "apogee_radius"
    C3 = "c3"
    TRUE_ANOMALY = "true_anomaly"
    #: one per jettison
    HEATING_AT_JETTISON = "heating_at_jettison"
    JETTISON_BEFORE_CUTOFF = "jettison_before_cutoff"
    HEATING_FROM_JETTISON = "heating_from_jettison"
    LOWEST_ALTITUDE = "lowest_altitude"
    PROPELLANT = "propellant"
    #: of the stage whose propellant is saved, if that is not the last
    SAVED_PROPELLANT = "saved_propellant"
    #: one per stage that limits it
    DYNAMIC_PRESSURE = "dynamic_pressure"
    Q_ALPHA = "q_alpha"
    #: one per free arc
    ARC_LENGTH = "arc_length"
    #: one per element of the orbit that a coast names
    PARKING_ORBIT = "parking_orbit"
    #: one per burn in held attitude
    HELD_DIRECTION = "held_direction"


class OptimizerError(ValueError):
    """Signal an invalid request: unknown method, bad guess, bad state."""


class UnfitMethod(OptimizerError):
    """Signal a method that cannot solve this mission."""


@dataclass(frozen=True)
class SteeringArc:
    """Hold a piece of the flight with one steering law.

    The thrust direction at t is unit(direction + direction_rate (t - reference_time_s)),
    Eq. 3.36. A coast has ``delta_v_m_s`` 0.

    Attributes:
        start_s, end_s: the piece.
        reference_time_s: time of ``direction``.
        direction: shape (3,), unit vector.
        direction_rate: shape (3,), 1/s.
        start_mass_kg: just after ``start_s`` and its drops.
        end_mass_kg: just before ``end_s`` and its drops.
        delta_v_m_s: integral of thrust acceleration.
        primer_rate: shape (3,), 1/s, at ``start_s``, of the primer scaled to ``direction``; nan:
            the method has no primer, or the direction is held.
    """

    start_s: float
    end_s: float
    reference_time_s: float
    direction: tuple[float, float, float]
    direction_rate: tuple[float, float, float]
    start_mass_kg: float
    end_mass_kg: float
    delta_v_m_s: float
    primer_rate: tuple[float, float, float] = (math.nan, math.nan, math.nan)

    @property
    def coasts(self) -> bool:
        """Return true if the piece has no thrust."""
        return self.delta_v_m_s == 0.0


@dataclass(frozen=True)
class FlownArc:
    """Hold an arc of the mission with its times in the flight.

    Attributes:
        arc: index into the mission's arcs.
        start_s, end_s: ignition and cut-off commands of a burn; ``start_s`` is in the past for an
            arc that is running.
    """

    arc: int
    start_s: float
    end_s: float


@dataclass(frozen=True)
class ConstraintCheck:
    """Hold one constraint with its value by the independent integration.

    Attributes:
        key: subject of the constraint.
        name: the same in words.
        value: value in the flight, in ``unit``.
        limit: required value (an equality) or bound.
        active: true for an equality, and for an inequality at its limit.
        unit: of value and limit.
        satisfied: true within the tolerance of the verification.
        multiplier: kg of final mass per ``unit`` of the limit, positive if a larger limit gives
            more mass; nan: not computed by the method.
        number: index of the jettison or stage concerned; None: none.
    """

    key: Check
    name: str
    value: float
    limit: float
    active: bool
    unit: str
    satisfied: bool
    multiplier: float = math.nan
    number: int | None = None


@dataclass(frozen=True)
class Verification:
    """Hold the figures of the flight by an integrator independent of the solver.

    Attributes:
        radius_m, speed_m_s, flight_path_angle_deg, inclination_deg, ascending_node_deg:
            at cut-off.
        m_f_kg: mass at cut-off.
        fmhr_w_m2: heating at the jettison that the heating limit governs; nan without one.
        peak_fmhr_after_jettison_w_m2: greatest heating from there to cut-off; nan without one.
        position_defect_m, velocity_defect_m_s, mass_defect_kg: largest distance between the
            nodes of the solver and the integration, interior and terminal.
        end: outcome by the judge of every flight.
    """

    radius_m: float
    speed_m_s: float
    flight_path_angle_deg: float
    inclination_deg: float
    ascending_node_deg: float
    m_f_kg: float
    fmhr_w_m2: float
    peak_fmhr_after_jettison_w_m2: float
    position_defect_m: float
    velocity_defect_m_s: float
    mass_defect_kg: float
    end: End


@dataclass(frozen=True)
class Trajectory:
    """Hold a sampled flight.

    Attributes:
        time_s: shape (n,). Drops and boundaries have two samples, before and after.
        position: shape (n, 3), m.
        velocity: shape (n, 3), m/s.
        mass: shape (n,), kg.
        direction: shape (n, 3), unit vectors; constant in a coast, as before it.
        heating_rate: shape (n,), W/m2.
        thrust: shape (n,), N.
    """

    time_s: Array
    position: Array
    velocity: Array
    mass: Array
    direction: Array
    heating_rate: Array
    thrust: Array

    def thrust_directions(self, arcs: Sequence[SteeringArc]) -> Array:
        """Return the direction of each sample, shape (n, 3); nan in the coasts among its arcs."""
        directions = self.direction.copy()
        for arc in arcs:
            if arc.coasts:
                first = np.searchsorted(self.time_s, arc.start_s, side="right") - 1
                last = np.searchsorted(self.time_s, arc.end_s, side="left")
                directions[max(first, 0) : last + 1] = math.nan
        return directions


def joined(tracks: Sequence[Trajectory]) -> Trajectory:
    """Concatenate trajectories."""
    columns = zip(*(vars(track).values() for track in tracks), strict=True)
    return Trajectory(*(np.concatenate(parts) for parts in columns))


@dataclass(frozen=True)
class Costates:
    """Hold the costates along a flight, scaled to |lambda_v| = 1 at its start.

    Attributes:
        time_s: shape (n,). A jettison has two samples, before and after the jump.
        lambda_r: shape (n, 3), 1/s.
        lambda_v: shape (n, 3), no unit.
        hamiltonian: shape (n,), lambda_r . V + lambda_v . (g + u T/m), m/s2.
        hamiltonian_spread: per piece of the flight, (greatest - least) / greatest |H|, with the
            mass costate term - lambda_m flow: lambda_m' = lambda_v . u T/m2, zero at cut-off and
            at the end of each stage, as the mass of the next stack is given.
        jump_pi: pi of Eqs. 3.44-3.51 per heating jettison, per unit lambda_v and W/m2.
        held_off_deg: per burn in held attitude, angle between its direction and the integral of
            lambda_v T/m over it, the optimal direction.
    """

    time_s: Array
    lambda_r: Array
    lambda_v: Array
    hamiltonian: Array
    hamiltonian_spread: tuple[float, ...]
    jump_pi: tuple[float, ...]
    held_off_deg: tuple[float, ...] = ()


@dataclass(frozen=True)
class Solution:
    """Hold an ascent: optimal, approximate (``analytic``) or failed.

    Attributes:
        method: ``collocation``, ``direct11``, ``direct14``, ``direct20``, ``jump``, ``indirect``,
            ``closed_form``, ``analytic``; with ``auto`` the method that found it.
        status: CONVERGED means optimal and verified, and nothing else. Of ``analytic`` it means
            an approximation whose iteration converged.
        reason: one line; on failure it names the violated constraint and its violation.
        jettison_times_s: one per jettison of the mission; nan: not dropped, or before the start.
        t_meco_s: cut-off time; nan without a trajectory.
        m_f_kg: mass at cut-off; nan without a trajectory.
        iterations: of the solver, restarts included.
        solve_ms: wall time of the solve alone, without compilation and verification.
        arcs: steering law, one per piece.
        constraints: the table of constraints.
        verification: the independent integration; None when there is no trajectory.
        trajectory: sampled flight; None when there is no trajectory.
        costates: None when the method gives none.
        flown: the mission's arcs from the start on, with their times.
        lengths_s: of the free arcs before the last, in flight order, as planned.
        parameters: shape (n,), variables of the solver: a guess for the next call.
        restarts: starts after the first.
        notes: further figures by name, with unit suffix.
        steps: of method ``auto``: the result of each method that it called, a line each.
        heated: jettisons that wait for the heating, by index; None: all.
        by_legs: true if the two-point problem lacks an active constraint: law ``optimal`` then
            flies to the end of each leg, as the other laws do.
    """

    method: str
    status: Status
    reason: str
    jettison_times_s: tuple[float, ...]
    t_meco_s: float
    m_f_kg: float
    iterations: int
    solve_ms: float
    arcs: tuple[SteeringArc, ...] = ()
    flown: tuple[FlownArc, ...] = ()
    lengths_s: tuple[float, ...] = ()
    constraints: tuple[ConstraintCheck, ...] = ()
    verification: Verification | None = None
    trajectory: Trajectory | None = None
    costates: Costates | None = None
    parameters: Array | None = None
    restarts: int = 0
    notes: dict[str, float] = field(default_factory=dict)
    steps: tuple[str, ...] = ()
    by_legs: bool = False
    heated: tuple[int, ...] | None = None

    @property
    def converged(self) -> bool:
        """Return true if the status is CONVERGED."""
        return self.status is Status.CONVERGED

    @property
    def flyable(self) -> bool:
        """Return true if the flight meets every constraint: optimal or feasible."""
        return self.status in (Status.CONVERGED, Status.FEASIBLE)

    @property
    def t_plf_s(self) -> float:
        """Return the time of the last jettison of the mission, s; nan without one."""
        return _last(self.jettison_times_s)

    @property
    def heating_jettison_s(self) -> float:
        """Return the time of the last jettison that waits for the heating, s; nan without one."""
        waits = self.heated
        times = enumerate(self.jettison_times_s)
        return _last(t for j, t in times if waits is None or j in waits)

    @property
    def last_burn_kg(self) -> float:
        """Return the propellant of the last burn, kg; nan without a flight."""
        last = self.arcs[-1] if self.arcs else None
        return math.nan if last is None else last.start_mass_kg - last.end_mass_kg

    def end_mass_kg(self, arc: int) -> float:
        """Return the mass at the end of an arc, before what is dropped there, kg.

        Raises:
            ValueError: the flight has no such arc.
        """
        ends = [flown.end_s for flown in self.flown if flown.arc == arc]
        if not ends:
            raise ValueError(f"arc is {arc}; expected one of the flight")
        if arc == self.flown[-1].arc:
            return self.m_f_kg
        return next(piece.end_mass_kg for piece in self.arcs if piece.end_s >= ends[0] - _SAME_S)

    @property
    def delta_v_m_s(self) -> float:
        """Return the ideal velocity of all burns, m/s; nan without a flight."""
        return sum(arc.delta_v_m_s for arc in self.arcs) if self.arcs else math.nan

    def to_json(self, arc_names: Sequence[str] = ()) -> dict[str, Any]:
        """Return the published summary for ``json.dumps``; unknown values are None.

        Args:
            arc_names: of the mission's arcs; empty: their indices.
        """
        v = self.verification
        return {
            "method": self.method,
            "status": str(self.status),
            "converged": self.converged,
            "search": list(self.steps),
            "reason": self.reason,
            "t_plf_s": _number(self.t_plf_s),
            "t_meco_s": _number(self.t_meco_s),
            "m_f_kg": _number(self.m_f_kg),
            "delta_v_m_s": _number(self.delta_v_m_s),
            "arcs": [
                {
                    "name": arc_names[flown.arc] if arc_names else str(flown.arc),
                    "start_s": _number(flown.start_s),
                    "end_s": _number(flown.end_s),
                }
                for flown in self.flown
            ],
            "iterations": self.iterations,
            "solve_ms": _number(self.solve_ms),
            "verification": None
            if v is None
            else {
                "radius_m": _number(v.radius_m),
                "speed_m_s": _number(v.speed_m_s),
                "flight_path_angle_deg": _number(v.flight_path_angle_deg),
                "inclination_deg": _number(v.inclination_deg),
                "fmhr_w_m2": _number(v.fmhr_w_m2),
                "end": str(v.end),
            },
        }


def _last(times: Iterable[float]) -> float:
    """Return the last of some times, s; nan if none is known."""
    return max((t for t in times if math.isfinite(t)), default=math.nan)


def _number(value: float) -> float | None:
    """Return a float that JSON can hold; None if not finite."""
    return float(value) if math.isfinite(value) else None


def next_to_nothing(propellant_kg: float) -> str:
    """Return the reason of a flight whose free burns need almost no propellant."""
    return (
        f"optimal within {propellant_kg:.3g} kg, which is all that the free burns take: "
        "those of fixed length all but reach the target; with a least length (min_s) of the last "
        "one guidance has time to correct the flight"
    )


def failed(method: str, cause: Cause, *, iterations: int = 0, solve_ms: float = 0.0) -> Solution:
    """Return a solution without a trajectory."""
    return Solution(method, *cause, (), math.nan, math.nan, iterations, solve_ms)
