# SPDX-License-Identifier: Apache-2.0
"""Transcribe a mission to a sparse program: phases, variables, rows.

The order of events is that of a timetable (``kernels/timetable.py``) for trial times. The arc in
which a fairing drops, and the burns that reach the limit of a throttle, are fixed by it.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, tril

from ares_models.arrays import BURN, MissionArrays, Record
from ares_models.floors import Floor, orbits_of
from ares_models.kernels.aerodynamics import is_in_air
from ares_optimizer.collocation.arrays import (
    COASTING,
    DYNAMIC_PRESSURE_RULE,
    FLOOR_RULE,
    GUIDED,
    HEATING_RULE,
    HELD_ATTITUDE,
    PERIGEE_RULE,
    PHASE,
    POINT,
    Q_ALPHA_RULE,
    RULE,
    TARGET_RULE,
    VERTICAL,
)
from ares_optimizer.collocation.intervals import (
    Sweep,
    Turning,
    has_thrust,
    place_by_sweep,
    place_intervals,
)
from ares_optimizer.collocation.kernels import (
    Program,
    fill_hessian,
    fill_jacobian,
    fill_rows,
    fill_rules,
)
from ares_optimizer.collocation.patterns import hessian_of, jacobian_of
from ares_optimizer.collocation.radau import radau
from ares_optimizer.collocation.rows import ConstraintRows, count_rows
from ares_optimizer.kernels import timetable
from ares_optimizer.plan import SHORTEST, free_arcs, saving_stage, waiting_for_heating

Array = NDArray[np.float64]

INFINITE = 2e19  # bound that the solver ignores
#: Negligible mass, and least mass of a state, relative to that at the start.
_NO_MASS = 1e-9
_LEAST_MASS = 1e-6
#: Worth of propellant that is dropped with a stage before a prescribed orbit, where nothing else
#: depends on it, relative to that of mass at the end: without it ascents that waste are as good.
_LEFT = 1e-4


class FreeTimes(NamedTuple):
    """Hold the free times of a flight.

    Attributes:
        lengths: of the free arcs before the last, s.
        cutoff: s, mission elapsed time.
        drops: of the heating jettisons to come, in the order of the file, s.
    """

    lengths: Array
    cutoff: float
    drops: Array


def segments_of(
    arrays: MissionArrays, start: NDArray[np.void], times: FreeTimes
) -> NDArray[np.void]:
    """Return the segments of a flight, dtype SEGMENT; empty if the times are not possible."""
    segments = np.zeros(timetable.MAX_SEGMENTS, timetable.SEGMENT)
    ends = np.zeros(max(1, len(times.lengths)))
    now = float(start["arc_start_time"][0])
    free = free_arcs(arrays, start[0])
    f = 0
    for k in range(int(start["arc"][0]), len(arrays.arcs) - 1):
        if k in free:
            now += float(times.lengths[f])
            ends[f] = now
            f += 1
        else:
            now += float(arrays.arcs[k]["duration"])
    drops = np.concatenate((times.drops, [0.0]))
    count = timetable.build_timetable(
        start[0],
        arrays.arcs,
        arrays.jettisons,
        timetable.Times(timetable.HEATING_PASSIVE, drops, ends, times.cutoff),
        segments,
    )
    return segments[:count]


class CollocationProgram:
    """Transcribe one mission with one order of events to a program.

    Attributes:
        program: for the kernels.
        segments: pieces of the trial flight, one per phase.
        first: index of the state at the begin of each phase, and of the last state.
        breaks: ends of the intervals of each phase, as fractions of the phase.
        intervals: number of intervals of each phase.
        names: of the rows.
        lower, upper: bounds of the variables, shape (n,).
        row_lower, row_upper: bounds of the rows, shape (m,).
        added_cost: shape (n, n), matrix of a quadratic cost beside the mass, see :meth:`add_cost`.
    """

    def __init__(
        self,
        arrays: MissionArrays,
        start: NDArray[np.void],
        times: FreeTimes,
        floors: tuple[Floor, ...] = (),
        degree: int = 5,
        finer: float = 1.0,
        turning: Turning | None = None,
        sweep: Sweep | None = None,
    ) -> None:
        """Define variables, rows and sparsity patterns.

        Args:
            arrays: the mission.
            start: shape (1,), dtype NAVIGATION.
            times: trial times, which fix the order of events.
            floors: of the arcs.
            degree: of the polynomials.
            finer: factor on the number of intervals.
            turning: turn of the thrust in a similar flight: intervals are shorter where it is
                fast. None: intervals are equal in a phase.
            sweep: of a similar flight: intervals of coasts are longer where its orbit is slow, and
                those of burns above the air. None: they are those of a low circular orbit.

        Raises:
            ValueError: the times are not possible, or a drop that waits for heating coincides with
                another event, where it would have no limit.
        """
        self.arrays = arrays
        self.start = start
        self.waiting = len(times.drops)
        self.mission = arrays.records()
        self.segments = segments_of(arrays, start, times)
        if not len(self.segments):
            raise ValueError("no flight is possible with these times")
        environment = arrays.environment[0]
        self.radius = float(environment["equatorial_radius"])
        self.speed = math.sqrt(float(environment["mu"]) / self.radius)
        self.time = self.radius / self.speed
        self.mass = float(self.segments[0]["mass"])
        self.degree = degree
        self._rows = ConstraintRows()
        self._lay_out_chain(finer, turning, sweep)
        self._lay_out_variables()
        self._lay_out_phases()
        self._lay_out_points()
        self._lay_out_lengths()
        if len(self.drop_ends) < self.waiting:
            raise ValueError("a drop that waits for heating coincides with another event")
        self._lay_out_masses()
        self._lay_out_rules(floors)
        self._assemble()
        self.added_cost = csr_array((self.size, self.size))
        self._added_curvature = np.zeros(0)

    def _assemble(self) -> None:
        """Hold all that is laid out for the kernels and the solver: program, rows, patterns."""
        laid = self._rows
        self.row_lower, self.row_upper = np.array(laid.lower), np.array(laid.upper)
        self.names = tuple(laid.names)
        self.program = Program(
            self.phases,
            self.points,
            self.rules,
            self.targets,
            radau(self.degree)[1],
            self.controls,
            1.5 * float(self.arrays.environment["j2"][0]),
            self.radius,
            self.speed,
            self.mass,
        )
        rows, columns = jacobian_of(self.program)
        linear = laid.linear
        self.linear = np.array([entry[2] for entry in linear])
        self._linear_rows = np.array([entry[0] for entry in linear], np.int64)
        self._linear_columns = np.array([entry[1] for entry in linear], np.int64)
        self.moving = len(rows)
        self.jacobian_pattern = (
            np.concatenate((rows, self._linear_rows)),
            np.concatenate((columns, self._linear_columns)),
        )
        self.hessian_pattern = hessian_of(self.program)

    # ---- phases, intervals, variables

    def _lay_out_chain(self, finer: float, turning: Turning | None, sweep: Sweep | None) -> None:
        """Place the intervals and number the states."""
        #: Angle that each phase sweeps in the similar flight, over that of a low circular orbit.
        self.pace = np.ones(len(self.segments))
        self.breaks: list[Array] = []
        above_air_s = math.inf if sweep is None else sweep.above_air_s
        for p, piece in enumerate(self.segments):
            if sweep is None or has_thrust(piece):
                air_end_s = above_air_s if self._in_air(piece) else -math.inf
                breaks = place_intervals(piece, self.time, air_end_s, finer, turning)
            else:
                breaks, self.pace[p] = place_by_sweep(piece, self.time, finer, sweep)
            self.breaks.append(breaks)
        self.intervals = np.array([len(breaks) - 1 for breaks in self.breaks])
        self.first = np.concatenate(([0], np.cumsum(self.intervals * self.degree)))
        self.nodes = int(self.first[-1]) + 1

    def _in_air(self, piece: Record) -> bool:
        """Return true if forces of the air or a vertical rise are part of a segment."""
        return bool(is_in_air(self.arrays.arcs[piece["arc"]]))

    def _lay_out_variables(self) -> None:
        """Assign the columns of states, directions, lengths and masses."""
        phases = len(self.segments)
        burning = np.array([has_thrust(piece) for piece in self.segments])
        self.steering = np.where(
            burning, np.where(self.segments["held"] > 0, HELD_ATTITUDE, GUIDED), COASTING
        )
        rising = self.arrays.arcs["vertical"][self.segments["arc"]] == 1
        self.steering[burning & rising] = VERTICAL
        at = 6 * self.nodes
        controls: list[int] = []
        self.control_of: list[NDArray[np.int64]] = []
        held: dict[int, int] = {}
        for p in range(phases):
            count = int(self.intervals[p]) * self.degree
            if self.steering[p] == GUIDED:
                own = at + 3 * np.arange(count)
                controls += own.tolist()
                at += 3 * count
            elif self.steering[p] == HELD_ATTITUDE:
                number = int(self.segments[p]["held"])
                if number not in held:
                    held[number] = at
                    controls.append(at)
                    at += 3
                own = np.full(count, held[number])
            else:
                own = np.full(count, -1)
            self.control_of.append(own)
        self.controls = np.array(controls, np.int64)
        self.lengths = at + np.arange(phases)
        self.masses = at + phases + np.arange(phases)
        self.ends = at + 2 * phases + np.arange(phases)
        self.size = at + 3 * phases
        self.lower = np.full(self.size, -INFINITE)
        self.upper = np.full(self.size, INFINITE)
        self.lower[6 * self.nodes : at] = -1.5
        self.upper[6 * self.nodes : at] = 1.5
        self.lower[:6] = self.upper[:6] = self.start_state
        self.lower[self.lengths] = 0.0
        self.lower[self.masses] = self.lower[self.ends] = _LEAST_MASS

    @property
    def start_state(self) -> Array:
        """Return the scaled state at the start, shape (6,)."""
        return np.concatenate(
            (self.start["position"][0] / self.radius, self.start["velocity"][0] / self.speed)
        )

    def _lay_out_phases(self) -> None:
        """Fill the records of the phases."""
        force = self.mass * self.speed / self.time
        flow = self.mass / self.time
        phases = np.zeros(len(self.segments), PHASE)
        for p, piece in enumerate(self.segments):
            row = phases[p]
            row["arc"] = piece["arc"]
            row["in_air"] = self._in_air(piece)
            row["steering"] = self.steering[p]
            row["length"] = self.lengths[p]
            row["mass"] = self.masses[p]
            row["from_end"] = self._is_known_from_end(p)
            known = (piece["end"] - piece["start"]) * row["from_end"]
            row["thrust"] = (piece["thrust"] + known * piece["thrust_slope"]) / force
            row["thrust_slope"] = piece["thrust_slope"] * self.time / force
            row["flow"] = (piece["flow"] + known * piece["flow_slope"]) / flow
            row["flow_slope"] = piece["flow_slope"] * self.time / flow
            row["fading"] = piece["fading"] * self.time
            row["acceleration"] = piece["thrust"] / piece["mass"] * self.time / self.speed
            row["end"] = self.ends[p]
        self.phases = phases

    def _lay_out_points(self) -> None:
        """Fill the Radau points, with six rows each, and add a row for each direction."""
        nodes = radau(self.degree)[0]
        points = np.zeros(int(self.intervals.sum()) * self.degree, POINT)
        i = 0
        for p, breaks in enumerate(self.breaks):
            for k, width in enumerate(np.diff(breaks)):
                for number in range(1, self.degree + 1):
                    row = points[i]
                    row["phase"] = p
                    row["node"] = self.first[p] + k * self.degree
                    row["number"] = number
                    row["width"] = width
                    row["fraction"] = breaks[k] + width * nodes[number]
                    row["control"] = self.control_of[p][k * self.degree + number - 1]
                    i += 1
        self.points = points
        for name, count in (("motion", 6 * len(points)), ("direction", len(self.controls))):
            for _ in range(count):
                self._rows.add(name, 0.0, 0.0)

    # ---- constraints

    def _lay_out_lengths(self) -> None:
        """Bound the lengths of phases and arcs."""
        start, pieces = self.start[0], self.segments
        self.drop_ends: dict[int, int] = {}
        self.arc_phases: dict[int, list[int]] = {}
        members: list[int] = []
        for p, piece in enumerate(pieces):
            members.append(p)
            k = int(piece["arc"])
            if not piece["after_cutoff"]:
                self.arc_phases.setdefault(k, []).append(p)
            if piece["end_heating"] >= 0:
                self.drop_ends[int(piece["end_heating"])] = p
            arc = self.arrays.arcs[k]
            length = float(piece["end"] - pieces[members[0]]["start"])
            if self._ends_arc(p):
                low = high = length
                if math.isinf(arc["duration"]) and not piece["after_cutoff"]:
                    past = float(start["time"] - start["arc_start_time"])
                    past = past if k == start["arc"] else 0.0
                    low = max(SHORTEST, float(arc["shortest"]) - past)
                    high = max(low, float(arc["longest"]) - past)
                self._bound_sum(f"length of arc {k}", members, low, high)
                members = []
            elif piece["end_heating"] < 0 and not self._throttle_turns(p):
                self._bound_sum(f"event in arc {k}", members, length, length)

    def _ends_arc(self, p: int) -> bool:
        """Return true if a phase is the last of its arc, or of the tail-off after the cut-off."""
        if p + 1 == len(self.segments):
            return True
        here, there = self.segments[p], self.segments[p + 1]
        return bool(here["arc"] != there["arc"] or here["after_cutoff"] != there["after_cutoff"])

    def _is_known_from_end(self, p: int) -> bool:
        """Return true if thrust that changes with time is known at the end of a phase alone.

        It begins where a jettison that waits for heating happens, and ends at a fixed time of its
        arc.
        """
        here, before = self.segments[p], self.segments[max(0, p - 1)]
        arc = self.arrays.arcs[here["arc"]]
        ends = math.isfinite(arc["duration"]) or here["after_cutoff"] or not self._ends_arc(p)
        return bool(
            (here["thrust_slope"] != 0.0 or here["flow_slope"] != 0.0)
            and before["end_heating"] >= 0
            and before["arc"] == here["arc"]
            and here["end_heating"] < 0
            and ends
        )

    def _throttle_turns(self, p: int) -> bool:
        """Return true if a phase ends where throttling of its burn begins or ends."""
        if p + 1 == len(self.segments):
            return False
        here, there = self.segments[p], self.segments[p + 1]
        return bool(
            here["arc"] == there["arc"]
            and math.isfinite(self.arrays.arcs[here["arc"]]["max_acceleration"])
            and (here["fading"] > 0.0) != (there["fading"] > 0.0)
        )

    def _bound_sum(self, name: str, phases: list[int], low: float, high: float) -> None:
        """Bound the total length of some phases, s."""
        low, high = low / self.time, min(high / self.time, INFINITE)
        if len(phases) == 1:
            at = self.lengths[phases[0]]
            self.lower[at], self.upper[at] = max(low, self.lower[at]), min(high, self.upper[at])
            return
        if high >= INFINITE and low <= 0.0:
            return
        row = self._rows.add(name, low, high)
        self._rows.linear += [(row, int(self.lengths[p]), 1.0) for p in phases]

    def _lay_out_masses(self) -> None:
        """Link the masses of successive phases, and bound the propellant of each stage."""
        rows, pieces, arcs = self._rows, self.segments, self.arrays.arcs
        self.lower[self.masses[0]] = self.upper[self.masses[0]] = 1.0
        dropped = np.zeros(len(pieces))
        for p, piece in enumerate(pieces):
            self.phases[p]["link"] = rows.add("mass", 0.0, 0.0)
            arc = arcs[piece["arc"]]
            if self._throttle_turns(p):
                limit = float(arc["thrust"] / arc["max_acceleration"]) / self.mass
                if piece["fading"] > 0.0:
                    limit *= float(arc["min_throttle"])
                self.lower[self.ends[p]] = self.upper[self.ends[p]] = limit
            if p + 1 == len(pieces):
                break
            after = pieces[p + 1]
            if arcs[after["arc"]]["begins_stage"] and after["arc"] != piece["arc"]:
                at = self.masses[p + 1]
                self.lower[at] = self.upper[at] = float(after["mass"]) / self.mass
                continue
            end = timetable.segment_mass(piece, piece["end"])
            drop = float(end - after["mass"]) / self.mass
            dropped[p] = drop if drop > _NO_MASS else 0.0
            row = rows.add("mass", -dropped[p], -dropped[p])
            rows.linear += [(row, int(self.masses[p + 1]), 1.0), (row, int(self.ends[p]), -1.0)]
        self._lay_out_propellant(dropped)

    def _lay_out_propellant(self, dropped: Array) -> None:
        """Bound the propellant of each stage with a free burn."""
        pieces, arcs = self.segments, self.arrays.arcs
        stages = arcs["stage"][pieces["arc"]]
        start = self.start[0]
        used = timetable.propellant_used(
            start, float(pieces[0]["mass"]), arcs, self.arrays.jettisons
        )
        #: Last phase of the stage whose propellant is saved; the last phase if there is none.
        saved = np.flatnonzero(stages == saving_stage(self.arrays, start))
        self.saving = int(saved[-1]) if saved.size else len(pieces) - 1
        self._worth = {int(self.ends[self.saving]): 1.0}
        ahead = orbits_of(self.arrays, self.start)
        parked = max((int(arcs[k]["stage"]) for k in ahead), default=-1)
        for stage in np.unique(stages):
            members = np.flatnonzero(stages == stage)
            there = arcs[np.unique(pieces["arc"][members])]
            burns = there[there["kind"] == BURN]
            if not np.isinf(burns["duration"]).any():
                continue
            if stage < min(parked, stages[self.saving]):
                self._worth[int(self.ends[members[-1]])] = _LEFT
            left = float(burns["propellant"].max())
            if stage == arcs[start["arc"]]["stage"]:
                left -= used
            most = left / self.mass + float(dropped[members[:-1]].sum())
            row = self._rows.add(f"propellant of stage {stage}", -INFINITE, most)
            self._rows.linear += [
                (row, int(self.masses[members[0]]), 1.0),
                (row, int(self.ends[members[-1]]), -1.0),
            ]

    def _lay_out_rules(self, floors: tuple[Floor, ...]) -> None:
        """Fill the constraints on single states: target, heating, floors."""
        rules: list[tuple[int, int, int, int, int, int, float]] = []
        rows = self._rows

        def add(kind: int, name: str, node: int, level: float, control: int = -1) -> None:
            rules.append((kind, node, rows.add(name, 0.0, INFINITE), 1, 0, control, level))

        #: Jettisons that wait for the heating, in the order of the file.
        self.waiting_for_heating = waiting_for_heating(self.arrays, self.start[0])
        self.heating_rows: dict[int, int] = {}
        for number, p in self.drop_ends.items():
            j = self.waiting_for_heating[number]
            self.heating_rows[j] = len(rows.lower)
            level = math.log(float(self.arrays.jettisons[j]["value"]))
            node = int(self.first[p + 1])
            add(HEATING_RULE, f"heating at jettison {j}", node, level)
        self.floor_rows: dict[int, list[int]] = {}
        for floor in floors:
            phases = self.arc_phases.get(floor.arc, [])
            # the state at the start is given
            nodes = [n for p in phases for n in range(self.first[p], self.first[p + 1] + 1) if n]
            before = len(rows.lower)
            if math.isfinite(floor.altitude_m):
                for node in dict.fromkeys(nodes):
                    name = f"altitude in arc {floor.arc}"
                    add(FLOOR_RULE, name, int(node), floor.altitude_m)
            if math.isfinite(floor.perigee_m) and nodes:
                name = f"perigee in arc {floor.arc}"
                row = rows.add(name, 0.0, INFINITE)
                rows.add(name, 0.0, INFINITE)
                rules.append((PERIGEE_RULE, int(nodes[0]), row, 2, 0, -1, floor.perigee_m))
            self.floor_rows[floor.arc] = list(range(before, len(rows.lower)))
        #: Rows of the pressure limits of each stage, by stage and kind of constraint, in order of
        #: time.
        self.limit_rows: dict[tuple[int, int], list[int]] = {}
        for point in self.points:
            arc = self.arrays.arcs[self.segments[point["phase"]]["arc"]]
            node = int(point["node"] + point["number"])
            stage, control = int(arc["stage"]), int(point["control"])
            for kind, name, most in (
                (DYNAMIC_PRESSURE_RULE, "dynamic pressure", float(arc["max_dynamic_pressure"])),
                (Q_ALPHA_RULE, "q alpha", float(arc["max_q_alpha"])),
            ):
                if math.isfinite(most) and (kind == DYNAMIC_PRESSURE_RULE or control >= 0):
                    self.limit_rows.setdefault((stage, kind), []).append(len(rows.lower))
                    add(kind, name, node, most, control if kind == Q_ALPHA_RULE else -1)
        orbits = orbits_of(self.arrays, self.start)
        #: For each coast that names an orbit, the phase that begins on it.
        self.orbit_phases = {k: self._after_thrust(k) for k in orbits if k in self.arc_phases}
        places = [(f"orbit of arc {k}", int(self.first[p])) for k, p in self.orbit_phases.items()]
        self.targets = np.concatenate((self.arrays.target, *(orbits[k] for k in self.orbit_phases)))
        for i, (name, node) in enumerate([("target", self.nodes - 1), *places]):
            count = count_rows(self.targets[i], self.start)
            numbers = [rows.add(name, 0.0, 0.0) for _ in range(count)]
            if numbers:
                rules.append((TARGET_RULE, node, numbers[0], count, i, -1, 0.0))
        self.rules = np.array(rules, RULE)
        self._levels = self.rules["level"].copy()

    def scale_limits(self, factors: Mapping[tuple[int, int], float | Array]) -> None:
        """Multiply the pressure limits of stages by factors, by the keys of ``limit_rows``.

        Args:
            factors: one for a stage, or one for each of its rows.
        """
        for key, factor in factors.items():
            own = np.isin(self.rules["row"], self.limit_rows[key])
            self.rules["level"][own] = factor * self._levels[own]

    def _after_thrust(self, arc: int) -> int:
        """Return the first phase of a coast after the tail-off."""
        phases = self.arc_phases[arc]
        return next((p for p in phases if self.steering[p] == COASTING), phases[-1])

    def move_floor(self, arc: int, altitude_m: float) -> None:
        """Change the altitude of the floor of an arc, m."""
        for rule in self.rules:
            if rule["kind"] == FLOOR_RULE and rule["row"] in self.floor_rows[arc]:
                rule["level"] = altitude_m

    # ---- callbacks of the solver

    def add_cost(self, cost: csr_array) -> None:
        """Add half the quadratic form of a symmetric matrix, shape (n, n), to the objective."""
        lower = coo_array(tril(cost))
        self.added_cost = cost
        self._added_curvature = lower.data
        rows, columns = self.hessian_pattern
        self.hessian_pattern = (np.append(rows, lower.row), np.append(columns, lower.col))

    def drop_cost(self) -> None:
        """Remove the added cost from the objective."""
        self.added_cost = 0.0 * self.added_cost
        self._added_curvature = 0.0 * self._added_curvature

    def objective(self, x: Array) -> float:
        """Return the negative mass at the end of the saving stage, plus the added cost."""
        worth = sum(weight * float(x[k]) for k, weight in self._worth.items())
        return 0.5 * float(x @ np.asarray(self.added_cost @ x)) - worth

    def gradient(self, x: Array, out: Array) -> None:
        """Write the gradient of :meth:`objective`."""
        out[:] = np.asarray(self.added_cost @ x)
        for k, weight in self._worth.items():
            out[k] -= weight

    def rows(self, x: Array, out: Array) -> None:
        """Write the values of all rows."""
        out[:] = 0.0
        fill_rows(x, self.program, self.mission, out)
        fill_rules(x, self.program, self.mission, out)
        if self.linear.size:
            np.add.at(out, self._linear_rows, self.linear * x[self._linear_columns])

    def jacobian(self, x: Array, out: Array) -> None:
        """Write the entries of the Jacobian."""
        fill_jacobian(x, self.program, self.mission, out)
        out[self.moving :] = self.linear

    def hessian(self, x: Array, multipliers: Array, factor: float, out: Array) -> None:
        """Write the entries of the Hessian of the Lagrangian."""
        moving = out.size - self._added_curvature.size
        fill_hessian(x, multipliers, self.program, self.mission, out[:moving])
        out[moving:] = factor * self._added_curvature
