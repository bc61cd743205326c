# SPDX-License-Identifier: Apache-2.0
"""Elements and back, circular, equatorial, retrograde and hyperbolic too."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ares_models.kernels.kepler import kepler
from ares_models.orbits import Elements, Insertion

MU = 3.986e14
R = np.array([-5255758.0, -2044694.0, 3058330.0])
V = np.array([413.927, -1839.599, 202.55])

turns = st.floats(0.0, 6.28)
inclinations = st.one_of(
    st.sampled_from([0.0, 1e-12, 1e-7, math.pi / 2, math.pi - 1e-7, math.pi]),
    st.floats(0.0, math.pi),
)
ellipses = st.builds(
    Elements,
    st.floats(6.6e6, 1e9),
    st.one_of(st.sampled_from([0.0, 1e-15, 1e-12, 1e-8]), st.floats(0.0, 0.98)),
    inclinations,
    turns,
    turns,
    st.floats(-3.14, 3.14),
)
hyperbolas = st.builds(
    lambda e, a, *angles: Elements(-a, e, *angles),
    st.floats(1.02, 10.0),
    st.floats(6.6e6, 1e9),
    inclinations,
    turns,
    turns,
    st.floats(-1.5, 1.5),
)


@given(st.one_of(ellipses, hyperbolas))
def test_state_to_elements_and_back(elements):
    r, v = elements.state(MU)
    again = Elements.from_state(r, v, MU)
    r2, v2 = again.state(MU)
    # 1 - e^2 from e, and the radius near apogee, magnify rounding
    strain = 1e-13 / abs(1.0 - elements.eccentricity) ** 2
    assert np.linalg.norm(r2 - r) <= strain * np.linalg.norm(r)
    assert np.linalg.norm(v2 - v) <= strain * np.linalg.norm(v)
    assert again.semi_major_axis == pytest.approx(
        elements.semi_major_axis, rel=1e-12 / abs(1.0 - elements.eccentricity)
    )
    assert again.inclination == pytest.approx(elements.inclination, abs=1e-7)
    assert again.eccentricity == pytest.approx(elements.eccentricity, abs=1e-12)


@given(
    st.builds(
        Elements,
        st.floats(6.6e6, 1e8),
        st.floats(0.01, 0.9),
        st.floats(0.01, 3.13),
        st.floats(0.01, 6.27),
        st.floats(0.01, 6.27),
        st.floats(-3.0, 3.0),
    )
)
def test_every_angle_comes_back_where_it_means_something(elements):
    again = Elements.from_state(*elements.state(MU), MU)
    for name in ("ascending_node", "argument_of_perigee", "true_anomaly"):
        off = math.remainder(getattr(again, name) - getattr(elements, name), 2.0 * math.pi)
        assert off == pytest.approx(0.0, abs=1e-9), name


@given(st.one_of(ellipses, hyperbolas), st.floats(-3e3, 3e3))
def test_elements_stay_along_the_orbit(elements, dt):
    r, v = elements.state(MU)
    r1, v1 = kepler(tuple(map(float, r)), tuple(map(float, v)), dt, MU)
    later = Elements.from_state(r1, v1, MU)
    loss = 1e-11 / abs(1.0 - elements.eccentricity)
    assert later.semi_major_axis == pytest.approx(elements.semi_major_axis, rel=loss)
    assert later.eccentricity == pytest.approx(elements.eccentricity, abs=1e-10)
    assert later.inclination == pytest.approx(elements.inclination, abs=1e-7)


def test_circular_equatorial_orbit_takes_the_conventions():
    speed = math.sqrt(MU / 7e6)
    orbit = Elements.from_state([0.0, 7e6, 0.0], [-speed, 0.0, 0.0], MU)
    assert orbit.ascending_node == 0.0
    assert orbit.inclination == 0.0
    assert orbit.eccentricity < 1e-15
    assert orbit.argument_of_perigee + orbit.true_anomaly == pytest.approx(math.pi / 2)
    backwards = Elements.from_state([0.0, 7e6, 0.0], [speed, 0.0, 0.0], MU)
    assert backwards.inclination == math.pi


def test_radii():
    orbit = Elements(7e6, 0.1, 0.0, 0.0, 0.0, 0.0)
    assert orbit.perigee_radius == pytest.approx(6.3e6)
    assert orbit.apogee_radius == pytest.approx(7.7e6)
    assert Elements(-7e6, 1.5, 0.0, 0.0, 0.0, 0.0).apogee_radius == math.inf


@pytest.mark.parametrize(
    ("position", "velocity"),
    [
        ([7e6, 0.0, 0.0], [1e3, 0.0, 0.0]),
        ([0.0, 0.0, 0.0], [1e3, 0.0, 0.0]),
        ([math.nan, 0.0, 0.0], [1e3, 1.0, 0.0]),
    ],
)
def test_no_elements_without_an_orbit(position, velocity):
    with pytest.raises(ValueError, match="expected a finite elliptic or hyperbolic state"):
        Elements.from_state(position, velocity, MU)


@pytest.mark.parametrize(
    "elements",
    [
        Elements(7e6, 1.5, 0.0, 0.0, 0.0, 0.0),
        Elements(-7e6, 0.5, 0.0, 0.0, 0.0, 0.0),
        Elements(-7e6, 1.5, 0.0, 0.0, 0.0, 3.0),
        Elements(math.nan, 0.5, 0.0, 0.0, 0.0, 0.0),
    ],
)
def test_no_state_from_elements_that_are_none(elements):
    with pytest.raises(ValueError, match="expected a > 0 with e < 1"):
        elements.state(MU)


def test_initial_state_of_the_thesis():
    """Recomputed from vectors 2.17 and 2.19."""
    start = Insertion.from_state(R, V)
    assert start.radius == pytest.approx(6415383.7, abs=0.05)
    assert start.speed == pytest.approx(1896.4405, abs=1e-4)
    assert math.degrees(start.flight_path_angle) == pytest.approx(10.4436, abs=5e-5)
    assert math.degrees(start.inclination) == pytest.approx(28.5007, abs=5e-5)
    orbit = Elements.from_state(R, V, MU)
    assert orbit.inclination == pytest.approx(start.inclination, abs=1e-14)
    assert orbit.ascending_node == pytest.approx(start.ascending_node, abs=1e-14)
