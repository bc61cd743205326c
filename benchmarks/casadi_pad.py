# SPDX-License-Identifier: Apache-2.0
"""Plan launches from the pad in CasADi SX with IPOPT, from the mission alone.

Radau collocation of degree 4: position and velocity at every node, at every collocation point a
unit vector of thrust, lengths of what is free. The mass follows from these lengths. The air is a
spline of the mission's table with a continuous second derivative. Limits of q and q alpha are
relaxed in steps. Nothing is shared with the optimizer but the reading of missions. Left out:
throttled and held burns, transients, lift, wind, programmes. `pad_peer.py` finds starts.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from casadi_ascent import log_density
from casadi_collocation import (
    OPTIONS,
    air_velocity,
    altitude,
    gravity,
    orbit_rows,
    plane_rows,
)
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ares_models.arrays import (
    BURN,
    HEATING_LIMIT,
    MISSION_TIME,
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_ASCENDING_NODE,
    NAMES_INCLINATION,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
)
from ares_models.floors import floors_of
from ares_models.mission import Mission

Array = NDArray[np.float64]

DEGREE = 4
#: Knots of the air, m; straight in both logarithms above.
KNOTS = np.r_[0.0:32e3:1e3, 32e3:92e3:2e3, 92e3:130e3:3e3, 130e3:200e3:10e3, 200e3, 250e3, 300e3]
GAMMA = 1.4
#: Unit of free lengths, s.
UNIT_S = 100.0
#: What limits are multiplied with, in turn.
RELAXED = (30.0, 2.0, 1.0)
#: First and longest interval of guided burns, s, and growth of the others.
FIRST_LAST_S = (1.0, 40.0)
GROWTH = 0.15
#: A coast has one interval below the first length, 12 below the second, s.
SHORT_S = 60.0
LONG_S = 6000.0
#: Limits of one call of IPOPT, and other ones on finer intervals.
LIMITS = {"ipopt.tol": 1e-8, "ipopt.max_iter": 150, "ipopt.max_cpu_time": 6.0}
FINE_LIMITS = {"ipopt.max_iter": 600, "ipopt.max_cpu_time": 90.0}


@dataclass(frozen=True)
class Piece:
    """Hold a part of an arc in which thrust and mass flow are straight in time.

    Attributes:
        arc: index into the arcs.
        length: s; inf where it is free.
        thrust, flow: at both ends, N and kg/s.
        drops: indices of what drops at its end.
        half: 0: whole; 1, 2: before and after a drop that waits for heating.
    """

    arc: int
    length: float
    thrust: tuple[float, float]
    flow: tuple[float, float]
    drops: tuple[int, ...] = ()
    half: int = 0

    def burnt(self, t: Any, length: Any) -> Any:
        """Return the propellant of its first ``t`` s, kg."""
        if self.flow[0] == self.flow[1]:
            return self.flow[0] * t
        return self.flow[0] * t + (self.flow[1] - self.flow[0]) * t * t / (2.0 * length)


@dataclass(frozen=True)
class Flight:
    """Hold a flight: a first guess, or a solution.

    Attributes:
        t: times of its states, s, shape (n,).
        x: position, velocity and thrust direction in turn, shape (n, 9), m and m/s.
        lengths: of the pieces, s, before drops that wait for heating cut them.
        heat: by drop that waits for heating: piece, and s from its begin.
        mass: at the end, kg.
        plane: normal of the plane that it was launched into.
    """

    t: Array
    x: Array
    lengths: list[float]
    heat: dict[int, tuple[int, float]] = field(default_factory=dict)
    mass: float = math.nan
    plane: tuple[float, ...] = ()

    def at(self, times: Array) -> Array:
        """Return the states at some times, directions as unit vectors."""
        x = np.array([np.interp(times, self.t, column) for column in self.x.T]).T
        x[:, 6:] /= np.linalg.norm(x[:, 6:], axis=1)[:, None]
        return x


class Launch:
    """Hold a mission as pieces and functions of the forces.

    Attributes:
        arrays: the mission; another target may be set.
        pieces: in flight order.
        rise: length of the vertical rise, s.
    """

    def __init__(self, mission: Mission, arcs: int | None = None) -> None:
        """Cut the arcs of a mission into pieces.

        Args:
            mission: from the pad.
            arcs: so many of them alone; None: all.

        Raises:
            ValueError: it has what is left out here.
        """
        arrays = mission.arrays()
        self.arrays = arrays._replace(arcs=arrays.arcs[:arcs], target=arrays.target.copy())
        self.start = mission.start()
        self.environment = arrays.environment[0]
        self.radius = float(self.environment["equatorial_radius"])
        self.gravity = float(self.environment["mu"]) / self.radius**2
        self.speed = math.sqrt(self.gravity * self.radius)
        self.floors = {
            floor.arc: floor.altitude_m for floor in floors_of(arrays, self.start.navigation())
        }
        self._check()
        self._fill_target()
        self.pieces = self._cut()
        vertical = self.arrays.arcs["vertical"]
        self.rise = sum(piece.length for piece in self.pieces if vertical[piece.arc])

    def _check(self) -> None:
        arcs, jettisons = self.arrays.arcs, self.arrays.jettisons
        burns = arcs[arcs["kind"] == BURN]
        odd = burns["held"].any() or np.isfinite(burns["max_acceleration"]).any()
        odd = odd or burns["tail_knots"].any() or (jettisons["criterion"] == MISSION_TIME).any()
        odd = odd or arcs["across_knots"].any() or arcs["body_axes"].any()
        odd = odd or arcs["min_perigee_radius"].any() or arcs["orbit"]["named"].any()
        if odd or self.environment["wind"]["knots"] or self.environment["boost"]["knots"]:
            raise ValueError("the peer leaves out what this mission has")

    def _cut(self) -> list[Piece]:
        pieces: list[Piece] = []
        since, lit = 0.0, {}
        for k, arc in enumerate(self.arrays.arcs):
            stage, length = int(arc["stage"]), float(arc["duration"])
            if arc["kind"] == BURN:
                lit.setdefault(stage, since)
            due = {
                j: lit[int(one["stage"])] + float(one["value"]) - since
                for j, one in enumerate(self.arrays.jettisons)
                if one["criterion"] != HEATING_LIMIT and int(one["stage"]) in lit
            }
            due = {j: t for j, t in due.items() if 1e-6 < t <= length + 1e-6}
            n = int(arc["start_knots"])
            knots = arc["start_time"][:n] if n else np.array([0.0, length])
            sides = [arc[f"start_{name}"][:n] if n else np.ones(2) for name in ("fraction", "flow")]
            inner = {t for t in due.values() if t < length - 1e-6}
            for begin, end in pairwise(sorted({0.0, length, *knots.tolist(), *inner})):
                if end - begin < 1e-6:
                    continue
                ends = []
                for full, side in zip(("thrust", "mass_flow"), sides, strict=True):
                    i = max(1, int(np.searchsorted(knots, begin, side="right")))
                    i = min(i, knots.size - 1)
                    w = [0.0, 0.0]
                    if math.isfinite(knots[i]):
                        w = [(t - knots[i - 1]) / (knots[i] - knots[i - 1]) for t in (begin, end)]
                    level = [side[i - 1] + part * (side[i] - side[i - 1]) for part in w]
                    ends.append(tuple(float(arc[full]) * each for each in level))
                drops = tuple(j for j, t in due.items() if abs(t - end) < 1e-6)
                pieces.append(Piece(k, end - begin, ends[0], ends[1], drops))
            since += length
        return pieces

    @cached_property
    def air(self) -> Any:
        """Return the function from the altitude, m, to the logarithms of density and pressure."""
        h, rows = ca.SX.sym("h"), []
        known = self.arrays.atmosphere
        for column in (1, 5):
            i = np.clip(np.searchsorted(known[:, 0], KNOTS, side="right") - 1, 0, None)
            x, (c0, c1, c2, c3) = KNOTS - known[i, 0], known[i, column : column + 4].T
            spline = CubicSpline(KNOTS, c0 + x * (c1 + x * (c2 + x * c3)))
            table = np.column_stack((KNOTS[:-1], *spline.c[::-1])).tolist()
            ends = [
                [KNOTS[k], float(spline(KNOTS[k])), float(spline(KNOTS[k], 1)), 0.0, 0.0]
                for k in (0, -1)
            ]
            rows.append(log_density(h, np.array([ends[0], *table[1:], ends[1]])))
        rows[0] += math.log(float(self.environment["density_factor"]))
        return ca.Function("air", [h], rows)

    def forces(self, arc: Any) -> Any:
        """Return the function of the forces of an arc.

        From r, v, u, thrust, N, and mass, kg, to the acceleration by gravity's unit, the dynamic
        pressure, Pa, the square of what is q times the sine of the angle of attack, and the
        logarithm of the heating, W/m2. States are by radius and circular speed.
        """
        r, v, u = (ca.SX.sym(name, 3) for name in "rvu")
        thrust, mass = ca.SX.sym("thrust"), ca.SX.sym("mass")
        place, environment = r * self.radius, self.environment
        log_rho, log_p = self.air(altitude(place, environment))
        w = air_velocity(place, v * self.speed, environment)
        square = ca.dot(w, w) + 1e-6
        rho, speed = ca.exp(log_rho), ca.sqrt(square)
        if arc["vertical"]:
            stretch = (self.radius / float(environment["polar_radius"])) ** 2
            up = ca.vertcat(r[0], r[1], stretch * r[2])
            u = up / ca.norm_2(up)
        force = (thrust - ca.exp(log_p) * float(arc["exit_area"])) * u if arc["kind"] == BURN else 0
        if arc["drag_area"] > 0.0:
            mach = speed / ca.sqrt(GAMMA * ca.exp(log_p - log_rho))
            force -= 0.5 * rho * float(arc["drag_area"]) * drag_coefficient(arc, mach) * speed * w
        motion = gravity(r, float(environment["j2"])) + force / (mass * self.gravity)
        across = ca.cross(u, w)
        aslant = (0.5 * rho) ** 2 * square * ca.dot(across, across)
        q, heating = 0.5 * rho * square, log_rho + 1.5 * ca.log(square) + math.log(0.5)
        u = ca.SX.sym("u", 3) if arc["vertical"] else u
        return ca.Function("forces", [r, v, u, thrust, mass], [motion, q, aslant, heating])

    @cached_property
    def arc_forces(self) -> list[Any]:
        """Return the function of the forces of every arc."""
        return [self.forces(arc) for arc in self.arrays.arcs]

    def target(self, r: Any, v: Any) -> list[Any]:
        """Return what is zero at the target, for a scaled state."""
        target, mu = self.arrays.target[0], float(self.environment["mu"])
        r, v = r * self.radius, v * self.speed
        if target["kind"] not in (
            TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
            TARGET_RADIUS_SPEED_ANGLE_PLANE,
        ):
            return orbit_rows(target, mu, r, v)
        radius, speed = float(target["radius"]), float(target["speed"])
        angle = float(target["flight_path_angle"])
        normal = ca.cross(r, v) / (radius * speed * math.cos(angle))
        plane = [normal[2] - math.cos(float(target["inclination"]))]
        if target["kind"] == TARGET_RADIUS_SPEED_ANGLE_PLANE:
            plane = plane_rows(target, normal)
        state = [ca.dot(r, r) / radius**2 - 1.0, ca.dot(v, v) / speed**2 - 1.0]
        return [*state, ca.dot(r, v) / (radius * speed) - math.sin(angle), *plane]

    def aim(self, perigee: float, apogee: float) -> None:
        """Set another orbit as the target, by its radii, m, in the same plane."""
        target = self.arrays.target[0]
        target["kind"] = TARGET_RADIUS_SPEED_ANGLE_INCLINATION
        target["named"] = NAMES_INCLINATION
        target["radius"], target["flight_path_angle"] = perigee, 0.0
        mu = float(self.environment["mu"])
        target["speed"] = math.sqrt(2.0 * mu * (1.0 / perigee - 1.0 / (perigee + apogee)))
        target["perigee_radius"], target["c3"] = perigee, -2.0 * mu / (perigee + apogee)

    @property
    def orbit(self) -> tuple[float, float]:
        """Return perigee radius, m, and C3, m2/s2, of the target."""
        target = self.arrays.target[0]
        return float(target["perigee_radius"]), float(target["c3"])

    def _fill_target(self) -> None:
        """Write what the elements or the state of the target imply."""
        target, mu = self.arrays.target[0], float(self.environment["mu"])
        if target["kind"] == TARGET_KEPLERIAN:
            target["perigee_radius"] = target["semi_major_axis"] * (1.0 - target["eccentricity"])
            target["c3"] = -mu / target["semi_major_axis"]
            target["named"] = NAMES_INCLINATION | NAMES_ASCENDING_NODE | NAMES_ARGUMENT_OF_PERIGEE
        elif not target["perigee_radius"]:
            target["perigee_radius"] = target["radius"]
            target["c3"] = target["speed"] ** 2 - 2.0 * mu / target["radius"]

    def normals(self) -> list[Array]:
        """Return the normals of the planes to launch into: northwards and southwards."""
        target = self.arrays.target[0]
        up = self.start.position / np.linalg.norm(self.start.position)
        i, node = float(target["inclination"]), float(target["ascending_node"])
        fixed = target["kind"] == TARGET_RADIUS_SPEED_ANGLE_PLANE
        if fixed or int(target["named"]) & NAMES_ASCENDING_NODE:
            across = math.sin(i) * math.sin(node), -math.sin(i) * math.cos(node), math.cos(i)
            return [np.array(across)]
        east = np.cross([0.0, 0.0, 1.0], up)
        east /= np.linalg.norm(east)
        sine = min(1.0, max(-1.0, math.cos(i) / math.hypot(up[0], up[1])))
        cosine = math.sqrt(1.0 - sine * sine)
        north = np.cross(up, east)
        return [np.cross(up, sine * east + side * cosine * north) for side in (1.0, -1.0)]

    def ignition(self, stage: int) -> int:
        """Return the first piece in which a stage burns."""
        arcs = self.arrays.arcs[[piece.arc for piece in self.pieces]]
        return int(np.flatnonzero((arcs["stage"] == stage) & (arcs["kind"] == BURN))[0])

    def masses(self, pieces: list[Piece], lengths: list[Any]) -> list[Any]:
        """Return the masses at the begins of pieces and at the end, kg."""
        arcs, drops = self.arrays.arcs, self.arrays.jettisons
        aboard, mass, at = set(range(len(drops))), 0.0, []
        for k, piece in enumerate(pieces):
            arc = arcs[piece.arc]
            if arc["begins_stage"] and (k == 0 or pieces[k - 1].arc != piece.arc):
                below = [drops[j]["mass"] for j in aboard if drops[j]["stage"] < arc["stage"]]
                mass = float(arc["stack_mass"]) + float(sum(below))
            at.append(mass)
            whole = lengths[k] + (lengths[k - 1] if piece.half == 2 else 0.0)
            before = lengths[k - 1] if piece.half == 2 else 0.0
            full = piece.length if math.isfinite(piece.length) else whole
            mass = mass - piece.burnt(before + lengths[k], full) + piece.burnt(before, full)
            for j in aboard.intersection(piece.drops):
                mass -= float(drops[j]["mass"])
            aboard -= set(piece.drops)
        return [*at, mass]


def drag_coefficient(arc: Any, mach: Any) -> Any:
    """Evaluate the drag table of an arc, constant beyond both ends."""
    n = int(arc["drag_knots"])
    first = float(arc["drag_cubic"][0, 0])
    if n == 1:
        return first
    flat = [[0.0, first, 0.0, 0.0, 0.0]]
    rows = [[float(arc["drag_mach"][k]), *arc["drag_cubic"][k].tolist()] for k in range(n - 1)]
    last = float(arc["drag_mach"][n - 1])
    x = last - rows[-1][0]
    end = float(np.polyval(rows[-1][:0:-1], x))
    return log_density(mach, np.array([*flat, *rows, [last, end, 0.0, 0.0, 0.0]]))


class Program:
    """Hold the program of a launch in which drops that wait for heating lie in given pieces.

    Attributes:
        pieces: with those cut.
        key: equal for guesses that one program serves.
    """

    def __init__(self, launch: Launch, guess: Flight, fine: float = 1.0) -> None:
        """Lay out intervals for the pieces and about the lengths of a guess.

        Args:
            launch: the launch.
            guess: a flight of it.
            fine: intervals are so many times shorter.
        """
        self.launch = launch
        self._fine = fine
        self.where = {j: place[0] for j, place in guess.heat.items()}
        self.pieces: list[Piece] = []
        self.base: list[int] = []
        for k, piece in enumerate(launch.pieces):
            waiting = tuple(j for j, at in self.where.items() if at == k)
            halves = [piece]
            if waiting:
                halves = [replace(piece, drops=waiting, half=1), replace(piece, half=2)]
            self.pieces += halves
            self.base += [k] * len(halves)
        self._free = [not math.isfinite(piece.length) or piece.half > 0 for piece in self.pieces]
        self._edges: list[Array] = []
        now = 0.0
        for k, length in enumerate(self._lengths(guess)):
            self._edges.append(self._edges_of(k, now, length, fine))
            now += length
        shape = [(len(each), each[1]) for each in self._edges]
        self.key = (launch, tuple(self.where.items()), tuple(shape))

    def _lengths(self, guess: Flight) -> list[float]:
        lengths = []
        for piece, k in zip(self.pieces, self.base, strict=True):
            whole = guess.lengths[k]
            if piece.half:
                first = min(max(guess.heat[j][1] for j, at in self.where.items() if at == k), whole)
                whole = first if piece.half == 1 else whole - first
            lengths.append(whole)
        return lengths

    def _variable(self, size: int, low: float = -ca.inf, high: float = ca.inf) -> Any:
        x = ca.SX.sym(f"x{len(self._x)}", size)
        self._x.append(x)
        self._bounds.append(np.tile([low, high], (size, 1)))
        return x

    def _row(self, value: Any, low: float = 0.0, high: float = 0.0, limit: int = 0) -> None:
        """Add a row; it is relaxed by a factor to the power of ``limit``."""
        self._g.append(value)
        self._sides.append((low, high, limit))

    @cached_property
    def _solver(self) -> Any:
        """Build the program, and return its solver."""
        launch, pieces = self.launch, self.pieces
        arcs = launch.arrays.arcs
        self._x, self._bounds, self._g, self._sides = [], [], [], []
        self._places: list[tuple[int, float, bool]] = []
        lengths = [
            self._variable(1, 0.0) * UNIT_S if is_free else piece.length
            for piece, is_free in zip(pieces, self._free, strict=True)
        ]
        self._rules_of_lengths(lengths)
        masses = launch.masses(pieces, lengths)
        taus = [0.0, *ca.collocation_points(DEGREE, "radau")]
        weights = ca.collocation_coeff(taus[1:])[0]
        unit = launch.radius / launch.speed
        x0 = np.r_[launch.start.position / launch.radius, launch.start.velocity / launch.speed]
        x = self._variable(6)
        self._bounds[-1] = np.column_stack((x0, x0))
        self._places.append((0, 0.0, False))
        for k, piece in enumerate(pieces):
            arc, forces, length = arcs[piece.arc], launch.arc_forces[piece.arc], lengths[k]
            before = lengths[k - 1] if piece.half == 2 else 0.0
            whole = piece.length
            if not math.isfinite(whole):
                whole = length + before + (lengths[k + 1] if piece.half == 1 else 0.0)
            guided = arc["kind"] == BURN and not arc["vertical"]
            floor = launch.floors.get(piece.arc, math.nan)
            for begin, end in pairwise(self._edges[k].tolist()):
                nodes, rates = [x], []
                for i in range(1, DEGREE + 1):
                    nodes.append(self._variable(6))
                    part = begin + taus[i] * (end - begin)
                    self._places.append((k, part, False))
                    u = ca.DM([0.0, 0.0, 0.0])
                    if guided:
                        u = self._variable(3, -1.2, 1.2)
                        self._places.append((k, part, True))
                        self._row(0.5 * (ca.dot(u, u) - 1.0))
                    t = before + part * length
                    thrust = piece.thrust[0] + (piece.thrust[1] - piece.thrust[0]) * t / whole
                    mass = masses[k] - piece.burnt(t, whole) + piece.burnt(before, whole)
                    r, v = nodes[i][:3], nodes[i][3:]
                    motion, q, aslant, heating = forces(r, v, u, thrust, mass)
                    rates.append((end - begin) * length / unit * ca.vertcat(v, motion))
                    if math.isfinite(floor):
                        height = altitude(r * launch.radius, launch.environment)
                        self._row((height - floor) / launch.radius, 0.0, ca.inf)
                    if math.isfinite(arc["max_dynamic_pressure"]) and arc["kind"] == BURN:
                        self._row(q / float(arc["max_dynamic_pressure"]), -ca.inf, 1.0, 1)
                    if math.isfinite(arc["max_q_alpha"]) and guided:
                        self._row(aslant / float(arc["max_q_alpha"]) ** 2, -ca.inf, 1.0, 2)
                slopes = ca.mtimes(ca.horzcat(*nodes), weights)
                self._row(ca.vec(slopes - ca.horzcat(*rates)))
                x = nodes[-1]
            for j in piece.drops if piece.half == 1 else ():
                level = math.log(float(launch.arrays.jettisons[j]["value"]))
                self._row(heating - level, -ca.inf, 0.0)
        for value in launch.target(x[:3], x[3:]):
            self._row(value)
        self.limited = any(limit for *_, limit in self._sides)
        self._sizes = [row.shape[0] for row in self._g]
        mass_unit = float(arcs[-1]["stack_mass"])
        nlp = {"x": ca.vertcat(*self._x), "f": -masses[-1] / mass_unit, "g": ca.vertcat(*self._g)}
        return ca.nlpsol(
            "pad", "ipopt", nlp, OPTIONS | LIMITS | (FINE_LIMITS if self._fine > 1.0 else {})
        )

    def _edges_of(self, k: int, now: float, length: float, fine: float) -> Array:
        """Return the edges of the intervals of a piece as shares of it."""
        piece = self.pieces[k]
        if self.launch.arrays.arcs[piece.arc]["vertical"]:
            return np.linspace(0.0, 1.0, 3)
        if piece.thrust == (0.0, 0.0):
            count = 1 if length < SHORT_S else 12 if length < LONG_S else 20
            share = np.linspace(0.0, 1.0, 1 + round(count * fine))
            # short where it begins and ends, perhaps at its perigee
            return share - (length > SHORT_S) * 0.9 * np.sin(2.0 * np.pi * share) / (2.0 * np.pi)
        if self._free[k]:
            steps = max(1.0, length * fine / FIRST_LAST_S[1])
            return np.linspace(0.0, 1.0, 1 + 2 ** math.ceil(math.log2(steps)))
        # short after the vertical rise, where the kick is
        ends = [0.0]
        while ends[-1] < length:
            guided = max(0.0, now + ends[-1] - self.launch.rise)
            ends.append(ends[-1] + min(FIRST_LAST_S[0] + GROWTH * guided, FIRST_LAST_S[1]) / fine)
        return np.array(ends) / ends[-1]

    def _rules_of_lengths(self, lengths: list[Any]) -> None:
        """Add what the lengths of pieces keep: fixed lengths, bounds and propellant."""
        launch = self.launch
        arcs = launch.arrays.arcs
        for k, piece in enumerate(self.pieces):
            if piece.half == 1 and math.isfinite(piece.length):
                self._row((lengths[k] + lengths[k + 1] - piece.length) / UNIT_S)
        burnt: dict[int, Any] = {}
        for i, arc in enumerate(arcs):
            parts = [k for k, piece in enumerate(self.pieces) if piece.arc == i]
            whole = sum(lengths[k] for k in parts)
            if isinstance(whole, ca.SX) and math.isinf(arc["duration"]):
                low, high = float(arc["shortest"]), float(arc["longest"])
                self._row(whole / UNIT_S, low / UNIT_S, high / UNIT_S)
            used = sum(
                self.pieces[k].burnt(lengths[k], lengths[k])
                if math.isinf(arc["duration"])
                else 0.5 * sum(self.pieces[k].flow) * self.pieces[k].length
                for k in parts
                if self.pieces[k].half != 2 or math.isinf(arc["duration"])
            )
            burnt[int(arc["stage"])] = burnt.get(int(arc["stage"]), 0.0) + used
        for stage, used in burnt.items():
            if isinstance(used, ca.SX):
                limit = float(arcs["propellant"][arcs["stage"] == stage][0])
                self._row(used / limit - 1.0, -ca.inf, 0.0)

    def _guess(self, guess: Flight) -> Array:
        lengths = np.array(self._lengths(guess))
        begins = np.r_[0.0, np.cumsum(lengths)]
        times = np.array([begins[k] + part * lengths[k] for k, part, _ in self._places])
        states = guess.at(times)
        scale = [self.launch.radius] * 3 + [self.launch.speed] * 3
        x: list[Any] = [lengths[np.array(self._free)] / UNIT_S]
        for (_, _, steers), state in zip(self._places, states, strict=True):
            x.append(state[6:] if steers else state[:6] / scale)
        return np.concatenate(x)

    def solve(self, guess: Flight, relaxed: tuple[float, ...] = RELAXED) -> Flight | None:
        """Solve from a guess, limits relaxed in turn; return None without a solution.

        Args:
            guess: a flight with the drops in the same pieces.
            relaxed: what the limits are multiplied with.
        """
        solver = self._solver
        x = self._guess(guess)
        low_x, high_x = np.concatenate(self._bounds).T
        low = np.repeat([side[0] for side in self._sides], self._sizes)
        for factor in relaxed if self.limited else (1.0,):
            highs = [high * (factor**limit if limit else 1.0) for _, high, limit in self._sides]
            high = np.repeat(highs, self._sizes)
            found = solver(x0=x, lbx=low_x, ubx=high_x, lbg=low, ubg=high)
            x = np.array(found["x"]).ravel()
            success = solver.stats()["success"]
            if not success and factor == relaxed[0]:
                return None
        return self._flight(x) if success else None

    def _flight(self, x: Array) -> Flight:
        lengths = [piece.length for piece in self.pieces]
        free = np.flatnonzero(self._free)
        for k, value in zip(free, x, strict=False):
            lengths[k] = float(value) * UNIT_S
        begins = np.r_[0.0, np.cumsum(lengths)]
        at, times, rows = len(free), [], []
        scale = [self.launch.radius] * 3 + [self.launch.speed] * 3
        for k, part, steers in self._places:
            if steers:
                rows[-1][6:] = x[at : at + 3]
                at += 3
                continue
            direction = rows[-1][6:] if rows else self.launch.start.position / self.launch.radius
            rows.append(np.r_[x[at : at + 6] * scale, direction])
            times.append(begins[k] + part * lengths[k])
            at += 6
        whole = [0.0] * len(self.launch.pieces)
        heat = {}
        for k, base in enumerate(self.base):
            whole[base] += lengths[k]
            if self.pieces[k].half == 1:
                heat |= dict.fromkeys(self.pieces[k].drops, (base, lengths[k]))
        mass = self.launch.masses(self.pieces, lengths)[-1]
        return Flight(np.array(times), np.array(rows), whole, heat, mass)
