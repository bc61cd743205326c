# SPDX-License-Identifier: Apache-2.0
"""Check the proofs that a target is out of reach against flights that reach it."""

import math
import re
import time
from pathlib import Path

import numpy as np
import pytest

from ares_models.arrays import MissionArrays
from ares_models.kernels.kepler import kepler
from ares_models.mission import MISSION, load_mission
from ares_optimizer.out_of_reach import ideal_delta_v, out_of_reach, strongest
from ares_optimizer.solution import Status
from ares_optimizer.solve import solve
from ares_trials.testing.samples import one_in

MISSIONS = Path(__file__).parent / "missions"
LAUNCHERS = Path(__file__).parents[3] / "benchmarks" / "launchers"
#: Flights whose stages, jettisons, tables, floors and bodies differ.
FLOWN = ("ares_v", "apollo11_ascent", "ariane5_eca", "soyuz_fregat", "ares_v_transients")


def arrays_of(name: str) -> tuple[MissionArrays, np.ndarray]:
    mission = load_mission(name)
    return mission.arrays(), mission.start().navigation()


def weakened(arrays: MissionArrays, share: float) -> MissionArrays:
    """Return the mission with a share of its thrust, at the same exhaust velocity."""
    arcs = arrays.arcs.copy()
    arcs["thrust"] *= share
    arcs["mass_flow"] *= share
    return arrays._replace(arcs=arcs)


def test_no_mission_that_is_flown_is_called_out_of_reach() -> None:
    files = [*LAUNCHERS.glob("*.yaml"), *MISSIONS.glob("*.yaml")]
    for path in (*MISSION.shipped(), *files):
        assert out_of_reach(*arrays_of(str(path))) == "", path


@pytest.mark.parametrize("name", one_in(3, FLOWN))
def test_both_bounds_hold_along_the_best_flight(name: str) -> None:
    arrays, start = arrays_of(name)
    track = solve(arrays, "auto", state=start).trajectory
    assert track is not None
    environment, state = arrays.environment[0], start[0]
    mu, j2 = float(environment["mu"]), float(environment["j2"])
    times = track.time_s - float(state["time"])
    radii = np.linalg.norm(track.position, axis=1)
    ground = float(environment["polar_radius"])
    squared = (track.velocity**2).sum(axis=1) + 2.0 * mu * (1.0 / ground - 1.0 / radii)
    gained = np.sqrt(squared) - math.sqrt(squared[0])
    most = strongest(arrays, state, times)
    # the bounds are for a round body, or for its oblateness apart
    assert (gained <= most * times + 0.1 + (50.0 if j2 else 0.0)).all()
    ideal = ideal_delta_v(arrays, state)
    assert gained.max() < ideal < 4.0 * gained.max()
    low = 0.9 * ground
    growth = math.sqrt(2.0 * mu / low**3)
    away = (most + 0.03 * bool(j2)) * (np.cosh(growth * times) - 1.0) / growth**2
    for t, r, off in zip(times, track.position, away, strict=True):
        there, _ = kepler(tuple(state["position"]), tuple(state["velocity"]), float(t), mu)
        if np.linalg.norm(there) - off < low:
            break
        assert np.linalg.norm(r - there) <= off + 1.0


@pytest.mark.parametrize("name", FLOWN)
def test_thrust_in_kn_is_answered_at_once(name: str) -> None:
    arrays, start = arrays_of(name)
    solve(load_mission("ares_v"), "auto", time_limit_s=0.0)
    began = time.process_time()
    solution = solve(weakened(arrays, 1e-3), "auto", state=start)
    assert solution.status is Status.INFEASIBLE
    assert solution.reason.startswith("every flight meets the ground within ")
    assert time.process_time() - began < 2.0


def test_too_little_propellant_is_told_before_a_search_if_it_is_far_too_little() -> None:
    arrays, start = arrays_of("delta_iii")
    # the best flight of 23,464 kg ends with 7,529.7 kg
    needed = 23_464.0 - 7_529.7
    claimed = []
    for share in np.linspace(0.5, 1.05, 111):
        arcs = arrays.arcs.copy()
        arcs["propellant"] = share * needed
        if out_of_reach(arrays._replace(arcs=arcs), start):
            claimed.append(share)
    assert 0.9 < max(claimed) < 1.0
    arcs["propellant"] = 0.8 * needed
    solution = solve(arrays._replace(arcs=arcs), "auto", state=start)
    assert solution.status is Status.INFEASIBLE
    assert re.fullmatch(
        r"all propellant gives a delta-V of at most [\d,]+ m/s; the energy of the target takes at "
        r"least [\d,]+ m/s, without any losses",
        solution.reason,
    )


def test_an_upper_stage_in_orbit_is_weak_and_not_out_of_reach() -> None:
    arrays, start = arrays_of("geostationary_burn")
    assert out_of_reach(weakened(arrays, 1e-2), start) == ""


def test_a_pad_at_sea_level_of_a_sphere_is_not_below_the_ground() -> None:
    # rounding puts a share of them 1e-9 m below it
    mission = load_mission("delta_iii_pad")
    arrays, start = mission.arrays(), mission.start().navigation()
    radius = float(arrays.environment["equatorial_radius"][0])
    arrays.environment["polar_radius"] = radius
    for latitude in np.radians(np.linspace(-65.0, 65.0, 200)):
        up = np.array([math.cos(latitude), 0.0, math.sin(latitude)])
        start["position"] = radius * up
        start["velocity"] = np.cross(
            [0.0, 0.0, float(arrays.environment["rotation_rate"][0])], radius * up
        )
        assert out_of_reach(arrays, start) == ""
