# SPDX-License-Identifier: Apache-2.0
"""Axes: orthonormal, right-handed, and back again."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ares_models import frames
from ares_models.earth import Earth, LaunchAngles
from ares_models.kernels.states import angles_from_state, state_from_angles

latitudes = st.floats(-math.pi / 2, math.pi / 2)
angles = st.floats(-math.pi, math.pi)
EARTH = Earth(6378140.0, 6356750.0, 7.2921159e-5)


def assert_rotation(matrix):
    assert np.allclose(matrix.T @ matrix, np.eye(3), atol=1e-14)
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=1e-13)
    assert np.allclose(frames.inverse(matrix) @ matrix, np.eye(3), atol=1e-14)


@given(latitudes, angles)
def test_east_north_up(latitude, right_ascension):
    matrix = frames.inertial_from_east_north_up(latitude, right_ascension)
    assert_rotation(matrix)
    assert matrix[2, 0] == 0.0
    assert matrix[2, 1] >= 0.0


@given(st.floats(-1e4, 1e4), angles)
def test_earth_fixed_axes(time, at_zero):
    matrix = frames.earth_fixed_from_inertial(time, 7.2921159e-5, at_zero)
    assert_rotation(matrix)
    assert np.allclose(matrix @ [0.0, 0.0, 1.0], [0.0, 0.0, 1.0])


def test_earth_fixed_axes_are_inertial_at_time_zero():
    assert np.array_equal(frames.earth_fixed_from_inertial(0.0, 7.2921159e-5), np.eye(3))


@given(
    st.floats(-1.57, 1.57), st.floats(-3.14, 3.14), st.floats(6e6, 1e8), st.floats(0.0, 1e5), angles
)
def test_latitude_and_longitude_there_and_back(latitude, longitude, radius, time, at_zero):
    earth = replace(EARTH, angle_at_zero=at_zero)
    position = earth.position(latitude, longitude, radius, time)
    again = earth.latitude_longitude(position, time)
    assert again[0] == pytest.approx(latitude, abs=1e-12)
    assert math.remainder(again[1] - longitude, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-11)


@given(st.floats(-1.57, 1.57))
def test_geodetic_latitude_there_and_back(latitude):
    geodetic = EARTH.geodetic_latitude(latitude)
    assert EARTH.geocentric_latitude(geodetic) == pytest.approx(latitude, abs=1e-14)
    assert abs(geodetic) >= abs(latitude) - 1e-15


def test_flattening():
    assert EARTH.flattening == pytest.approx(1.0 / 298.18, rel=1e-4)


@given(
    st.floats(6e6, 1e8),
    st.floats(-1.57, 1.57),
    st.floats(-3.14, 3.14),
    st.floats(1.0, 1e4),
    st.floats(-1.57, 1.57),
    st.floats(-3.14, 3.14),
)
def test_state_from_angles_there_and_back(
    radius, latitude, right_ascension, speed, flight_path_angle, azimuth
):
    given_angles = (radius, latitude, right_ascension, speed, flight_path_angle, azimuth)
    r, v = state_from_angles(*given_angles)
    r2, v2 = state_from_angles(*angles_from_state(r, v))
    assert np.allclose(r2, r, rtol=0.0, atol=1e-8 * 10.0)
    assert np.allclose(v2, v, rtol=0.0, atol=1e-9)
    assert math.hypot(*v) == pytest.approx(speed, rel=1e-14)


def test_printed_initial_state_of_the_thesis():
    """Vectors 2.17 and 2.19; printed: flight-path angle 10.6 deg, which they do not have."""
    r = (-5255758.0, -2044694.0, 3058330.0)
    v = (413.927, -1839.599, 202.55)
    launch = LaunchAngles.from_state(r, v)
    assert launch.radius == pytest.approx(6415383.7, abs=0.05)
    assert launch.speed == pytest.approx(1896.4405, abs=1e-4)
    assert math.degrees(launch.flight_path_angle) == pytest.approx(10.4436, abs=5e-5)
    again = launch.state()
    assert np.allclose(again[0], r, rtol=0.0, atol=1e-7)
    assert np.allclose(again[1], v, rtol=0.0, atol=1e-11)


def test_azimuth_is_from_north_to_east():
    east = LaunchAngles(7e6, 0.0, 0.0, 100.0, 0.0, math.pi / 2).state()[1]
    assert np.allclose(east, [0.0, 100.0, 0.0], atol=1e-12)
    north = LaunchAngles(7e6, 0.0, 0.0, 100.0, 0.0, 0.0).state()[1]
    assert np.allclose(north, [0.0, 0.0, 100.0], atol=1e-12)
