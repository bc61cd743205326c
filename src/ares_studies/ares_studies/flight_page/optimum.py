# SPDX-License-Identifier: Apache-2.0
"""Convert an optimum to the columns of a flight, with its optimality conditions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ares_models.arrays import BURN, MissionArrays, Record
from ares_models.kernels.aerodynamics import air_at, body_force, pressure_loss
from ares_models.kernels.environment import air_velocity, altitude
from ares_models.kernels.states import insertion_quantities
from ares_models.kernels.vectors import norm
from ares_models.mission import Mission
from ares_models.plans import flies_in_air
from ares_optimizer.solution import FlownArc, Solution, Trajectory
from ares_studies.flight_page.data import OPTIMUM, Columns, Optimality, Recording
from ares_studies.flight_page.geometry import local_axes

Array = NDArray[np.float64]

LAW = OPTIMUM
_NOTHING = {"time": np.empty(0)}
#: Speed against the air, m/s, below which there is no angle of attack.
AT_REST_M_S = 1.0
#: Relative accuracy with which a throttled burn holds its acceleration limit.
_AT_LIMIT = 1e-9


def record_optimum(name: str, mission: Mission, solution: Solution) -> Recording:
    """Convert an optimum to the columns of a flight.

    Args:
        name: of the optimum.
        mission: solved mission.
        solution: with a trajectory.

    Returns:
        The recording; with the optimality conditions if the method has costates.

    Raises:
        ValueError: the solution has no trajectory.
    """
    track = solution.trajectory
    if track is None:
        raise ValueError(f"{solution.method} has no trajectory: {solution.reason}")
    states = [
        (tuple(r), tuple(v))
        for r, v in zip(track.position.tolist(), track.velocity.tolist(), strict=True)
    ]
    insertion = np.array([insertion_quantities(r, v) for r, v in states])
    environment = mission.environment_array()[0]
    truth = {
        "time": track.time_s,
        "position": track.position,
        "velocity": track.velocity,
        "mass": track.mass,
        "thrust_direction": track.direction,
        "thrust": track.thrust,
        "altitude": np.array([altitude(r, environment) for r, _ in states]),
        "relative_speed": np.array([norm(air_velocity(r, v, environment)) for r, v in states]),
        "flight_path_angle": insertion[:, 2],
        "inclination": insertion[:, 3],
        "heating_rate": track.heating_rate,
        "arc": _arcs(track.time_s, solution.flown),
        "jettisoned": _jettisoned(track.time_s, mission, solution),
    }
    arrays = mission.arrays()
    if flies_in_air(arrays.arcs):
        truth |= _in_air(truth, arrays)
    return Recording(
        name=name,
        law=LAW,
        mission=mission,
        truth=truth,
        navigation=_NOTHING,
        status=_NOTHING,
        optimality=optimality_of(mission, solution),
    )


def _in_air(truth: Columns, arrays: MissionArrays) -> dict[str, Array]:
    """Compute the columns of VehicleState that tell of the air, thrust less ambient pressure."""
    surroundings = arrays.environment[0], arrays.atmosphere
    found = np.zeros((len(truth["time"]), 6))
    for i, height in enumerate(truth["altitude"].tolist()):
        arc = arrays.arcs[truth["arc"][i]]
        r, v = tuple(truth["position"][i]), tuple(truth["velocity"][i])
        u, thrust = truth["thrust_direction"][i], float(truth["thrust"][i])
        if thrust > 0.0:
            thrust = max(0.0, thrust - pressure_loss(arc, r, *surroundings))
        force = thrust * u + np.array(body_force(arc, r, v, tuple(u), *surroundings))
        axial = float(force @ u)
        air, speed = air_at(height, *surroundings), float(truth["relative_speed"][i])
        stream = np.array(air_velocity(r, v, surroundings[0]))
        across = float(np.linalg.norm(np.cross(stream, u)))
        found[i] = (
            thrust,
            axial,
            float(np.linalg.norm(force - axial * u)),
            0.5 * air.density * speed * speed,
            speed / air.sound,
            math.atan2(across, float(stream @ u)) if speed > AT_REST_M_S else 0.0,
        )
    mass = truth["mass"]
    return {
        "thrust": found[:, 0],
        "axial_acceleration": found[:, 1] / mass,
        "lateral_acceleration": found[:, 2] / mass,
        "dynamic_pressure": found[:, 3],
        "mach": found[:, 4],
        "angle_of_attack": found[:, 5],
    }


def _passed(time: Array, instants: Sequence[float]) -> NDArray[np.bool_]:
    """Tell which instants are past at each row, shape (n, m).

    Of several rows at an instant, it is past at all but the first.
    """
    at = np.asarray(instants, dtype=float)
    near = np.abs(time[:, None] - at) < 1e-9
    behind = (time[:, None] > at) | near
    # the first of several rows precedes the event, and so does the end of the flight
    first = (np.cumsum(near, axis=0) == 1) & (near.sum(axis=0) > 1)
    last = np.arange(len(time)) == len(time) - 1
    return np.asarray(behind & ~(near & (first | last[:, None])))


def _arcs(time: Array, flown: Sequence[FlownArc]) -> NDArray[np.int64]:
    """Return the index of the arc of each row, shape (n,)."""
    passed = _passed(time, [arc.end_s for arc in flown[:-1]])
    return np.array([arc.arc for arc in flown])[np.sum(passed, axis=1)]


def _jettisoned(time: Array, mission: Mission, solution: Solution) -> NDArray[np.int64]:
    """Return the bit mask of completed jettisons, shape (n,)."""
    start = int(mission.start().navigation()["jettisoned"][0])
    gone = np.full(len(time), start, dtype=np.int64)
    for k, at in enumerate(solution.jettison_times_s):
        if math.isfinite(at):
            gone |= np.where(_passed(time, [at])[:, 0], 1 << k, 0)
    return gone


@dataclass(frozen=True)
class _Stretch:
    """Hold the interval between two events at the times of the costates, shape (n,).

    `pushed` is lambda_v . F, with the force of thrust and air.
    """

    rows: NDArray[np.intp]
    time: Array
    mass: Array
    thrust: Array
    pushed: Array
    size: Array
    hamiltonian: Array


def optimality_of(mission: Mission, solution: Solution) -> Optimality | None:
    """Compute the optimality conditions along an optimum; None if the method has no costates.

    Along a burn H = lambda_r . V + lambda_v . (g + F/m) - (mu + c) b, with F the force of thrust
    and air, b the mass flow, mu the mass costate and c the propellant multiplier of free burns. The
    switching function is c_e |lambda_v| / m - mu - c, divided by c: the gain of final mass, kg, per
    kg of propellant burnt there, beyond its cost. It is zero at the ends of free burns.

    Source: Bryson and Ho, Applied Optimal Control, sections 3.5 and 3.6.
    """
    costates, track = solution.costates, solution.trajectory
    if costates is None or track is None:
        return None
    arrays = mission.arrays()
    arcs = arrays.arcs
    time = costates.time_s
    switching = np.full(len(time), math.nan)
    total = costates.hamiltonian.copy()
    mu = price = 0.0
    for flown in reversed(solution.flown):
        arc = arcs[flown.arc]
        free = bool(arc["kind"] == BURN and arc["duration"] == np.inf)
        speed = _exhaust_speed(arcs, flown.arc)
        following = arcs[min(flown.arc + 1, len(arcs) - 1)]
        drops = following["stage"] != arc["stage"]
        mu = 0.0 if drops else mu
        pieces = _cut(solution, track, flown, arrays)
        if free:
            value = _per_flow(pieces[-1], speed)
            if price == 0.0:
                price = value - mu
            elif drops and not _held(arc, flown):
                mu = value - price
        for piece in reversed(pieces):
            costs = price if free else 0.0
            mus = _mass_costate(piece, arc, mu, costs)
            mu = float(mus[0])
            flow = piece.thrust / speed if speed > 0.0 else np.zeros(len(piece.time))
            total[piece.rows] = piece.hamiltonian - flow * (mus + costs)
            if price > 0.0 and speed > 0.0 and (free or arc["kind"] != BURN):
                worth = piece.size * speed / piece.mass
                switching[piece.rows] = (worth - mus) / price - 1.0
    track_at = _at(track, time)
    position, velocity = track_at[:, :3], track_at[:, 3:]
    axes = local_axes(position, velocity, arrays.environment[0])
    parts = [np.sum(costates.lambda_v * axis, axis=1) for axis in axes]
    return Optimality(
        time_s=time,
        primer=np.linalg.norm(costates.lambda_v, axis=1),
        primer_up=parts[0],
        primer_ahead=parts[1],
        primer_right=parts[2],
        switching=switching,
        hamiltonian_m_s2=total,
    )


def _exhaust_speed(arcs: NDArray[np.void], k: int) -> float:
    """Return the exhaust velocity of a burn, or of the burn after a coast; 0 without one."""
    for arc in arcs[k:]:
        if arc["stage"] == arcs[k]["stage"] and arc["kind"] == BURN:
            return float(arc["exhaust_velocity"])
    return 0.0


def _held(arc: Record, flown: FlownArc) -> bool:
    """Tell whether an arc ends at an active bound of its length."""
    length = flown.end_s - flown.start_s
    bounds = (float(arc["shortest"]), float(arc["longest"]))
    return any(abs(length - bound) < 1e-6 for bound in bounds)


def _cut(
    solution: Solution, track: Trajectory, flown: FlownArc, arrays: MissionArrays
) -> list[_Stretch]:
    """Divide an arc at its jettisons; each interval has both its ends."""
    costates = solution.costates
    assert costates is not None
    first = max(flown.start_s, float(track.time_s[0]))
    inside = [t for t in solution.jettison_times_s if first < t < flown.end_s]
    bounds = [first, *sorted(inside), flown.end_s]
    pieces = []
    for begin, end in pairwise(bounds):
        rows, own = _between(costates.time_s, begin, end), _between(track.time_s, begin, end)
        time, samples = costates.time_s[rows], track.time_s[own]
        direction = np.column_stack(
            [np.interp(time, samples, track.direction[own, k]) for k in range(3)]
        )
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        thrust = np.interp(time, samples, track.thrust[own])
        force = thrust[:, None] * direction
        if flies_in_air(arrays.arcs):
            force += _air_force(_at(track, time), direction, arrays.arcs[flown.arc], arrays)
        pieces.append(
            _Stretch(
                rows=rows,
                time=time,
                mass=np.interp(time, samples, track.mass[own]),
                thrust=thrust,
                pushed=np.sum(costates.lambda_v[rows] * force, axis=1),
                size=np.linalg.norm(costates.lambda_v[rows], axis=1),
                hamiltonian=costates.hamiltonian[rows],
            )
        )
    return pieces


def _air_force(state: Array, direction: Array, arc: Record, arrays: MissionArrays) -> Array:
    """Compute the force on the body less what ambient pressure takes, N, shape (n, 3)."""
    surroundings = arrays.environment[0], arrays.atmosphere
    found = []
    for row, along in zip(state, direction, strict=True):
        r, v = tuple(row[:3].tolist()), tuple(row[3:].tolist())
        lost = pressure_loss(arc, r, *surroundings)
        force = np.array(body_force(arc, r, v, tuple(along.tolist()), *surroundings))
        found.append(force - lost * along)
    return np.array(found)


def _between(time: Array, begin: float, end: float) -> NDArray[np.intp]:
    """Return the rows from begin to end; of a pair at begin the second, at the end the first."""
    first = int(np.searchsorted(time, begin + 1e-9, side="right")) - 1
    last = int(np.searchsorted(time, end - 1e-9, side="left"))
    return np.arange(max(first, 0), min(last, len(time) - 1) + 1)


def _per_flow(piece: _Stretch, speed: float) -> float:
    """Return H over mass flow at the end of a burn, without mass costate and multiplier."""
    return float(piece.hamiltonian[-1] * speed / piece.thrust[-1])


def _mass_costate(piece: _Stretch, arc: Record, end: float, costs: float) -> Array:
    """Integrate the mass costate along an interval backwards from its end value, shape (n,)."""
    acceleration = piece.thrust / piece.mass
    throttled = acceleration > float(arc["max_acceleration"]) * (1.0 - _AT_LIMIT)
    fixed = piece.pushed / piece.mass**2
    if not np.any(throttled):
        # a knot of a thrust curve stands twice
        once = np.diff(piece.time, prepend=-math.inf) > 0.0
        rise = CubicSpline(piece.time[once], fixed[once]).antiderivative()(piece.time)
        return np.asarray(end + rise - rise[-1])
    mus = np.full(len(piece.time), end)
    for i in range(len(mus) - 2, -1, -1):
        step = piece.time[i + 1] - piece.time[i]
        if throttled[i] and throttled[i + 1]:
            mus[i] = (mus[i + 1] + costs) * piece.mass[i + 1] / piece.mass[i] - costs
        else:
            mus[i] = mus[i + 1] - 0.5 * step * (fixed[i] + fixed[i + 1])
    return mus


def _at(track: Trajectory, time: Array) -> Array:
    """Interpolate position and velocity, shape (n, 6)."""
    state = np.column_stack((track.position, track.velocity))
    return np.column_stack([np.interp(time, track.time_s, column) for column in state.T])
