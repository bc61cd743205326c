# SPDX-License-Identifier: Apache-2.0
"""Wind over altitude: its table, its gradient, what refuses it, and the air speed with it."""

import math
from importlib import resources

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from ares_models.arrays import MAX_WIND_KNOTS
from ares_models.kernels import environment as kernels
from ares_models.mission import MissionError, load_mission, parse_mission
from ares_models.wind import FADE_M, together, wind_profile

TEXT = resources.files("ares_models").joinpath("missions", "delta_iii_pad.yaml").read_text()
KNOTS = [[0.0, 3.0, -2.0], [5e3, 18.0, 4.0], [12e3, 45.0, 5.0], [20e3, 8.0, 0.0], [3e4, 8.0, 1.0]]
AIR = load_mission("ares_v").arrays()


def record(knots=KNOTS, gust=(6.0, -7.0), length=400.0):
    environment = AIR.environment.copy()
    wind_profile(knots).write(environment["wind"][0])
    environment["wind"]["gust"] = gust
    environment["wind"]["gust_altitude"] = 11e3
    environment["wind"]["gust_length"] = length
    return environment[0]


def component(h, axis, environment):
    return kernels.wind_component(h, environment["wind"], axis)[0]


def with_table(table, more=""):
    return TEXT.replace("scale_height_m: 7200.0", f"scale_height_m: 7200.0\n    {table}{more}")


def place(height, latitude, longitude):
    level = 6378140.0 + height
    return (
        level * math.cos(latitude) * math.cos(longitude),
        level * math.cos(latitude) * math.sin(longitude),
        level * math.sin(latitude) * 0.9983,
    )


places = st.builds(
    place,
    st.floats(-2e3, 6e4),
    st.floats(-1.55, 1.55),
    st.floats(-math.pi, math.pi),
)


def test_the_wind_goes_through_its_knots_and_ends_beyond_them():
    environment = record(length=0.0)
    for height, *wanted in KNOTS:
        for axis in (0, 1):
            assert component(height, axis, environment) == pytest.approx(wanted[axis], abs=1e-12)
    assert component(-500.0, 0, environment) == 3.0
    assert component(3e4 + FADE_M, 0, environment) == component(2e5, 0, environment) == 0.0
    assert 0.0 < component(3e4 + 0.5 * FADE_M, 0, environment) < 8.0


def test_the_wind_is_monotone_and_has_no_kinks():
    environment = record(length=0.0)
    heights = np.array([row[0] for row in KNOTS] + [3e4 + FADE_M])
    slopes = PchipInterpolator(heights, [row[1] for row in KNOTS] + [0.0]).derivative()(heights)
    for k, height in enumerate(heights):
        inside = kernels.wind_component(height, environment["wind"], 0)[1]
        before = kernels.wind_component(height - 1e-3, environment["wind"], 0)[1]
        assert inside == pytest.approx(before, abs=1e-7)
        wanted = slopes[k] if 0 < k < len(heights) - 1 else 0.0
        assert inside == pytest.approx(wanted, abs=1e-12)
    climb = [component(h, 0, environment) for h in np.linspace(0.0, 12e3, 200)]
    assert np.all(np.diff(climb) >= 0.0)


def test_a_single_knot_holds_up_to_it():
    environment = record([[1e4, 20.0, -5.0]], length=0.0)
    assert component(0.0, 0, environment) == component(1e4, 0, environment) == 20.0
    assert component(2e4, 1, environment) == pytest.approx(-2.5)


def test_a_gust_is_one_minus_cosine():
    environment = record([[0.0, 0.0, 0.0]])
    for x, share in ((-200.0, 0.0), (-100.0, 0.5), (0.0, 1.0), (100.0, 0.5), (250.0, 0.0)):
        assert component(11e3 + x, 0, environment) == pytest.approx(6.0 * share, abs=1e-12)
        assert component(11e3 + x, 1, environment) == pytest.approx(-7.0 * share, abs=1e-12)


def test_east_and_north_are_level_and_turn_with_the_place():
    environment = record([[3e4, 10.0, 0.0]], length=0.0)
    r = place(0.0, 0.5, 1.2)
    assert kernels.wind_at(r, environment).velocity == pytest.approx(
        (-10.0 * math.sin(1.2), 10.0 * math.cos(1.2), 0.0)
    )
    north = record([[3e4, 0.0, 10.0]], length=0.0)
    up = np.array(kernels.altitude_gradient(r, north))
    velocity = np.array(kernels.wind_at(r, north).velocity)
    assert np.linalg.norm(velocity) == pytest.approx(10.0)
    assert velocity[2] > 0.0
    assert velocity @ up == pytest.approx(0.0, abs=1e-4)
    assert kernels.wind_at((0.0, 0.0, 6.4e6), north).velocity == (0.0, 0.0, 0.0)


@given(places)
def test_the_gradient_of_the_wind_is_that_of_its_velocity(r):
    environment = record(length=4000.0)
    wind = kernels.wind_at(r, environment)
    for k, found in enumerate((wind.by_x, wind.by_y, wind.by_z)):
        step = 0.1 * np.eye(3)[k]
        ahead = np.array(kernels.wind_at(tuple(r + step), environment).velocity)
        behind = np.array(kernels.wind_at(tuple(r - step), environment).velocity)
        # beside a knot the curvature jumps
        assert np.allclose(found, (ahead - behind) / 0.2, rtol=0.0, atol=1e-6)


@given(places)
def test_the_gradient_of_heating_knows_the_wind(r):
    environment = record(length=4000.0)
    v = (1200.0, -700.0, 400.0)
    _, by_position, by_velocity = kernels.log_heating_gradient(r, v, environment, AIR.atmosphere)

    def heating(dr, dv):
        moved = tuple(np.add(r, dr)), tuple(np.add(v, dv))
        return math.log(kernels.heating_rate(*moved, environment, AIR.atmosphere))

    for k, step in enumerate(np.eye(3)):
        slope = 0.5 * (heating(step, (0, 0, 0)) - heating(-step, (0, 0, 0)))
        assert by_position[k] == pytest.approx(slope, rel=1e-4, abs=1e-8)
        slope = 0.5 * (heating((0, 0, 0), step) - heating((0, 0, 0), -step))
        assert by_velocity[k] == pytest.approx(slope, rel=1e-4, abs=1e-7)


def test_two_winds_by_the_knots_of_both_are_what_they_were():
    one, other = wind_profile(KNOTS), wind_profile([[0.0, 1.0, 1.0], [7e3, -4.0, 2.0]])
    for before, after in zip((one, other), together((one, other)), strict=True):
        old, new = (AIR.environment["wind"].copy() for _ in range(2))
        before.write(old[0])
        after.write(new[0])
        for h in np.linspace(-1e3, 6e4, 123):
            for axis in (0, 1):
                wanted = kernels.wind_component(h, old[0], axis)
                assert kernels.wind_component(h, new[0], axis) == pytest.approx(wanted, abs=1e-12)


def test_knots_of_two_winds_that_are_nearly_the_same_are_one():
    near = [[1e-320, 1.0, 1.0], [5e3, 2.0, 2.0]]
    one, other = together((wind_profile(KNOTS), wind_profile(near)))
    assert one.altitude.tolist() == other.altitude.tolist()
    assert np.diff(one.altitude).min() > 1.0
    assert np.isfinite(other.cubic).all()


def test_a_mission_without_wind_is_calm():
    environment = AIR.environment[0]
    r, v = (6.5e6, 1e5, 1e6), (100.0, 7000.0, 200.0)
    relative = kernels.relative_velocity(r, v, environment)
    assert kernels.air_velocity(r, v, environment) == relative
    windy = parse_mission(with_table(f"wind_table: {KNOTS}"), "windy.yaml").environment_array()[0]
    east = (0.0, float(windy["equatorial_radius"]) + 12e3, 0.0)
    difference = np.subtract(
        kernels.relative_velocity(east, v, windy), kernels.air_velocity(east, v, windy)
    )
    assert difference == pytest.approx([-45.0, 0.0, 5.0], abs=1e-9)


@pytest.mark.parametrize(
    ("table", "line"),
    [
        (
            "[[0.0, 1.0, 1.0], [0.0, 2.0, 2.0]]",
            "wind_table[1][0] is 0.0; expected an altitude of at least 1",
        ),
        ("[[0.0, 1.0, 301.0]]", "wind_table[0][2] is 301.0; expected a number from -200 to 200"),
        ("[[70e3, 1.0, 1.0]]", "wind_table[0][0] is 70000.0; expected a number from -1000 to 6"),
        ("[]", "wind_table is an empty list; expected a list of at least 1"),
        ("[[0.0, 1.0]]", "wind_table[0]"),
        ("12.0", "wind_table is 12.0; expected a list"),
        (
            str([[1e3 * k, 1.0, 1.0] for k in range(MAX_WIND_KNOTS + 1)]),
            f"at most {MAX_WIND_KNOTS}",
        ),
    ],
)
def test_a_bad_table_is_refused_in_one_line(table, line):
    with pytest.raises(MissionError) as caught:
        parse_mission(with_table(f"wind_table: {table}"), "windy.yaml")
    text = str(caught.value)
    assert "\n" not in text
    assert line in text
    assert "environment.atmosphere.wind_table" in text


def test_where_there_is_no_air_there_is_no_wind():
    text = with_table(f"wind_table: {KNOTS}")
    text = text.replace("model: exponential", "model: none")
    for key in ("surface_density_kg_m3: 1.225", "scale_height_m: 7200.0"):
        text = text.replace(key, "")
    with pytest.raises(MissionError, match=r"wind_table is.*because model is none"):
        parse_mission(text, "windy.yaml")
