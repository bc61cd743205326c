# SPDX-License-Identifier: Apache-2.0
"""What every method of the optimizer returns, and how it is printed.

Times are mission elapsed time in s, vectors stand in the frame ``ares_eci``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.judge import End

Array = NDArray[np.float64]


class Status(StrEnum):
    """How a request ended."""

    #: an optimum, proven if that was asked for; of ``analytic``, its own conditions are met
    CONVERGED = "converged"
    #: the flight meets every constraint, but is not proven to be the best
    FEASIBLE = "feasible"
    #: the target or a limit on the way cannot be met
    INFEASIBLE = "infeasible"
    #: what was found is stationary and no optimum: a saddle, a detour, beaten by another
    NOT_OPTIMAL = "not_optimal"
    #: the iterations were used up
    ITERATION_LIMIT = "iteration_limit"
    #: no step led on, and nothing is known to stand in the way
    STALLED = "stalled"
    #: the time limit passed
    TIME_LIMIT = "time_limit"
    #: no flight can be laid out from the start
    ILLEGAL_START = "illegal_start"


class Cause(NamedTuple):
    """How a request ended, and why in one line."""

    status: Status
    reason: str


OPTIMAL = Cause(Status.CONVERGED, "optimal")
#: Why a flight is no optimum where no burn can be shortened.
NOTHING_SAVED = "no burn is free, so the mass at cut-off is given and nothing is left to optimize"
OUT_OF_TIME = Cause(Status.TIME_LIMIT, "the time limit passed before the search ended")


def infeasible(line: str) -> Cause | None:
    """The cause that a line on an obstacle tells of; None for an empty line."""
    return Cause(Status.INFEASIBLE, line) if line else None


class Check(StrEnum):
    """What a constraint check is about; a figure of the target by its field of TARGET."""

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
    #: of one jettison each
    HEATING_AT_JETTISON = "heating_at_jettison"
    JETTISON_BEFORE_CUTOFF = "jettison_before_cutoff"
    HEATING_FROM_JETTISON = "heating_from_jettison"
    LOWEST_ALTITUDE = "lowest_altitude"
    PROPELLANT = "propellant"
    #: of one free arc each
    ARC_LENGTH = "arc_length"
    #: of one figure of the orbit that a coast names
    PARKING_ORBIT = "parking_orbit"
    #: of one burn in held attitude each
    HELD_DIRECTION = "held_direction"


class OptimizerError(ValueError):
    """A request that cannot be worked on: unknown method, bad guess, bad state."""


class UnfitMethod(OptimizerError):
    """The method is known but cannot solve this mission."""


@dataclass(frozen=True)
class SteeringArc:
    """A piece of the flight with one steering law.

    The thrust direction at t is unit(direction + direction_rate (t - reference_time_s)),
    Eq. 3.36. A coast has ``delta_v_m_s`` 0.

    Attributes:
        start_s, end_s: the piece.
        reference_time_s: where ``direction`` holds.
        direction: shape (3,), unit vector.
        direction_rate: shape (3,), 1/s.
        start_mass_kg: just after ``start_s``, drops done.
        end_mass_kg: just before ``end_s``, drops not done.
        delta_v_m_s: integral of thrust acceleration.
        primer_rate: shape (3,), 1/s, of the primer that is ``direction`` at ``start_s``; nan: the
            method has none, or the direction is held.
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


@dataclass(frozen=True)
class FlownArc:
    """An arc of the mission as it is flown.

    Attributes:
        arc: index into the mission's arcs.
        start_s, end_s: ignition and cut-off commands of a burn; a start in the past for one
            that runs.
    """

    arc: int
    start_s: float
    end_s: float


@dataclass(frozen=True)
class ConstraintCheck:
    """One constraint as the independent integration finds it.

    Attributes:
        key: what is constrained,
        name: and in words.
        value: what it came to, in ``unit``.
        limit: what it must be (an equality) or must not pass.
        active: True when it holds the optimum: an equality, or an inequality at its limit.
        unit: of value and limit.
        satisfied: within the tolerance of the verification.
        multiplier: kg of final mass per ``unit`` of the limit, positive when more of it
            helps; nan when the method does not give it.
        jettison: of the mission, that it is about; None: of none.
    """

    key: Check
    name: str
    value: float
    limit: float
    active: bool
    unit: str
    satisfied: bool
    multiplier: float = math.nan
    jettison: int | None = None


@dataclass(frozen=True)
class Verification:
    """The flight re-integrated by an integrator that shares nothing with the solver.

    Attributes:
        radius_m, speed_m_s, flight_path_angle_deg, inclination_deg, ascending_node_deg:
            at cut-off.
        m_f_kg: mass at cut-off.
        fmhr_w_m2: heating at the jettison that the heating limit governs; nan without one.
        peak_fmhr_after_jettison_w_m2: greatest heating from there to cut-off; nan without one.
        position_defect_m, velocity_defect_m_s, mass_defect_kg: greatest distance between the
            solver's own nodes and the integration, interior and terminal.
        end: what is reached, as the judge of every flight says.
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
    """The flight, sampled.

    Attributes:
        time_s: shape (n,). A drop or a boundary stands twice, before and after.
        position: shape (n, 3), m.
        velocity: shape (n, 3), m/s.
        mass: shape (n,), kg.
        direction: shape (n, 3), unit vectors; the last one is kept through a coast.
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


def joined(tracks: Sequence[Trajectory]) -> Trajectory:
    """Trajectories one after the other."""
    columns = zip(*(vars(track).values() for track in tracks), strict=True)
    return Trajectory(*(np.concatenate(parts) for parts in columns))


@dataclass(frozen=True)
class Costates:
    """Costates along the flight, |lambda_v| = 1 at its start.

    Attributes:
        time_s: shape (n,). A jettison stands twice, before and after the jump.
        lambda_r: shape (n, 3), 1/s.
        lambda_v: shape (n, 3), no unit.
        hamiltonian: shape (n,), lambda_r . V + lambda_v . (g + u T/m), m/s2.
        hamiltonian_spread: per piece of the flight, (greatest - least) / greatest |H|, with
            the mass costate's part - lambda_m flow: lambda_m' = lambda_v . u T/m2, zero at
            cut-off and at the end of each stage (the mass of the next stack is given).
        jump_pi: pi of Eqs. 3.44-3.51 per heating jettison, per unit lambda_v and W/m2.
        held_off_deg: per burn in held attitude, angle between its direction and the integral of
            lambda_v T/m over it, which the best direction lies along.
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
    """An optimal (analytic: approximate; or failed) ascent.

    Attributes:
        method: ``collocation``, ``direct11``, ``direct14``, ``direct20``, ``jump``, ``indirect``,
            ``closed_form``, ``analytic``; of ``auto`` the one whose solution it is.
        status: how it ended. CONVERGED: optimal and verified; never for anything else. Of
            ``analytic``, an approximation and not an optimum: its iteration met its own
            conditions.
        reason: one line; on failure it names the constraint in the way and by how much.
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
        parameters: shape (n,), the solver's own variables: a guess for the next call.
        restarts: further starts that the solver had to make.
        notes: further figures by name, with unit suffix.
        steps: of method ``auto``: what each method that it called came to, a line each.
        by_legs: the two-point problem lacks a constraint that holds: law ``optimal`` flies to the
            end of each leg, as the other laws do.
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

    @property
    def converged(self) -> bool:
        """Whether the status is CONVERGED."""
        return self.status is Status.CONVERGED

    @property
    def flyable(self) -> bool:
        """Whether it meets every constraint: an optimum, or a flight that may be none."""
        return self.status in (Status.CONVERGED, Status.FEASIBLE)

    @property
    def t_plf_s(self) -> float:
        """Time of the fairing jettison: the last drop of the mission; nan without one."""
        done = [t for t in self.jettison_times_s if math.isfinite(t)]
        return max(done) if done else math.nan

    @property
    def delta_v_m_s(self) -> float:
        """Exhaust velocity times log of the mass ratio, summed over the burns; nan: no flight."""
        return sum(arc.delta_v_m_s for arc in self.arcs) if self.arcs else math.nan

    def to_json(self, arc_names: Sequence[str] = ()) -> dict[str, Any]:
        """The published summary, ready for ``json.dumps``: what is unknown is None.

        Args:
            arc_names: of the mission's arcs; empty: the arcs are counted from 0.
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


def _number(value: float) -> float | None:
    """A float that JSON can carry."""
    return float(value) if math.isfinite(value) else None


def next_to_nothing(propellant_kg: float) -> str:
    """Why no optimum is sought where the free burns take next to nothing."""
    return (
        f"optimal within {propellant_kg:.3g} kg, which is all that the free burns take: "
        "those of fixed length all but reach the target"
    )


def failed(method: str, cause: Cause, *, iterations: int = 0, solve_ms: float = 0.0) -> Solution:
    """A failure without a trajectory."""
    return Solution(method, *cause, (), math.nan, math.nan, iterations, solve_ms)
