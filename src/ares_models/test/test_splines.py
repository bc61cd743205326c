# SPDX-License-Identifier: Apache-2.0
"""The splines of the atmospheres beside SciPy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, PchipInterpolator

from ares_models.splines import monotone_slopes, spline_slopes

steps = st.floats(0.1, 2.0)
# whole numbers: some neighbours are equal, some points are turning points
values = st.integers(-5, 5).map(float)


@st.composite
def data(draw, least):
    size = draw(st.integers(least, 12))
    x = np.cumsum(draw(st.lists(steps, min_size=size, max_size=size)))
    return x, np.array(draw(st.lists(values, min_size=size, max_size=size)))


@given(data(3))
def test_the_monotone_slopes_are_those_of_scipy(points):
    x, y = points
    expected = PchipInterpolator(x, y).derivative()(x)
    assert monotone_slopes(x, y) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@given(data(4))
def test_the_slopes_of_the_spline_are_those_of_scipy(points):
    x, y = points
    assert spline_slopes(x, y) == pytest.approx(CubicSpline(x, y)(x, 1), rel=1e-10, abs=1e-10)


def test_several_profiles_at_once_are_as_one_by_one():
    x = np.array([0.0, 1.0, 2.5, 3.0, 5.0])
    profiles = np.array([[0.0, 1.0, 1.0, -2.0, 3.0], [5.0, 4.0, 2.0, 1.0, 0.5]])
    together = monotone_slopes(x, profiles)
    assert np.array_equal(together, [monotone_slopes(x, profile) for profile in profiles])
