# SPDX-License-Identifier: Apache-2.0
"""Draw launchers on their pads to test plans and flights for which nothing was tuned.

Two or three stages, liquid or solid, with or without strap-on boosters, pressure limits and a
parking orbit, from sites between the equator and 65 deg, to circles and ellipses of any inclination
that the site allows. Not all of them can reach their target.
"""

import math
from itertools import pairwise
from typing import Any

import numpy as np

from ares_models.mission import Mission
from ares_trials.random_vehicles import EQUATORIAL_RADIUS, G0, MU

ROTATION_RATE = 7.292115e-5
#: Losses to gravity, drag and steering up to a low orbit, m/s.
LOSSES = (1450.0, 2000.0)
DRAG_TABLE = [[0.0, 0.3], [0.8, 0.36], [1.0, 0.55], [1.2, 0.62], [1.6, 0.55], [2.5, 0.4], [7, 0.25]]


def random_launcher(seed: int) -> Mission:
    """Draw the mission of a seed, equal on every machine.

    Args:
        seed: not negative.
    """
    draw = np.random.default_rng(seed)
    target, latitude, speed, parked = _way(draw)
    count = int(draw.integers(2, 4))
    stages, lift_off = _stages(draw, speed, count, parked)
    area = float(draw.uniform(0.8, 1.3)) * (lift_off / 55e3) ** (2.0 / 3.0) * 1.6
    jettisons = []
    if draw.random() < 0.7:
        fairing = {"name": "fairing", "mass_kg": 0.0015 * lift_off, "stage": "s1"}
        after: dict[str, Any] = {"heating_limit_w_m2": 1135.0}
        if draw.random() < 0.5:
            after = {"time_after_ignition_s": float(draw.uniform(10.0, 60.0))}
        jettisons.append(fairing | after)
        stages[0]["payload"] += fairing["mass_kg"]
    payload = stages[0].pop("payload")
    return Mission.model_validate(
        {
            "name": f"random_launcher_{seed}",
            "title": f"random launcher {seed}",
            "source": "drawn, no rocket that was built",
            "payload_kg": payload,
            "environment": {
                "mu_m3_s2": MU,
                "earth": {
                    "equatorial_radius_m": EQUATORIAL_RADIUS,
                    "polar_radius_m": 6356752.3,
                    "rotation_rate_rad_s": ROTATION_RATE,
                    "zero_longitude_deg": 0.0,
                },
                "atmosphere": {"model": "us76"},
            },
            "aerodynamics": {"reference_area_m2": area, "drag_table": DRAG_TABLE},
            "initial_state": {
                "time_s": 0.0,
                "geodetic_latitude_deg": latitude,
                "longitude_deg": float(draw.uniform(-180.0, 180.0)),
                "altitude_m": float(draw.uniform(0.0, 300.0)),
            },
            "stages": stages,
            "jettisons": jettisons,
            "target": target,
        }
    )


def _way(draw: np.random.Generator) -> tuple[dict[str, Any], float, float, bool]:
    """Draw target and site; return them with the ideal speed needed, and if it coasts."""
    latitude = float(draw.uniform(-65.0, 65.0))
    least = abs(latitude) + 0.2
    inclination = float(draw.uniform(least, max(180.0 - least, least + 1.0)))
    if draw.random() < 0.3:
        inclination = float(draw.uniform(96.0, 99.0))
    elif draw.random() < 0.5:
        inclination = float(draw.uniform(least, min(least + 30.0, 180.0 - least)))
    inclination = min(max(inclination, least), 180.0 - least)
    kind = draw.random()
    perigee = apogee = float(draw.uniform(180e3, 400e3))
    if kind > 0.85:
        apogee = float(draw.uniform(20e6, 36e6))
    elif kind > 0.7:
        perigee = apogee = float(draw.uniform(400e3, 900e3))
    elif kind > 0.5:
        apogee = float(draw.uniform(perigee, 900e3))
    parked = apogee > 400e3
    low = EQUATORIAL_RADIUS + 200e3
    r_p, r_a = EQUATORIAL_RADIUS + perigee, EQUATORIAL_RADIUS + apogee
    at_perigee = math.sqrt(2.0 * MU * (1.0 / low - 1.0 / (low + r_a)))
    at_apogee = 0.0
    if perigee > 200e3:
        at_apogee = math.sqrt(MU * (2.0 / r_a - 2.0 / (r_p + r_a))) - math.sqrt(
            MU * (2.0 / r_a - 2.0 / (low + r_a))
        )
    turning = ROTATION_RATE * EQUATORIAL_RADIUS * math.cos(math.radians(inclination))
    target = {
        "perigee_altitude_m": perigee,
        "apogee_altitude_m": apogee,
        "inclination_deg": inclination,
    }
    speed = at_perigee + abs(at_apogee) - turning + float(draw.uniform(*LOSSES))
    return target, latitude, speed, parked


def _air_limits(draw: np.random.Generator) -> dict[str, float]:
    """Draw the limits of a stage in the air."""
    limits = {}
    if draw.random() < 0.6:
        limits["max_dynamic_pressure_pa"] = float(draw.uniform(30e3, 60e3))
    if draw.random() < 0.6:
        limits["max_q_alpha_pa_rad"] = float(draw.uniform(1500.0, 5000.0))
    return limits


def _stages(
    draw: np.random.Generator, speed: float, count: int, parked: bool
) -> tuple[list[dict[str, Any]], float]:
    """Draw stages, first to last; return them with the mass at lift-off, kg."""
    shares = draw.uniform(0.7, 1.3, count) * ((0.8, 1.2) if count == 2 else (0.8, 1.0, 1.0))
    gains = speed * draw.uniform(1.0, 1.06) * shares / shares.sum()
    mass = payload = float(math.exp(draw.uniform(math.log(150.0), math.log(25e3))))
    stages: list[dict[str, Any]] = []
    for k in reversed(range(count)):
        solid = draw.random() < 0.25 and k < count - 1
        isp = float(draw.uniform(270.0, 295.0) if solid else draw.uniform(295.0, 345.0))
        if k > 0 and not solid and draw.random() < 0.4:
            isp = float(draw.uniform(345.0, 460.0))
        ratio = math.exp(gains[k] / (isp * G0))
        dry = float(draw.uniform(0.06, 0.11))
        # dry mass as a share of the propellant
        propellant = mass * (ratio - 1.0) / (1.0 - dry * (ratio - 1.0))
        if propellant <= 0.0 or propellant > 40.0 * mass:
            propellant = 12.0 * mass
        total = mass + propellant * (1.0 + dry)
        weights = draw.uniform(1.25, 1.7) if k == 0 else draw.uniform(0.6, 1.4)
        boosted = k == 0 and draw.random() < 0.4
        if boosted:
            weights = draw.uniform(0.7, 1.2)
        thrust = float(weights * total * G0)
        if k == 0 and not boosted:
            # ambient pressure takes a share of it
            thrust *= 1.12
        burn: dict[str, Any] = {"thrust_n": thrust, "isp_s": isp}
        stage: dict[str, Any] = {
            "name": f"s{k}",
            "dry_mass_kg": dry * propellant,
            "propellant_kg": propellant,
        }
        time = propellant * isp * G0 / thrust
        coast = {"coast_s": float(draw.uniform(1.0, 12.0))}
        if solid:
            level = thrust / 1.05
            burn = {"isp_s": isp, "thrust_table": _solid(level, time * 1.05)}
        elif k < count - 1:
            burn["burn_time_s"] = 0.9999 * time
        else:
            burn["burn_time_s"] = "free"
        arcs = [burn] if k == 0 else [coast, burn]
        if k == count - 1 and parked:
            arcs = [coast, burn, {"coast_s": "free"}, dict(burn)]
        if k == 0:
            burn["exit_area_m2"] = float(draw.uniform(0.08, 0.16)) * thrust / 101325.0
            burn["vertical_rise_s"] = float(draw.uniform(3.0, 12.0))
            stage |= _air_limits(draw)
            if boosted:
                stage["boosters"] = [_booster(draw, total, thrust, time)]
        stages.append(stage | {"arcs": arcs})
        mass = total
    stages.reverse()
    for each in stages[0].get("boosters", ()):
        mass += each["count"] * (each["dry_mass_kg"] + each["propellant_kg"])
    stages[0]["payload"] = payload
    return stages, mass


def _solid(thrust: float, time: float) -> list[list[float]]:
    """Return a thrust table of the same impulse: progressive, regressive, tailing off."""
    shape = [[0.0, 0.9], [0.3, 1.12], [0.7, 1.05], [0.93, 0.8], [1.0, 0.0]]
    area = sum(0.5 * (b[1] + a[1]) * (b[0] - a[0]) for a, b in pairwise(shape))
    return [[t * time, level * thrust / area] for t, level in shape]


def _booster(
    draw: np.random.Generator, core: float, core_thrust: float, core_s: float
) -> dict[str, Any]:
    """Draw strap-on boosters of a core, by its mass, kg, thrust, N, and burn time, s."""
    count = int(draw.integers(2, 7))
    isp = float(draw.uniform(265.0, 310.0))
    time = float(min(core_s, 0.35 * isp) * draw.uniform(0.5, 0.95))
    weights = float(draw.uniform(1.4, 1.8))
    # propellant of all: so much that there are so many weights of thrust at lift-off
    per_kg = isp * G0 / time
    propellant = (weights * G0 * core - core_thrust) / (per_kg - 1.12 * weights * G0)
    return {
        "name": "boosters",
        "count": count,
        "dry_mass_kg": 0.12 * propellant / count,
        "propellant_kg": propellant / count,
        "thrust_n": per_kg * propellant / count,
        "burn_time_s": time,
        "exit_area_m2": 0.12 * per_kg * propellant / count / 101325.0,
    }
