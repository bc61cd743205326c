# SPDX-License-Identifier: Apache-2.0
"""Columns of flights: they record the flown values."""

import numpy as np
import pytest

from ares_guidance.law import Law
from ares_models.mission import load_mission
from ares_optimizer.solution import Cause, Status, failed
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_stepwise
from ares_thesis.history import pitch_deg, profile_of, record_flight


@pytest.fixture(scope="module")
def mission():
    return load_mission("ares_v")


@pytest.fixture(scope="module")
def history(mission):
    return record_flight(mission, Law(mission.arrays()))


def test_the_recorded_flight_is_the_flight(mission, history):
    flown = fly_stepwise(mission)
    assert history.flight.plant["mass"] == flown.plant["mass"]
    assert history.time_s[-1] == pytest.approx(float(flown.plant["time"]), abs=1e-9)
    assert history.mass_kg[-1] == flown.plant["mass"]
    assert np.all(np.diff(history.time_s) > 0.0)


def test_the_columns_begin_and_end_where_the_mission_says(mission, history):
    start = mission.start()
    assert history.time_s[0] == start.time_s
    assert history.radius_m[0] == pytest.approx(np.linalg.norm(start.position))
    assert history.mass_kg[0] == start.mass_kg
    target = mission.target
    assert history.radius_m[-1] == pytest.approx(target.radius_m, abs=1.0)
    assert history.speed_m_s[-1] == pytest.approx(target.speed_m_s, abs=0.01)
    assert history.flight_path_angle_deg[-1] == pytest.approx(
        target.flight_path_angle_deg, abs=1e-4
    )
    assert history.inclination_deg[-1] == pytest.approx(target.inclination_deg, abs=1e-6)
    assert np.ptp(history.ascending_node_deg) < 0.1


def test_thrust_falls_at_staging(mission, history):
    core, upper = mission.stages
    before = history.time_s < 337.0
    after = (history.time_s > 337.2) & (history.time_s < history.time_s[-1])
    assert set(history.thrust_n[before]) == {core.thrust_n}
    assert set(history.thrust_n[after]) == {upper.thrust_n}


def test_predictions_end_where_the_events_are(history):
    jettison = history.predicted_jettison_s
    known = np.isfinite(jettison)
    # after the drop there is none to predict
    last = np.flatnonzero(known)[-1]
    assert not known[last + 1 :].any()
    assert history.time_s[last + 1] == pytest.approx(jettison[last], abs=0.11)
    assert history.predicted_cutoff_s[-2] == pytest.approx(history.time_s[-1], abs=1e-3)


def test_pitch_is_that_of_the_vertical_plane():
    position = np.array([[7e6, 0.0, 0.0]] * 3)
    velocity = np.array([[100.0, 7e3, 0.0]] * 3)
    tilted = np.array([[0.5, np.sqrt(0.75), 0.0], [1.0, 0.0, 0.0], [0.3, 0.3, 0.6]])
    # the last one leans out of the plane: only its part in the plane counts
    assert pitch_deg(position, velocity, tilted) == pytest.approx([30.0, 90.0, 45.0])


def test_the_profile_of_an_optimum(mission):
    solution = solve(mission, "direct11")
    profile = profile_of(mission, solution)
    core, upper = mission.stages
    assert (profile.thrust_n[0], profile.thrust_n[-1]) == (core.thrust_n, upper.thrust_n)
    # staging stands twice, each side with its own thrust
    (staging,) = np.flatnonzero(np.diff(profile.thrust_n))
    assert profile.time_s[staging] == profile.time_s[staging + 1] == pytest.approx(337.15)
    assert profile.mass_kg[-1] == pytest.approx(solution.m_f_kg, abs=0.1)


def test_a_solution_without_a_flight_has_no_profile(mission):
    with pytest.raises(ValueError, match="no luck"):
        profile_of(mission, failed("direct11", Cause(Status.STALLED, "no luck")))
