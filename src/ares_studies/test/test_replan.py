# SPDX-License-Identifier: Apache-2.0
"""Law `optimal` in the air: the flight solved anew in each cycle, beside the programme."""

from dataclasses import replace

import numpy as np
import pytest

from ares_guidance.arrays import (
    FOUND_EARLY_END,
    FOUND_ENGINE_LOST,
    FOUND_NOTHING,
    FOUND_THRUST_LOW,
)
from ares_guidance.laws import make_law
from ares_guidance.plan import plan_of
from ares_guidance.settings import LawSettings
from ares_models.failures import Failure, FailureKind
from ares_models.judge import End
from ares_models.mission import load_mission
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, fly_stepwise, offline_trajectory
from ares_trials.testing.arrivals import judged
from ares_vehicle_sim.dispersions import load_dispersions
from ares_vehicle_sim.simulator import CAMPAIGN

pytestmark = pytest.mark.long

LAUNCHER = "falcon9_leo_pad"


@pytest.fixture(scope="module")
def launcher():
    mission = load_mission(LAUNCHER)
    return mission, solve(mission, "auto")


def flown(mission, solution, boost, failure=None, **given):
    """Fly by law `optimal` to the target, without a false alarm; return the flight."""
    arrays = mission.arrays(foreseen=True)
    law = make_law("optimal", arrays, LawSettings(boost_steering=boost))
    law.follow_arcs(plan_of(offline_trajectory(solution), arrays))
    flight = fly_stepwise(mission, law=law, failure=failure, **given)
    assert judged(mission, flight.plant).end is End.TARGET
    if failure is None:
        assert flight.guidance["found"]["kind"] == FOUND_NOTHING
    return flight


@pytest.mark.parametrize("name", ["delta_iii_pad", "falcon9_iss_pad"])
def test_the_optimum_is_flown_without_its_programme(name):
    mission = load_mission(name)
    solution = solve(mission, "auto")
    flight = flown(mission, solution, "replan")
    programme = flight.guidance["programme"]
    # in each cycle but those of the vertical rise and of the coast at staging
    assert programme["replans"] > 0.85 * programme["cycle"]
    assert float(flight.plant["mass"]) == pytest.approx(solution.m_f_kg, rel=1e-6)


def test_replan_saves_propellant_where_an_engine_fails(launcher):
    mission, solution = launcher
    failure = Failure(FailureKind.ENGINE_OUT, time_s=20.0, thrust_ratio=8.0 / 9.0)
    programme, replan = (
        float(flown(mission, solution, boost, failure=failure).plant["mass"])
        for boost in ("programme", "replan")
    )
    assert replan - programme > 100.0


ENGINE_OUT = Failure(FailureKind.ENGINE_OUT, 3.3, thrust_ratio=8.0 / 9.0)


@pytest.mark.parametrize(
    ("failure", "kind"),
    [
        (ENGINE_OUT, FOUND_ENGINE_LOST),
        # near the greatest dynamic pressure
        (replace(ENGINE_OUT, time_s=60.0), FOUND_ENGINE_LOST),
        # mass flow as before: sensed through the drag
        (
            Failure(FailureKind.THRUST_LOW, 60.0, thrust_ratio=0.95, flow_ratio=1.0),
            FOUND_THRUST_LOW,
        ),
    ],
)
@pytest.mark.parametrize("boost", ["programme", "replan"])
def test_a_failure_in_the_air_is_found_at_once(launcher, boost, failure, kind):
    found = flown(*launcher, boost, failure=failure).guidance["found"]
    assert found["kind"] == kind
    assert found["ratio"] == pytest.approx(failure.thrust_ratio, abs=0.002)
    assert failure.time_s < found["first_time"] <= failure.time_s + 2.0


@pytest.mark.parametrize(
    ("failure", "kind"),
    [
        (Failure(FailureKind.EARLY_SHUTDOWN, 60.0), FOUND_EARLY_END),
        (
            Failure(FailureKind.THRUST_LOW, 110.0, thrust_ratio=0.7, flow_ratio=0.7),
            FOUND_THRUST_LOW,
        ),
    ],
)
def test_a_failure_beside_boosters_is_found_at_once(failure, kind):
    # their thrust is three and one and a half times that of the engine
    mission = load_mission("delta_iii_pad")
    found = fly_compiled(mission, CAMPAIGN, failure=failure).guidance["found"]
    assert found["first_kind"] == kind
    assert failure.time_s < found["first_time"] <= failure.time_s + 2.0


@pytest.mark.trial
def test_replan_flies_dispersed_flights_no_worse(launcher):
    mission, solution = launcher
    gains = [
        np.subtract(
            *(
                float(
                    flown(
                        mission,
                        solution,
                        boost,
                        dispersions=load_dispersions("standard_pad"),
                        flight=k,
                    ).plant["mass"]
                )
                for boost in ("replan", "programme")
            )
        )
        for k in range(8)
    ]
    assert np.mean(gains) > 0.0
    assert min(gains) > -5.0


def test_replan_is_of_law_optimal(launcher):
    mission, _ = launcher
    with pytest.raises(ValueError, match="boost_steering is 'replan' and law is 'peg'; expected"):
        make_law("peg", mission.arrays(foreseen=True), LawSettings(boost_steering="replan"))
