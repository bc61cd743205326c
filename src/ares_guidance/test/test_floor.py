# SPDX-License-Identifier: Apache-2.0
"""Lowest altitude of a plan: by the samples, and along the coasts between them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ares_guidance.floor import check_floor, held_burns, lifted, lowest_coast
from ares_guidance.trajectory import OfflineTrajectory
from ares_models.arrays import COAST
from ares_models.mission import load_mission
from ares_models.orbits import Elements
from ares_models.tolerances import FLOOR_M
from ares_trials.testing.laws import RESTART

GROUND = 6.2e6
MU = 3.986004418e14


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    path = tmp_path_factory.mktemp("floor") / "mission.yaml"
    path.write_text(RESTART.format(burn="free", coast="free"))
    return load_mission(path)


def trajectory(orbit, length):
    """Return a burn, a coast and a burn, sampled only at the start of the coast."""
    begin, end = 300.0, 300.0 + length
    position, velocity = orbit.state(MU)
    none, no_vectors = np.zeros(0), np.zeros((0, 3))
    return OfflineTrajectory(
        jettison_time=math.nan,
        cutoff_time=end + 10.0,
        arc_start_time=none,
        arc_end_time=none,
        arc_start_mass=none,
        arc_end_mass=none,
        arc_delta_v=none,
        steering_reference_time=none,
        steering_direction=no_vectors,
        steering_direction_rate=no_vectors,
        primer_rate=no_vectors,
        sample_time=np.array([begin]),
        sample_position=position[None],
        sample_velocity=velocity[None],
        sample_mass=np.ones(1),
        sample_direction=np.array([[1.0, 0.0, 0.0]]),
        flown_arc=np.array([0, 1, 2, 3]),
        flown_start_time=np.array([0.0, 148.0, begin, end]),
        flown_end_time=np.array([148.0, begin, end, end + 10.0]),
    )


@pytest.mark.parametrize("eccentricity", [0.001, 0.3, 0.7])
@pytest.mark.parametrize("perigee", [6.1e6, 6.35e6])
def test_a_coast_is_as_low_as_its_perigee(mission, eccentricity, perigee):
    axis = perigee / (1.0 - eccentricity)
    orbit = Elements(axis, eccentricity, 0.5, 0.1, 0.2, true_anomaly=-2.0)
    period = 2.0 * math.pi * math.sqrt(axis**3 / MU)
    arrays = mission.arrays()
    assert arrays.arcs["kind"][2] == COAST
    whole = trajectory(orbit, period)
    assert lowest_coast(whole, arrays) == pytest.approx(perigee - GROUND, abs=0.01)
    # before the first ignition it is where the flight begins, which no plan can help
    unlit = mission.arrays()
    unlit.arcs["kind"][:2] = COAST
    assert lowest_coast(whole, unlit) == math.inf
    if perigee < GROUND:
        with pytest.raises(ValueError, match="arc 2, a coast, goes through the ground, 100,000 m"):
            check_floor(whole, arrays)
    else:
        check_floor(whole, arrays)


@pytest.mark.parametrize("above", [-11.0, -9.0, 4.0, 9.0, 11.0])
def test_a_coast_that_touches_the_ground_lifts_the_burn_before(mission, above):
    axis = (GROUND + above) / 0.7
    orbit = Elements(axis, 0.3, 0.5, 0.1, 0.2, true_anomaly=-2.0)
    whole = trajectory(orbit, 2.0 * math.pi * math.sqrt(axis**3 / MU))
    arrays = mission.arrays()
    if above < -FLOOR_M:
        with pytest.raises(ValueError, match="arc 2, a coast, goes through the ground, 11 m deep"):
            check_floor(whole, arrays)
    else:
        check_floor(whole, arrays)
    lifts = held_burns(whole, arrays)
    if abs(above) < FLOOR_M:
        lift = max(0.0, 0.5 * FLOOR_M - above)
        assert lifts == pytest.approx({1: lift}, abs=0.01)
    else:
        # the coast is long
        assert lifts == {1: 0.0}


def test_a_coast_that_ends_before_its_perigee_is_as_low_as_its_end(mission):
    orbit = Elements(6.9e6, 0.12, 0.5, 0.1, 0.2, true_anomaly=math.pi)
    position, velocity = orbit.state(MU)
    arrays = mission.arrays()

    def motion(_, state):
        r = state[:3]
        return np.concatenate([state[3:], -MU * r / np.linalg.norm(r) ** 3])

    flown = solve_ivp(
        motion, (0.0, 1000.0), np.concatenate([position, velocity]), rtol=1e-11, atol=1e-6
    )
    end = np.linalg.norm(flown.y[:3, -1])
    assert lowest_coast(trajectory(orbit, 1000.0), arrays) == pytest.approx(end - GROUND, abs=0.1)


@pytest.mark.trial
def test_the_oblate_earth_bends_a_coast(mission):
    """Over a day in a low orbit the effect of J2 on the perigee counts."""
    arrays = mission.arrays()
    arrays.environment["j2"] = 0.00108263
    orbit = Elements(6.6e6, 0.02, 1.1, 0.1, 0.2, true_anomaly=1.0)
    position, velocity = orbit.state(MU)

    def motion(_, state):
        r = state[:3]
        size = np.linalg.norm(r)
        k = 1.5 * 0.00108263 * MU * float(arrays.environment["equatorial_radius"][0]) ** 2
        z = 5.0 * (r[2] / size) ** 2
        pull = -MU * r / size**3 - k / size**5 * r * np.array([1 - z, 1 - z, 3 - z])
        return np.concatenate([state[3:], pull])

    length = 20_000.0
    flown = solve_ivp(
        motion,
        (0.0, length),
        np.concatenate([position, velocity]),
        rtol=1e-11,
        atol=1e-6,
        max_step=1.0,
    )
    lowest = np.min(np.linalg.norm(flown.y[:3], axis=0)) - GROUND
    found = lowest_coast(trajectory(orbit, length), arrays)
    assert found == pytest.approx(lowest, abs=50.0)
    arrays.environment["j2"] = 0.0
    assert abs(lowest_coast(trajectory(orbit, length), arrays) - lowest) > 500.0


def test_a_sample_below_the_ground(mission):
    arrays = mission.arrays()
    orbit = Elements(6.6e6, 0.0, 0.5, 0.1, 0.2, true_anomaly=0.0)
    good = trajectory(orbit, 100.0)
    check_floor(good, arrays)
    bad = replace(
        good,
        sample_time=np.array([200.0, 300.0]),
        sample_position=np.array([[6.19e6, 0.0, 0.0], good.sample_position[0]]),
        sample_velocity=np.array([[0.0, 7e3, 0.0], good.sample_velocity[0]]),
        sample_mass=np.ones(2),
        sample_direction=np.repeat(good.sample_direction, 2, axis=0),
    )
    with pytest.raises(ValueError, match="arc 1, a burn, goes through the ground, 10,000 m deep"):
        check_floor(bad, arrays)


@pytest.mark.parametrize(("length", "told"), [(6.0, False), (60.0, False), (61.0, True)])
def test_a_coast_between_stages_is_not_told(mission, length, told):
    orbit = Elements(6.6e6, 0.12, 0.5, 0.1, 0.2, true_anomaly=1.0)
    lowest = lowest_coast(trajectory(orbit, length), mission.arrays())
    assert math.isfinite(lowest) == told


def test_no_coast_no_lowest(mission):
    arrays = mission.arrays()
    orbit = Elements(6.6e6, 0.0, 0.5, 0.1, 0.2, true_anomaly=0.0)
    without = replace(trajectory(orbit, 100.0), sample_time=np.array([1e4]))
    assert lowest_coast(without, arrays) == math.inf


@pytest.mark.parametrize(("eccentricity", "begin"), [(0.0156, -0.92), (0.6, 0.1), (1.09, -0.04)])
def test_a_lifted_end_passes_through_the_next_ignition(eccentricity, begin):
    perigee = 6.46e6
    axis = perigee / (1.0 - eccentricity)
    planned = Elements(axis, eccentricity, 0.9, 4.8, 1.8, true_anomaly=begin)
    there, _ = replace(planned, true_anomaly=2.1).state(MU)
    higher = Elements.from_state(*lifted(*planned.state(MU), 6.0, there, MU), MU)
    assert higher.perigee_radius - perigee == pytest.approx(6.0, rel=1e-3)
    turned = replace(higher, true_anomaly=higher.true_anomaly + 2.1 - begin)
    assert turned.state(MU)[0] == pytest.approx(there, abs=0.01)


def test_an_end_whose_lowest_place_is_the_next_ignition_is_lifted_alone():
    planned = Elements(7.0e6, 0.05, 0.9, 4.8, 1.8, true_anomaly=math.pi - 1e-3)
    r, v = planned.state(MU)
    perigee, _ = replace(planned, true_anomaly=0.0).state(MU)
    higher, same = lifted(r, v, 6.0, perigee, MU)
    assert np.linalg.norm(higher) - np.linalg.norm(r) == pytest.approx(6.0)
    assert same == pytest.approx(v)
