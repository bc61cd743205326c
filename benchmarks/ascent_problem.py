# SPDX-License-Identifier: Apache-2.0
"""Provide the default mission as plain numbers, and equal guesses for every solver.

Variables of the 11-parameter problem, in the order and units of the optimizer: B (3), the rate
up to the jettison and the rate after it (3 each, 1e-3 1/s), jettison and cut-off (100 s after
the start).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_models.mission import Mission, load_mission
from ares_optimizer.direct.kernels.evaluate import evaluate, make_point, make_scratch
from ares_optimizer.direct.kernels.problem import Problem
from ares_optimizer.direct.search import Guess, guess_variables
from ares_optimizer.direct.transcription import transcribe
from ares_optimizer.solve import solve
from ares_thesis.guess import thesis_guess

Array = NDArray[np.float64]

FAIR = "B turned up by 5 deg, both rates 10 % too large, t_PLF 10 s early, t_burn 20 s too long"
THESIS = "B = unit V0, A = 1e-4 1/s, t_PLF 420 s, t_burn 330 s"


@dataclass(frozen=True)
class Ascent:
    """Hold the problem for other solvers.

    Attributes:
        mission: the mission.
        arrays: the same as arrays.
        problem: the finite problem of ``direct11``.
        start_s: mission elapsed time at the start.
        position: m, shape (3,).
        velocity: m/s, shape (3,).
        thrust: of both burns, N.
        flow: of both burns, kg/s.
        mass: at the begin of both burns, kg.
        core_s: length of the first burn.
        fairing_kg: mass of the heating jettison.
        limit: of the heating, W/m2.
        environment: record ENVIRONMENT.
        target: record TARGET.
    """

    mission: Mission
    arrays: MissionArrays
    problem: Problem
    start_s: float
    position: Array
    velocity: Array
    thrust: tuple[float, float]
    flow: tuple[float, float]
    mass: tuple[float, float]
    core_s: float
    fairing_kg: float
    limit: float
    environment: Any
    target: Any

    def final_mass(self, cutoff_s: float) -> float:
        """Return the mass in kg at a cut-off time in s after the start."""
        return self.mass[1] - self.fairing_kg - self.flow[1] * (cutoff_s - self.core_s)

    def variables(self, guess: Guess) -> Array:
        """Return the scaled variables of a guess, shape (11,)."""
        return guess_variables(self.problem, guess)

    def terminal_miss(self, variables: Array) -> tuple[float, float]:
        """Return errors of radius (m) and speed (m/s) of a peer's answer flown by our kernels."""
        scratch = make_scratch(self.problem)
        point = make_point(self.problem)
        evaluate(np.ascontiguousarray(variables), self.problem, scratch, point)
        radius = float(np.linalg.norm(scratch.final[1:4]) - self.target["radius"])
        return radius, float(np.linalg.norm(scratch.final[4:7]) - self.target["speed"])

    def density_rows(self, low: float, high: float) -> Array:
        """Return the rows of the density table between two altitudes (m), extrapolated linearly."""
        table = self.arrays.atmosphere
        part = table[(table[:, 0] >= low) & (table[:, 0] <= high)]
        first = np.array([[*part[0, :3], 0.0, 0.0]])
        last = np.array([[*part[-1, :3], 0.0, 0.0]])
        return np.vstack((first, part[:-1], last))


def load_ascent(name: str = "ares_v") -> Ascent:
    """Load the default mission for the peers."""
    mission = load_mission(name)
    arrays = mission.arrays()
    start = mission.start().navigation()
    core, upper = arrays.arcs
    jettison = arrays.jettisons[0]
    flow = [float(arc["thrust"] / arc["exhaust_velocity"]) for arc in (core, upper)]
    return Ascent(
        mission,
        arrays,
        transcribe(arrays, start[0], "direct11").problem,
        float(start[0]["time"]),
        np.array(start[0]["position"]),
        np.array(start[0]["velocity"]),
        (float(core["thrust"]), float(upper["thrust"])),
        (flow[0], flow[1]),
        (float(core["stack_mass"]), float(upper["stack_mass"])),
        float(core["duration"]),
        float(jettison["mass"]),
        float(jettison["value"]),
        arrays.environment[0],
        arrays.target[0],
    )


def guesses(ascent: Ascent) -> dict[str, Guess]:
    """Return the fair guess (text FAIR, from our solution) and the thesis' guess (text THESIS)."""
    start = ascent.mission.start().navigation()[0]
    best = solve(ascent.mission, "direct11", guess=thesis_guess(start), verify=False)
    p = best.parameters
    b, up = p[:3], ascent.position / np.linalg.norm(ascent.position)
    side = up - b * (up @ b)
    side /= np.linalg.norm(side)
    turned = np.cos(np.radians(5.0)) * b + np.sin(np.radians(5.0)) * side
    jettison = ascent.start_s + 100.0 * p[9] - 10.0
    fair = Guess(
        tuple(turned),
        tuple(1.1e-3 * p[3:6]),
        float(jettison),
        float(100.0 * (p[10] - p[9]) + 20.0),
        tuple(1.1e-3 * p[6:9]),
    )
    return {"fair": fair, "thesis": thesis_guess(start)}
