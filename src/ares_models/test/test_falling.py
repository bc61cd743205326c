# SPDX-License-Identifier: Apache-2.0
"""Falls through the air, against another integrator with equations of its own."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from ares_models.impacts import find_impact
from ares_models.kernels.environment import altitude
from ares_models.kernels.falling import come_down
from ares_models.mission import Mission, load_mission
from ares_models.wind import wind_profile

Array = NDArray[np.float64]

WIND = [[0.0, 3.0, -2.0], [9000.0, 30.0, 10.0], [20000.0, 5.0, 5.0]]
#: Speed (m/s), flight-path angle (deg) and altitude (m) at the separation, kg/m2.
CASES = {
    "first stage": (2500.0, 25.0, 70e3, 400.0),
    "booster": (900.0, 50.0, 30e3, 180.0),
    "fairing": (4000.0, 8.0, 115e3, 20.0),
    "dense": (2500.0, 25.0, 70e3, 1e5),
}


def windy() -> Mission:
    """Return a mission on an ellipsoid with J2, US76 and a wind."""
    shipped = load_mission("falcon9_leo_pad").model_dump(mode="json", exclude_unset=True)
    shipped["environment"]["atmosphere"]["wind_table"] = WIND
    return Mission.model_validate(shipped)


def state(speed: float, angle_deg: float, height: float) -> tuple[Array, Array]:
    """Return an inertial state over 28 deg north, flying north-east, in the turning frame."""
    latitude, azimuth, angle = np.radians([28.0, 60.0, angle_deg])
    up = np.array([np.cos(latitude), 0.0, np.sin(latitude)])
    north = np.array([-np.sin(latitude), 0.0, np.cos(latitude)])
    east = np.array([0.0, 1.0, 0.0])
    r = (6373.2e3 + height) * up
    level = np.cos(azimuth) * north + np.sin(azimuth) * east
    over_ground = speed * (np.sin(angle) * up + np.cos(angle) * level)
    return r, over_ground + np.cross([0.0, 0.0, 7.292115e-5], r)


def reference(mission: Mission, r: Array, v: Array, beta: float) -> tuple[float, Array, Array]:
    """Fall by DOP853 in Earth-fixed axes: gravity, Coriolis, centrifugal force and drag."""
    part = mission.environment
    omega = np.array([0.0, 0.0, part.earth.rotation_rate_rad_s])
    a, b = part.earth.equatorial_radius_m, part.earth.polar_radius_m
    atmosphere = mission.atmosphere()
    profile = wind_profile(WIND)
    blows = CubicHermiteSpline(profile.altitude, profile.value.T, profile.slope.T)

    def height(x: Array) -> float:
        radius = np.linalg.norm(x)
        sine = x[2] / radius
        return float(radius - a * b / math.sqrt(a * a * sine**2 + b * b * (1.0 - sine**2)))

    def breeze(x: Array, h: float) -> Array:
        if h >= profile.altitude[-1]:
            return np.zeros(3)
        normal = x / np.array([a * a, a * a, b * b])
        normal /= np.linalg.norm(normal)
        east = np.cross([0.0, 0.0, 1.0], normal)
        east /= np.linalg.norm(east)
        u, w = blows(max(h, 0.0))
        return u * east + w * np.cross(normal, east)

    def slope(_: float, y: Array) -> Array:
        x, speed = y[:3], y[3:]
        square = x @ x
        k = part.mu_m3_s2 / square**1.5
        q = 1.5 * part.j2 * a * a / square
        z = 5.0 * x[2] ** 2 / square
        pull = -k * x * (1.0 + q * (np.array([1.0, 1.0, 3.0]) - z))
        pull -= 2.0 * np.cross(omega, speed) + np.cross(omega, np.cross(omega, x))
        h = height(x)
        through = speed - breeze(x, h)
        rho = float(atmosphere.density(h))
        drag = 0.5 * rho * np.linalg.norm(through) * through / beta
        return np.concatenate((speed, pull - drag))

    def ground(_: float, y: Array) -> float:
        return height(y[:3])

    ground.terminal = True  # type: ignore[attr-defined]
    ground.direction = -1.0  # type: ignore[attr-defined]
    start = np.concatenate((r, v - np.cross(omega, r)))
    found = solve_ivp(
        slope, (0.0, 5000.0), start, method="DOP853", rtol=1e-10, atol=1e-5, events=ground
    )
    return float(found.t_events[0][0]), found.y_events[0][0][:3], found.y_events[0][0][3:]


@pytest.mark.parametrize("name", CASES)
def test_a_fall_agrees_with_another_integrator(name):
    speed, angle, height, beta = CASES[name]
    mission = windy()
    arrays = mission.arrays()
    r, v = state(speed, angle, height)
    span, end, _ = come_down(
        tuple(r), tuple(v), beta, math.inf, arrays.environment[0], arrays.atmosphere
    )
    expected_s, place, _ = reference(mission, r, v, beta)
    turned = 7.292115e-5 * span
    c, s = math.cos(turned), math.sin(turned)
    fixed = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.array(end)
    assert span == pytest.approx(expected_s, abs=0.01)
    assert np.linalg.norm(fixed - place) < 1.0


def test_without_air_it_is_the_kepler_arc():
    mission = windy()
    environment = mission.environment_array()
    environment["j2"] = 0.0
    r, v = state(3500.0, 30.0, 80e3)
    surroundings = environment[0], mission.atmosphere().table
    span, end, speed = come_down(tuple(r), tuple(v), math.inf, math.inf, *surroundings)
    expected = find_impact(r, v, 0.0, environment[0])
    again = find_impact(end, speed, span, environment[0])
    assert expected is not None and again is not None
    assert span == pytest.approx(expected.time_s, abs=0.01)
    assert again.latitude_deg == pytest.approx(expected.latitude_deg, abs=1e-5)
    assert again.longitude_deg == pytest.approx(expected.longitude_deg, abs=1e-5)
    assert abs(altitude(end, environment[0])) < 1e-3


def test_a_fall_in_parts_is_the_same_fall():
    mission = windy()
    arrays = mission.arrays()
    surroundings = arrays.environment[0], arrays.atmosphere
    r, v = state(*CASES["booster"][:3])
    whole, end, _ = come_down(tuple(r), tuple(v), 180.0, math.inf, *surroundings)
    now, at, speed = 0.0, tuple(r), tuple(v)
    for _ in range(10):
        span, at, speed = come_down(at, speed, 180.0, 0.1 * whole, *surroundings)
        now += span
    assert now == pytest.approx(whole, abs=0.01)
    assert np.linalg.norm(np.subtract(at, end)) < 2.0


@pytest.mark.parametrize(
    ("speed", "angle", "height"),
    [(7800.0, 0.0, 300e3), (10000.0, 0.0, 200e3), (12000.0, 5.0, 200e3)],
)
def test_what_stays_up_comes_down_nowhere(speed, angle, height):
    arrays = windy().arrays()
    r, v = state(speed, angle, height)
    span, _, _ = come_down(
        tuple(r), tuple(v), 200.0, math.inf, arrays.environment[0], arrays.atmosphere
    )
    assert math.isnan(span)


def test_an_orbit_inside_the_air_comes_down():
    arrays = windy().arrays()
    r, v = state(7350.0, 0.0, 130e3)
    span, end, _ = come_down(
        tuple(r), tuple(v), 50.0, math.inf, arrays.environment[0], arrays.atmosphere
    )
    assert 0.0 < span < 6000.0
    assert abs(altitude(end, arrays.environment[0])) < 1e-3


def test_no_number_keeps_it_from_ending():
    arrays = windy().arrays()
    surroundings = arrays.environment[0], arrays.atmosphere
    r, v = state(2500.0, 25.0, 70e3)
    for beta in (1e-6, math.nan, 1e300):
        span, _, _ = come_down(tuple(r), tuple(v), beta, math.inf, *surroundings)
        assert math.isnan(span) or span > 0.0
    assert math.isnan(come_down((math.nan, 0.0, 0.0), tuple(v), 1.0, math.inf, *surroundings)[0])
    assert come_down(tuple(r * 0.9), tuple(-v), 1.0, math.inf, *surroundings)[0] == 0.0
