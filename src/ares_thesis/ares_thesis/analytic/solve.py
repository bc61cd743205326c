# SPDX-License-Identifier: Apache-2.0
"""Solve an ascent by chapter 5 of the thesis, as printed and improved.

The ascent is planar and divided at the jettison: part one from the start to the jettison target,
part two from there to cut-off. In each, sin(gamma) and cos(alpha) are polynomials of time, so speed
and radius have closed forms; a few angles and the time to go are iterated until the target is met.
The result is an approximation to a few seconds or better in less than a millisecond, not an
optimum.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_models.mission import Mission
from ares_optimizer.deadline import Deadline
from ares_optimizer.direct.solve import solve_direct
from ares_optimizer.kernels.timetable import propellant_used
from ares_optimizer.obstacles import target_obstacle
from ares_optimizer.proof.checks import constraint_table, verification
from ares_optimizer.proof.flight import fly, steering_of
from ares_optimizer.request import Heating, Request, arrays_and_state
from ares_optimizer.solution import (
    Cause,
    OptimizerError,
    Solution,
    Status,
    SteeringArc,
    Trajectory,
    UnfitMethod,
    failed,
    infeasible,
)
from ares_thesis.analytic.flight import PlanarFlight
from ares_thesis.analytic.kernels.burn import sample_burn
from ares_thesis.analytic.kernels.plane import Plane, Track, place_samples
from ares_thesis.analytic.options import AnalyticOptions
from ares_thesis.analytic.parts import (
    Ascent,
    JettisonTarget,
    NoSolution,
    Work,
    part_one,
    part_two,
    read_ascent,
    target_of_mission,
    target_of_optimum,
)
from ares_thesis.analytic.plane import plane_to_target

Array = NDArray[np.float64]

METHOD = "analytic"

APPROXIMATION = Cause(
    Status.CONVERGED, "analytic approximation, not an optimum: the iteration converged"
)

_SAMPLE_PERIOD = 1.0  # s
_SHORTEST = 1e-6  # s, least length of a burn that becomes an arc


@dataclass(frozen=True)
class AnalyticBurn:
    """Hold one burn in closed form.

    Attributes:
        start_s, end_s: mission elapsed time.
        sin_gamma: coefficients of Eqs. 5.8, 5.9 or of higher degree, lowest power first, of the
            time in s after the start of the burn.
        cos_alpha: the same for Eqs. 5.17, 5.18.
        gravity_m_s2: constant over the burn.
        delta_v_m_s: integral of thrust acceleration, a scalar of Table 6.6.
        end_radius_m, end_speed_m_s, end_flight_path_angle_deg: state at the end.
    """

    start_s: float
    end_s: float
    sin_gamma: tuple[float, ...]
    cos_alpha: tuple[float, ...]
    gravity_m_s2: float
    delta_v_m_s: float
    end_radius_m: float
    end_speed_m_s: float
    end_flight_path_angle_deg: float


@dataclass(frozen=True)
class AnalyticPart:
    """Hold the part from start to jettison, or from jettison to cut-off.

    Attributes:
        converged: speed within 1e-4 m/s, radius within 1 m and, if solved for,
            flight-path angle within 1e-6 rad of the target of the part.
        iterations: updates of the angles, with the final check.
        searches: projections in the search for the time to go (Eq. 5.30), of all iterations.
        start_s: mission elapsed time.
        time_to_go_s: duration of the last burn.
        theta_start_deg, theta_end_deg: thrust above the local horizon.
        gamma_joint_deg: flight-path angle at staging; nan without staging in the part.
        partials_m_per_deg: dr/d(angle) of Eq. 5.32 by name of the angle, at constant time.
        position_error_m, speed_error_m_s, gamma_error_deg: desired minus projected.
        burns: the closed forms.
    """

    converged: bool
    iterations: int
    searches: int
    start_s: float
    time_to_go_s: float
    theta_start_deg: float
    theta_end_deg: float
    gamma_joint_deg: float
    partials_m_per_deg: dict[str, float]
    position_error_m: float
    speed_error_m_s: float
    gamma_error_deg: float
    burns: tuple[AnalyticBurn, ...]


@dataclass(frozen=True)
class AnalyticSolution:
    """Hold the result of the analytic method.

    Attributes:
        options: the options used.
        jettison: target of part one; None after the jettison, or if none was found.
        part_one: None after the jettison, for a jettison at the start, or if not reached.
        part_two: None if not reached.
        projected_flights: flights computed in the search for the jettison target.
        flight: the planar flight; None unless both parts converged.
        solution: as of every method; its trajectory is the closed form, its verification a flight
            with its steering.
    """

    options: AnalyticOptions
    jettison: JettisonTarget | None
    part_one: AnalyticPart | None
    part_two: AnalyticPart | None
    projected_flights: int
    flight: PlanarFlight | None
    solution: Solution

    @property
    def delta_v_m_s(self) -> tuple[float, ...]:
        """Return the scalar delta-V of each burn, m/s (Table 6.6)."""
        parts = (part for part in (self.part_one, self.part_two) if part is not None)
        return tuple(burn.delta_v_m_s for part in parts for burn in part.burns)

    def to_json(self) -> dict[str, Any]:
        """Return the results without samples, for ``json.dumps``; unknown is None."""
        return {
            "profile": _plain(self.options.profile),
            "position_integral": self.options.position_integral,
            "steps": list(self.options.steps),
            "jettison_target": _plain(self.jettison),
            "projected_flights": self.projected_flights,
            "part_one": _plain(self.part_one),
            "part_two": _plain(self.part_two),
            **self.solution.to_json(),
            # per burn, as in Table 6.6
            "delta_v_m_s": list(self.delta_v_m_s),
        }


def _plain(value: Any) -> Any:
    """Convert a dataclass to values that JSON can hold."""
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


@dataclass
class _Found:
    """Hold the parts of an ascent found so far.

    Attributes:
        target: target of part one.
        flights: number of flights projected to find it.
        one, two: the parts.
    """

    target: JettisonTarget | None = None
    flights: int = 0
    one: Work | None = None
    two: Work | None = None

    @property
    def works(self) -> tuple[Work, ...]:
        """Return the parts that were reached."""
        return tuple(work for work in (self.one, self.two) if work is not None)


def _optimum(arrays: MissionArrays, state: NDArray[np.void]) -> Solution:
    """Solve by ``direct11`` for the optimum that gives the target of part one."""
    with Deadline() as unlimited:
        return solve_direct(Request(arrays, state, "direct11", Heating.AT_JETTISON, unlimited))


def _flown(ascent: Ascent, found: _Found, verify: bool) -> tuple[PlanarFlight, Solution]:
    """Return the flight that was found: in its plane, and as a solution."""
    pieces = _pieces(ascent, found)
    plane = _plane(ascent, pieces)
    planar, trajectory = _sampled(ascent, plane, pieces)
    solution = replace(_solution(ascent, plane, pieces), trajectory=trajectory)
    return planar, _verified(ascent, solution, trajectory) if verify else solution


def solve_analytic(
    mission: Mission | MissionArrays,
    options: AnalyticOptions | None = None,
    *,
    state: NDArray[np.void] | None = None,
    optimum: Solution | None = None,
    verify: bool = True,
    deadline: Deadline | None = None,
) -> AnalyticSolution:
    """Solve the ascent by chapter 5 of the thesis.

    Args:
        mission: two stages of one burn each, one jettison by a heating limit in the second.
        options: None: the defaults.
        state: start, shape (1,), dtype NAVIGATION; None: that of the mission.
        optimum: solution that gives the target of ``jettison_target`` ``optimizer``; None: solved
            by ``direct11``.
        verify: fly the steering with the independent integrator and fill ``verification`` and
            ``constraints`` of the solution.
        deadline: time limit; None: no limit.

    Raises:
        OptimizerError: the method does not apply to the mission or the state; one line.
    """
    options = options or AnalyticOptions()
    if isinstance(mission, Mission) and mission.heating_limit_holds != "at_jettison":
        raise UnfitMethod(
            f"heating_limit_holds is {mission.heating_limit_holds!r}; analytic takes at_jettison"
        )
    arrays, state = arrays_and_state(mission, state)
    ascent = read_ascent(arrays, state)
    if ascent.first_arc == 1 and not options.ties.solved:
        raise OptimizerError(
            f"profile is {options.profile!r} and state.arc is 1; expected arc 0, the angles that "
            "are assumed are those of a start before staging"
        )
    found = _Found()
    cause = infeasible(target_obstacle(arrays))
    if ascent.jettisoned or options.jettison_target == "mission":
        optimum = None
    elif optimum is None and cause is None:
        optimum = _optimum(arrays, state)
    began = time.perf_counter()
    try:
        if cause is None:
            _search(ascent, options, optimum, found, deadline or Deadline())
    except NoSolution as failure:
        cause = failure.cause
    elapsed = 1e3 * (time.perf_counter() - began)
    one, two = (None if work is None else _report(work) for work in (found.one, found.two))
    iterations = sum(part.iterations for part in (one, two) if part is not None)
    planar = None
    if cause is not None:
        solution = failed(METHOD, cause)
    else:
        planar, solution = _flown(ascent, found, verify)
    solution = replace(solution, iterations=iterations, solve_ms=elapsed)
    return AnalyticSolution(options, found.target, one, two, found.flights, planar, solution)


def _search(
    ascent: Ascent,
    options: AnalyticOptions,
    optimum: Solution | None,
    found: _Found,
    deadline: Deadline,
) -> None:
    """Find jettison target, part one and part two.

    Raises:
        NoSolution: a part has no solution; with its cause.
    """
    start = (ascent.radius, ascent.speed, ascent.gamma)
    begin = ascent.start_s
    tau = ascent.tau_s[1]
    if not ascent.jettisoned:
        if optimum is None:
            found.target, found.flights = target_of_mission(ascent)
        else:
            found.target = target_of_optimum(optimum)
        target = found.target
        begin = target.time_s
        if begin - ascent.start_s > _SHORTEST:
            found.one = part_one(ascent, options, target)
            found.one.run("part one", deadline)
            begin = found.one.end_s
            start = (target.radius_m, target.speed_m_s, math.radians(target.flight_path_angle_deg))
        # as printed, part two starts from all of the target, its mass included
        jettison_s = begin if options.ties.solved else target.time_s
        tau -= jettison_s - ascent.staging_s + ascent.drop_s
    found.two = part_two(ascent, options, start, begin, tau)
    found.two.run("part two", deadline)


def _report(work: Work) -> AnalyticPart:
    row = work.part[0]
    burns = work.burns
    last = burns[-1]
    turned = last["range_angle"][last["nodes"] - 1] if row["steering"] else 0.0
    names: tuple[str, ...] = ("theta_start", "theta_end")
    if not row["solved"]:
        names = ("theta_end", "gamma_joint") if len(burns) == 2 else ("theta_start",)
    per_deg = [math.radians(float(value)) for value in row["partials"]]
    joint = math.nan
    if len(burns) == 2:
        joint = _end_gamma_deg(burns[0])
    return AnalyticPart(
        converged=work.converged,
        iterations=int(row["iterations"]),
        searches=int(row["searches"]),
        start_s=work.start_s,
        time_to_go_s=float(row["time_to_go"]),
        theta_start_deg=math.degrees(row["theta_start"]),
        theta_end_deg=math.degrees(row["theta_end"] + turned),
        gamma_joint_deg=joint,
        partials_m_per_deg=dict(zip(names, per_deg, strict=False)),
        position_error_m=float(row["position_error"]),
        speed_error_m_s=float(row["speed_error"]),
        gamma_error_deg=math.degrees(row["gamma_error"]),
        burns=tuple(_report_burn(work.start_s, burn) for burn in burns),
    )


def _end_gamma_deg(burn: np.void) -> float:
    sine = float(burn["sine"][burn["nodes"] - 1])
    return math.degrees(math.asin(sine)) if abs(sine) <= 1.0 else math.nan


def _report_burn(part_start_s: float, burn: np.void) -> AnalyticBurn:
    duration = float(burn["duration"])
    start = part_start_s + float(burn["begin"])
    nodes = int(burn["nodes"])
    return AnalyticBurn(
        start_s=start,
        end_s=start + duration,
        sin_gamma=_of_time(burn["sin_gamma"], duration),
        cos_alpha=_of_time(burn["cos_alpha"][:nodes], duration),
        gravity_m_s2=float(burn["gravity"]),
        delta_v_m_s=-float(burn["exhaust_velocity"]) * math.log1p(-duration / float(burn["tau"])),
        end_radius_m=float(burn["end_radius"]),
        end_speed_m_s=float(burn["speed"][nodes - 1]),
        end_flight_path_angle_deg=_end_gamma_deg(burn),
    )


def _of_time(coefficients: Array, duration: float) -> tuple[float, ...]:
    """Convert powers of t/T to powers of t, without trailing zeros."""
    kept = np.trim_zeros(coefficients, "b")
    if duration == 0.0 or not len(kept):
        return (float(coefficients[0]),)
    return tuple(float(c) / duration**k for k, c in enumerate(kept))


@dataclass(frozen=True)
class _PlacedBurn:
    """Hold a burn with its place in the flight.

    Attributes:
        work: its part.
        index: index of the burn in the part.
        start_s: mission elapsed time.
        turned: range angle from the start of the flight to that of the part, rad.
        mass: at the start of the burn, kg.
        arc: record ARC.
    """

    work: Work
    index: int
    start_s: float
    turned: float
    mass: float
    arc: np.void

    @property
    def burn(self) -> np.void:
        """Return the record of the burn."""
        return self.work.burns[self.index]

    @property
    def duration(self) -> float:
        """Return the duration, s."""
        return float(self.burn["duration"])

    @property
    def end_s(self) -> float:
        """Return the end, s, mission elapsed time."""
        return self.start_s + self.duration

    def mass_at(self, x: Array) -> Array:
        """Return the mass at fractions of the burn, kg."""
        return self.mass - float(self.arc["mass_flow"]) * self.duration * x

    def samples(self, x: Array) -> Array:
        """Return samples, shape (n, 6), see `sample_burn`; range angles from the start."""
        out = np.empty((len(x), 6))
        sample_burn(self.work.part[0], self.burn, x, out)
        out[:, 3] += self.turned
        return out


def _pieces(ascent: Ascent, found: _Found) -> list[_PlacedBurn]:
    """Return the burns in order, with their masses; burns of no length are left out."""
    arcs = ascent.arrays.arcs
    drop = 0.0 if ascent.jettisoned else float(ascent.arrays.jettisons[0]["mass"])
    mass = float(ascent.state[0]["mass"])
    turned = 0.0
    pieces = []
    for work in found.works:
        if work is found.two:
            mass -= drop
        for index, burn in enumerate(work.burns):
            k = 2 - len(work.burns) + index
            if index == 1:
                mass = float(arcs[1]["stack_mass"])
            start = work.start_s + float(burn["begin"])
            piece = _PlacedBurn(work, index, start, turned, mass, arcs[k])
            if piece.duration > _SHORTEST:
                pieces.append(piece)
            mass = float(piece.mass_at(np.ones(1))[0])
        last = work.burns[-1]
        turned += float(last["range_angle"][last["nodes"] - 1])
    return pieces


def _plane(ascent: Ascent, pieces: Sequence[_PlacedBurn]) -> Plane:
    """Return the plane of the flight in space."""
    last = pieces[-1]
    radius, speed, sine, range_angle = last.samples(np.ones(1))[0, :4].tolist()
    state = ascent.state[0]
    return plane_to_target(
        np.asarray(state["position"], dtype=np.float64),
        np.asarray(state["velocity"], dtype=np.float64),
        float(ascent.arrays.environment[0]["mu"]),
        ascent.arrays.target[0],
        (radius, speed, sine, range_angle),
        last.end_s - ascent.start_s,
    )


def _in_space(ascent: Ascent, plane: Plane, time_s: Array, samples: Array) -> Track:
    """Convert planar samples, shape (n, 6), to a track in space."""
    position, velocity, direction = (np.empty((len(samples), 3)) for _ in range(3))
    track = Track(position, velocity, direction, np.empty(len(samples)))
    place_samples(samples, time_s - ascent.start_s, plane, ascent.arrays, track)
    return track


def _sampled(
    ascent: Ascent, plane: Plane, pieces: Sequence[_PlacedBurn]
) -> tuple[PlanarFlight, Trajectory]:
    """Sample the closed forms every second and at the ends of burns, planar and in space."""
    grids = [
        np.linspace(0.0, 1.0, max(2, math.ceil(piece.duration / _SAMPLE_PERIOD) + 1))
        for piece in pieces
    ]
    pairs = list(zip(pieces, grids, strict=True))
    samples = np.concatenate([piece.samples(x) for piece, x in pairs])
    times = np.concatenate([piece.start_s + piece.duration * x for piece, x in pairs])
    mass = np.concatenate([piece.mass_at(x) for piece, x in pairs])
    thrust = np.concatenate([np.full(len(x), float(piece.arc["thrust"])) for piece, x in pairs])
    gamma = np.arcsin(np.clip(samples[:, 2], -1.0, 1.0))
    theta = np.arctan2(samples[:, 5], samples[:, 4])
    planar = PlanarFlight(times, samples[:, 0], samples[:, 1], gamma, theta, mass)
    track = _in_space(ascent, plane, times, samples)
    return planar, Trajectory(
        times, track.position, track.velocity, mass, track.direction, track.rate, thrust
    )


def _steering_arc(ascent: Ascent, plane: Plane, piece: _PlacedBurn) -> SteeringArc:
    """Return the linear law through the directions at start, middle and end of a burn."""
    x = np.array([0.0, 0.5, 1.0])
    times = piece.start_s + piece.duration * x
    start, middle, end = _in_space(ascent, plane, times, piece.samples(x)).direction
    left = float(np.linalg.norm(np.cross(start, middle)))
    right = float(np.linalg.norm(np.cross(middle, end)))
    # start + size * end is parallel to the middle direction
    size = left / right if min(left, right) > 0.0 else 1.0
    masses = piece.mass_at(x)
    return SteeringArc(
        piece.start_s,
        piece.end_s,
        piece.start_s,
        (float(start[0]), float(start[1]), float(start[2])),
        tuple((size * end - start) / piece.duration),
        float(masses[0]),
        float(masses[2]),
        float(piece.arc["exhaust_velocity"]) * math.log(masses[0] / masses[2]),
    )


def _solution(ascent: Ascent, plane: Plane, pieces: Sequence[_PlacedBurn]) -> Solution:
    """Build a solution with times, masses and steering, without trajectory and counts."""
    arcs = tuple(_steering_arc(ascent, plane, piece) for piece in pieces)
    last = arcs[-1]
    lacking = _propellant_line(ascent, last.end_s)
    if not last.end_mass_kg > 0.0:
        # the closed form does not limit a burn to its propellant
        lacking = f"propellant: {last.end_mass_kg:,.0f} kg are left of the vehicle"
    cause = infeasible(lacking) or APPROXIMATION
    return Solution(
        METHOD,
        **cause._asdict(),
        jettison_times_s=(math.nan if ascent.jettisoned else last.start_s,),
        t_meco_s=last.end_s,
        m_f_kg=last.end_mass_kg,
        iterations=0,
        solve_ms=0.0,
        arcs=arcs,
    )


def _propellant_line(ascent: Ascent, cutoff_s: float) -> str:
    """Return a line if the last stage burns more than it has, else ""."""
    row = ascent.state[0]
    arrays = ascent.arrays
    used = float(arrays.arcs[1]["mass_flow"]) * (cutoff_s - ascent.staging_s)
    if ascent.first_arc == 1:
        used += propellant_used(row, row["mass"], arrays.arcs, arrays.jettisons)
    missing = used - float(arrays.arcs[1]["propellant"])
    if missing <= 0.0:
        return ""
    return f"propellant of the last stage: {missing:,.0f} kg short of the {used:,.0f} kg to burn"


def _verified(ascent: Ascent, solution: Solution, trajectory: Trajectory) -> Solution:
    """Fly the steering by the independent integrator; add the errors of the approximation."""
    arrays = ascent.arrays
    start = ascent.state[0]
    starts = [arc.start_s for arc in solution.arcs]
    steering = steering_of(solution.arcs)
    times = solution.jettison_times_s
    flight = fly(arrays, start, steering, times, solution.t_meco_s, starts)
    # the ends of the burns
    ends = np.flatnonzero(np.diff(trajectory.time_s, append=math.inf) == 0.0).tolist()
    nodes = np.array(
        [
            [
                trajectory.time_s[k],
                *trajectory.position[k],
                *trajectory.velocity[k],
                trajectory.mass[k],
            ]
            for k in (*ends, -1)
        ]
    )
    return replace(
        solution,
        verification=verification(arrays, flight, nodes),
        constraints=constraint_table(arrays, start, flight, Heating.AT_JETTISON),
    )
