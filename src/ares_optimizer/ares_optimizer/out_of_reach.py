# SPDX-License-Identifier: Apache-2.0
"""Prove that a target is out of reach of every flight, by bounds on energy and time.

The energy E = v^2/2 - U changes by dE/dt = v . a under a thrust acceleration a. Above the ground U
is at most its value there, so w = sqrt(2 (E + U_ground)) is at least the speed, and dw/dt <= |a|:
whatever the steering, w grows by at most the ideal delta-V.

A flight x(t) and a coast y(t) from the same state part by d = x - y with |d|'' <= k^2 |d| + a,
where k^2 = 2 mu / r^3 bounds the gradient of gravity down to a radius r. So |d| is at most
a (cosh(k t) - 1) / k^2 (Gronwall's inequality). Where the coast is farther than that below the
ground, every flight has met the ground.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import (
    BURN,
    NAMES_APOGEE,
    NAMES_C3,
    NAMES_ECCENTRICITY,
    NAMES_PERIGEE,
    NAMES_RADIUS,
    NAMES_SEMI_MAJOR_AXIS,
    NAMES_SPEED,
    TARGET_KEPLERIAN,
    MissionArrays,
    Record,
)
from ares_models.kernels.judging import judged_by

Array = NDArray[np.float64]

#: Allowance for the tolerances of a target, a share of mu / R.
_TOLERANCE = 1e-3
#: Least radius, a share of the ground's, down to which the gradient of gravity is bounded.
_DEEPEST = 0.9
#: Depth at which a flight is below the ground, m: a start on it is not, whatever the rounding.
_CLEARLY_M = 1.0
#: Points of the coast on its way down.
_POINTS = 400


def out_of_reach(arrays: MissionArrays, start: NDArray[np.void]) -> str:
    """Return the evidence that no flight reaches the target, one line; "": there is none.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
    """
    environment, state = arrays.environment[0], start[0]
    mu, oblate = float(environment["mu"]), float(environment["j2"])
    equator = float(environment["equatorial_radius"])
    ground = min(equator, float(environment["polar_radius"]))
    radius, speed = (float(np.linalg.norm(state[key])) for key in ("position", "velocity"))
    if radius < ground:
        return ""
    flattened = oblate * (equator / ground) ** 2
    deepest = mu / ground * (1.0 + flattened)
    wanted = lowest_energy(arrays.target[0], mu) - mu / ground * (flattened + _TOLERANCE)
    if not wanted > -deepest:
        return ""
    bound = math.sqrt(speed**2 + 2.0 * (deepest - mu / radius * (1.0 - flattened)))
    needed = math.sqrt(2.0 * (wanted + deepest)) - bound
    ideal = ideal_delta_v(arrays, state)
    if needed > ideal:
        return (
            f"all propellant gives a delta-V of at most {ideal:,.0f} m/s; the energy of the "
            f"target takes at least {needed:,.0f} m/s, without any losses"
        )
    times, heights = _way_down(state, mu)
    thrust = strongest(arrays, state, times)
    low = _DEEPEST * ground
    growth = math.sqrt(2.0 * mu / low**3)
    disturbed = thrust + 3.0 * mu * oblate * equator**2 / ground**4
    away = disturbed * (np.cosh(growth * times) - 1.0) / growth**2
    below = heights + away < ground - _CLEARLY_M
    proven = below & (heights - away > low) & (thrust * times < needed)
    if not proven.any():
        return ""
    at = int(np.argmax(proven))
    return (
        f"every flight meets the ground within {times[at]:,.0f} s: until then the thrust gives at "
        f"most {thrust[at] * times[at]:,.3g} m/s, and the energy of the target takes at least "
        f"{needed:,.0f} m/s"
    )


def lowest_energy(target: Record, mu: float) -> float:
    """Return the least energy of an orbit that is on target, J/kg; -inf: no bound.

    Args:
        target: record TARGET.
        mu: m3/s2.
    """
    named = int(judged_by(target))
    energies = [-math.inf]
    if named & NAMES_RADIUS and target["kind"] != TARGET_KEPLERIAN:
        speed = float(target["speed"]) if named & NAMES_SPEED else 0.0
        energies.append(0.5 * speed**2 - mu / float(target["radius"]))
    if named & NAMES_SEMI_MAJOR_AXIS:
        energies.append(-0.5 * mu / float(target["semi_major_axis"]))
    if named & NAMES_C3:
        energies.append(0.5 * float(target["c3"]))
    shape = float(target["eccentricity"]) if named & NAMES_ECCENTRICITY else math.nan
    perigee, apogee = float(target["perigee_radius"]), float(target["apogee_radius"])
    if named & NAMES_PERIGEE and named & NAMES_APOGEE:
        energies.append(-mu / (perigee + apogee))
    elif named & NAMES_PERIGEE:
        energies.append(-0.5 * mu * (1.0 - (0.0 if math.isnan(shape) else shape)) / perigee)
    elif named & NAMES_APOGEE:
        energies.append(-0.5 * mu * (1.0 + (1.0 if math.isnan(shape) else shape)) / apogee)
    return max(energies)


class _Ahead(NamedTuple):
    """Hold the arcs ahead and bounds on the masses of their stages, an entry each.

    Attributes:
        arcs: shape (n,), dtype ARC.
        mass: greatest at the begin of the stage without what may have been dropped by then, less
            all that may drop later, kg.
        propellant: greatest that the stage burns, kg.
        flow: greatest flow of the stage, kg/s.
        earliest: earliest begin of the arc after the state, s.
    """

    arcs: NDArray[np.void]
    mass: Array
    propellant: Array
    flow: Array
    earliest: Array


def _ahead(arrays: MissionArrays, state: Record) -> _Ahead:
    """Return the arcs ahead of a state, record NAVIGATION, with their bounds."""
    arcs = arrays.arcs[int(state["arc"]) :]
    same = arcs["stage"][:, None] == arcs["stage"][None, :]
    present = same[0]
    jettisons = arrays.jettisons
    done = (int(state["jettisoned"]) >> np.arange(len(jettisons))) & 1 == 1
    own = jettisons["stage"][None, :] >= arcs["stage"][:, None]
    drops = ((own | present[:, None]) & ~done[None, :]) @ jettisons["mass"]
    mass = np.where(present, float(state["mass"]), arcs["stack_mass"]) - drops
    tails = arcs["mass_flow"] * np.maximum(0.0, arcs["tail_gain"])
    flows = arcs["mass_flow"] * np.maximum(1.0, arcs["start_flow"].max(axis=1))
    flow = np.where(same, flows[None, :], 0.0).max(axis=1)
    # what the present stage has lost may all have been propellant
    lost = np.where(present, np.maximum(0.0, arcs["stack_mass"] - float(state["mass"])), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        spent = np.maximum(0.0, arcs["propellant"] - lost) / flow
    lengths = np.where(np.isinf(arcs["duration"]), arcs["shortest"], arcs["duration"])
    lengths = np.where(arcs["kind"] == BURN, np.minimum(lengths, spent), lengths)
    earliest = np.concatenate(([0.0], np.cumsum(lengths)[:-1]))
    earliest -= max(0.0, float(state["time"] - state["arc_start_time"]))
    return _Ahead(arcs, mass, arcs["propellant"] + same @ tails, flow, earliest)


def ideal_delta_v(arrays: MissionArrays, state: Record) -> float:
    """Return the most that all propellant can give, m/s; inf: no bound.

    Each stage burns all of its propellant after its jettisons, at its best exhaust velocity; a
    motor by a table gives its impulse to the least mass.

    Args:
        arrays: the mission.
        state: record NAVIGATION.
    """
    ahead = _ahead(arrays, state)
    total = 0.0
    for stage in np.unique(ahead.arcs["stage"]):
        members = np.flatnonzero((ahead.arcs["stage"] == stage) & (ahead.arcs["kind"] == BURN))
        if not members.size:
            continue
        first, arcs = members[0], ahead.arcs[members]
        end = float(ahead.mass[first] - ahead.propellant[first])
        if not end > 0.0:
            return math.inf
        tabled = arcs["tabled"] == 1
        if not tabled.all():
            best = float(arcs["exhaust_velocity"][~tabled].max())
            total += best * math.log(float(ahead.mass[first]) / end)
        for arc in arcs[tabled]:
            knots = slice(0, int(arc["start_knots"]))
            length = np.trapezoid(arc["start_fraction"][knots], arc["start_time"][knots])
            total += float(arc["thrust"] * length) / end
    return total


def strongest(arrays: MissionArrays, state: Record, times: Array) -> Array:
    """Return the greatest thrust acceleration of any flight until some times, m/s2.

    Args:
        arrays: the mission.
        state: record NAVIGATION.
        times: after the state, s, shape (n,).

    Returns:
        shape (n,); inf: no bound.
    """
    ahead = _ahead(arrays, state)
    found = np.zeros(len(times))
    for k in np.flatnonzero(ahead.arcs["kind"] == BURN):
        full = float(ahead.arcs[k]["thrust"]) * max(
            1.0, float(ahead.arcs[k]["start_fraction"].max())
        )
        mass = ahead.mass[k] - np.minimum(ahead.propellant[k], ahead.flow[k] * times)
        most = np.full(len(times), math.inf)
        np.divide(full, mass, out=most, where=mass > 0.0)
        found = np.where(times > ahead.earliest[k], np.maximum(found, most), found)
    return found


def _way_down(state: Record, mu: float) -> tuple[Array, Array]:
    """Return times and radii of a coast from its apogee, or the state behind it, to its perigee.

    Args:
        state: record NAVIGATION.
        mu: m3/s2.

    Returns:
        s after the state and m, shape (n,); empty for an escape. From the state to each point the
        radius is at least the lesser of both.
    """
    r, v = state["position"], state["velocity"]
    radius = float(np.linalg.norm(r))
    alpha = 2.0 / radius - float(v @ v) / mu
    if not alpha > 0.0:
        return np.empty(0), np.empty(0)
    size = 1.0 / alpha
    sine, cosine = float(r @ v) / math.sqrt(mu * size), 1.0 - radius * alpha
    shape = math.hypot(sine, cosine)
    now = math.atan2(sine, cosine) % math.tau
    anomaly = np.linspace(max(now, math.pi), math.tau, _POINTS)
    rate = math.sqrt(mu / size**3)
    times = (anomaly - shape * np.sin(anomaly) - (now - sine)) / rate
    return times, size * (1.0 - shape * np.cos(anomaly))
