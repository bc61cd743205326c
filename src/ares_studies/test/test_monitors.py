# SPDX-License-Identifier: Apache-2.0
"""Monitors: each rule, and no violation in dispersed flights."""

import math
from functools import cache

import numpy as np
import pytest

from ares_guidance.arrays import (
    MONITOR_DEPLETION,
    MONITOR_DIRECTION,
    MONITOR_JETTISON,
    MONITOR_STEERING_RATE,
    MONITOR_TIME_TO_GO,
    MONITOR_WORK,
    Onboard,
)
from ares_guidance.kernels.monitors.answers import most_iterations, watch_answer
from ares_models.mission import load_mission
from ares_studies.closed_loop import ready_law
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_vehicle_sim.dispersions import STANDARD, load_dispersions
from ares_vehicle_sim.simulator import Simulator


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


@cache
def on_board_at(time):
    """Return the onboard arrays after all states of a nominal flight up to a time."""
    mission = load_mission("ares_v")
    simulator = Simulator(mission)
    law = ready_law(mission)
    while float(simulator.navigation["time"]) < time:
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
    assert law.state["monitors"]["violations"] == 0
    assert law.state["monitors"]["kept"] == 1
    return law.onboard


def guided_to(mission, time):
    """Make a law that has answered all states of a nominal flight of ares_v up to a time."""
    law = ready_law(mission)
    for array, there in zip(law.onboard, on_board_at(time), strict=True):
        array[:] = there
    return law


def watched(mission, law):
    """Let the monitors look at what stands in ``law``; which rules are broken."""
    watch_answer(mission.arrays().records(), Onboard(*(array[0] for array in law.onboard[:4])))
    return int(law.state["monitors"]["flags"])


@pytest.mark.parametrize(
    ("field", "value", "flag"),
    [
        ("direction", [1.0, 1.0, 0.0], MONITOR_DIRECTION),
        ("direction", [math.nan, 0.0, 0.0], MONITOR_DIRECTION),
        ("direction_rate", [math.inf, 0.0, 0.0], MONITOR_DIRECTION),
        ("reference_time", math.nan, MONITOR_DIRECTION),
        ("cutoff_time", math.inf, MONITOR_DIRECTION),
        ("jettison", 3, MONITOR_DIRECTION),
        ("arc_end_times", math.inf, MONITOR_DIRECTION),
        ("cutoff_time", 599.0, MONITOR_TIME_TO_GO),
        ("cutoff_time", 2000.0, MONITOR_DEPLETION),
        ("direction_rate", [0.0, 0.0, 30.0], MONITOR_STEERING_RATE),
    ],
)
def test_a_broken_rule_holds_the_last_good_answer(ares_v, field, value, flag):
    law = guided_to(ares_v, 600.0)
    assert watched(ares_v, law) == 0
    good = law.steering.tobytes()
    # where a line turns fastest
    law.steering[0]["reference_time"] = law.onboard.navigation["time"][0]
    law.steering[0][field] = value
    assert watched(ares_v, law) & flag
    assert law.steering.tobytes() == good
    assert law.state["monitors"]["violations"] == 1
    assert law.state["monitors"]["violated"] & flag


def test_too_much_work_is_told(ares_v):
    law = guided_to(ares_v, 600.0)
    law.state["iterations"] = most_iterations(law.onboard.settings[0]) + 1
    assert watched(ares_v, law) == MONITOR_WORK


def test_a_drop_at_its_predicted_time_is_let_out(ares_v):
    law = guided_to(ares_v, 433.2)
    assert law.steering[0]["jettison_time"] == pytest.approx(434.0, abs=0.3)
    assert watched(ares_v, law) == 0
    assert law.steering[0]["jettison"] == 0


@pytest.mark.parametrize("early_s", [1.0, 5.0, 20.0])
def test_a_drop_above_the_limit_is_not_commanded(ares_v, early_s):
    law = guided_to(ares_v, 433.2 - early_s)
    law.steering[0]["jettison_time"] = float(law.onboard.navigation["time"][0]) + 0.1
    law.steering[0]["jettison"] = 0
    assert watched(ares_v, law) == MONITOR_JETTISON
    assert law.steering[0]["jettison"] == -1
    # nor by the answer that is held next time
    assert law.state["monitors"]["good"]["jettison"] == -1


def test_without_a_good_answer_the_thrust_points_along_the_velocity(ares_v):
    law = guided_to(ares_v, 600.0)
    law.state["monitors"]["kept"] = 0
    law.steering[0]["direction"] = math.nan
    assert watched(ares_v, law) == MONITOR_DIRECTION
    velocity = law.onboard.navigation["velocity"][0]
    assert law.steering[0]["direction"] == pytest.approx(velocity / np.linalg.norm(velocity))
    assert math.isnan(law.steering[0]["cutoff_time"])


def test_a_line_that_turns_too_fast_in_its_turn_is_frozen(ares_v):
    law = guided_to(ares_v, 600.0)
    for steering in (law.state["monitors"]["good"], law.steering[0]):
        steering["reference_time"] = law.onboard.navigation["time"][0]
        steering["direction_rate"] = [0.0, 0.0, 30.0]
    assert watched(ares_v, law) == MONITOR_STEERING_RATE
    assert np.all(law.steering[0]["direction_rate"] == 0.0)
    assert np.linalg.norm(law.steering[0]["direction"]) == pytest.approx(1.0)
    assert watched(ares_v, law) == 0


@pytest.mark.parametrize(
    ("mission", "law", "flights"),
    [
        ("ares_v", "peg", 500),
        ("ares_v", "igm", 500),
        ("ares_v", "optimal", 200),
        ("saturn_v_as506", "peg", 200),
        ("delta_iii", "igm", 200),
        ("space_shuttle_sts121", "peg", 200),
    ],
)
def test_no_standard_flight_sets_off_gate_or_monitor(mission, law, flights):
    settings = Settings(load_mission(mission), load_dispersions(STANDARD), law=law)
    results = FlightRange(settings).fly(0, flights).results
    assert np.all(results["iterations"] > 0)
    assert np.all(results["navigation_refused"] == 0)
    assert np.all(results["violations"] == 0)
