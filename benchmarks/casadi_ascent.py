# SPDX-License-Identifier: Apache-2.0
"""Solve the 11-parameter problem in CasADi SX with IPOPT, with an exact Hessian.

Single shooting with the Nystroem method of order 6 that the optimizer uses (RK4 needs four
times as many gravity evaluations for the same error), all in megametres and with log heating. Built
once; only the solution is timed.
"""

import time
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from ascent_problem import Array, Ascent

from ares_optimizer.kernels.nystroem import NODES, VELOCITY_WEIGHTS, WEIGHTS

LENGTH = 1.0e6  # m

#: Steps of the core and of the upper stage with and without fairing.
STEPS = {"coarse": (3, 2, 6), "as fine as ours": (10, 4, 18)}

#: Sets of IPOPT's options worth trying: which is best differs from guess to guess.
OPTIONS: dict[str, dict[str, Any]] = {
    "adaptive": {"mu_strategy": "adaptive"},
    "mu_init 1e-2": {"mu_init": 1e-2},
    "mu_init 1e-4": {"mu_init": 1e-4},
}
#: Bounds on B, on the rates (1e-3 1/s), on jettison and on cut-off (100 s after the start).
BOXES: dict[str, tuple[float, float, tuple[float, float], tuple[float, float]]] = {
    "wide": (1.5, 5.0, (1.8125, 6.0), (1.82, 9.0)),
    "tight": (1.5, 5.0, (2.0, 4.5), (4.5, 8.0)),
}


@dataclass(frozen=True)
class Attempt:
    """Hold the end of one solution.

    Attributes:
        variables: shape (11,).
        success: as reported by IPOPT.
        status: IPOPT's status.
        iterations: number of iterations.
        seconds: wall time.
    """

    variables: Array
    success: bool
    status: str
    iterations: int
    seconds: float


def log_density(h: Any, rows: Array) -> Any:
    """Evaluate the cubic of the row below ``h``, selected by a sum of steps without branches."""
    c = [ca.SX(float(x)) for x in rows[0]]
    for below, row in pairwise(rows):
        above = h >= float(row[0])
        for k in range(5):
            if row[k] != below[k]:
                c[k] += above * float(row[k] - below[k])
    x = h - c[0]
    return c[1] + x * (c[2] + x * (c[3] + x * c[4]))


def _leg(
    r: Any, v: Any, begin: Any, end: Any, steps: int, burn: tuple[Any, ...], law: tuple[Any, ...]
) -> tuple[Any, Any]:
    """Fly from ``begin`` to ``end``; burn: mass, thrust, flow, mu; law: B, rate, its time."""
    mass, thrust, flow, mu = burn
    direction, rate, reference = law
    h = (end - begin) / steps

    def force(tau: Any, r: Any) -> Any:
        u = direction + rate * (begin + tau - reference)
        square = ca.dot(r, r)
        return (
            -mu / (square * ca.sqrt(square)) * r
            + (thrust / LENGTH / ((mass - flow * tau) * ca.sqrt(ca.dot(u, u)))) * u
        )

    for i in range(steps):
        forces: list[Any] = []
        place = r
        for q in range(6):
            if q:
                gain = sum(WEIGHTS[q, j] * forces[j] for j in range(q) if WEIGHTS[q, j] != 0.0)
                place = r + NODES[q] * h * v + h * h * gain
            forces.append(force((i + NODES[q]) * h, place))
        r = place
        v = v + h * sum(VELOCITY_WEIGHTS[q] * forces[q] for q in range(6))
    return r, v


def build(ascent: Ascent, steps: tuple[int, int, int]) -> dict[str, Any]:
    """Build the nonlinear program: variables, objective (cut-off time), constraints."""
    environment, target = ascent.environment, ascent.target
    mu = float(environment["mu"]) / LENGTH**3
    x = ca.SX.sym("x", 11)
    b, before, after = x[0:3], x[3:6] * 1e-3, x[6:9] * 1e-3
    drop, cutoff = 100.0 * x[9], 100.0 * x[10]
    staging = ascent.core_s
    first = (ascent.mass[0], ascent.thrust[0], ascent.flow[0], mu)
    second = (ascent.mass[1], ascent.thrust[1], ascent.flow[1], mu)
    light = ascent.mass[1] - ascent.fairing_kg - ascent.flow[1] * (drop - staging)
    third = (light, ascent.thrust[1], ascent.flow[1], mu)
    r, v = ca.SX(ascent.position / LENGTH), ca.SX(ascent.velocity / LENGTH)
    r, v = _leg(r, v, 0.0, staging, steps[0], first, (b, before, 0.0))
    r, v = _leg(r, v, staging, drop, steps[1], second, (b, before, 0.0))

    square = ca.dot(r, r)
    equatorial = float(environment["equatorial_radius"])
    polar = float(environment["polar_radius"])
    k = 1.0 - (polar / equatorial) ** 2
    h = LENGTH * ca.sqrt(square) - polar / ca.sqrt(1.0 - k * (r[0] ** 2 + r[1] ** 2) / square)
    spin = float(environment["rotation_rate"])
    air = LENGTH * ca.vertcat(v[0] + spin * r[1], v[1] - spin * r[0], v[2])
    heating = log_density(h, ascent.density_rows(60e3, 250e3)) + 1.5 * ca.log(ca.dot(air, air))
    heating += float(np.log(0.5 * environment["density_factor"] / ascent.limit))

    r, v = _leg(r, v, drop, cutoff, steps[2], third, (b + before * drop, after, drop))
    radius, speed, momentum = ca.norm_2(r), ca.norm_2(v), ca.cross(r, v)
    constraints = ca.vertcat(
        100.0 * (radius * LENGTH / float(target["radius"]) - 1.0),
        100.0 * (speed * LENGTH / float(target["speed"]) - 1.0),
        100.0 * (ca.dot(r, v) / (radius * speed) - np.sin(target["flight_path_angle"])),
        100.0 * (momentum[2] / ca.norm_2(momentum) - np.cos(target["inclination"])),
        0.5 * (ca.dot(b, b) - 1.0),
        heating,
        x[9] - x[10],
    )
    return {"x": x, "f": x[10], "g": constraints}


class CasadiAscent:
    """Hold one built solver, to be started from many guesses."""

    def __init__(
        self, programme: dict[str, Any], options: str, box: str, compiled: bool = False
    ) -> None:
        begun = time.perf_counter()
        settings: dict[str, Any] = {
            "print_time": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.tol": 1e-6,
            "ipopt.max_iter": 300,
            "ipopt.nlp_scaling_method": "none",  # scaled by hand above
            **{f"ipopt.{key}": value for key, value in OPTIONS[options].items()},
        }
        if compiled:
            settings["jit"] = True
            settings["compiler"] = "shell"
            settings["jit_options"] = {"compiler": "gcc", "flags": ["-O1"]}
        self.solver = ca.nlpsol("ascent", "ipopt", programme, settings)
        b, rate, drop, cutoff = BOXES[box]
        self.bounds = {
            "lbx": [-b] * 3 + [-rate] * 6 + [drop[0], cutoff[0]],
            "ubx": [b] * 3 + [rate] * 6 + [drop[1], cutoff[1]],
            "lbg": [0.0] * 5 + [-np.inf] * 2,
            "ubg": [0.0] * 6 + [-0.001],
        }
        self.build_s = time.perf_counter() - begun

    def solve(self, guess: Array) -> Attempt:
        """Solve from one guess."""
        begun = time.perf_counter()
        result = self.solver(x0=guess, **self.bounds)
        seconds = time.perf_counter() - begun
        stats = self.solver.stats()
        return Attempt(
            np.array(result["x"]).ravel(),
            bool(stats["success"]),
            str(stats["return_status"]),
            int(stats["iter_count"]),
            seconds,
        )
