"""How low a flight may be, arc by arc."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import BURN, COAST, MissionArrays
from ares_models.kernels.environment import altitude, log_density
from ares_models.orbits import Elements
from ares_optimizer.plan import with_lengths
from ares_optimizer.proof.flight import flown_arcs
from ares_optimizer.solution import Solution, Trajectory

#: kg/m3; what is thinner is no air: that of the US Standard Atmosphere 1976 at 100 km.
THIN = 5.605e-7
_HIGHEST = 1e6  # m
#: Below a floor by so much, m, a flight does not keep it.
_SAG_M = 1.0
_SAME_TIME = 1e-3  # s


class Floor(NamedTuple):
    """What an arc must keep to.

    Attributes:
        arc: index into the mission's arcs.
        altitude_m: least altitude all along it; nan: none is asked for.
        perigee_m: least radius of the perigee of the orbit in which it is flown; nan: none.
        said: the mission file asks for it. Else a coast that begins below is let be.
    """

    arc: int
    altitude_m: float
    perigee_m: float
    said: bool


def edge_of_air(arrays: MissionArrays) -> float:
    """Return the altitude at which the air of a mission has become thin, m; 0 without air."""
    level = math.log(THIN) - math.log(float(arrays.environment[0]["density_factor"]))
    low, high = 0.0, _HIGHEST
    if log_density(low, arrays.atmosphere)[0] <= level:
        return 0.0
    while high - low > 1.0:
        middle = 0.5 * (low + high)
        if log_density(middle, arrays.atmosphere)[0] > level:
            low = middle
        else:
            high = middle
    return high


def floors_of(arrays: MissionArrays, start: NDArray[np.void]) -> tuple[Floor, ...]:
    """Return the floors of the arcs from the start on.

    A free coast after a burn stays above the air, unless the file says otherwise.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
    """
    floors = []
    burnt = False
    edge = math.nan
    for k in range(int(start["arc"][0]), len(arrays.arcs)):
        arc = arrays.arcs[k]
        altitude = float(arc["min_altitude"])
        perigee = float(arc["min_perigee_radius"]) or math.nan
        if math.isfinite(altitude) or math.isfinite(perigee):
            floors.append(Floor(k, altitude, perigee, said=True))
        elif arc["kind"] == COAST and math.isinf(arc["duration"]) and burnt:
            edge = edge_of_air(arrays) if math.isnan(edge) else edge
            floors.append(Floor(k, edge, math.nan, said=False))
        burnt = burnt or arc["kind"] == BURN
    return tuple(floors)


def below_floor(arrays: MissionArrays, start: NDArray[np.void], solution: Solution) -> str:
    """Name the floor that a flight does not keep, and by how much; empty: it keeps all.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        solution: with its trajectory; without one nothing is known, and nothing is said.
    """
    track, floors = solution.trajectory, floors_of(arrays, start)
    if track is None or not floors:
        return ""
    planned = with_lengths(arrays, start[0], np.array(solution.lengths_s))
    arcs = {arc.arc: arc for arc in flown_arcs(planned, start[0], solution.t_meco_s)}
    for floor in floors:
        if floor.arc not in arcs:
            continue
        begin, end = arcs[floor.arc].start_s, arcs[floor.arc].end_s
        low = _lowest_between(arrays, track, (begin, end), floor.altitude_m)
        # on its way up a vehicle may coast below the default floor
        counts = floor.said or _rises_to(arrays, track, begin, floor.altitude_m)
        if low < floor.altitude_m - _SAG_M and counts:
            return (
                f"lowest altitude in arc {floor.arc} {low:,.0f} m; at least "
                f"{floor.altitude_m:,.0f} m"
            )
        at = int(np.searchsorted(track.time_s, begin - _SAME_TIME))
        mu = float(arrays.environment[0]["mu"])
        orbit = Elements.from_state(track.position[at], track.velocity[at], mu)
        if orbit.perigee_radius < floor.perigee_m - _SAG_M:
            return (
                f"perigee radius in arc {floor.arc} {orbit.perigee_radius:,.0f} m; at least "
                f"{floor.perigee_m:,.0f} m"
            )
    return ""


def _lowest_between(
    arrays: MissionArrays, track: Trajectory, times: tuple[float, float], level: float
) -> float:
    """Least altitude of a trajectory between two times where it may be below a level, m, or inf."""
    environment = arrays.environment[0]
    # no place is lower than above the equatorial radius
    near = np.linalg.norm(track.position, axis=1) - environment["equatorial_radius"] < level
    inside = (track.time_s >= times[0] - _SAME_TIME) & (track.time_s <= times[1] + _SAME_TIME)
    heights = (float(altitude(tuple(r), environment)) for r in track.position[inside & near])
    return min(heights, default=math.inf)


def _rises_to(arrays: MissionArrays, track: Trajectory, time_s: float, level: float) -> bool:
    """Tell if a flight has been at an altitude, m, at a time."""
    environment = arrays.environment[0]
    before = track.position[track.time_s <= time_s]
    return any(float(altitude(tuple(r), environment)) >= level for r in before)
