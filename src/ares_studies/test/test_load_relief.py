# SPDX-License-Identifier: Apache-2.0
"""Load relief in the boost: winds are felt, and the loads that they make are less."""

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_vehicle_sim.dispersions import Dispersions, load_dispersions

#: A wind of 10 m/s to the north at all heights, of which guidance knows nothing.
TO_THE_NORTH = """
wind: {table: [[0.0, 0.0, 10.0], [60000.0, 0.0, 10.0]], factor: {mean: 1.0, sigma: 0.0}}
"""


@pytest.fixture(scope="module")
def settings():
    return Settings(load_mission("saturn_v_as506_pad"), Dispersions()).planned()


def flights(settings, dispersions, relieved=True):
    """Return a range of flights, without load relief if it is not wanted."""
    made = FlightRange(
        Settings(settings.mission, dispersions, plan=settings.plan, options=settings.options)
    )
    if not relieved:
        made._blank.onboard.state["programme"]["relief"] = 0.0
    return made


@pytest.mark.trial
def test_winds_load_a_vehicle_less_where_it_is_relieved(settings):
    dispersions = load_dispersions("standard_pad")
    plain, relieved = (
        flights(settings, dispersions, relief).fly(0, 20).results for relief in (False, True)
    )
    loads = [np.quantile(flown["q_alpha_share"], 0.9) for flown in (plain, relieved)]
    assert loads[1] < 0.5 * loads[0]
    assert plain["terminal_accuracy"].all() and relieved["terminal_accuracy"].all()
    # what is paid for it
    assert relieved["mass"].mean() > 0.998 * plain["mass"].mean()


@pytest.mark.trial
def test_the_wind_is_estimated_from_what_is_sensed_across_the_thrust(settings, tmp_path):
    path = tmp_path / "north.yaml"
    path.write_text(TO_THE_NORTH)
    made = flights(settings, load_dispersions(path))
    made.fly(0, 1)
    up = made._blank.vehicle.plant["position"][0]
    up = up / np.linalg.norm(up)
    north = np.array([0.0, 0.0, 1.0]) - up[2] * up
    north /= np.linalg.norm(north)
    wind = made._workspace.onboard.state["programme"]["wind"][0]
    # the thrust points east-north-east, so that some of it is along the axis
    assert wind @ north == pytest.approx(9.5, abs=1.0)
    assert np.linalg.norm(wind) == pytest.approx(9.75, abs=1.0)


@pytest.mark.trial
def test_a_flight_without_wind_needs_no_relief(settings):
    plain, relieved = (
        flights(settings, Dispersions(), relief).fly(0, 1).results for relief in (False, True)
    )
    assert relieved["mass"] == pytest.approx(plain["mass"], rel=1e-4)
    assert relieved["q_alpha_share"] == pytest.approx(plain["q_alpha_share"], rel=0.02)


def test_a_stage_without_a_limit_is_flown_by_the_programme_alone():
    mission = load_mission("falcon9_leo_pad")
    made = FlightRange(Settings(mission, Dispersions()))
    assert not made._blank.onboard.state["programme"]["relief"].any()
