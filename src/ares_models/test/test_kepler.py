# SPDX-License-Identifier: Apache-2.0
"""Closed-form propagation against constants of the motion, its inverse and an integrator."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from ares_models.kernels.kepler import _further, kepler, universal_functions
from ares_models.orbits import Elements

MU = 3.986e14

radii = st.floats(6.4e6, 6e7)
unit_angles = st.floats(-math.pi, math.pi)
# radial direction kept off the vertical, where the orbit is a line through the centre
flight_path_angles = st.floats(math.radians(-85.0), math.radians(85.0))
times = st.floats(-2e5, 2e5)
# speed over escape speed: ellipse, parabola within rounding and more, hyperbola
speed_ratios = st.one_of(
    st.floats(0.2, 0.999),
    st.floats(-16.0, -3.0).flatmap(
        lambda power: st.sampled_from([1.0 - 10.0**power, 1.0, 1.0 + 10.0**power])
    ),
    st.floats(1.001, 4.0),
)


def make_state(radius, angle, flight_path_angle, ratio):
    speed = ratio * math.sqrt(2.0 * MU / radius)
    up = np.array([math.cos(angle), math.sin(angle) * 0.6, math.sin(angle) * 0.8])
    ahead = np.array([-math.sin(angle), math.cos(angle) * 0.6, math.cos(angle) * 0.8])
    r = radius * up
    v = speed * (math.sin(flight_path_angle) * up + math.cos(flight_path_angle) * ahead)
    return tuple(map(float, r)), tuple(map(float, v))


states = st.builds(make_state, radii, unit_angles, flight_path_angles, speed_ratios)


def energy_and_momentum(r, v):
    return 0.5 * np.dot(v, v) - MU / np.linalg.norm(r), np.cross(r, v)


@given(states, times)
def test_energy_and_angular_momentum_are_conserved(state, dt):
    r, v = state
    r1, v1 = kepler(r, v, dt, MU)
    e0, h0 = energy_and_momentum(r, v)
    e1, h1 = energy_and_momentum(r1, v1)
    kinetic = max(np.dot(v, v), np.dot(v1, v1))
    assert abs(e1 - e0) <= 1e-11 * kinetic
    assert np.linalg.norm(h1 - h0) <= 1e-11 * np.linalg.norm(r1) * np.linalg.norm(v1)


# the last step, a series, is not small beside a hyperbola that turns fast
@example(make_state(9750212.0, 0.0, 1.25, 2.0), -2360.0)
@given(states, st.floats(-3e3, 3e3))
def test_forward_and_back_is_where_it_began(state, dt):
    r, v = state
    r2, v2 = kepler(*kepler(r, v, dt, MU), -dt, MU)
    # a pass close to the centre magnifies rounding by speed over the least distance
    h = np.linalg.norm(np.cross(r, v))
    nearest = h * h / MU / 2.0
    tolerance = 1e-13 * (1.0 + (np.linalg.norm(r) / nearest) ** 2)
    assert np.allclose(r2, r, rtol=0.0, atol=tolerance * (np.linalg.norm(r) + 3e3 * norm(v)))
    assert np.allclose(v2, v, rtol=0.0, atol=tolerance * max(norm(v), norm(v2)) * 10.0)


def norm(x):
    return float(np.linalg.norm(x))


@given(states, st.floats(0.0, 1e3), st.floats(0.0, 1e3))
def test_two_steps_are_one(state, first, second):
    r, v = state
    in_two = kepler(*kepler(r, v, first, MU), second, MU)
    in_one = kepler(r, v, first + second, MU)
    h = np.linalg.norm(np.cross(r, v))
    strain = 1.0 + (norm(r) / (h * h / MU / 2.0)) ** 2
    assert np.allclose(in_two[0], in_one[0], rtol=0.0, atol=1e-13 * strain * (norm(r) + 1e7))


@pytest.mark.parametrize("ratio", [0.3, 0.7, 0.9999, 1.0, 1.0001, 1.5])
@pytest.mark.parametrize("dt", [-700.0, 1.0, 430.0, 5000.0])
def test_agrees_with_an_integrator(ratio, dt):
    r, v = make_state(6.6e6, 0.4, math.radians(20.0), ratio)
    if ratio < 0.5 and dt > 1e3:
        dt = 600.0  # falls to the centre later

    def motion(_, y):
        return np.concatenate([y[3:], -MU * y[:3] / np.linalg.norm(y[:3]) ** 3])

    end = solve_ivp(motion, (0.0, dt), np.array(r + v), method="DOP853", rtol=3e-14, atol=1e-7).y[
        :, -1
    ]
    r1, v1 = kepler(r, v, dt, MU)
    assert np.allclose(r1, end[:3], rtol=0.0, atol=1e-12 * norm(end[:3]) * 10.0)
    assert np.allclose(v1, end[3:], rtol=0.0, atol=1e-12 * norm(end[3:]) * 10.0)


@pytest.mark.parametrize("eccentricity", [0.0, 0.1, 0.9, 0.9999, 1.0001, 1.5, 20.0])
def test_relative_accuracy_from_perigee(eccentricity):
    """Compare with Kepler's equation solved explicitly, from anomaly to time."""
    perigee = 6.6e6
    a = perigee / (1.0 - eccentricity) if eccentricity != 1.0 else math.inf
    start = Elements(a, eccentricity, 0.5, 1.0, 2.0, 0.0).state(MU)
    anomaly = 0.8
    if eccentricity < 1.0:
        root = math.sqrt((1.0 - eccentricity) / (1.0 + eccentricity))
        big_e = 2.0 * math.atan(root * math.tan(0.5 * anomaly))
        # E - e sin E without cancellation
        lag = (1.0 - eccentricity) * math.sin(big_e) + (big_e - math.sin(big_e))
        dt = lag * math.sqrt(a**3 / MU)
    else:
        root = math.sqrt((eccentricity - 1.0) / (1.0 + eccentricity))
        big_f = 2.0 * math.atanh(root * math.tan(0.5 * anomaly))
        lag = (eccentricity - 1.0) * math.sinh(big_f) + (math.sinh(big_f) - big_f)
        dt = lag * math.sqrt((-a) ** 3 / MU)
    expected = Elements(a, eccentricity, 0.5, 1.0, 2.0, anomaly).state(MU)
    r, v = kepler(tuple(map(float, start[0])), tuple(map(float, start[1])), dt, MU)
    # near the parabola the test's own lag loses digits, not the kernel
    tolerance = 1e-12 if abs(eccentricity - 1.0) > 0.01 else 1e-9
    assert norm(expected[0] - r) <= tolerance * norm(r)
    assert norm(expected[1] - v) <= tolerance * norm(v)


def test_no_time_changes_nothing():
    r, v = make_state(7e6, 1.0, 0.3, 0.8)
    assert kepler(r, v, 0.0, MU) == (r, v)


def test_whole_revolutions_come_back():
    r, v = make_state(7e6, 1.0, 0.3, 0.75)
    alpha = 2.0 / norm(r) - np.dot(v, v) / MU
    period = 2.0 * math.pi / math.sqrt(MU * alpha**3)
    for turns in (1, 5, -3, 1000):
        r1, v1 = kepler(r, v, turns * period, MU)
        assert np.allclose(r1, r, rtol=0.0, atol=1e-12 * abs(turns) * norm(r) * 10.0)
        assert np.allclose(v1, v, rtol=0.0, atol=1e-12 * abs(turns) * norm(v) * 10.0)


@pytest.mark.parametrize("place", range(7))
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite_ends_and_gives_no_number(place, bad):
    values = [7e6, 1e5, 2e5, 100.0, 7e3, 50.0, 300.0]
    values[place] = bad
    r, v = kepler(tuple(values[:3]), tuple(values[3:6]), values[6], MU)
    assert not all(math.isfinite(x) for x in (*r, *v))


@given(st.floats(-50.0, 50.0), st.floats(-2.0, 2.0))
def test_universal_functions_hold_their_identities(anomaly, alpha):
    u0, u1, u2, u3 = universal_functions(anomaly, alpha)
    size = max(1.0, abs(u0), abs(alpha * u2))
    assert abs(u0 + alpha * u2 - 1.0) <= 1e-12 * size
    assert abs(u1 + alpha * u3 - anomaly) <= 1e-12 * max(1.0, abs(u1), abs(anomaly))
    assert abs(u0 * u0 + alpha * u1 * u1 - 1.0) <= 1e-11 * size * size


@pytest.mark.parametrize("z", [0.999999, 1.000001, -0.999999, -1.000001])
def test_universal_functions_meet_where_series_ends(z):
    below = universal_functions(1.0, z * (1.0 - 1e-9))
    above = universal_functions(1.0, z * (1.0 + 1e-9))
    assert np.allclose(below, above, rtol=3e-9)


@given(st.floats(1.0, 50.0), st.floats(-0.01, 0.01), st.floats(-5e-3, 5e-3))
def test_a_short_step_further_is_as_from_the_beginning(anomaly, alpha, part):
    step = part * anomaly
    further = _further(universal_functions(anomaly, alpha), step, alpha)
    expected = universal_functions(anomaly + step, alpha)
    # U0 and U1 pass through zero
    sizes = np.maximum(np.abs(expected), [1.0, anomaly, 0.0, 0.0])
    assert np.all(np.abs(np.subtract(further, expected)) <= 1e-13 * sizes)
