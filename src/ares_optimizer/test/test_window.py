# SPDX-License-Identifier: Apache-2.0
"""The launch window of a plane that is fixed in space."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_optimizer.solution import OptimizerError, Status
from ares_optimizer.solve import solve
from ares_optimizer.window import Window, launch_window, launched_later

pytestmark = pytest.mark.long

STATION = "falcon9_iss_pad"


@pytest.fixture(scope="module")
def station() -> Window:
    return launch_window(load_mission(STATION), 0)


@pytest.mark.trial
def test_best_launch_time_is_within_two_minutes_of_the_real_one(station: Window) -> None:
    # Demo-2 left at the epoch of the file; the plane comes from two-line elements
    assert abs(station.best.later_s) < 120.0


@pytest.mark.trial
def test_each_launch_beside_the_best_costs_more() -> None:
    station = launch_window(load_mission(STATION), 2)
    best = station.best.final_mass_kg
    costs = np.array([best - launch.final_mass_kg for launch in station.launches])
    assert all(launch.solution.converged for launch in station.launches)
    minutes = np.arange(-2, 3)
    # a plane change grows with the square of the time, to the accuracy of the best time
    assert costs == pytest.approx(costs[-1] / 4.0 * minutes**2, abs=1.0)
    assert costs[-1] > 15.0


@pytest.mark.trial
def test_best_time_is_right_to_its_accuracy(station: Window) -> None:
    beside = [
        solve(launched_later(station.best.mission, seconds), "auto").m_f_kg
        for seconds in (-15.0, 15.0)
    ]
    assert station.best.final_mass_kg > max(beside)


@pytest.mark.trial
def test_a_launch_beside_a_known_one_begins_at_its_flight(station: Window) -> None:
    later = launched_later(station.best.mission, 90.0)
    alone, beside = (solve(later, "auto", guess=each) for each in (None, station.best.solution))
    assert beside.converged
    assert beside.m_f_kg == pytest.approx(alone.m_f_kg, rel=1e-7)
    assert beside.iterations < 0.5 * alone.iterations
    assert beside.restarts == 0


@pytest.mark.trial
@pytest.mark.trial
def test_a_known_flight_that_one_start_led_to_is_not_evidence_enough(station: Window) -> None:
    later = launched_later(station.best.mission, 90.0)
    known = replace(station.best.solution, status=Status.FEASIBLE)
    beside = solve(later, "auto", guess=known)
    assert beside.converged
    assert beside.restarts > 0


@pytest.mark.trial
def test_the_solution_of_another_sequence_is_no_guess(station: Window) -> None:
    with pytest.raises(OptimizerError, match="solution with 0 free arcs before the last one; "):
        solve(load_mission("falcon9_gto_pad"), "auto", guess=station.best.solution)


@pytest.mark.parametrize("name", [STATION, "delta_iii_pad"])
def test_later_launch_turns_the_site_and_keeps_the_plane(name: str) -> None:
    mission = load_mission(name)
    later = launched_later(mission, 600.0)
    angle = mission.environment.earth.rotation_rate_rad_s * 600.0
    before, after = mission.start().position, later.start().position
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    # the mean equinox moves by 0.0001 m in ten minutes
    assert after == pytest.approx(turn @ before, abs=1.0)
    assert later.target.node_deg(later) == pytest.approx(mission.target.node_deg(mission), abs=1e-9)
    if mission.epoch is not None:
        assert later.epoch == mission.epoch + timedelta(seconds=600.0)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("falcon9_leo_pad", "target has no node; expected one"),
        ("ares_v", "initial_state does not turn with the ground; expected"),
    ],
)
def test_mission_without_window_is_refused(name: str, told: str) -> None:
    with pytest.raises(OptimizerError, match=told):
        launch_window(load_mission(name), 1)
