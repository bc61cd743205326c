# SPDX-License-Identifier: Apache-2.0
"""Reachability of the target, determined without guidance."""

import math
import re

import pytest

from ares_models.mission import load_mission
from ares_studies.closed_loop import fly_compiled
from ares_studies.montecarlo import reach as module
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_studies.montecarlo.reach import Reach, reach, reaches
from ares_vehicle_sim.dispersions import Dispersions, load_dispersions


def settings(**drawn):
    return Settings(load_mission("ares_v"), Dispersions(**drawn))


def test_what_nothing_disperses_reaches_the_optimum():
    found = reach(settings(), 0)
    assert found.within is True
    assert found.m_f_kg == pytest.approx(174_183.1, abs=0.1)
    assert str(found) == "within reach: the optimum ends with 174,183.1 kg"


def test_weak_engines_do_not_reach_the_orbit():
    found = reach(settings(thrust={"mean": -0.4}), 0)
    assert found.within is False
    assert math.isnan(found.m_f_kg)
    assert str(found).startswith("out of reach: ")


@pytest.mark.trial
def test_a_flight_through_wind_is_asked_about_too():
    mission = load_mission("delta_iii_pad")
    pad = Settings(mission, load_dispersions("standard", mission), law="optimal")
    weak, good = reach(pad, 42), reach(pad, 3)
    assert weak.within is False
    assert "propellant of the last stage" in weak.reason
    flown = FlightRange(pad).fly(3, 1).results[0]
    assert flown["terminal_accuracy"]
    assert 0.995 * good.m_f_kg < flown["mass"] < good.m_f_kg


def test_the_optimum_knows_the_wind_of_the_day_but_no_turbulence():
    mission = load_mission("delta_iii_pad")
    wind = {"table": [[0.0, 5.0, 5.0], [12_000.0, 10.0, 10.0]]}
    stirred = {"table": [[0.0, 3.0, 3.0], [15_000.0, 3.0, 3.0]]}
    calm, windy, turbulent = (
        reach(Settings(mission, Dispersions(**drawn)), 0).m_f_kg
        for drawn in ({}, {"wind": wind}, {"wind": wind, "turbulence": stirred})
    )
    assert windy == turbulent
    assert abs(windy - calm) > 0.1


def test_a_pad_is_where_it_is_whatever_navigation_says():
    mission = load_mission("delta_iii_pad")
    drawn = Dispersions(navigation={"position_bias_m": {"mean": -300.0}})
    found = reach(Settings(mission, drawn), 0)
    assert found.m_f_kg == pytest.approx(7529.712, abs=0.001)
    flight = fly_compiled(mission, dispersions=drawn)
    assert flight.plant["mass"] > 0.99 * found.m_f_kg


def test_each_flight_is_drawn_as_the_campaign_drew_it():
    drawn = settings(thrust=0.01, initial_position_m=500.0)
    masses = [reach(drawn, flight).m_f_kg for flight in (3, 4, 3)]
    assert masses[0] == masses[2] != masses[1]


def test_the_optimizer_may_have_no_answer(monkeypatch):
    monkeypatch.setattr(module, "TIME_LIMIT", 0.0)
    found = reach(settings(), 0)
    assert found.within is None
    assert str(found).startswith("within reach or not: unknown, ")


def test_a_start_below_the_ground_is_nothing_to_ask_of_the_optimizer():
    moon = Settings(load_mission("apollo11_ascent"), load_dispersions("standard"))
    found = reach(moon, 0)
    assert found.within is None
    assert re.fullmatch(
        r"within reach or not: unknown, state\.position is [\d,]+ m from the Earth's centre; "
        r"expected at least [\d,]+ m",
        str(found),
    )


def test_an_error_of_the_program_is_not_asked_about():
    rows = [{"flight": 1, "outcome": "error"}, {"flight": 2, "outcome": "target_missed"}]
    found = reaches(settings(), rows)
    assert list(found) == [2]
    assert isinstance(found[2], Reach)
