# SPDX-License-Identifier: Apache-2.0
"""Missions with free arcs, held attitude and throttled burns, from the file to the arrays."""

import math

import numpy as np
import pytest

from ares_models.arrays import BURN, COAST
from ares_models.mission import load_mission
from ares_models.mission_arcs import BurnArc

G0 = 9.80665

STAGES = """
stages:
  - name: one
    ignition_mass_kg: 157355.0
    thrust_n: 2340000.0
    isp_s: 301.8
    burn_time_s: 148.1
  - name: two
    ignition_mass_kg: 32758.0
    propellant_kg: 25000.0
    arcs:
      - {name: climb, thrust_n: 456100.0, isp_s: 315.0, burn_time_s: free, min_s: 20.0}
      - {name: coast, coast_s: free, max_s: 450.0}
      - {name: circle, thrust_n: 456100.0, isp_s: 315.0, burn_time_s: free,
         max_acceleration_m_s2: 40.0, min_throttle: 0.4}
  - name: kick
    ignition_mass_kg: 3000.0
    thrust_n: 60000.0
    isp_s: 290.0
    burn_time_s: 50.0
    attitude: held
"""

HEAD = """
name: free
title: free arcs
source: made up
environment:
  mu_m3_s2: 3.986004418e14
  earth:
    {equatorial_radius_m: 6370000.0, polar_radius_m: 6370000.0, rotation_rate_rad_s: 7.29e-5}
  atmosphere: {model: us76}
initial_state:
  time_s: 0.0
  position_m: [5593203.0, 0.0, 3050526.0]
  velocity_m_s: [0.0, 1407.0, 0.0]
target:
  {radius_m: 6556000.0, speed_m_s: 7797.0, flight_path_angle_deg: 0.0, inclination_deg: 28.7}
"""


@pytest.fixture
def mission(tmp_path):
    """Free burns and coast, then a solid kick."""
    path = tmp_path / "free.yaml"
    path.write_text(HEAD + STAGES)
    return load_mission(path)


def test_arrays_of_free_arcs(mission):
    arcs = mission.arrays().arcs
    assert list(arcs["kind"]) == [BURN, BURN, COAST, BURN, BURN]
    assert list(np.isinf(arcs["duration"])) == [False, True, True, True, False]
    assert list(arcs["shortest"]) == [148.1, 20.0, 0.0, 0.0, 50.0]
    assert list(arcs["longest"]) == [148.1, math.inf, 450.0, math.inf, 50.0]
    assert list(arcs["held"]) == [0, 0, 0, 0, 1]
    assert list(arcs["max_acceleration"]) == [math.inf, math.inf, 0.0, 40.0, math.inf]
    assert list(arcs["min_throttle"]) == [0.0, 0.0, 0.0, 0.4, 0.0]
    assert mission.plans_arcs


def test_first_ignitions_are_the_earliest(mission):
    assert mission.ignition_times() == pytest.approx((0.0, 148.1, 168.1))


def flown_propellant(burn, mass, drops=()):
    """Integrate by small steps."""
    step = 1e-3
    used = 0.0
    at = {round(time / step): dropped for time, dropped in drops}
    for k in range(round(burn.burn_time_s / step)):
        mass -= at.get(k, 0.0)
        limited = burn.max_acceleration_m_s2 * (mass - used)
        thrust = min(burn.thrust_n, max(limited, burn.least_throttle * burn.thrust_n))
        used += step * thrust / (G0 * burn.isp_s)
    return used


@pytest.mark.parametrize("least", [None, 0.4, 1.0])
@pytest.mark.parametrize("limit", [5.0, 20.0, 60.0])
@pytest.mark.parametrize("drops", [(), ((30.0, 4000.0), (90.0, 500.0))])
def test_propellant_of_a_throttled_burn(least, limit, drops):
    burn = BurnArc(
        thrust_n=456100.0,
        isp_s=315.0,
        burn_time_s=160.0,
        max_acceleration_m_s2=limit,
        min_throttle=least,
    )
    mass = 32758.0
    flown = flown_propellant(burn, mass, drops)
    assert burn.propellant(G0, mass, drops) == pytest.approx(flown, rel=1e-5)


BOOSTED = """
payload_kg: 1000.0
stages:
  - name: one
    dry_mass_kg: 10000.0
    propellant_kg: {propellant}
    boosters:
      - {{name: strap-ons, count: 2, dry_mass_kg: 4000.0, propellant_kg: 30000.0,
          thrust_n: 1.0e6, burn_time_s: 80.0}}
    arcs:
      - {{name: boosted, thrust_n: 1.0e6, isp_s: 320.0, burn_time_s: 90.0}}
      - {{name: throttled, thrust_n: 1.0e6, isp_s: 320.0, burn_time_s: 120.0,
          max_acceleration_m_s2: 30.0}}
  - name: two
    dry_mass_kg: 500.0
    propellant_kg: 6000.0
    thrust_n: 60000.0
    isp_s: 340.0
    burn_time_s: free
jettisons:
  - {{name: fairing, mass_kg: 1500.0, stage: one, time_after_ignition_s: 150.0}}
"""


def test_what_was_dropped_counts_in_a_throttled_burn(tmp_path):
    """Write a throttled burn with its length after boosters, with the propellant that it takes."""
    path = tmp_path / "boosted.yaml"
    path.write_text(HEAD + BOOSTED.format(propellant=70000.0))
    mission = load_mission(path)
    stage = mission.stages[0]
    boosted, throttled = stage.burns
    first = boosted.propellant(G0, math.nan)
    # without boosters, and the fairing comes off after 60 s
    mass = mission.ignition_mass(0) - 68000.0 - first
    taken = first + flown_propellant(throttled, mass, [(60.0, 1500.0)])
    assert mission.fixed_propellant(0) - 60000.0 == pytest.approx(taken, rel=1e-5)
    # less than at full thrust
    assert taken < 0.98 * first * 210.0 / 90.0
    path.write_text(HEAD + BOOSTED.format(propellant=taken + 1.0))
    assert load_mission(path).propellant(0) == pytest.approx(60000.0 + taken + 1.0)
