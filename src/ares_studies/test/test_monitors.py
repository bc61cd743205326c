# SPDX-License-Identifier: Apache-2.0
"""Monitors: each rule, and no violation in dispersed flights."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ares_guidance.arrays import (
    ERROR_PROPELLANT_SHORT,
    ERROR_TARGET_UNREACHABLE,
    MONITOR_DEPLETION,
    MONITOR_DIRECTION,
    MONITOR_JETTISON,
    MONITOR_STEERING_RATE,
    MONITOR_TIME_TO_GO,
    MONITOR_WORK,
    PHASE_CUTOFF,
    Onboard,
)
from ares_guidance.kernels.monitors import DEPLETION_S, most_iterations, watch_answer
from ares_models.arrays import HEATING_LIMIT
from ares_models.mission import load_mission
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, ready_law
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_vehicle_sim.arrays import JETTISON_DONE
from ares_vehicle_sim.dispersions import STANDARD, load_dispersions
from ares_vehicle_sim.simulator import CAMPAIGN, Simulator, SimulatorOptions, true_vehicle


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
    watch_answer(mission.arrays().records(), Onboard(*(array[0] for array in law.onboard)))
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


def test_the_thesis_law_drops_nothing_above_the_limit_that_it_measures(ares_v):
    """Check its jettison, timed by speed: in denser air a monitor delays it."""
    spread = load_dispersions(STANDARD)
    guess = solve(ares_v, "analytic")
    violations, dropped = 0, []
    # the flights of a campaign, in whose loop nothing else flies this law: it takes long to compile
    for number in range(100):
        law = ready_law(ares_v, "peg_thesis", guess=guess)
        flight = fly_compiled(ares_v, CAMPAIGN, spread, flight=number, law=law)
        assert flight.guidance["navigation"]["refused"] == 0
        violations += int(flight.guidance["monitors"]["violations"])
        true, _ = true_vehicle(ares_v, CAMPAIGN, spread, 0, number)
        heating = flight.events["heating_rate"][flight.events["type"] == JETTISON_DONE]
        dropped += [float(heat) / float(true.jettisons["value"][0]) for heat in heating]
    assert violations > 0
    assert len(dropped) > 90
    assert max(dropped) <= 1.01


#: All laws and missions whose vehicle can be as far off as STANDARD says and still arrive.
FLOWN = (
    *(("ares_v", law) for law in ("peg", "igm", "optimal", "peg_thesis")),
    *(("ares_v_transients", law) for law in ("peg", "igm", "optimal")),
    *(("saturn_v_as506", law) for law in ("peg", "igm", "optimal")),
    *(("delta_iii", law) for law in ("peg", "igm", "optimal")),
    *(("delta_iii_coast", law) for law in ("peg", "igm")),
    *(("space_shuttle_sts121", law) for law in ("peg", "igm", "optimal")),
)


#: What guidance says of a target that it cannot reach.
SHORT = (ERROR_PROPELLANT_SHORT, ERROR_TARGET_UNREACHABLE)


def keeps_its_rules(law, now, before):
    """Hold an answer against what is asked of each, without a kernel of the monitors.

    Args:
        law: that has answered.
        now: the navigation state it has answered, record.
        before: arc, time and direction of the answer before; None for the first.

    Returns:
        arc, time and direction of this one.
    """
    answer = law.steering[0]
    time = float(now["time"])
    since = time - float(answer["reference_time"])
    assert np.linalg.norm(answer["direction"]) == pytest.approx(1.0, abs=1e-6)
    direction = answer["direction"] + since * answer["direction_rate"]
    direction = direction / np.linalg.norm(direction)
    settings = law.onboard.settings[0]
    arc = int(now["arc"])
    # the next burn may begin in another direction
    if before is not None and arc == before[0]:
        _, then, earlier = before
        turned = math.atan2(np.linalg.norm(np.cross(earlier, direction)), earlier @ direction)
        # a cycle may find another solution; it turns no faster than over a cycle
        span = max(time - then, float(settings["cycle_period"]))
        assert turned <= float(settings["steering_rate_limit"]) * span
    if law.state["phase"] < PHASE_CUTOFF:
        assert not float(answer["cutoff_time"]) < time - 1e-9
    assert 0 <= law.state["iterations"] <= most_iterations(settings)
    return arc, time, direction


@pytest.mark.parametrize("period_s", [2.0, 4.0])
@pytest.mark.parametrize("law", ["peg", "peg_thesis"])
def test_no_jettison_is_too_early_where_states_are_rarer_than_cycles(law, period_s):
    mission = load_mission("ares_v")
    limit = float(mission.arrays().jettisons[0]["value"])
    options = SimulatorOptions(navigation_period_s=period_s)
    # in these peg_thesis would come to 1.1 to 1.5 times the limit
    for seed in (4, 13, 19):
        flown = fly_compiled(mission, options, load_dispersions(STANDARD), seed, law=law)
        (dropped,) = flown.events[flown.events["type"] == JETTISON_DONE]
        assert dropped["heating_rate"] <= 1.005 * limit


@given(st.sampled_from(FLOWN), st.integers(0, 10**6), st.sampled_from((0.2, 0.5, 1.0)))
@settings(max_examples=15, deadline=None)
def test_every_answer_of_a_dispersed_flight_keeps_the_rules(flown, seed, period_s):
    mission, name = load_mission(flown[0]), flown[1]
    simulator = Simulator(
        mission,
        SimulatorOptions(navigation_period_s=period_s),
        load_dispersions(STANDARD),
        seed=seed,
    )
    law = ready_law(mission, name)
    arrays = mission.arrays()
    before, heated = None, math.nan
    jettisoned = int(simulator.navigation["jettisoned"])
    while not simulator.complete:
        nav = simulator.navigation
        law.step(nav)
        if law.steered:
            before = keeps_its_rules(law, nav, before)
        heated = float(nav["heating_rate"])
        simulator.command(law.steering)
        simulator.advance()
        dropped = int(simulator.navigation["jettisoned"]) & ~jettisoned
        jettisoned |= dropped
        for index, jettison in enumerate(arrays.jettisons):
            if dropped >> index & 1 and jettison["criterion"] == HEATING_LIMIT:
                # what it measured at most a period before, while the heating falls
                assert heated <= (1.0 + 0.1 * period_s) * float(jettison["value"])
    # cut off by command, or its want of propellant said, or known as well as depletion is
    late = float(law.steering[0]["cutoff_time"]) - float(simulator.plant["time"])
    assert simulator.ended_well or law.state["error"] in SHORT or late <= DEPLETION_S
