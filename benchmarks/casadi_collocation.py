# SPDX-License-Identifier: Apache-2.0
"""Solve the program of a planned mission in CasADi SX with IPOPT, with CasADi's derivatives.

Variables, rows, intervals and bounds are those of ``Transcription``, so that both solvers have the
same problem; the equations are written independently. Thrust curves and throttled burns are left
out. `casadi_pad.py` shares the equations.
"""

import time
from typing import Any

import casadi as ca
import numpy as np
from casadi_ascent import log_density

from ares_models.arrays import (
    ALTITUDE_SPHERICAL,
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_ASCENDING_NODE,
    NAMES_INCLINATION,
)
from ares_optimizer.collocation.arrays import COASTING, FLOOR_RULE, HEATING_RULE, TARGET_RULE
from ares_optimizer.collocation.radau import radau
from ares_optimizer.collocation.transcription import CollocationProgram

OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-9,
    "ipopt.constr_viol_tol": 1e-9,
    "ipopt.mu_strategy": "adaptive",
    "ipopt.max_iter": 100,
}


def gravity(r: Any, j2: float) -> Any:
    """Return the acceleration by the unit mu / R^2 at a position by the equatorial radius R."""
    square = ca.dot(r, r)
    tilt = 5.0 * r[2] * r[2] / square
    bulge = 1.0 + 1.5 * j2 / square * (ca.vertcat(1.0, 1.0, 3.0) - tilt)
    return -r * bulge / (square * ca.sqrt(square))


def altitude(r: Any, environment: Any) -> Any:
    """Return the altitude of a position, both in m, above the ellipsoid or the sphere."""
    square = ca.dot(r, r)
    equatorial, polar = (float(environment[f"{a}_radius"]) for a in ("equatorial", "polar"))
    if environment["altitude_model"] == ALTITUDE_SPHERICAL:
        return ca.sqrt(square) - equatorial
    k = 1.0 - (polar / equatorial) ** 2
    return ca.sqrt(square) - polar / ca.sqrt(1.0 - k * (r[0] ** 2 + r[1] ** 2) / square)


def air_velocity(r: Any, v: Any, environment: Any) -> Any:
    """Return the velocity in air that turns with the body, m/s."""
    spin = float(environment["rotation_rate"])
    return ca.vertcat(v[0] + spin * r[1], v[1] - spin * r[0], v[2])


def orbit_rows(target: Any, mu: float, r: Any, v: Any) -> list[Any]:
    """Return what is zero on an orbit: energy, plane, perigee or eccentricity vector.

    Args:
        target: record TARGET with perigee radius, C3 and eccentricity.
        mu: m3/s2.
        r: position, m.
        v: velocity, m/s.
    """
    perigee, c3 = float(target["perigee_radius"]), float(target["c3"])
    named = int(target["named"])
    h = ca.cross(r, v)
    momentum = ca.dot(h, h)
    size = ca.sqrt(ca.dot(r, r))
    energy = ca.dot(v, v) - 2.0 * mu / size
    out = [(energy - c3) * (0.5 * perigee / mu)]
    normal = h / ca.sqrt(momentum)
    tilt = [normal[2] - np.cos(float(target["inclination"]))]
    if named & NAMES_ASCENDING_NODE:
        tilt = plane_rows(target, normal)
    if named & NAMES_ARGUMENT_OF_PERIGEE:
        node = ca.vertcat(-normal[1], normal[0], 0.0)
        node /= ca.norm_2(node)
        eccentric = ca.cross(v, h) / mu - r / size
        argument = float(target["argument_of_perigee"])
        along = ca.dot(eccentric, node)
        ahead = ca.dot(eccentric, ca.cross(normal, node))
        towards = np.cos(argument) * along + np.sin(argument) * ahead
        across = np.cos(argument) * ahead - np.sin(argument) * along
        return [out[0], *tilt, towards - 1.0 - perigee * c3 / mu, across]
    least = 1.0 / max(float(target["eccentricity"]), 1e-3)
    miss = momentum - perigee**2 * energy - 2.0 * mu * perigee
    out.append(miss * (0.5 * least / (mu * perigee)))
    return [*out, *tilt] if named & (NAMES_INCLINATION | NAMES_ASCENDING_NODE) else out


def plane_rows(target: Any, normal: Any) -> list[Any]:
    """Return what is zero in the plane of a target with a node, for the normal of a plane."""
    i, node = float(target["inclination"]), float(target["ascending_node"])
    along = ca.vertcat(np.cos(node), np.sin(node), 0.0)
    ahead = ca.vertcat(-np.sin(node) * np.cos(i), np.cos(node) * np.cos(i), np.sin(i))
    return [ca.dot(normal, along), ca.dot(normal, ahead)]


class CasadiCollocation:
    """Hold one built program.

    Attributes:
        build_s: CPU time of building it.
        rows: function of the variables, all rows.
    """

    def __init__(self, program: CollocationProgram) -> None:
        """Build the equations.

        Args:
            program: the transcription; without throttled burns and thrust curves.
        """
        begun = time.process_time()
        self.program = program
        x = ca.SX.sym("x", program.size)
        rows: list[Any] = [ca.SX(0)] * program.row_lower.size
        self._motion(x, rows)
        for i, at in enumerate(program.controls):
            u = x[int(at) : int(at) + 3]
            rows[6 * len(program.points) + i] = 0.5 * (ca.dot(u, u) - 1.0)
        for phase in program.phases:
            length, mass = x[int(phase["length"])], x[int(phase["mass"])]
            rows[phase["link"]] = x[int(phase["end"])] - mass + length * float(phase["flow"])
        places = (part[program.moving :] for part in program.jacobian_pattern)
        for row, column, factor in zip(*places, program.linear, strict=True):
            rows[row] += float(factor) * x[int(column)]
        self._rules(x, rows)
        g = ca.vertcat(*rows)
        self.rows = ca.Function("rows", [x], [g])
        nlp = {"x": x, "f": -x[int(program.ends[-1])], "g": g}
        self._solver = ca.nlpsol("plan", "ipopt", nlp, OPTIONS)
        self.build_s = time.process_time() - begun

    def _motion(self, x: Any, rows: list[Any]) -> None:
        program = self.program
        weights = radau(program.degree)[1]
        j2 = float(program.arrays.environment[0]["j2"])
        for i, point in enumerate(program.points):
            phase = program.phases[point["phase"]]
            length = x[int(phase["length"])]
            at = 6 * int(point["node"] + point["number"])
            r, v = x[at : at + 3], x[at + 3 : at + 6]
            motion = gravity(r, j2)
            if phase["steering"] != COASTING:
                left = x[int(phase["mass"])] - float(point["fraction"] * phase["flow"]) * length
                u = x[int(point["control"]) : int(point["control"]) + 3]
                motion += float(phase["thrust"]) / left * u
            first = 6 * int(point["node"])
            nodes = ca.reshape(x[first : first + 6 * (program.degree + 1)], 6, -1)
            rate = ca.mtimes(nodes, ca.DM(weights[int(point["number"]) - 1]))
            defect = rate - float(point["width"]) * length * ca.vertcat(v, motion)
            for c in range(6):
                rows[6 * i + c] = defect[c]

    def _rules(self, x: Any, rows: list[Any]) -> None:
        program = self.program
        environment = program.arrays.environment[0]
        target = program.arrays.target[0], float(environment["mu"])
        table = program.arrays.atmosphere
        low = table[(table[:, 0] >= 60e3) & (table[:, 0] <= 250e3)]
        straight = [[*low[k, :3], 0.0, 0.0] for k in (0, -1)]
        table = np.vstack((straight[0], low[:-1, :5], straight[1]))
        for rule in program.rules:
            at, row = 6 * int(rule["node"]), int(rule["row"])
            r, v = x[at : at + 3] * program.radius, x[at + 3 : at + 6] * program.speed
            height = altitude(r, environment)
            if rule["kind"] == HEATING_RULE:
                air = air_velocity(r, v, environment)
                heating = log_density(height, table) + 1.5 * ca.log(ca.dot(air, air))
                heating += float(np.log(0.5 * environment["density_factor"]))
                rows[row] = float(rule["level"]) - heating
            elif rule["kind"] == FLOOR_RULE:
                rows[row] = (height - float(rule["level"])) / program.radius
            elif rule["kind"] == TARGET_RULE:
                for i, value in enumerate(orbit_rows(*target, r, v)):
                    rows[row + i] = value
            else:
                raise ValueError("a perigee of a coast is not written here")

    def solve(self, guess: np.ndarray) -> float:
        """Solve from a guess; return the final mass, kg, nan without a solution."""
        program = self.program
        result = self._solver(
            x0=guess,
            lbx=program.lower,
            ubx=program.upper,
            lbg=program.row_lower,
            ubg=program.row_upper,
        )
        if not self._solver.stats()["success"]:
            return float("nan")
        return float(result["x"][int(program.ends[-1])]) * program.mass
