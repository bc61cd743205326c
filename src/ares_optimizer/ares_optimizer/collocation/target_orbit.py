# SPDX-License-Identifier: Apache-2.0
"""Compute energy, apogee and perigee of the target orbit."""

import math

from ares_models.arrays import TARGET_ELEMENTS, TARGET_KEPLERIAN, MissionArrays


def target_energy(arrays: MissionArrays) -> float:
    """Return the specific energy of the target orbit, m2/s2."""
    target = arrays.target[0]
    mu = float(arrays.environment[0]["mu"])
    if target["kind"] == TARGET_ELEMENTS:
        return 0.5 * float(target["c3"])
    if target["kind"] == TARGET_KEPLERIAN:
        return -0.5 * mu / float(target["semi_major_axis"])
    return 0.5 * float(target["speed"]) ** 2 - mu / float(target["radius"])


def target_apogee(arrays: MissionArrays) -> float:
    """Return the apogee radius of the target, m; inf: escape, or not named."""
    target = arrays.target[0]
    if target["kind"] == TARGET_ELEMENTS:
        return float(target["apogee_radius"])
    energy = target_energy(arrays)
    if energy >= 0.0:
        return math.inf
    return -float(arrays.environment[0]["mu"]) / energy - target_perigee(arrays)


def target_perigee(arrays: MissionArrays) -> float:
    """Return the perigee radius of the target, m; nan: not named."""
    target = arrays.target[0]
    if target["kind"] == TARGET_ELEMENTS:
        return float(target["perigee_radius"])
    if target["kind"] == TARGET_KEPLERIAN:
        return float(target["semi_major_axis"] * (1.0 - target["eccentricity"]))
    mu = float(arrays.environment[0]["mu"])
    radius, speed = float(target["radius"]), float(target["speed"])
    momentum = (radius * speed * math.cos(float(target["flight_path_angle"]))) ** 2 / mu
    energy = target_energy(arrays)
    return momentum / (1.0 + math.sqrt(max(0.0, 1.0 + 2.0 * energy * momentum / mu)))
