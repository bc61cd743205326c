# SPDX-License-Identifier: Apache-2.0
"""Build and iterate the two parts of the analytic method, see `analytic/solve.py`."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, HEATING_LIMIT, TARGET_ELEMENTS, TARGET_KEPLERIAN, MissionArrays
from ares_optimizer.deadline import Deadline
from ares_optimizer.kernels.timetable import propellant_used
from ares_optimizer.solution import (
    OUT_OF_TIME,
    Cause,
    OptimizerError,
    Solution,
    Status,
    UnfitMethod,
)
from ares_thesis.analytic import arrays as layout
from ares_thesis.analytic.kernels import iteration
from ares_thesis.analytic.kernels import target as target_search
from ares_thesis.analytic.kernels.plane import Plane
from ares_thesis.analytic.options import POSITION_INTEGRALS, STEERINGS, AnalyticOptions
from ares_thesis.analytic.plane import tilted_plane

Array = NDArray[np.float64]

_FORMS = {"cubic": (layout.CUBIC, 3), "fitted": (layout.FITTED, 5)}
_ITERATIONS = 100
_SAME_TIME = 1e-6


@dataclass(frozen=True)
class JettisonTarget:
    """Hold the target state of part one.

    Attributes:
        source: ``mission`` or ``optimizer``.
        time_s: mission elapsed time of the source flight; part one finds its own time.
        radius_m, speed_m_s, flight_path_angle_deg: the target.
    """

    source: str
    time_s: float
    radius_m: float
    speed_m_s: float
    flight_path_angle_deg: float


@dataclass(frozen=True)
class Ascent:
    """Hold a mission of two burns and a jettison, in its plane.

    Attributes:
        arrays: the mission.
        state: shape (1,), dtype NAVIGATION.
        staging_s: end of the first burn; the start, if after it.
        plane: plane of the start.
        radius, speed, gamma: at the start, m, m/s, rad.
        tau_s: mass over mass flow at the begin of each burn; nan for a burn in the past.
    """

    arrays: MissionArrays
    state: NDArray[np.void]
    staging_s: float
    plane: Plane
    radius: float
    speed: float
    gamma: float
    tau_s: tuple[float, float]

    @property
    def start_s(self) -> float:
        """Return the start, s, mission elapsed time."""
        return float(self.state[0]["time"])

    @property
    def first_arc(self) -> int:
        """Return 0 before staging, 1 after it."""
        return int(self.state[0]["arc"])

    @property
    def jettisoned(self) -> bool:
        """Return true if the jettison is done."""
        return bool(int(self.state[0]["jettisoned"]) & 1)

    @property
    def drop_s(self) -> float:
        """Return the dropped mass over the mass flow of the second stage, s."""
        return float(self.arrays.jettisons[0]["mass"] / self.arrays.arcs[1]["mass_flow"])

    def heating(self) -> target_search.HeatingLimit:
        """Return the heating limit for the kernels."""
        return target_search.HeatingLimit(
            self.arrays.environment,
            self.arrays.atmosphere,
            self.plane,
            float(self.arrays.jettisons[0]["value"]),
            self.drop_s,
        )


def _refuse(found: str) -> UnfitMethod:
    return UnfitMethod(
        f"method analytic takes two stages of one burn each, with constant thrust, and one "
        f"jettison by a heating limit in the second; {found}"
    )


def _check_kind(arrays: MissionArrays) -> None:
    """Refuse missions to which chapter 5 does not apply."""
    arcs = arrays.arcs
    stages = [int(stage) for stage in arcs["stage"]]
    if stages != [0, 1] or np.any(arcs["kind"] != BURN):
        counts = [str(stages.count(stage)) for stage in range(max(stages) + 1)]
        raise _refuse(f"the mission's {len(counts)} stage(s) have {' and '.join(counts)} arc(s)")
    for k, arc in enumerate(arcs):
        if arc["start_knots"] or arc["tail_knots"]:
            raise _refuse(f"arc {k} has a thrust-time curve")
    jettisons = arrays.jettisons
    if len(jettisons) != 1:
        raise _refuse(f"the mission has {len(jettisons)} jettisons")
    if jettisons[0]["criterion"] != HEATING_LIMIT:
        raise _refuse("its jettison goes by time")
    if jettisons[0]["stage"] != 1:
        raise _refuse("its jettison belongs to the first stage")
    if arrays.target[0]["kind"] in (TARGET_KEPLERIAN, TARGET_ELEMENTS):
        raise UnfitMethod(
            "method analytic takes a target of radius, speed and flight-path angle; "
            "the mission's target is an orbit"
        )


def read_ascent(arrays: MissionArrays, state: NDArray[np.void]) -> Ascent:
    """Check a mission and a start, and convert them for this method.

    Raises:
        OptimizerError: the method does not apply; one line.
    """
    _check_kind(arrays)
    row = state[0]
    arcs = arrays.arcs
    now = float(row["time"])
    staging = now
    tau = float(row["mass"] / arcs[row["arc"]]["mass_flow"])
    taus = (math.nan, tau)
    if row["arc"] == 0:
        if int(row["jettisoned"]) & 1:
            raise OptimizerError(
                "state.jettisoned is 1 in arc 0; expected 0, the jettison is in the second stage"
            )
        left = arcs[0]["propellant"] - propellant_used(row, row["mass"], arcs, arrays.jettisons)
        burnout = now + float(left / arcs[0]["mass_flow"])
        staging = max(now, min(float(row["arc_start_time"] + arcs[0]["duration"]), burnout))
        taus = (tau, float(arcs[1]["stack_mass"] / arcs[1]["mass_flow"]))
    r = np.asarray(row["position"], dtype=np.float64)
    v = np.asarray(row["velocity"], dtype=np.float64)
    radius = float(np.linalg.norm(r))
    speed = float(np.linalg.norm(v))
    if not speed > 0.0:
        raise OptimizerError("state.velocity is zero; expected a velocity with a direction")
    return Ascent(
        arrays,
        state,
        staging,
        tilted_plane(r, v, float(arrays.environment[0]["mu"])),
        radius,
        speed,
        math.asin(float(r @ v) / (radius * speed)),
        taus,
    )


def _burns(ascent: Ascent, options: AnalyticOptions, which: str) -> NDArray[np.void]:
    """Return the burns of part ``one`` or ``two``, or of the ``whole`` ascent as one part."""
    arcs = ascent.arrays.arcs
    indices = [1] if which == "two" else list(range(ascent.first_arc, 2))
    burns = np.zeros(len(indices), layout.BURN)
    burns["moments_of"] = math.nan
    for burn, k in zip(burns, indices, strict=True):
        between = k == 1 and which == "one"
        printed = (layout.LINEAR, 2) if between else (layout.QUADRATIC, 3)
        burn["form"], burn["nodes"] = _FORMS.get(options.ties.sine, printed)
        burn["steps"] = options.steps[1 if between else 0]
        burn["exhaust_velocity"] = arcs[k]["exhaust_velocity"]
        burn["tau"] = ascent.tau_s[k]
        burn["duration"] = ascent.staging_s - ascent.start_s if k == 0 else 0.0
    return burns


def _part(
    ascent: Ascent,
    options: AnalyticOptions,
    burns: NDArray[np.void],
    start: tuple[float, float, float],
    target: tuple[float, float, float],
) -> NDArray[np.void]:
    """Return the record of a part between two states (radius m, speed m/s, gamma rad), no guess."""
    part = np.zeros(1, layout.PART)
    ties = options.ties
    part["mu"] = ascent.arrays.environment[0]["mu"]
    part["burns"] = len(burns)
    part["steering"] = STEERINGS[ties.steering]
    part["solved"] = ties.solved
    part["mean_gravity"] = ties.mean_gravity
    part["integral"] = POSITION_INTEGRALS[options.position_integral]
    part["step_scale"] = options.step_scale
    part["max_iterations"] = _ITERATIONS
    for prefix, values in (("", start), ("target_", target)):
        for name, value in zip(("radius", "speed", "gamma"), values, strict=True):
            part[prefix + name] = value
    part["mean_radius"] = 0.5 * (start[0] + target[0])
    part["mean_speed"] = 0.5 * (start[1] + target[1])
    return part


def _cutoff_target(arrays: MissionArrays) -> tuple[float, float, float]:
    target = arrays.target[0]
    return (
        float(target["radius"]),
        float(target["speed"]),
        float(target["flight_path_angle"]),
    )


class NoSolution(Exception):
    """Signal that a part has no solution.

    Attributes:
        cause: status and one line.
    """

    def __init__(self, cause: Cause) -> None:
        super().__init__(cause.reason)
        self.cause = cause


def target_of_mission(ascent: Ascent) -> tuple[JettisonTarget, int]:
    """Find the jettison on the shortest projected flight, by the default options."""
    options = AnalyticOptions()
    start = (ascent.radius, ascent.speed, ascent.gamma)
    goal = _cutoff_target(ascent.arrays)
    whole_burns = _burns(ascent, options, "whole")
    whole_burns[-1]["tau"] -= ascent.drop_s
    before = _burns(ascent, options, "one")
    after = _burns(ascent, options, "two")
    whole = _part(ascent, options, whole_burns, start, goal)
    parts = np.concatenate(
        (_part(ascent, options, before, start, goal), _part(ascent, options, after, goal, goal))
    )
    status, flights, level = target_search.find_target(
        whole[0], whole_burns, parts, before, after, ascent.heating()
    )
    if status == target_search.NO_FLIGHT:
        raise NoSolution(
            Cause(Status.ITERATION_LIMIT, f"the projected flight to the target {_errors(whole[0])}")
        )
    if status == target_search.TOO_HOT:
        limit = float(ascent.arrays.jettisons[0]["value"])
        raise NoSolution(
            Cause(
                Status.INFEASIBLE,
                f"heating limit of jettison 0: {limit:,.6g} W/m2 is not met on the projected arc, "
                f"the least is {limit * math.exp(level):,.6g} W/m2",
            )
        )
    first = parts[0]
    return JettisonTarget(
        "mission",
        ascent.staging_s + float(first["time_to_go"]),
        float(first["target_radius"]),
        float(first["target_speed"]),
        math.degrees(first["target_gamma"]),
    ), flights


def target_of_optimum(optimum: Solution) -> JettisonTarget:
    """Return the state of a solution just before its jettison."""
    if not optimum.converged or optimum.trajectory is None:
        raise NoSolution(
            Cause(optimum.status, f"no jettison target from the optimizer: {optimum.reason}")
        )
    flight = optimum.trajectory
    at = int(np.argmin(np.abs(flight.time_s - optimum.t_plf_s)))
    r, v = flight.position[at], flight.velocity[at]
    radius, speed = float(np.linalg.norm(r)), float(np.linalg.norm(v))
    gamma = math.degrees(math.asin(float(r @ v) / (radius * speed)))
    return JettisonTarget("optimizer", optimum.t_plf_s, radius, speed, gamma)


@dataclass
class Work:
    """Hold a part during the iteration.

    Attributes:
        part: shape (1,), dtype PART.
        burns: dtype BURN.
        start_s: mission elapsed time.
        converged: true if the iteration met its conditions.
    """

    part: NDArray[np.void]
    burns: NDArray[np.void]
    start_s: float
    converged: bool = False

    @property
    def end_s(self) -> float:
        """Return the end of the last burn, s, mission elapsed time."""
        return self.start_s + float(self.burns["duration"].sum())

    def run(self, name: str, deadline: Deadline) -> None:
        """Iterate from the guess; if ``solved`` and not converged, from a guess with a new time.

        Raises:
            NoSolution: it did not converge, or not in time.
        """
        row = self.part[0]
        deadline.watch(self.part["stop"])
        met = iteration.iterate(row, self.burns)
        if not met and row["solved"] and not row["timed"]:
            before = int(row["iterations"])
            iteration.guess_angles(row, self.burns, False)
            met = iteration.iterate(row, self.burns)
            row["iterations"] += before
        self.converged = bool(met and row["time_to_go"] >= 0.0)
        if not self.converged and deadline.passed:
            raise NoSolution(OUT_OF_TIME)
        if not self.converged:
            raise NoSolution(Cause(Status.ITERATION_LIMIT, f"{name} {_errors(row)}"))


def _errors(part: Any) -> str:
    """Describe the errors of the latest projection of a part."""
    if not math.isfinite(part["position_error"]):
        return (
            f"did not converge in {part['iterations']} iterations: with "
            f"{part['time_to_go']:.1f} s to go no flight can be projected"
        )
    text = (
        f"did not converge in {part['iterations']} iterations: with {part['time_to_go']:.1f} s to "
        f"go radius is off by {-part['position_error']:,.4g} m, speed by "
        f"{-part['speed_error']:,.4g} m/s"
    )
    if part["solved"]:
        text += f", flight-path angle by {-math.degrees(part['gamma_error']):,.4g} deg"
    return text


def part_one(ascent: Ascent, options: AnalyticOptions, target: JettisonTarget) -> Work:
    """Build the part from start to jettison, with its guess."""
    burns = _burns(ascent, options, "one")
    goal = (target.radius_m, target.speed_m_s, math.radians(target.flight_path_angle_deg))
    part = _part(ascent, options, burns, (ascent.radius, ascent.speed, ascent.gamma), goal)
    row = part[0]
    time_to_go = target.time_s - ascent.staging_s
    if time_to_go < _SAME_TIME:
        if not options.ties.solved:
            raise NoSolution(
                Cause(
                    Status.INFEASIBLE,
                    "part one: the jettison falls on staging; profile thesis needs it later",
                )
            )
        row["timed"] = 1
        time_to_go = 0.0
    if options.ties.solved:
        row["time_to_go"] = time_to_go
        iteration.guess_angles(row, burns, True)
    else:
        guess = options.guess
        row["time_to_go"] = guess.time_to_go_s
        row["theta_start"] = math.radians(guess.theta_0_deg)
        row["theta_end"] = math.radians(guess.theta_plf_deg)
        row["gamma_joint"] = math.radians(guess.gamma_staging_deg)
    return Work(part, burns, ascent.start_s)


def part_two(
    ascent: Ascent,
    options: AnalyticOptions,
    start: tuple[float, float, float],
    start_s: float,
    tau_s: float,
) -> Work:
    """Build the part from jettison (or a later start) to cut-off, with its guess (5.29)."""
    burns = _burns(ascent, options, "two")
    burns[0]["tau"] = tau_s
    part = _part(ascent, options, burns, start, _cutoff_target(ascent.arrays))
    row = part[0]
    iteration.guess_time(row, burns, float(row["target_speed"] - row["speed"]))
    if options.ties.solved:
        iteration.guess_angles(row, burns, True)
    else:
        row["theta_start"] = math.radians(options.guess.theta_plf_deg)
    return Work(part, burns, start_s)
