# SPDX-License-Identifier: Apache-2.0
"""Lay out the missions of an ascent alone, to the orbit on which the flight coasts."""

import math
from collections.abc import Iterator

import numpy as np

from ares_models.arrays import (
    BURN,
    HEADINGS,
    NAMES_APOGEE,
    NAMES_ASCENDING_NODE,
    NAMES_INCLINATION,
    NAMES_PERIGEE,
    NAMES_SPEED,
    TARGET_ELEMENTS,
    TARGET_RADIUS_SPEED_ANGLE_INCLINATION,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
    MissionArrays,
)
from ares_models.kernels.judging import judged_by
from ares_models.kernels.targets import named_plane
from ares_models.kernels.thrust_curve import curve_area, flow_area
from ares_optimizer.collocation.pilot import Pilot, names_plane
from ares_optimizer.collocation.target_orbit import target_apogee, target_energy, target_perigee

#: Ratio of apogee to perigee from which the way by a circle is the likelier one.
HIGH_UP = 1.5
#: Cosine of the angle of a named plane to the pad up to which an ascent turns into it rather than
#: into the nearest plane over the pad.
_NEAR_PLANE = math.cos(math.radians(8.0))
#: Perigees above and below a parking orbit at which a circle is flown, m.
LOW_M = 3e5
_LOWER_M = 5e4


def ascents_to_park(pilot: Pilot) -> Iterator[MissionArrays]:
    """Yield the missions of an ascent alone, to orbits from which the target is reached.

    Before a stage that burns whole at the apogee, that is the orbit on which it adds what is left.
    Else they are a circle and the ellipse from its radius to the target's apogee. If one burn alone
    follows the ascent, the circle is at the target's perigee, if that is low, and else only tried
    if the target is eccentric.
    A prescribed orbit is the only one.

    Args:
        pilot: of the whole mission.
    """
    apogee, perigee = target_apogee(pilot.arrays), target_perigee(pilot.arrays)
    lowest = max((f.perigee_m for f in pilot.floors if f.perigee_m > 0.0), default=0.0)
    parking = max(pilot.parking_m, lowest)
    ways = [(parking, pilot.apogee_m), (parking, apogee)]
    kick = _orbit_before_kick(pilot)
    if kick is not None:
        yield ascent_to(pilot, *kick, anywhere=True)
    last = end_of_ascent(pilot)
    if last is None:
        return
    following = pilot.count - 1 - pilot.groups[last]
    if following == 1 and pilot.apogee_m == parking:
        low = max(parking - _LOWER_M, lowest) <= perigee < parking + LOW_M
        circle = perigee if low else parking
        ways = [(circle, circle)] * (low or apogee > HIGH_UP * perigee)
        ways += [(parking, apogee)] * (apogee > perigee or not low)
        if apogee < HIGH_UP * parking:
            ways.reverse()
    if pilot.parks:
        ways = [(pilot.parking_m, pilot.apogee_m)]
    for radius, highest in dict.fromkeys(ways):
        yield ascent_to(pilot, last, radius, highest)


def _orbit_before_kick(pilot: Pilot) -> tuple[int, float, float] | None:
    """Return the orbit of an ascent to which a last stage that burns whole adds what is left.

    Returns:
        the last arc of the ascent, perigee and apogee radius, m. None: the last stage is not such a
        one, or what it adds is too little: the flight orbits before it burns.
    """
    arrays, arcs = pilot.arrays, pilot.arrays.arcs
    burns = np.flatnonzero(arcs["kind"] == BURN)
    before, after = (burns[pilot.groups[burns] == group] for group in (0, 1))
    if not pilot.ascends or pilot.count != 2 or not np.isfinite(arcs["duration"][after]).all():
        return None
    if arcs["stage"][before[-1]] == arcs["stage"][after[0]]:
        return None
    gained, mass = 0.0, math.nan
    for k, arc in zip(after, arrays.records().arcs[after], strict=True):
        if math.isnan(mass) or arc["stage"] != arcs["stage"][k - 1]:
            mass = float(arc["stack_mass"])
        length = float(arc["duration"])
        used = float(arc["mass_flow"]) * flow_area(arc, length)
        area = curve_area(arc["start_time"], arc["start_fraction"], arc["start_knots"], length)
        impulse = float(arc["thrust"]) * (area if arc["start_knots"] else length)
        gained -= impulse / used * math.log1p(-used / mass)
        mass -= used
    mu = float(arrays.environment[0]["mu"])
    apogee, perigee = target_apogee(arrays), target_perigee(arrays)
    if not perigee <= apogee < math.inf:
        return None
    speed = math.sqrt(2.0 * mu * (1.0 / perigee - 1.0 / (perigee + apogee))) - gained
    momentum = (perigee * max(speed, 0.0)) ** 2 / mu
    lowest = momentum * perigee / (2.0 * perigee - momentum)
    return (int(before[-1]), lowest, perigee) if 0.0 < lowest < pilot.clear_m else None


def end_of_ascent(pilot: Pilot) -> int | None:
    """Return the first free burn that ends a group; None: no ascent begins, or no group follows."""
    burns = np.flatnonzero(pilot.arrays.arcs["kind"] == BURN)
    lasts = [int(burns[pilot.groups[burns] == group][-1]) for group in range(pilot.count - 1)]
    return next((k for k in lasts if k in pilot.free), None) if pilot.ascends else None


def ascent_to(
    pilot: Pilot, last: int, radius: float, apogee: float, anywhere: bool = False
) -> MissionArrays:
    """Return the mission of an ascent alone, to the perigee of an orbit.

    It ends at the edge of the air, on the way up, if the perigee is lower.

    Args:
        pilot: of the whole mission.
        last: the last arc of the ascent.
        radius: of the perigee, m.
        apogee: radius, m; inf: with the energy of the target.
        anywhere: it ends anywhere on the orbit.
    """
    arrays, start = pilot.arrays, pilot.start
    mu = float(arrays.environment[0]["mu"])
    r, v = start["position"][0], start["velocity"][0]
    h = np.cross(r, v)
    target = arrays.target.copy()
    target["kind"] = TARGET_RADIUS_SPEED_ANGLE_INCLINATION
    target["radius"] = end = max(radius, min(pilot.clear_m, apogee))
    energy = -mu / (radius + apogee) if apogee < math.inf else target_energy(arrays)
    at_perigee = math.sqrt(max(2.0 * (energy + mu / radius), mu / radius))
    speed = math.sqrt(at_perigee**2 - 2.0 * mu * (1.0 / radius - 1.0 / end))
    target["speed"] = speed
    target["flight_path_angle"] = math.acos(min(1.0, radius * at_perigee / (end * speed)))
    plane = h / np.linalg.norm(h) if pilot.plane is None else pilot.plane
    if pilot.plane is not None and names_plane(arrays):
        # two planes of one inclination pass over the pad
        wanted = np.array(named_plane(arrays.target[0]))
        plane = wanted if wanted @ plane > _NEAR_PLANE else plane
        target["kind"] = TARGET_RADIUS_SPEED_ANGLE_PLANE
        target["ascending_node"] = math.atan2(plane[0], -plane[1])
    target["inclination"] = math.acos(float(plane[2]))
    if anywhere:
        named = NAMES_ASCENDING_NODE * bool(target["kind"] == TARGET_RADIUS_SPEED_ANGLE_PLANE)
        target["kind"] = TARGET_ELEMENTS
        named |= int(arrays.target["named"][0]) & HEADINGS
        target["named"] = named | NAMES_PERIGEE | NAMES_APOGEE | NAMES_INCLINATION
        target["perigee_radius"], target["apogee_radius"] = radius, apogee
        target["c3"] = 2.0 * energy
    return arrays._replace(arcs=arrays.arcs[: last + 1].copy(), target=target)


def without_speed(alone: MissionArrays) -> MissionArrays:
    """Return the mission of an ascent with free speed at its end."""
    target = alone.target.copy()
    heading = int(target["named"][0]) & HEADINGS
    target["named"] = int(judged_by(target[0])) & ~NAMES_SPEED | heading
    target["kind"] = TARGET_ELEMENTS
    return alone._replace(target=target)
