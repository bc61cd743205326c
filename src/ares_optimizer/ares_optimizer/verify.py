"""Proof by an integrator of another make.

The flight is flown again from the mission's plain data by SciPy's DOP853 (Hairer, Norsett,
Wanner), with the sequence of events, the gravity, the heating and the orbit written here a
second time in NumPy: nothing of the solver's kernels is used. What differs is the solver's
error.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from ares_models.arrays import (
    ALTITUDE_SPHERICAL,
    BURN,
    HEATING_LIMIT,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    MissionArrays,
    Record,
)
from ares_optimizer.solution import ConstraintCheck, SteeringArc, Trajectory, Verification

Array = NDArray[np.float64]

#: Thrust direction within one piece of the flight: unit vector, shape (3,), at a time in s.
Direction = Callable[[float], Array]
#: State within one piece: position, velocity and mass, shape (7,), at a time in s.
State = Callable[[float], Array]
#: Gives the direction for the piece between two times in s.
Steering = Callable[[float, float], Direction]

RELATIVE_TOLERANCE = 1e-11
ABSOLUTE_TOLERANCE = np.array([1e-6] * 3 + [1e-9] * 3 + [1e-6])
SAMPLE_PERIOD = 1.0  # s; longer where a flight would have more than MOST_SAMPLES
MOST_SAMPLES = 5000
#: What a constraint may be off, per unit, and still count as met.
TOLERANCES = {"m": 1.0, "m/s": 1e-2, "deg": 1e-4, "W/m2": 0.2, "kg": 0.1, "s": 1e-3, "1": 1e-6}
_ACTIVE = 1e-3  # an inequality this close to its limit, relatively, is active
_SAME_TIME = 1e-9
_SIDE = 1e-6


@dataclass(frozen=True)
class Engine:
    """One arc's thrust: its own curve, or its tail after the cut-off command."""

    arc: int
    begin: float
    end: float
    tail: bool


@dataclass
class Plan:
    """Who thrusts when, and where the mass changes.

    Attributes:
        engines: thrust curves that run, in order of time.
        stagings: (time s, arc that begins a stage).
        breaks: times at which the equations of motion change their form, s.
        end: end of thrust, s.
        used_kg: propellant that the last stage has burnt at the end.
    """

    engines: list[Engine] = field(default_factory=list)
    stagings: list[tuple[float, int]] = field(default_factory=list)
    breaks: set[float] = field(default_factory=set)
    end: float = math.nan
    used_kg: float = 0.0


@dataclass(frozen=True)
class Flight:
    """A flight as integrated here.

    Attributes:
        plan: its sequence.
        trajectory: samples, events twice.
        final: shape (7,): position m, velocity m/s, mass kg.
        at_jettison: per jettison of the mission, (heating W/m2, time s) or None.
        peak_w_m2: greatest heating after the last heating-limited jettison; nan without one.
        peak_time_s: when.
        pieces: (begin s, end s, state at a time) per smooth piece.
    """

    plan: Plan
    trajectory: Trajectory
    final: Array
    at_jettison: tuple[tuple[float, float] | None, ...]
    peak_w_m2: float
    peak_time_s: float
    pieces: tuple[tuple[float, float, State], ...]

    def defects(self, nodes: Array) -> tuple[float, float, float]:
        """Greatest distance of a solver's nodes from this flight.

        Args:
            nodes: shape (k, 8): time s, position m, velocity m/s, mass kg. At an event
                either side of it counts.

        Returns:
            distance in m, in m/s and in kg.
        """
        worst = np.zeros(3)
        for node in nodes:
            sides = [
                np.abs(sol(min(max(node[0], begin), end)) - node[1:])
                for begin, end, sol in self.pieces
                if begin - _SIDE <= node[0] <= end + _SIDE
            ]
            if sides:
                near = min(sides, key=lambda d: float(d[6]))
                size = (np.linalg.norm(near[:3]), np.linalg.norm(near[3:6]), near[6])
                worst = np.maximum(worst, size)
        return float(worst[0]), float(worst[1]), float(worst[2])


def steering_of(arcs: Sequence[SteeringArc]) -> Steering:
    """Steering of a solution's arcs; a time outside keeps to the nearest arc."""

    def steering(begin: float, end: float) -> Direction:
        middle = 0.5 * (begin + end)
        arc = min(arcs, key=lambda a: max(a.start_s - middle, middle - a.end_s))
        direction = np.asarray(arc.direction)
        rate = np.asarray(arc.direction_rate)

        def at(t: float) -> Array:
            vector = direction + rate * (t - arc.reference_time_s)
            return vector / math.sqrt(vector @ vector)

        return at

    return steering


def _curve(arc: Record, name: str) -> tuple[Array, Array]:
    knots = int(arc[f"{name}_knots"])
    return arc[f"{name}_time"][:knots], arc[f"{name}_fraction"][:knots]


def thrust_fraction(arcs: NDArray[np.void], engine: Engine, t: float) -> float:
    """Fraction of full thrust at a time."""
    times, fractions = _curve(arcs[engine.arc], "tail" if engine.tail else "start")
    if not len(times):
        return 1.0
    return float(np.interp(t - engine.begin, times, fractions))


def _burnt(arcs: NDArray[np.void], engines: Sequence[Engine], begin: float, end: float) -> float:
    """Propellant that the given curves take between two times, kg."""
    total = 0.0
    for engine in engines:
        low, high = max(begin, engine.begin), min(end, engine.end)
        if high <= low:
            continue
        times, _ = _curve(arcs[engine.arc], "tail" if engine.tail else "start")
        knots = [low, *(t for t in engine.begin + times if low < t < high), high]
        fractions = [thrust_fraction(arcs, engine, t) for t in knots]
        area = float(np.trapezoid(fractions, knots))
        total += float(arcs[engine.arc]["mass_flow"]) * area
    return total


def _burnout(
    arcs: NDArray[np.void],
    engines: Sequence[Engine],
    begin: float,
    left: float,
    low: float,
    high: float,
) -> float:
    """Time at which the propellant ``left`` at ``begin`` is gone, s."""
    return float(brentq(lambda t: _burnt(arcs, engines, begin, t) - left, low, high, xtol=1e-12))


def _left_running(arcs: NDArray[np.void], present: int, begin: float, now: float) -> list[Engine]:
    """The tail-off that is not over when a flight starts in the coast after it."""
    for k in range(present, 0, -1):
        if arcs[k]["begins_stage"] == 1:
            break
        if arcs[k - 1]["kind"] == BURN:
            times, _ = _curve(arcs[k - 1], "tail")
            if len(times) and begin + times[-1] > now:
                return [Engine(k - 1, begin, begin + float(times[-1]), True)]
            break
        begin -= float(arcs[k - 1]["duration"])
    return []


def plan_flight(arrays: MissionArrays, start: Record, t_meco: float) -> Plan:
    """Lay the mission's arcs out in time, from the start to the end of the tail-off.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        t_meco: cut-off command, s.
    """
    arcs = arrays.arcs
    now = float(start["time"])
    plan = Plan()
    k = int(start["arc"])
    begin = float(start["arc_start_time"])
    stage = int(arcs[k]["stage"])
    mass = float(start["mass"]) if start["mass"] > 0.0 else float(arcs[k]["stack_mass"])
    full = float(arcs[k]["stack_mass"])
    for j, jettison in enumerate(arrays.jettisons):
        gone = (int(start["jettisoned"]) >> j) & 1
        if not gone and jettison["stage"] < stage:
            full += float(jettison["mass"])
        elif gone and jettison["stage"] >= stage:
            full -= float(jettison["mass"])
    used = max(0.0, full - mass)
    running = _left_running(arcs, k, begin, now)  # of this stage, for its propellant
    for tail in running:
        plan.engines.append(tail)
        plan.breaks.update(tail.begin + _curve(arcs[tail.arc], "tail")[0])
    stage_begin = now
    last = len(arcs) - 1
    while True:
        arc = arcs[k]
        end = t_meco if k == last else begin + float(arc["duration"])
        spent = False
        if arc["kind"] == BURN:
            engine = Engine(k, begin, end, False)
            left = float(arc["propellant"]) - used
            if k != last:
                far = min(end, begin + 1e5)
                trial = [*running, Engine(k, begin, far, False)]
                excess = _burnt(arcs, trial, stage_begin, far) - left
                if excess > 1e-6 * float(arc["mass_flow"]):
                    spent = True
                    end = _burnout(arcs, trial, stage_begin, left, max(begin, now), far)
                    engine = Engine(k, begin, end, False)
            running.append(engine)
            plan.engines.append(engine)
            plan.breaks.update(begin + _curve(arc, "start")[0])
            tail_times, _ = _curve(arc, "tail")
            if len(tail_times) and not spent:
                tail = Engine(k, end, end + float(tail_times[-1]), True)
                running.append(tail)
                plan.engines.append(tail)
                plan.breaks.update(end + tail_times)
        plan.breaks.add(end)
        if k == last:
            plan.end = max([t_meco, *(e.end for e in running if e.tail and e.begin >= t_meco)])
            plan.used_kg = used + _burnt(arcs, running, stage_begin, plan.end)
            break
        k += 1
        while spent and k < last and arcs[k]["kind"] == BURN and arcs[k]["stage"] == arc["stage"]:
            k += 1
        begin = end
        if arcs[k]["begins_stage"] == 1:
            plan.stagings.append((begin, k))
            # a separated stage's tail is lost
            plan.engines = [Engine(e.arc, e.begin, min(e.end, begin), e.tail) for e in plan.engines]
            running, used, stage_begin = [], 0.0, begin
    plan.breaks = {t for t in plan.breaks if now < t < plan.end} | {plan.end}
    return plan


def gravity(r: Array, environment: Record) -> Array:
    """Gravitational acceleration, m/s2: Eq. 2.13, with J2 if the mission has it."""
    square = float(r @ r)
    g = -float(environment["mu"]) / square**1.5 * r
    j2 = float(environment["j2"])
    if j2 != 0.0:
        z2 = 5.0 * r[2] ** 2 / square
        factor = 1.5 * j2 * float(environment["equatorial_radius"]) ** 2 / square
        g = g * (1.0 + factor * np.array([1.0 - z2, 1.0 - z2, 3.0 - z2]))
    return g


def surface_radius(r: Array, environment: Record) -> float:
    """Distance of the ground below a position from the Earth's centre, m (Eq. 2.15)."""
    equatorial = float(environment["equatorial_radius"])
    if environment["altitude_model"] == ALTITUDE_SPHERICAL:
        return equatorial
    polar = float(environment["polar_radius"])
    cos_square = 1.0 - float(r[2] ** 2 / (r @ r))
    return polar / math.sqrt(1.0 + ((polar / equatorial) ** 2 - 1.0) * cos_square)


def heating(r: Array, v: Array, arrays: MissionArrays) -> float:
    """Free molecular heating 0.5 rho V_rel^3, W/m2 (Eqs. 2.2 to 2.5, 2.12, 2.15)."""
    environment = arrays.environment[0]
    height = float(np.linalg.norm(r)) - surface_radius(r, environment)
    table = arrays.atmosphere
    row = table[max(int(np.searchsorted(table[:, 0], height, side="right")) - 1, 0)]
    x = height - row[0]
    log_density = row[1] + row[2] * x
    if x > 0.0:
        log_density += (row[3] + row[4] * x) * x * x
    omega = np.array([0.0, 0.0, float(environment["rotation_rate"])])
    relative = v - np.cross(omega, r)
    density = float(environment["density_factor"]) * math.exp(log_density)
    return 0.5 * density * float(relative @ relative) ** 1.5


def thrust_and_flow(
    arcs: NDArray[np.void], engines: Sequence[Engine], t: float
) -> tuple[float, float]:
    """Thrust in N and mass flow in kg/s of the given curves at a time."""
    thrust = 0.0
    flow = 0.0
    for engine in engines:
        fraction = thrust_fraction(arcs, engine, t)
        thrust += fraction * float(arcs[engine.arc]["thrust"])
        flow += fraction * float(arcs[engine.arc]["mass_flow"])
    return thrust, flow


def running(engines: Sequence[Engine], begin: float, end: float) -> list[Engine]:
    """The curves that run all through a piece of the flight."""
    middle = 0.5 * (begin + end)
    return [engine for engine in engines if engine.begin < middle < engine.end]


def _integrate(
    arrays: MissionArrays,
    engines: Sequence[Engine],
    direction: Direction,
    span: tuple[float, float],
    y: Array,
) -> tuple[State, Array]:
    """Eq. 2.1 over one smooth piece.

    Returns:
        state at a time within it, and the state at its end, shape (7,).
    """
    environment = arrays.environment[0]

    def motion(t: float, y: Array) -> Array:
        thrust, flow = thrust_and_flow(arrays.arcs, engines, t)
        acceleration = gravity(y[:3], environment)
        if thrust > 0.0:
            acceleration = acceleration + thrust / y[6] * direction(t)
        return np.concatenate((y[3:6], acceleration, [-flow]))

    result = solve_ivp(
        motion,
        span,
        y,
        method="DOP853",
        rtol=RELATIVE_TOLERANCE,
        atol=ABSOLUTE_TOLERANCE,
        dense_output=True,
    )
    state = result.sol
    if state is None:
        raise AssertionError("asked for dense output")
    return state, result.y[:, -1].copy()


def _greatest_heating(
    arrays: MissionArrays, state: State, grid: Array, samples: Array
) -> tuple[float, float]:
    """Greatest heating over one piece, W/m2, and its time, s."""
    values = [heating(y[:3], y[3:6], arrays) for y in samples]
    best = int(np.argmax(values))
    if not 0 < best < len(grid) - 1:
        return values[best], float(grid[best])
    refined = minimize_scalar(
        lambda t: -heating(state(t)[:3], state(t)[3:6], arrays),
        bounds=(grid[best - 1], grid[best + 1]),
        method="bounded",
        options={"xatol": 1e-6},
    )
    return -float(refined.fun), float(refined.x)


def fly(
    arrays: MissionArrays,
    start: Record,
    steering: Steering,
    jettison_times: Sequence[float],
    t_meco: float,
    boundaries: Sequence[float] = (),
) -> Flight:
    """Integrate a flight.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        steering: thrust direction per piece.
        jettison_times: s, one per jettison of the mission; nan: not dropped.
        t_meco: cut-off command, s.
        boundaries: further times at which the steering has a kink, s.
    """
    arcs = arrays.arcs
    jettisons = arrays.jettisons
    plan = plan_flight(arrays, start, t_meco)
    now = float(start["time"])
    done = {j for j in range(len(jettisons)) if (int(start["jettisoned"]) >> j) & 1}
    due = {
        j: max(t, now)
        for j, t in enumerate(jettison_times)
        if math.isfinite(t) and t <= t_meco + _SAME_TIME and j not in done
    }
    breaks = plan.breaks | set(due.values()) | {t for t in boundaries if now < t < plan.end}
    ends = sorted(t for t in breaks if t > now + _SAME_TIME)
    mass = float(start["mass"]) if start["mass"] > 0.0 else float(arcs[start["arc"]]["stack_mass"])
    y = np.concatenate((start["position"], start["velocity"], [mass]))
    at_jettison: list[tuple[float, float] | None] = [None] * len(jettisons)
    times: list[Array] = []
    states: list[Array] = []
    directions: list[Array] = []
    pieces: list[tuple[float, float, State]] = []
    watching = False
    period = max(SAMPLE_PERIOD, (plan.end - now) / MOST_SAMPLES)
    peak, peak_time = -math.inf, math.nan
    t = now
    for end in [*ends, math.inf]:
        for time, k in plan.stagings:
            if abs(time - t) <= _SAME_TIME:
                y[6] = float(arcs[k]["stack_mass"]) + sum(
                    float(jettison["mass"])
                    for j, jettison in enumerate(jettisons)
                    if j not in done and jettison["stage"] < arcs[k]["stage"]
                )
        for j, time in due.items():
            if j not in done and time <= t + _SAME_TIME:
                done.add(j)
                y[6] -= float(jettisons[j]["mass"])
                at_jettison[j] = (heating(y[:3], y[3:6], arrays), t)
                if jettisons[j]["criterion"] == HEATING_LIMIT:
                    watching, peak = True, -math.inf
        if math.isinf(end):
            break
        direction = steering(t, end)
        state, after = _integrate(arrays, running(plan.engines, t, end), direction, (t, end), y)
        grid = np.linspace(t, end, max(2, math.ceil((end - t) / period) + 1))
        samples = np.array([state(s) for s in grid])
        samples[0] = y
        samples[-1] = after
        times.append(grid)
        states.append(samples)
        directions.append(np.array([direction(s) for s in grid]))
        pieces.append((t, end, state))
        if watching:
            level, at = _greatest_heating(arrays, state, grid, samples)
            if level > peak:
                peak, peak_time = level, at
        y = after
        t = end
    table = np.concatenate(states)
    trajectory = Trajectory(
        np.concatenate(times),
        table[:, :3],
        table[:, 3:6],
        table[:, 6],
        np.concatenate(directions),
        np.array([heating(row[:3], row[3:6], arrays) for row in table]),
    )
    return Flight(
        plan,
        trajectory,
        y,
        tuple(at_jettison),
        peak if math.isfinite(peak) else math.nan,
        peak_time,
        tuple(pieces),
    )


def elements(r: Array, v: Array, mu: float) -> dict[str, float]:
    """Orbit and flight-path figures of a state, angles in deg.

    Returns:
        radius_m, speed_m_s, flight_path_angle_deg, inclination_deg, ascending_node_deg,
        semi_major_axis_m, eccentricity, argument_of_perigee_deg.
    """
    radius = float(np.linalg.norm(r))
    speed = float(np.linalg.norm(v))
    h = np.cross(r, v)
    unit = h / np.linalg.norm(h)
    node = np.array([-h[1], h[0], 0.0])
    size = float(np.linalg.norm(node))
    node = node / size if size > 0.0 else np.array([1.0, 0.0, 0.0])
    e = np.cross(v, h) / mu - r / radius
    return {
        "radius_m": radius,
        "speed_m_s": speed,
        "flight_path_angle_deg": math.degrees(math.asin(float(r @ v) / (radius * speed))),
        "inclination_deg": math.degrees(math.atan2(math.hypot(h[0], h[1]), h[2])),
        "ascending_node_deg": math.degrees(math.atan2(node[1], node[0])) % 360.0,
        "semi_major_axis_m": 1.0 / (2.0 / radius - speed**2 / mu),
        "eccentricity": float(np.linalg.norm(e)),
        "argument_of_perigee_deg": math.degrees(
            math.atan2(float(np.cross(node, e) @ unit), float(node @ e))
        )
        % 360.0,
    }


#: Target field, figure, name in words, unit, whether it is an angle of a whole turn.
_STATE_ROWS = (
    ("radius", "radius_m", "radius at cut-off", "m", False),
    ("speed", "speed_m_s", "speed at cut-off", "m/s", False),
    ("flight_path_angle", "flight_path_angle_deg", "flight-path angle at cut-off", "deg", False),
    ("inclination", "inclination_deg", "inclination", "deg", False),
)
_NODE_ROW = ("ascending_node", "ascending_node_deg", "ascending node", "deg", True)
_ORBIT_ROWS = (
    ("semi_major_axis", "semi_major_axis_m", "semi-major axis", "m", False),
    ("eccentricity", "eccentricity", "eccentricity", "1", False),
    ("inclination", "inclination_deg", "inclination", "deg", False),
    _NODE_ROW,
    ("argument_of_perigee", "argument_of_perigee_deg", "argument of perigee", "deg", True),
)


def target_rows(kind: int) -> tuple[tuple[str, str, str, str, bool], ...]:
    """Rows of the constraint table that a kind of target has."""
    if kind == TARGET_KEPLERIAN:
        return _ORBIT_ROWS
    return (*_STATE_ROWS, _NODE_ROW) if kind == TARGET_RADIUS_SPEED_ANGLE_PLANE else _STATE_ROWS


def constraint_table(
    arrays: MissionArrays, start: Record, flight: Flight, path: bool, judged: bool
) -> tuple[ConstraintCheck, ...]:
    """Constraint by constraint: value, limit, active, met.

    Args:
        arrays: the mission.
        start: record NAVIGATION.
        flight: from :func:`fly`.
        path: whether the heating limit holds from the jettison on.
        judged: whether the heating limit counts at all.
    """
    target = arrays.target[0]
    figures = elements(flight.final[:3], flight.final[3:6], float(arrays.environment[0]["mu"]))
    table = []
    for key, figure, name, unit, turn in target_rows(int(target["kind"])):
        limit = float(target[key])
        if unit == "deg":
            limit = math.degrees(limit)
        value = figures[figure]
        off = value - limit
        if turn:
            limit %= 360.0
            off = (value - limit + 180.0) % 360.0 - 180.0
            value = limit + off
        # an argument means less the rounder the orbit, a node the flatter its plane
        scale = 1.0
        if key == "argument_of_perigee":
            scale = max(figures["eccentricity"], 1e-3)
        table.append(
            ConstraintCheck(name, value, limit, True, unit, abs(off) * scale <= TOLERANCES[unit])
        )
    for j, jettison in enumerate(arrays.jettisons):
        if jettison["criterion"] != HEATING_LIMIT or (int(start["jettisoned"]) >> j) & 1:
            continue
        limit = float(jettison["value"])
        at = flight.at_jettison[j]
        if at is None:
            table.append(
                ConstraintCheck(f"jettison {j} before cut-off", 0.0, 1.0, False, "1", not judged)
            )
            continue
        if judged:
            table.append(_at_most(f"heating at jettison {j}", at[0], limit, "W/m2"))
    if path and math.isfinite(flight.peak_w_m2):
        limits = [
            float(arrays.jettisons[j]["value"])
            for j, at in enumerate(flight.at_jettison)
            if at is not None and arrays.jettisons[j]["criterion"] == HEATING_LIMIT
        ]
        table.append(
            _at_most("heating from the jettison on", flight.peak_w_m2, min(limits), "W/m2")
        )
    lowest = min(
        float(np.linalg.norm(r)) - surface_radius(r, arrays.environment[0])
        for r in flight.trajectory.position
    )
    table.append(ConstraintCheck("lowest altitude", lowest, 0.0, False, "m", lowest >= 0.0))
    usable = float(arrays.arcs[-1]["propellant"])
    table.append(_at_most("propellant of the last stage", flight.plan.used_kg, usable, "kg"))
    return tuple(table)


def _at_most(name: str, value: float, limit: float, unit: str) -> ConstraintCheck:
    return ConstraintCheck(
        name,
        value,
        limit,
        value > limit * (1.0 - _ACTIVE),
        unit,
        value <= limit + TOLERANCES[unit],
    )


def verification(arrays: MissionArrays, flight: Flight, nodes: Array | None) -> Verification:
    """Figures of a flight, with the distance of a solver's own nodes from it.

    Args:
        arrays: the mission.
        flight: from :func:`fly`.
        nodes: shape (k, 8), see :meth:`Flight.defects`; None: not compared (nan).
    """
    figures = elements(flight.final[:3], flight.final[3:6], float(arrays.environment[0]["mu"]))
    limited = [
        at
        for j, at in enumerate(flight.at_jettison)
        if at is not None and arrays.jettisons[j]["criterion"] == HEATING_LIMIT
    ]
    defects = (math.nan,) * 3 if nodes is None else flight.defects(nodes)
    return Verification(
        radius_m=figures["radius_m"],
        speed_m_s=figures["speed_m_s"],
        flight_path_angle_deg=figures["flight_path_angle_deg"],
        inclination_deg=figures["inclination_deg"],
        ascending_node_deg=figures["ascending_node_deg"],
        m_f_kg=float(flight.final[6]),
        fmhr_w_m2=limited[-1][0] if limited else math.nan,
        peak_fmhr_after_jettison_w_m2=flight.peak_w_m2,
        position_defect_m=defects[0],
        velocity_defect_m_s=defects[1],
        mass_defect_kg=defects[2],
    )


def verify(
    arrays: MissionArrays,
    start: Record,
    steering: Steering,
    jettison_times: Sequence[float],
    t_meco: float,
    boundaries: Sequence[float] = (),
    nodes: Array | None = None,
    path: bool = False,
    judged: bool = True,
) -> tuple[Verification, tuple[ConstraintCheck, ...], Trajectory]:
    """Fly a solution again and judge it.

    Args:
        arrays, start, steering, jettison_times, t_meco, boundaries: as :func:`fly`.
        nodes: the solver's own states, see :meth:`Flight.defects`.
        path: whether the heating limit holds from the jettison on.
        judged: False when the heating limit is ignored.

    Returns:
        figures, table of constraints, sampled trajectory.
    """
    flight = fly(arrays, start, steering, jettison_times, t_meco, boundaries)
    return (
        verification(arrays, flight, nodes),
        constraint_table(arrays, start, flight, path, judged),
        flight.trajectory,
    )
