# SPDX-License-Identifier: Apache-2.0
"""Coasts with the oblateness: against the same field integrated."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ares_models.kernels.coast import coast
from ares_models.kernels.environment import gravity
from ares_models.kernels.kepler import kepler
from ares_models.mission import load_mission

LOW = (6.678e6, 7.6e3, 5.0)
ECCENTRIC = (6.678e6, 9.9e3, 12.0)


def environment(j2):
    record = load_mission("ares_v").arrays().environment[0].copy()
    record["j2"] = j2
    return record


def start(radius, speed, inclination_deg):
    tilt = math.radians(inclination_deg + 28.0)
    return (radius, 0.0, 0.0), (50.0, speed * math.cos(tilt), speed * math.sin(tilt))


@pytest.mark.parametrize("orbit", [LOW, ECCENTRIC])
@pytest.mark.parametrize("dt", [40.0, 5400.0, -2000.0])
def test_a_coast_with_j2_is_the_field_integrated(orbit, dt):
    field = environment(1.08263e-3)
    r, v = start(*orbit)
    exact = solve_ivp(
        lambda _, y: np.concatenate([y[3:], gravity(tuple(y[:3]), field)]),
        (0.0, dt),
        np.concatenate([r, v]),
        method="DOP853",
        rtol=1e-12,
        atol=1e-6,
    ).y[:, -1]
    position, velocity = coast(r, v, dt, field)
    conic, _ = kepler(r, v, dt, field["mu"])
    assert np.array(position) == pytest.approx(exact[:3], abs=8.0)
    assert np.array(velocity) == pytest.approx(exact[3:], abs=8e-3)
    if abs(dt) > 1000.0:
        assert np.linalg.norm(np.array(conic) - exact[:3]) > 1000.0


def test_without_j2_it_is_a_conic():
    field = environment(0.0)
    r, v = start(*LOW)
    assert coast(r, v, 3000.0, field) == kepler(r, v, 3000.0, field["mu"])


def test_nothing_happens_in_no_time():
    r, v = start(*LOW)
    position, velocity = coast(r, v, 0.0, environment(1.08263e-3))
    assert np.array(position) == pytest.approx(r)
    assert np.array(velocity) == pytest.approx(v)
