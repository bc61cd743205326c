# SPDX-License-Identifier: Apache-2.0
"""Draw random vehicles and missions to test guidance laws that were made for none of them.

One to three stages of 0.4 to 2 g each at ignition, with or without coasts and fairing, from the
upper atmosphere to orbits of 180 to 800 km. Not all of them can reach their target.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ares_guidance.laws import check_law
from ares_models.mission import Mission
from ares_optimizer.solution import Check
from ares_optimizer.solve import solve
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_vehicle_sim.dispersions import Dispersions

MU = 3.986004418e14
G0 = 9.80665
EQUATORIAL_RADIUS = 6378137.0


def random_mission(seed: int) -> Mission:
    """Draw the mission of a seed, equal on every machine.

    Args:
        seed: not negative.
    """
    generator = np.random.default_rng(seed)
    target, initial_state, delta_v = _way(generator)
    count = int(generator.integers(1, 4))
    return _mission(
        f"random_{seed}", generator, target, initial_state, _stages(generator, delta_v, count)
    )


def random_coasting_mission(seed: int) -> Mission:
    """Draw three stages with one or two free coasts between them, some limited in length.

    Args:
        seed: not negative.
    """
    generator = np.random.default_rng(seed)
    target, initial_state, delta_v = _way(generator)
    stages = _stages(generator, delta_v, 3)
    before = [1, 2] if generator.random() < 0.5 else [int(generator.integers(1, 3))]
    for k in before:
        coast: dict[str, Any] = {"name": f"coast {k}", "coast_s": "free"}
        if generator.random() < 0.5:
            coast["max_s"] = generator.uniform(60.0, 900.0)
        stages[k]["arcs"].insert(0, coast)
    return _mission(f"random_coasting_{seed}", generator, target, initial_state, stages)


def _mission(
    name: str,
    generator: np.random.Generator,
    target: dict[str, Any],
    initial_state: dict[str, Any],
    stages: list[dict[str, Any]],
) -> Mission:
    """Assemble a mission from drawn parts, with a fairing in 60 % of cases."""
    jettisons = []
    if generator.random() < 0.6:
        fairing = stages[0]["ignition_mass_kg"] * generator.uniform(0.003, 0.012)
        jettisons.append(
            {"name": "fairing", "mass_kg": fairing, "stage": "s0", "heating_limit_w_m2": 1135.0}
        )
    return Mission.model_validate(
        {
            "name": name,
            "title": name.replace("_", " "),
            "source": "drawn, no rocket that was built",
            "environment": {
                "mu_m3_s2": MU,
                "earth": {
                    "equatorial_radius_m": EQUATORIAL_RADIUS,
                    "polar_radius_m": 6356752.3,
                    "rotation_rate_rad_s": 7.292115e-5,
                },
                "atmosphere": {"model": "us76"},
            },
            "initial_state": initial_state,
            "stages": stages,
            "jettisons": jettisons,
            "target": target,
        }
    )


def _way(generator: np.random.Generator) -> tuple[dict[str, Any], dict[str, Any], float]:
    """Draw target, start, and the delta-V of the vehicle, m/s."""
    highest = 800e3 if generator.random() < 0.6 else 350e3
    radius = EQUATORIAL_RADIUS + generator.uniform(180e3, highest)
    speed = math.sqrt(MU / radius)
    if generator.random() < 0.3:
        # an elliptical target, reached at perigee
        speed *= generator.uniform(1.0, 1.02)
    latitude = generator.uniform(-28.0, 28.0)
    azimuth = generator.uniform(0.0, 180.0)
    start_speed = generator.uniform(2300.0, 4900.0)
    # close to the plane of the start
    inclination = math.degrees(
        math.acos(math.cos(math.radians(latitude)) * math.sin(math.radians(azimuth)))
    )
    inclination = max(abs(latitude) + 0.05, inclination + generator.normal(0.0, 0.3))
    needed = speed - start_speed + generator.uniform(150.0, 900.0)
    target = {
        "radius_m": radius,
        "speed_m_s": speed,
        "flight_path_angle_deg": 0.0,
        "inclination_deg": inclination,
    }
    initial_state = {
        "time_s": 100.0,
        "latitude_deg": latitude,
        "right_ascension_deg": generator.uniform(0.0, 360.0),
        "radius_m": EQUATORIAL_RADIUS + generator.uniform(75e3, 145e3),
        "speed_m_s": start_speed,
        "flight_path_angle_deg": generator.uniform(4.0, 25.0),
        "azimuth_deg": azimuth,
    }
    return target, initial_state, needed * generator.uniform(1.05, 1.5)


def _stages(generator: np.random.Generator, delta_v: float, count: int) -> list[dict[str, Any]]:
    """Draw stages, first to last, that share a delta-V, m/s."""
    shares = generator.uniform(0.4, 1.0, count)
    gains = delta_v * shares / shares.sum()
    coasts = generator.random() < 0.5
    mass = math.exp(generator.uniform(math.log(800.0), math.log(30e3)))
    stages: list[dict[str, Any]] = []
    for k in reversed(range(count)):
        isp = generator.uniform(300.0, 460.0)
        empty = mass if k == count - 1 else mass * generator.uniform(1.05, 1.25)
        mass = empty * math.exp(gains[k] / (isp * G0))
        propellant = mass - empty
        thrust = generator.uniform(0.4, 2.0) * mass * G0
        burn: dict[str, Any] = {"thrust_n": thrust, "isp_s": isp, "burn_time_s": "free"}
        coast = {"coast_s": generator.uniform(2.0, 14.0)}
        arcs: list[dict[str, Any]] = [burn]
        if k < count - 1:
            burn["burn_time_s"] = 0.999 * propellant * isp * G0 / thrust
            arcs = [burn, coast] if coasts else [burn]
        elif count == 1 and coasts:
            arcs = [coast, burn]
        stages.append(
            {
                "name": f"s{k}",
                "ignition_mass_kg": mass,
                "propellant_kg": propellant,
                "arcs": arcs,
            }
        )
    return stages[::-1]


@dataclass(frozen=True)
class Solved:
    """Hold a mission with its optimum.

    Attributes:
        seed: of the mission.
        mission: the mission.
        optimum_kg: mass at cut-off of its optimum.
        spare_kg: propellant left in the optimum.
    """

    seed: int
    mission: Mission
    optimum_kg: float
    spare_kg: float


def solvable(seeds: range) -> Iterator[Solved]:
    """Yield the missions of some seeds that `indirect` solves.

    Args:
        seeds: of :func:`random_mission`.
    """
    for seed in seeds:
        mission = random_mission(seed)
        solution = solve(mission, "indirect")
        if solution.converged:
            burnt = next(c for c in solution.constraints if c.key is Check.PROPELLANT)
            yield Solved(seed, mission, solution.m_f_kg, burnt.limit - burnt.value)


def fly_as_planned(mission: Mission, law: str) -> Any:
    """Fly without dispersions and judge as a campaign does; return a record RESULT.

    Args:
        mission: to be flown.
        law: name of the guidance law.

    Raises:
        ValueError: the law cannot fly the mission.
        RuntimeError: the flight had an internal error.
    """
    check_law(law, mission.arrays(foreseen=True), mission.start().navigation())
    flown = FlightRange(Settings(mission, Dispersions(), law=law)).fly(0, 1)
    if flown.errors:
        raise RuntimeError(flown.errors[0])
    return flown.results[0]
