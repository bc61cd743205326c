# SPDX-License-Identifier: Apache-2.0
"""Describe obstacles common to all methods, in one line each; "" without one."""

from ares_models.arrays import TARGET_KEPLERIAN, MissionArrays
from ares_optimizer.solution import Check, ConstraintCheck


def target_obstacle(arrays: MissionArrays) -> str:
    """Return a line if the target is below the surface, else ""."""
    target = arrays.target[0]
    environment = arrays.environment[0]
    ground = float(min(environment["equatorial_radius"], environment["polar_radius"]))
    if target["kind"] == TARGET_KEPLERIAN:
        highest = float(target["semi_major_axis"] * (1.0 + target["eccentricity"]))
        name = "target apogee radius"
    else:
        highest = float(target["radius"])
        name = "target radius"
    if 0.0 < highest < ground:
        return (
            f"{name} {highest:,.0f} m is {ground - highest:,.0f} m below the surface "
            f"({ground:,.0f} m)"
        )
    return ""


def check_obstacle(checks: tuple[ConstraintCheck, ...]) -> str:
    """Return a line with the constraints that the independent integration finds violated."""
    for check in checks:
        # a flight through the Earth makes other checks meaningless
        if check.key is Check.LOWEST_ALTITUDE and not check.satisfied and check.value < 0.0:
            return f"the flight goes through the ground, {-check.value:,.0f} m deep"
    broken = [_broken(check) for check in checks if not check.satisfied]
    return "; ".join(broken)


def _broken(check: ConstraintCheck) -> str:
    """Describe one violated constraint."""
    if check.key is Check.JETTISON_BEFORE_CUTOFF:
        return f"jettison {check.number} is still on at the cut-off"
    value, limit, unit = check.value, check.limit, check.unit
    if check.key is Check.LOWEST_ALTITUDE:
        return (
            f"{check.name} is {value:,.0f} m, {limit - value:,.0f} m below its floor of "
            f"{limit:,.0f} m"
        )
    return (
        f"{check.name} is {value:,.6g} {unit}, limit {limit:,.6g} {unit}, "
        f"off by {value - limit:,.3g} {unit}"
    )
