# SPDX-License-Identifier: Apache-2.0
"""Check that a solution keeps the floors of its arcs, the orbits they name, and its last burn."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_models.floors import floors_of, orbits_of
from ares_models.judge import judge
from ares_models.kernels.environment import altitude
from ares_models.orbits import Elements
from ares_models.plans import flies_in_air
from ares_models.tolerances import FLOOR_M, WIDER_IN_AIR
from ares_optimizer.obstacles import check_obstacle
from ares_optimizer.plan import with_lengths
from ares_optimizer.proof.checks import bounds_last_burn, last_burn_checks
from ares_optimizer.proof.flight import flown_arcs
from ares_optimizer.solution import Solution, Trajectory

_SAME_TIME = 1e-3  # s


def below_floor(arrays: MissionArrays, start: NDArray[np.void], solution: Solution) -> str:
    """Name the floor, orbit or bound of the last burn that a flight violates; "": none.

    Args:
        arrays: the mission.
        start: shape (1,), dtype NAVIGATION.
        solution: checked only if it has a trajectory.
    """
    track, floors = solution.trajectory, floors_of(arrays, start)
    if track is None or not (floors or bounds_last_burn(arrays)):
        return ""
    planned = with_lengths(arrays, start[0], np.array(solution.lengths_s))
    flown = flown_arcs(planned, start[0], solution.t_meco_s)
    last = (flown[-1].arc, flown[-1].start_s, flown[-1].end_s)
    broken = check_obstacle(last_burn_checks(arrays, start[0], last))
    if broken:
        return broken
    arcs = {arc.arc: arc for arc in flown}
    tolerance = FLOOR_M * (WIDER_IN_AIR if flies_in_air(arrays.arcs) else 1.0)
    for floor in floors:
        if floor.arc not in arcs:
            continue
        begin, end = arcs[floor.arc].start_s, arcs[floor.arc].end_s
        low = _lowest_between(arrays, track, (begin, end), floor.altitude_m)
        # in the ascent a vehicle may coast below the default floor
        counts = floor.said or _rises_to(arrays, track, begin, floor.altitude_m)
        if low < floor.altitude_m - tolerance and counts:
            return (
                f"lowest altitude in arc {floor.arc} {low:,.0f} m; at least "
                f"{floor.altitude_m:,.0f} m"
            )
        at = int(np.searchsorted(track.time_s, begin - _SAME_TIME))
        mu = float(arrays.environment[0]["mu"])
        orbit = Elements.from_state(track.position[at], track.velocity[at], mu)
        if orbit.perigee_radius < floor.perigee_m - tolerance:
            return (
                f"perigee radius in arc {floor.arc} {orbit.perigee_radius:,.0f} m; at least "
                f"{floor.perigee_m:,.0f} m"
            )
    environment = arrays.environment[0]
    mu, ground = float(environment["mu"]), float(environment["equatorial_radius"])
    for k, named in orbits_of(arrays, start).items():
        if k not in arcs:
            continue
        # the tail-off at the begin of the coast belongs to the burn before it
        begin = arcs[k].start_s + float(arrays.arcs[k - 1]["tail_time"].max())
        at = int(np.searchsorted(track.time_s, begin - _SAME_TIME))
        judged = judge(track.position[at], track.velocity[at], named[0], mu, ground)
        if misses := judged.misses():
            return f"orbit of arc {k}: " + "; ".join(misses)
    return ""


def depth_below_ground(arrays: MissionArrays, solution: Solution) -> float:
    """Return how deep a flight goes below the ground, m; 0: nowhere, or no trajectory.

    Args:
        arrays: the mission.
        solution: of any method.
    """
    track = solution.trajectory
    if track is None or not len(track.time_s):
        return 0.0
    return max(0.0, -_lowest_between(arrays, track, (-math.inf, math.inf), 0.0))


def _lowest_between(
    arrays: MissionArrays, track: Trajectory, times: tuple[float, float], level: float
) -> float:
    """Return the least altitude below ``level`` between two times, m; inf: none."""
    environment = arrays.environment[0]
    # altitude is at least the radius minus the equatorial radius
    near = np.linalg.norm(track.position, axis=1) - environment["equatorial_radius"] < level
    inside = (track.time_s >= times[0] - _SAME_TIME) & (track.time_s <= times[1] + _SAME_TIME)
    heights = (float(altitude(tuple(r), environment)) for r in track.position[inside & near])
    return min(heights, default=math.inf)


def _rises_to(arrays: MissionArrays, track: Trajectory, time_s: float, level: float) -> bool:
    """Return true if a flight has been at an altitude, m, up to a time."""
    environment = arrays.environment[0]
    before = track.position[track.time_s <= time_s]
    return any(float(altitude(tuple(r), environment)) >= level for r in before)
