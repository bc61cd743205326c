# SPDX-License-Identifier: Apache-2.0
"""Gravity, altitude, air and heating: values of the thesis, gradients, units."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ares_models import heating
from ares_models.arrays import ALTITUDE_SPHERICAL, ENVIRONMENT
from ares_models.atmosphere import no_air
from ares_models.earth import Earth
from ares_models.kernels import environment as kernels
from ares_models.kernels.vectors import axpy
from ares_models.mission import load_mission

ARES = load_mission("ares_v").arrays()
ATMOSPHERE = ARES.atmosphere
POSITION = (-5255758.0, -2044694.0, 3058330.0)
VELOCITY = (413.927, -1839.599, 202.55)


def environment(**changes):
    record = ARES.environment.copy()
    for key, value in changes.items():
        record[key] = value
    return record[0]


def place(radius, latitude, longitude):
    return (
        radius * math.cos(latitude) * math.cos(longitude),
        radius * math.cos(latitude) * math.sin(longitude),
        radius * math.sin(latitude),
    )


places = st.builds(
    place,
    st.floats(6.45e6, 6.9e6),
    st.floats(-1.55, 1.55),
    st.floats(-math.pi, math.pi),
)
velocities = st.tuples(*[st.floats(-8e3, 8e3)] * 3)


def slope_along(function, x, direction, step):
    """Central difference of a function of position along a direction."""
    ahead = function(axpy(step, direction, x))
    behind = function(axpy(-step, direction, x))
    return (np.asarray(ahead) - np.asarray(behind)) / (2.0 * step)


def test_gravity_is_inverse_square():
    g = np.array(kernels.gravity(POSITION, environment()))
    r = np.array(POSITION)
    assert np.allclose(g, -3.986e14 * r / np.linalg.norm(r) ** 3, rtol=1e-15)
    assert np.linalg.norm(g) == pytest.approx(9.685, abs=5e-4)


@given(places, st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_gravity_with_j2_is_the_gradient_of_its_potential(r, direction):
    mu, radius, j2 = 3.986e14, 6378140.0, 1.08263e-3
    env = environment(j2=j2)

    def disturbing_potential(x):
        square = x[0] ** 2 + x[1] ** 2 + x[2] ** 2
        return -mu * j2 * radius**2 * (3.0 * x[2] ** 2 / square - 1.0) / (2.0 * square**1.5)

    slope = slope_along(disturbing_potential, r, direction, 100.0)
    extra = np.array(kernels.gravity(r, env)) - np.array(kernels.gravity(r, environment()))
    assert float(np.dot(extra, direction)) == pytest.approx(float(slope), abs=1e-6)


def test_altitude_over_equator_and_pole():
    env = environment()
    assert kernels.altitude((6378140.0 + 5e4, 0.0, 0.0), env) == pytest.approx(5e4, abs=1e-6)
    assert kernels.altitude((0.0, 0.0, -6356750.0 - 5e4), env) == pytest.approx(5e4, abs=1e-6)
    round_earth = environment(altitude_model=ALTITUDE_SPHERICAL)
    assert kernels.altitude((0.0, 0.0, 6.4e6), round_earth) == pytest.approx(21860.0, abs=1e-6)


def test_altitude_is_the_printed_equation_with_its_bracket_put_right():
    flattening = (6378140.0 - 6356750.0) / 6378140.0
    r = float(np.linalg.norm(POSITION))
    sin2 = (POSITION[2] / r) ** 2
    ratio = 1.0 - flattening
    h = r - ratio * 6378140.0 / math.sqrt(1.0 + (ratio**2 - 1.0) * (1.0 - sin2))
    assert kernels.altitude(POSITION, environment()) == pytest.approx(h, abs=1e-6)
    earth = Earth(6378140.0, 6356750.0, 7.2921159e-5)
    assert r - earth.surface_radius(math.asin(math.sqrt(sin2))) == pytest.approx(h, abs=1e-6)


@given(places, st.tuples(*[st.floats(-1.0, 1.0)] * 3), st.booleans())
def test_altitude_gradient(r, direction, spherical):
    env = environment(altitude_model=0 if spherical else 1)
    slope = slope_along(lambda x: kernels.altitude(x, env), r, direction, 10.0)
    gradient = kernels.altitude_gradient(r, env)
    assert float(np.dot(gradient, direction)) == pytest.approx(float(slope), abs=1e-7)


def test_relative_velocity():
    env = environment()
    v = np.array(VELOCITY) - np.cross([0.0, 0.0, 7.2921159e-5], POSITION)
    assert np.allclose(kernels.relative_velocity(POSITION, VELOCITY, env), v, rtol=1e-15)


def test_heating_is_half_rho_v_cubed_and_knows_the_density_factor():
    env = environment()
    speed = float(np.linalg.norm(kernels.relative_velocity(POSITION, VELOCITY, env)))
    rho = kernels.density(POSITION, env, ATMOSPHERE)
    q = kernels.heating_rate(POSITION, VELOCITY, env, ATMOSPHERE)
    assert q == pytest.approx(0.5 * rho * speed**3, rel=1e-14)
    assert q == pytest.approx(heating.free_molecular_heating(rho, speed), rel=1e-14)
    denser = environment(density_factor=1.5)
    assert kernels.heating_rate(POSITION, VELOCITY, denser, ATMOSPHERE) == pytest.approx(1.5 * q)


def test_constant_of_equation_2_2_turns_foot_pounds_into_btu():
    """c q V_rel with q in lbf/ft2 and V in ft/s is BTU/ft2/s; in SI it is 0.5 rho V^3."""
    rho, speed = 1.3e-8, 5500.0
    foot, pound_force = 0.3048, 4.4482216152605
    btu_per_foot_pound = 1.0 / 777.65
    q_english = 0.5 * rho * speed**2 / (pound_force / foot**2)
    english = btu_per_foot_pound * q_english * speed / foot
    si = heating.free_molecular_heating(rho, speed)
    # W/m2 in one BTU/ft2/s
    assert english * 11356.5 == pytest.approx(si, rel=1e-3)


@given(places, velocities, st.tuples(*[st.floats(-30.0, 30.0)] * 3), st.booleans())
def test_log_heating_and_its_rate_follow_the_motion(r, v, a, spherical):
    env = environment(altitude_model=0 if spherical else 1, density_factor=1.2)
    # at rest relative to the air there is no heating, and no logarithm of it
    assume(np.linalg.norm(kernels.relative_velocity(r, v, env)) > 200.0)
    value, rate = kernels.log_heating(r, v, env, ATMOSPHERE, a)
    assert value == pytest.approx(math.log(kernels.heating_rate(r, v, env, ATMOSPHERE)), abs=1e-12)

    def after(t):
        moved = axpy(0.5 * t * t, a, axpy(t, v, r))
        return math.log(kernels.heating_rate(moved, axpy(t, a, v), env, ATMOSPHERE))

    dt = 1e-3
    assert rate == pytest.approx((after(dt) - after(-dt)) / (2.0 * dt), rel=1e-4, abs=1e-5)


@given(places, velocities)
def test_log_heating_gradient(r, v):
    env = environment()
    assume(np.linalg.norm(kernels.relative_velocity(r, v, env)) > 200.0)
    _, by_position, by_velocity = kernels.log_heating_gradient(r, v, env, ATMOSPHERE)
    for axis in range(3):
        e = tuple(float(k == axis) for k in range(3))
        slope = slope_along(
            lambda x: math.log(kernels.heating_rate(x, v, env, ATMOSPHERE)), r, e, 1.0
        )
        assert by_position[axis] == pytest.approx(float(slope), rel=1e-4, abs=1e-8)
        slope = slope_along(
            lambda x: math.log(kernels.heating_rate(r, x, env, ATMOSPHERE)), v, e, 0.1
        )
        assert by_velocity[axis] == pytest.approx(float(slope), rel=1e-4, abs=1e-7)


def test_environment_record_has_the_fields_that_kernels_read():
    assert set(ENVIRONMENT.names) >= {"mu", "j2", "density_factor", "altitude_model"}


def test_without_air_nothing_heats():
    air = no_air().table
    env = environment()
    for height in (-1e3, 0.0, 1e5, 1e9):
        r = (env["equatorial_radius"] + height, 0.0, 0.0)
        assert kernels.density(r, env, air) == 0.0
        assert kernels.heating_rate(r, (0.0, 1e5, 0.0), env, air) == 0.0
    log_rate, by_position, by_velocity = kernels.log_heating_gradient(POSITION, VELOCITY, env, air)
    assert np.all(np.isfinite([log_rate, *by_position, *by_velocity]))
