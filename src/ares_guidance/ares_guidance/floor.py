# SPDX-License-Identifier: Apache-2.0
"""Coasts of a plan: the floors they keep, and the burns whose end a leg holds because of them."""

import math

import numpy as np
from numpy.typing import NDArray

from ares_guidance.kernels.plans.floor import lowest_altitude
from ares_guidance.trajectory import SAME_TIME, OfflineTrajectory
from ares_models.arrays import BURN, COAST, NAVIGATION, MissionArrays
from ares_models.floors import floors_of
from ares_models.kernels.environment import altitude
from ares_models.orbits import Elements, Insertion
from ares_models.plans import LONG_COAST_S
from ares_models.tolerances import FLOOR_M

Array = NDArray[np.float64]

#: Lowest altitude of a flight, m.
GROUND = 0.0
#: Clearance above a floor that the plan touches, m; a law meets its target to about a metre.
CLEARANCE = 0.5 * FLOOR_M
#: Least gain of the perigee, as a fraction of a lift that does not move the next ignition.
LEAST_GAIN = 0.5
#: Depth, m, from which a burn dips.
DIP = 1e3


def _lowest(trajectory: OfflineTrajectory, arrays: MissionArrays) -> list[tuple[int, float]]:
    """Return index and lowest altitude, m, of each arc of a trajectory."""
    return [
        (
            k,
            lowest_altitude(
                begin - SAME_TIME,
                end,
                bool(arrays.arcs["kind"][k] == COAST),
                trajectory.sample_time,
                trajectory.sample_position,
                trajectory.sample_velocity,
                arrays.environment,
            ),
        )
        for k, begin, end in trajectory.flown()
    ]


def lowest_coast(trajectory: OfflineTrajectory, arrays: MissionArrays) -> float:
    """Return the lowest altitude of the long coasts after the first burn, m; inf without one.

    A coast of LONG_COAST_S at most is between two stages, on the way up, and has no perigee.

    Args:
        trajectory: of this mission.
        arrays: the mission.
    """
    coasting = arrays.arcs["kind"] == COAST
    first = int(np.argmin(coasting))
    coasts = [
        at
        for (k, at), (_, begin, end) in zip(
            _lowest(trajectory, arrays), trajectory.flown(), strict=True
        )
        if coasting[k] and k > first and end - begin > LONG_COAST_S
    ]
    return min(coasts, default=math.inf)


def check_floor(trajectory: OfflineTrajectory, arrays: MissionArrays) -> None:
    """Check that a trajectory stays above the ground.

    Args:
        trajectory: of this mission.
        arrays: the mission.

    Raises:
        ValueError: an arc goes through the ground; one line.
    """
    k, lowest = min(_lowest(trajectory, arrays), key=lambda arc: arc[1])
    if lowest < GROUND - FLOOR_M:
        kind = "coast" if arrays.arcs["kind"][k] == COAST else "burn"
        raise ValueError(
            f"arc {k}, a {kind}, goes through the ground, {GROUND - lowest:,.0f} m deep"
        )


def held_burns(trajectory: OfflineTrajectory, arrays: MissionArrays) -> dict[int, float]:
    """Return the burns whose end a leg holds, with the lift of these ends, m.

    They are the burns before coasts that are long or touch their floor: a law that aims beyond
    such a coast predicts its end poorly, and violates its floor. In a plan by legs they are the
    burns of fixed length before a burn that dips too, which may be kept above a floor there.

    Args:
        trajectory: of this mission.
        arrays: the mission.
    """
    arcs = arrays.arcs
    lengths = {k: end - begin for k, begin, end in trajectory.flown()}
    lifts: dict[int, float] = {}
    for k, length in lengths.items():
        burn = _burn_before(arcs, k)
        if arcs["kind"][k] == COAST and length > LONG_COAST_S and burn >= 0:
            lifts[burn] = 0.0
    if trajectory.by_legs:
        lifts |= dict.fromkeys(_before_dips(trajectory, arrays), 0.0)
    return {k: lift for k, lift in (lifts | _lifts(trajectory, arrays)).items() if k in lengths}


def lifted(
    position: Array, velocity: Array, lift: float, ignition: Array, mu: float
) -> tuple[Array, Array]:
    """Lift the end of a burn until the perigee of the coast after it rises by ``lift``.

    The speed changes too, so that the coast still passes through the place of the next ignition: a
    short burn there cannot correct its place. Where that would not raise the perigee, the end is
    lifted by ``lift`` alone.

    Args:
        position: at the end of the burn, m.
        velocity: there, m/s.
        lift: m.
        ignition: position of the next ignition, m.
        mu: m3/s2.

    Returns:
        position and velocity.
    """
    radius = float(np.linalg.norm(position))
    normal = np.cross(position, velocity)
    normal /= np.linalg.norm(normal)
    climb = Insertion.from_state(position, velocity).flight_path_angle
    ahead = math.atan2(float(np.cross(position, ignition) @ normal), float(position @ ignition))
    away = float(np.linalg.norm(ignition))

    def raised(height: float) -> tuple[Array, Array]:
        # v^2 r c(r) is the same for all conics through both places at one flight-path angle
        higher = radius + height
        c, c_higher = (
            r / away * math.cos(climb) - math.cos(ahead + climb) for r in (radius, higher)
        )
        square = radius * c / (higher * c_higher)
        return position * (higher / radius), velocity * math.sqrt(max(0.0, square))

    planned = Elements.from_state(position, velocity, mu).perigee_radius
    gained = Elements.from_state(*raised(lift), mu).perigee_radius - planned
    if not LEAST_GAIN * lift < gained < lift / LEAST_GAIN:
        return position * (1.0 + lift / radius), velocity
    return raised(lift * lift / gained)


def _burn_before(arcs: NDArray[np.void], k: int) -> int:
    """Return the last burn before an arc; -1: none."""
    burns = np.flatnonzero(arcs["kind"][:k] == BURN)
    return int(burns[-1]) if len(burns) else -1


def _before_dips(trajectory: OfflineTrajectory, arrays: MissionArrays) -> list[int]:
    """Return the burns before burns that sink by more than DIP and rise by as much."""
    arcs = arrays.arcs
    environment = arrays.environment[0]
    height = np.array([altitude(tuple(r), environment) for r in trajectory.sample_position])
    found = []
    for k, begin, end in trajectory.flown():
        inside = (trajectory.sample_time > begin - SAME_TIME) & (
            trajectory.sample_time < end + SAME_TIME
        )
        burn = _burn_before(arcs, k)
        if arcs["kind"][k] != BURN or not inside.any() or burn < 0:
            continue
        low = height[inside].min() + DIP
        if low < height[inside][0] and low < height[inside][-1]:
            found.append(burn)
    return found


def _lifts(trajectory: OfflineTrajectory, arrays: MissionArrays) -> dict[int, float]:
    """Return the burns before coasts that touch their floor, with the lift of their ends, m."""
    arcs = arrays.arcs
    lowest = dict(_lowest(trajectory, arrays))
    start = np.zeros(1, NAVIGATION)
    start["arc"] = trajectory.flown_arc[0]
    lifts: dict[int, float] = {}
    for floor in floors_of(arrays, start):
        burn = _burn_before(arcs, floor.arc)
        if arcs["kind"][floor.arc] != COAST or floor.arc not in lowest or burn < 0:
            continue
        above = [lowest[floor.arc] - floor.altitude_m]
        if math.isfinite(floor.perigee_m):
            begin = trajectory.flown_start_time[trajectory.flown_arc == floor.arc][0]
            at = int(np.searchsorted(trajectory.sample_time, begin - SAME_TIME))
            orbit = Elements.from_state(
                trajectory.sample_position[at],
                trajectory.sample_velocity[at],
                float(arrays.environment["mu"][0]),
            )
            above.append(orbit.perigee_radius - floor.perigee_m)
        for height in above:
            if abs(height) < FLOOR_M:
                lifts[burn] = max(lifts.get(burn, 0.0), CLEARANCE - height)
    return lifts
