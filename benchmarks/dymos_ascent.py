# SPDX-License-Identifier: Apache-2.0
"""Solve the 11-parameter problem in Dymos with SLSQP: Gauss-Lobatto or Radau collocation.

Three linked phases (core, upper stage with and without fairing); the steering parameters are
static parameters of the trajectory, mass is a known function of time, and the partial
derivatives of the equations are exact (complex step, coloured). In megametres and units of
100 s; log heating.
"""

import contextlib
import io
import os
import tempfile
import time
import warnings
from itertools import pairwise
from typing import Any

import dymos as dm
import numpy as np
import openmdao.api as om
from ascent_problem import Array, Ascent
from scipy.integrate import solve_ivp

LENGTH = 1.0e6
TIME = 100.0
NAMES = ("core", "upper", "light")

#: Segments per phase, order, Radau or not.
GRIDS: dict[str, tuple[tuple[int, int, int], int, bool]] = {
    "Gauss-Lobatto, 2+1+2 of order 5": ((2, 1, 2), 5, False),
    "Gauss-Lobatto, 2+1+3 of order 5": ((2, 1, 3), 5, False),
    "Radau, 2+1+2 of order 5": ((2, 1, 2), 5, True),
    "Radau, 2+1+3 of order 4": ((2, 1, 3), 4, True),
}


def _log_density(h: Array, rows: Array) -> Array:
    """Evaluate the cubic in log density; accept complex altitudes."""
    k = np.clip(np.searchsorted(rows[:, 0], h.real, side="right") - 1, 0, len(rows) - 1)
    x = h - rows[k, 0]
    return rows[k, 1] + x * (rows[k, 2] + x * (rows[k, 3] + x * rows[k, 4]))


class Equations(om.ExplicitComponent):
    """Compute the rates of position and velocity, and the boundary quantities."""

    def initialize(self) -> None:
        """Declare the options."""
        self.options.declare("num_nodes", types=int)
        self.options.declare("ascent", recordable=False)
        self.options.declare("phase", types=int)

    def setup(self) -> None:
        """Declare inputs, outputs, and the coloured complex step."""
        n = self.options["num_nodes"]
        self.add_input("time", np.ones(n))
        for name in ("r", "v"):
            self.add_input(name, np.ones((n, 3)))
        for name in ("B", "A1", "A2"):
            self.add_input(name, np.ones(3))
        self.add_input("drop", np.ones(1))
        for name in ("r_dot", "v_dot"):
            self.add_output(name, np.ones((n, 3)))
        outputs = ["size", "radius", "speed", "sine", "cosine", "heating"]
        for name in outputs:
            self.add_output(name, np.ones(n))
        self.declare_partials("*", "*", method="cs")
        self.declare_coloring(wrt="*", method="cs", show_summary=False, num_full_jacs=2)

    def compute(self, inputs: Any, outputs: Any, *_: Any) -> None:
        """Evaluate all nodes at once."""
        ascent: Ascent = self.options["ascent"]
        phase = self.options["phase"]
        t, r, v = inputs["time"] * TIME, inputs["r"], inputs["v"]
        drop = inputs["drop"] * TIME
        b, before, after = inputs["B"], 1e-3 * inputs["A1"], 1e-3 * inputs["A2"]
        if phase == 2:
            u = b + before * drop + after * (t - drop)[:, None]
        else:
            u = b + before * t[:, None]
        k = min(phase, 1)
        mass = ascent.mass[k] - ascent.flow[k] * (t - (ascent.core_s if k else 0.0))
        if phase == 2:
            mass = mass - ascent.fairing_kg
        environment = ascent.environment
        square = np.sum(r * r, axis=1)
        mu = float(environment["mu"]) / LENGTH**3
        outputs["r_dot"] = TIME * v
        force = ascent.thrust[k] / LENGTH / (mass * np.sqrt(np.sum(u * u, axis=1)))
        outputs["v_dot"] = TIME * (-(mu / square**1.5)[:, None] * r + force[:, None] * u)

        radius, speed = np.sqrt(square), np.sqrt(np.sum(v * v, axis=1))
        outputs["radius"] = radius * LENGTH / float(ascent.target["radius"])
        outputs["size"] = 0.5 * (np.sum(b * b) - 1.0)
        outputs["speed"] = speed * LENGTH / float(ascent.target["speed"])
        outputs["sine"] = np.sum(r * v, axis=1) / (radius * speed)
        momentum = np.cross(r, v)
        outputs["cosine"] = momentum[:, 2] / np.sqrt(np.sum(momentum * momentum, axis=1))
        equatorial = float(environment["equatorial_radius"])
        polar = float(environment["polar_radius"])
        flat = 1.0 - (polar / equatorial) ** 2
        around = (r[:, 0] ** 2 + r[:, 1] ** 2) / square
        h = LENGTH * radius - polar / np.sqrt(1.0 - flat * around)
        spin = float(environment["rotation_rate"])
        air = np.stack((v[:, 0] + spin * r[:, 1], v[:, 1] - spin * r[:, 0], v[:, 2]), axis=1)
        outputs["heating"] = (
            _log_density(h, ascent.density_rows(60e3, 250e3))
            + 1.5 * np.log(LENGTH**2 * np.sum(air * air, axis=1))
            + np.log(0.5 * float(environment["density_factor"]) / ascent.limit)
        )


def _fly(ascent: Ascent, x: Array) -> tuple[list[Any], list[float]]:
    """Integrate the three phases of a guess; return dense solutions, s after the start."""
    times = [0.0, ascent.core_s, TIME * float(x[9]), TIME * float(x[10])]
    state = np.concatenate((ascent.position, ascent.velocity)) / LENGTH
    mu = float(ascent.environment["mu"]) / LENGTH**3
    flights = []
    for phase, (begin, end) in enumerate(pairwise(times)):
        k = min(phase, 1)

        def rates(t: float, y: Array, phase: int = phase, k: int = k) -> Array:
            u = x[:3] + 1e-3 * x[3:6] * (t if phase < 2 else times[2])
            u = u + (1e-3 * x[6:9] * (t - times[2]) if phase == 2 else 0.0)
            mass = ascent.mass[k] - ascent.flow[k] * (t - (ascent.core_s if k else 0.0))
            mass -= ascent.fairing_kg if phase == 2 else 0.0
            force = ascent.thrust[k] / LENGTH / mass * u / np.linalg.norm(u)
            return np.concatenate((y[3:], force - mu * y[:3] / np.linalg.norm(y[:3]) ** 3))

        flight = solve_ivp(rates, (begin, end), state, rtol=1e-8, atol=1e-9, dense_output=True)
        state = flight.y[:, -1]
        flights.append(flight.sol)
    return flights, times


class DymosAscent:
    """Hold one problem, to be started from many guesses."""

    def __init__(
        self, ascent: Ascent, segments: tuple[int, int, int], order: int, radau: bool
    ) -> None:
        begun = time.perf_counter()
        self.ascent = ascent
        os.environ["OPENMDAO_REPORTS"] = "0"
        os.environ["OPENMDAO_WORKDIR"] = tempfile.mkdtemp(prefix="dymos")
        warnings.simplefilter("ignore")
        problem = self.problem = om.Problem(reports=False)
        driver = problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-8, maxiter=300)
        driver.options["disp"] = False
        driver.declare_coloring(show_summary=False)
        trajectory = problem.model.add_subsystem("t", dm.Trajectory())
        phases = []
        for k, name in enumerate(NAMES):
            rule = dm.Radau if radau else dm.GaussLobatto
            phase = dm.Phase(
                ode_class=Equations,
                ode_init_kwargs={"ascent": ascent, "phase": k},
                transcription=rule(num_segments=segments[k], order=order, compressed=True),
            )
            phases.append(trajectory.add_phase(name, phase))
            self._describe(phase, k)
        for name, bound in (("B", 1.5), ("A1", 5.0), ("A2", 5.0)):
            trajectory.add_parameter(
                name, opt=True, static_target=True, shape=(3,), lower=-bound, upper=bound,
                targets={key: [name] for key in NAMES},
            )  # fmt: skip
        phases[0].add_boundary_constraint("size", loc="initial", equals=0.0)
        phases[1].add_boundary_constraint("heating", loc="final", upper=0.0)
        target = ascent.target
        for name, value in (
            ("radius", 1.0),
            ("speed", 1.0),
            ("sine", float(np.sin(target["flight_path_angle"]))),
            ("cosine", float(np.cos(target["inclination"]))),
        ):
            phases[2].add_boundary_constraint(name, loc="final", equals=value, ref=value + 0.01)
        phases[2].add_objective("time", loc="final")
        trajectory.link_phases(list(NAMES), ["time", "r", "v"], connected=True)
        problem.setup(force_alloc_complex=True)
        self.build_s = time.perf_counter() - begun

    def _describe(self, phase: Any, k: int) -> None:
        """Declare time and states of a phase."""
        core = self.ascent.core_s / TIME
        bounds = [{"fix_duration": True}, {}, {}][k]
        if k > 0:
            bounds = {"duration_bounds": ((0.02, 4.0), (0.5, 6.0))[k - 1]}
        first = {"fix_initial": True} if k == 0 else {"input_initial": True}
        phase.set_time_options(
            units="s", targets=["time"], t_initial_targets=["drop"],
            initial_val=0.0 if k == 0 else core, duration_val=core, **first, **bounds,
        )  # fmt: skip
        for name, rate, ref in (("r", "r_dot", 1.0), ("v", "v_dot", 1e-3)):
            phase.add_state(
                name, rate_source=rate, targets=[name], shape=(3,), ref=ref, defect_ref=ref,
                **({"fix_initial": True} if k == 0 else {"input_initial": True}),
            )  # fmt: skip

    def solve(self, x: Array) -> tuple[Array, bool, int, float]:
        """Return the variables found, SLSQP's success, its iterations, and the wall time in s."""
        problem = self.problem
        flights, times = _fly(self.ascent, x)
        for name, flight, (begin, end) in zip(NAMES, flights, pairwise(times), strict=True):
            phase = problem.model.t._get_subsystem(f"phases.{name}")
            phase.set_time_val(begin / TIME, (end - begin) / TIME)
            nodes = np.linspace(begin, end, 60)
            values = flight(nodes).T
            for state, part in (("r", values[:, :3]), ("v", values[:, 3:])):
                phase.set_state_val(state, part, time_vals=nodes / TIME, interpolation_kind="cubic")
        for name, part in (("B", x[:3]), ("A1", x[3:6]), ("A2", x[6:9])):
            problem.set_val(f"t.parameters:{name}", part)
        quiet = io.StringIO()
        begun = time.perf_counter()
        with contextlib.redirect_stdout(quiet):
            result = problem.run_driver()
        seconds = time.perf_counter() - begun
        ends = [problem.get_val(f"t.{name}.timeseries.time")[-1, 0] for name in NAMES]
        parts = [
            problem.get_val(f"t.parameter_vals:{name}").ravel()[:3] for name in ("B", "A1", "A2")
        ]
        found = np.concatenate((*parts, ends[1:]))
        return found, bool(result.success), int(result.iter_count), seconds
