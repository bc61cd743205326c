# SPDX-License-Identifier: Apache-2.0
"""First guesses of an upper stage of low thrust: its last burn divided by a revolution."""

import pytest

from ares_models.floors import floors_of
from ares_models.mission import Mission, parse_mission
from ares_models.orbits import Elements
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.divided_burn import raises_slowly, try_divided_burn
from ares_optimizer.collocation.guess import trials
from ares_optimizer.collocation.points import times_of
from ares_optimizer.collocation.search import Search
from ares_optimizer.deadline import Deadline
from ares_optimizer.request import Heating, Request, arrays_and_state
from ares_optimizer.solve import solve

#: A stage of 1 m/s2 that raises its apogee to 20,000 km, by two burns unless the file has one.
STAGE = """
name: slow
title: a made-up stage of low thrust in a low orbit
source: made up for this test
payload_kg: 3000.0
environment:
  mu_m3_s2: 3.986004418e14
  earth:
    equatorial_radius_m: 6378137.0
    polar_radius_m: 6356752.3
    rotation_rate_rad_s: 7.292115e-5
  atmosphere: {{model: none}}
initial_state:
  time_s: 0.0
  position_m: [6578137.0, 0.0, 0.0]
  velocity_m_s: [0.0, 6000.0, 4900.0]
stages:
  - name: stage
    dry_mass_kg: 1500.0
    propellant_kg: 13000.0
    arcs:
      - {{thrust_n: {thrust}, isp_s: 328.0, burn_time_s: free}}
{more}
target: {{perigee_altitude_m: 220000.0, apogee_altitude_m: 20.0e6}}
"""
MORE = """
      - {{coast_s: free, max_s: 30000.0}}
      - {{thrust_n: {thrust}, isp_s: 328.0, burn_time_s: free}}
"""


def mission_of(more: str, thrust: float = 17500.0) -> Mission:
    return parse_mission(STAGE.format(thrust=thrust, more=more.format(thrust=thrust)), "slow.yaml")


def test_two_burns_at_perigee_take_less_than_one() -> None:
    one = solve(mission_of(""), "collocation")
    assert one.converged, one.reason
    arrays, start = arrays_and_state(mission_of(MORE), None)
    with Deadline() as deadline:
        request = Request(arrays, start, "collocation", Heating.AT_JETTISON, deadline)
        search = Search(arrays, start, floors_of(arrays, start), request)
        try_divided_burn(search)
    assert search.best is not None
    assert search.best.m_f_kg > one.m_f_kg + 50.0
    # there is a revolution between the burns
    assert times_of(search.best.program, search.best.point.x).cutoff > one.t_meco_s + 5000.0


@pytest.mark.trial
def test_two_burns_at_perigee_are_the_optimum() -> None:
    two = solve(mission_of(MORE), "collocation")
    assert two.converged, two.reason
    assert two.m_f_kg == pytest.approx(8_970.432, abs=0.01)


@pytest.mark.parametrize(("more", "thrust", "slow"), [(MORE, 17500.0, True), (MORE, 60e3, False)])
def test_a_stage_raises_slowly_by_its_thrust(more: str, thrust: float, slow: bool) -> None:
    mission = mission_of(more, thrust)
    assert raises_slowly(mission.arrays(), mission.start().navigation()) == slow


def test_one_burn_is_not_divided() -> None:
    mission = mission_of("")
    assert not raises_slowly(mission.arrays(), mission.start().navigation())


#: A stage that drops its tanks between the burns at perigee and the one at apogee.
TANKS = """
name: tanks
title: a made-up stage of low thrust that drops its tanks
source: made up for this test
payload_kg: 6000.0
environment:
  mu_m3_s2: 3.986004418e14
  earth: {equatorial_radius_m: 6378137.0, polar_radius_m: 6356752.3, rotation_rate_rad_s: 0.0}
  atmosphere: {model: none}
initial_state:
  time_s: 0.0
  position_m: [6563137.0, 0.0, 0.0]
  velocity_m_s: [0.0, 5450.0, 5600.0]
stages:
  - name: tanks
    dry_mass_kg: 1100.0
    propellant_kg: 12000.0
    arcs:
      - {thrust_n: 19600.0, isp_s: 328.0, burn_time_s: free}
      - {coast_s: free, max_s: 9000.0}
      - {thrust_n: 19600.0, isp_s: 328.0, burn_time_s: free}
      - {coast_s: free, max_s: 12000.0}
      - {thrust_n: 19600.0, isp_s: 328.0, burn_time_s: free}
  - name: core
    dry_mass_kg: 1370.0
    propellant_kg: 5200.0
    arcs:
      - {coast_s: 60.0}
      - {thrust_n: 19600.0, isp_s: 328.0, burn_time_s: free}
      - {coast_s: free, max_s: 25000.0}
      - {thrust_n: 19600.0, isp_s: 328.0, burn_time_s: free}
target: {perigee_altitude_m: 4120000.0, apogee_altitude_m: 35786000.0, inclination_deg: 30.0}
"""


@pytest.mark.trial
def test_burns_at_perigee_raise_the_apogee_in_steps_within_their_propellant() -> None:
    mission = parse_mission(TANKS, "tanks.yaml")
    arrays, start = mission.arrays(), mission.start().navigation()
    first = next(trials(arrays, start, floors_of(arrays, start)))
    mu = float(arrays.environment[0]["mu"])
    apogees = []
    for coast in (1, 3, 7):
        row = first.track[first.track[:, rollout.ARC] == coast][0]
        r, v = (row[at : at + 3] for at in (rollout.POSITION, rollout.VELOCITY))
        apogees.append(Elements.from_state(r, v, mu).apogee_radius)
    assert apogees == sorted(apogees)
    assert apogees[1] > apogees[0] + 2e6
    burns = first.times.lengths[[0, 2, 4]]
    assert burns.sum() * arrays.arcs[0]["mass_flow"] < 1.01 * 12000.0
