# SPDX-License-Identifier: Apache-2.0
"""Measure how often, how fast and how honestly the optimizer solves from random guesses.

Guesses: B within 60 deg of V0 (even over the cap), each component of A within +-2e-3 1/s,
t_PLF 420 s and t_burn 330 s each times 0.7 to 1.3.
"""

import argparse
import statistics
import time
from dataclasses import dataclass

import numpy as np
from ascent_problem import Array, Ascent, load_ascent

from ares_optimizer.direct.search import Guess
from ares_optimizer.solve import solve
from ares_thesis.guess import thesis_guess

AGREEMENT_KG = 1.0


def random_guess(velocity: Array, generator: np.random.Generator) -> Guess:
    """Draw one guess of the set in the module text."""
    axis = velocity / np.linalg.norm(velocity)
    cosine = generator.uniform(np.cos(np.radians(60.0)), 1.0)
    across = np.cross(axis, generator.normal(size=3))
    across /= np.linalg.norm(across)
    direction = cosine * axis + np.sqrt(1.0 - cosine * cosine) * across
    rate = generator.uniform(-2e-3, 2e-3, 3)
    jettison, burn = np.array([420.0, 330.0]) * generator.uniform(0.7, 1.3, 2)
    return Guess(tuple(direction), tuple(rate), float(jettison), float(burn))


@dataclass
class Tally:
    """Count the outcomes of one solver."""

    name: str
    reached: int = 0
    wrong: int = 0
    failed: int = 0

    def __post_init__(self) -> None:
        self.times: list[float] = []

    def add(self, success: bool, mass: float, optimum: float, milliseconds: float) -> None:
        """Count one solution."""
        self.times.append(milliseconds)
        if not success:
            self.failed += 1
        elif abs(mass - optimum) <= AGREEMENT_KG:
            self.reached += 1
        else:
            self.wrong += 1

    def show(self) -> None:
        """Print one line."""
        print(
            f"{self.name}: {self.reached} of {len(self.times)} within {AGREEMENT_KG:g} kg, "
            f"{self.wrong} wrong successes, {self.failed} failures; "
            f"median {statistics.median(self.times):.2f} ms, "
            f"95 % {np.percentile(self.times, 95):.2f} ms, max {max(self.times):.2f} ms"
        )


def run_ours(ascent: Ascent, guesses: list[Guess], optimum: float, verify: bool) -> Tally:
    """Run our ``direct11`` on every guess."""
    tally = Tally("direct11, verified" if verify else "direct11")
    for guess in guesses:
        begun = time.perf_counter()
        solution = solve(ascent.mission, "direct11", guess=guess, verify=verify)
        milliseconds = 1e3 * (time.perf_counter() - begun)
        tally.add(solution.converged, solution.m_f_kg, optimum, milliseconds)
    return tally


def run_casadi(ascent: Ascent, guesses: list[Guess], optimum: float) -> list[Tally]:
    """Run CasADi and IPOPT on the same guesses, one line per set of options."""
    from casadi_ascent import BOXES, OPTIONS, STEPS, CasadiAscent, build

    programme = build(ascent, STEPS["coarse"])
    tallies = []
    for options in OPTIONS:
        for box in BOXES:
            solver = CasadiAscent(programme, options, box)
            tally = Tally(f"CasADi SX, IPOPT, {options}, {box}")
            for guess in guesses:
                attempt = solver.solve(ascent.variables(guess))
                mass = ascent.final_mass(100.0 * float(attempt.variables[10]))
                tally.add(attempt.success, mass, optimum, 1e3 * attempt.seconds)
            tallies.append(tally)
    return tallies


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verify", action="store_true", help="with the verification flight")
    parser.add_argument("--casadi", action="store_true", help="CasADi on the same guesses")
    options = parser.parse_args()
    ascent = load_ascent()
    generator = np.random.default_rng(options.seed)
    guesses = [random_guess(ascent.velocity, generator) for _ in range(options.count)]
    start = ascent.mission.start().navigation()[0]
    best = solve(ascent.mission, "direct11", guess=thesis_guess(start), verify=options.verify)
    print(f"optimum {best.m_f_kg:,.3f} kg; seed {options.seed}")
    run_ours(ascent, guesses, best.m_f_kg, options.verify).show()
    if options.casadi:
        for tally in run_casadi(ascent, guesses, best.m_f_kg):
            tally.show()


if __name__ == "__main__":
    main()
