# SPDX-License-Identifier: Apache-2.0
"""Navigation that is temporarily wrong, in closed loop: refused, the solution held, insertion."""

import math
from functools import cache
from itertools import product

import numpy as np
import pytest

from ares_guidance.arrays import (
    ERROR_NAVIGATION_INVALID,
    REFUSED_DRIFT,
    REFUSED_FROZEN,
    REFUSED_IMPLAUSIBLE,
    REFUSED_MASS,
    REFUSED_POSITION,
    REFUSED_SEQUENCE,
    REFUSED_TIME,
    REFUSED_VELOCITY,
)
from ares_guidance.kernels.monitors.navigation_gate import FEW, MOST_REPEATS
from ares_guidance.laws import find_law, make_law
from ares_models.mission import load_mission
from ares_models.tolerances import FLIGHT_PATH_ANGLE_DEG, ORIENTATION_DEG, RADIUS_M, SPEED_M_S
from ares_studies.closed_loop import Flight, arc_plan, fly_compiled, ready_law
from ares_trials.testing.arrivals import assert_inserted
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.simulator import Simulator

TOLERANCES = [RADIUS_M, SPEED_M_S, FLIGHT_PATH_ANGLE_DEG, ORIENTATION_DEG]


def of_another_mission(nav):
    time = float(nav["time"])
    other = load_mission("apollo11_ascent").start().navigation()[0]
    for name in nav.dtype.names:
        nav[name] = other[name]
    nav["time"] = nav["arc_start_time"] = time


def all_zero(nav):
    for name in nav.dtype.names:
        nav[name] = 0


def changed(**changes):
    def change(nav):
        for name, value in changes.items():
            nav[name] = value(nav[name])

    return change


#: What happens to a state, and why it is refused.
SUDDEN = {
    "position nan": (changed(position=lambda _: math.nan), REFUSED_IMPLAUSIBLE),
    "velocity infinite": (changed(velocity=lambda _: math.inf), REFUSED_IMPLAUSIBLE),
    "all zero": (all_zero, REFUSED_IMPLAUSIBLE),
    "of another mission": (of_another_mission, REFUSED_IMPLAUSIBLE),
    "arc beyond the last": (changed(arc=lambda _: 7), REFUSED_IMPLAUSIBLE),
    "hardly any mass": (changed(mass=lambda mass: 0.03 * mass), REFUSED_IMPLAUSIBLE),
    "position flipped": (changed(position=lambda r: -r), REFUSED_POSITION),
    "velocity flipped": (changed(velocity=lambda v: -v), REFUSED_POSITION | REFUSED_VELOCITY),
    "50 km off": (changed(position=lambda r: r + [0.0, 0.0, 50e3]), REFUSED_POSITION),
    "100 m/s off": (changed(velocity=lambda v: v + [100.0, 0.0, 0.0]), REFUSED_VELOCITY),
    "too much mass": (changed(mass=lambda m: 1.5 * m), REFUSED_MASS | REFUSED_IMPLAUSIBLE),
    "too little mass": (changed(mass=lambda m: 0.5 * m), REFUSED_MASS | REFUSED_IMPLAUSIBLE),
    "nothing sensed so far": (changed(sensed_delta_v=lambda _: 0.0), REFUSED_VELOCITY),
    "an hour late": (changed(time=lambda t: t - 3600.0), REFUSED_TIME),
}


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


@cache
def until(law, begin):
    """Fly ares_v to a time; return simulator and law."""
    mission = load_mission("ares_v")
    simulator = Simulator(mission)
    guide = ready_law(mission, law)
    while not simulator.complete and float(simulator.navigation["time"]) < begin:
        guide.step(simulator.navigation)
        assert guide.state["navigation"]["refused"] == 0
        simulator.command(guide.steering)
        simulator.advance()
    return simulator, guide


def begin_at(simulator, guide, begin):
    """Take up a flight that had no fault so far: most tests fly the same way up to theirs."""
    before, guided = until(guide.kind.name, begin)
    simulator._tick = before._tick
    for arrays, found in (
        (simulator._vehicle, before._vehicle),
        (guide.onboard, guided.onboard),
    ):
        for array, there in zip(arrays, found, strict=True):
            array[:] = there


def fly(mission, fault, begin, end, law="peg"):
    """Fly with navigation changed by `fault` from ``begin`` to ``end`` s; plant, law, refused."""
    simulator = Simulator(mission)
    guide = ready_law(mission, law) if isinstance(law, str) else law
    if mission.name == "ares_v" and not guide.kind.needs_trajectory:
        begin_at(simulator, guide, begin - 1.0)
    wrong = []
    while not simulator.complete:
        nav = simulator.navigation.copy()
        time = float(nav["time"])
        if begin <= time < end:
            before = guide.steering.tobytes()
            fault(nav)
            guide.step(nav)
            refused = guide.state["error"] == ERROR_NAVIGATION_INVALID
            assert not refused or guide.steering.tobytes() == before
            wrong.append((time, bool(refused)))
        else:
            guide.step(nav)
            if not wrong:
                assert guide.state["navigation"]["refused"] == 0
        simulator.command(guide.steering)
        simulator.advance()
    return simulator.plant, guide.state["navigation"], wrong


def assert_arrives(mission, plant):
    assert_inserted(mission, Flight(plant, None), TOLERANCES)


@pytest.mark.parametrize(
    ("name", "begin"), one_in(4, product(SUDDEN, [200.0, 330.0, 425.0, 500.0, 745.0]))
)
def test_a_sudden_fault_is_refused_from_its_first_state_to_its_last(ares_v, name, begin):
    fault, reason = SUDDEN[name]
    plant, watch, wrong = fly(ares_v, fault, begin, begin + 12.0)
    assert all(refused for _, refused in wrong)
    assert watch["refused"] == len(wrong) == 120
    assert watch["reasons"] & reason
    assert_arrives(ares_v, plant)


@pytest.mark.parametrize("share", [0.95, 1.05])
def test_a_twentieth_of_the_mass_is_told_while_one_engine_burns(ares_v, share):
    plant, watch, wrong = fly(ares_v, changed(mass=lambda mass: share * mass), 500.0, 505.0)
    assert watch["refused"] == len(wrong)
    assert watch["reasons"] == REFUSED_MASS
    assert_arrives(ares_v, plant)


def test_an_arc_that_begins_once_more_is_refused(ares_v):
    plant, watch, wrong = fly(ares_v, changed(arc_start_time=lambda t: t + 1.0), 500.0, 505.0)
    assert watch["refused"] == len(wrong)
    assert watch["reasons"] == REFUSED_SEQUENCE
    assert_arrives(ares_v, plant)


@pytest.mark.parametrize("begin", [445.0, 745.0])
def test_a_jettison_that_is_undone_is_refused(ares_v, begin):
    plant, watch, wrong = fly(ares_v, changed(jettisoned=lambda _: 0), begin, begin + 12.0)
    assert watch["refused"] == len(wrong) == 120
    assert watch["reasons"] == REFUSED_SEQUENCE
    assert_arrives(ares_v, plant)


def frozen(*names):
    """Return a fault that repeats the first state, or some of its fields; time advances."""
    seen = []

    def freeze(nav):
        seen.append(nav.copy())
        for name in names or set(nav.dtype.names) - {"time"}:
            nav[name] = seen[0][name]

    return freeze


@pytest.mark.parametrize("begin", one_in(2, [200.0, 330.0, 425.0, 745.0]))
def test_a_navigation_that_stands_still_is_refused_from_its_second_state_on(ares_v, begin):
    plant, watch, wrong = fly(ares_v, frozen(), begin, begin + 12.0)
    assert [refused for _, refused in wrong] == [False] + 119 * [True]
    assert watch["reasons"] & REFUSED_FROZEN
    assert_arrives(ares_v, plant)


def test_a_clock_that_stands_still_is_refused_after_some_repeats(ares_v):
    plant, watch, wrong = fly(ares_v, frozen("time", "position", "velocity"), 500.0, 512.0)
    assert sum(refused for _, refused in wrong) == watch["refused"] == 120 - 1 - MOST_REPEATS
    assert watch["reasons"] & REFUSED_TIME
    assert_arrives(ares_v, plant)


#: Within how many s a part that stands still is told, and by what.
PARTS = {
    "position": (0.2, REFUSED_POSITION),
    "velocity": (2.0, REFUSED_VELOCITY | REFUSED_DRIFT),
    "sensed_delta_v": (2.0, REFUSED_VELOCITY | REFUSED_DRIFT),
    "mass": (20.0, REFUSED_MASS | REFUSED_DRIFT),
}


# each part at one time
@pytest.mark.parametrize(
    ("begin", "name"),
    [*one_in(2, product([200.0], PARTS)), *one_in(2, product([600.0], [*PARTS][::-1]))],
)
def test_a_part_that_stands_still_is_told_within_seconds(ares_v, name, begin):
    within_s, reasons = PARTS[name]
    plant, watch, wrong = fly(ares_v, frozen(name), begin, begin + 25.0)
    told = [time for time, refused in wrong if refused]
    assert told[0] - begin <= within_s
    assert watch["reasons"] & reasons
    assert_arrives(ares_v, plant)


def drifting(name, rate, begin):
    """Return a fault by which a field drifts from a time on."""

    def drift(nav):
        nav[name] += rate * (float(nav["time"]) - begin)

    return drift


@pytest.mark.parametrize(
    ("drift", "begin", "law"),
    one_in(
        5,
        product(
            [("position", 5.0, 30.0), ("velocity", 0.3, 30.0)],
            [220.0, 340.0, 600.0],
            ["peg", "igm"],
        ),
    ),
)
def test_a_slow_drift_is_told_before_it_does_harm(ares_v, law, begin, drift):
    name, rate, within_s = drift
    fault = drifting(name, np.array([0.0, 0.0, rate]), begin)
    plant, watch, wrong = fly(ares_v, fault, begin, begin + 60.0, law)
    told = [time for time, refused in wrong if refused]
    assert told[0] - begin <= within_s
    assert watch["reasons"] & (REFUSED_DRIFT | REFUSED_POSITION | REFUSED_VELOCITY)
    assert watch["acquired"] <= 1
    assert_arrives(ares_v, plant)


def test_navigation_that_stays_away_is_never_taken_up(ares_v):
    fault = changed(position=lambda r: r + [0.0, 0.0, 50e3])
    plant, watch, wrong = fly(ares_v, fault, 600.0, math.inf)
    assert watch["refused"] == len(wrong) > 1600
    assert watch["acquired"] == 0
    # the last solution is flown to its cut-off
    assert plant["inserted"] == 1


def test_navigation_that_was_set_anew_nearby_is_taken_up_after_a_window(ares_v):
    fault = changed(position=lambda r: r + [0.0, 0.0, 400.0])
    plant, watch, wrong = fly(ares_v, fault, 500.0, math.inf)
    assert [refused for _, refused in wrong[:200]] == 200 * [True]
    assert watch["acquired"] == 1
    assert 200 <= watch["refused"] < 240
    assert plant["inserted"] == 1


def test_a_first_state_that_was_none_is_given_up(ares_v):
    fault = changed(position=lambda r: -r)
    plant, watch, wrong = fly(ares_v, fault, 0.0, ares_v.start().time_s + 0.05)
    assert [refused for _, refused in wrong] == [False]
    assert watch["acquired"] == 1
    assert watch["refused"] == FEW - 1
    assert_arrives(ares_v, plant)


@pytest.mark.parametrize("name", ["position nan", "50 km off", "of another mission"])
def test_a_fault_until_after_the_cut_off_ends_where_the_last_solution_does(ares_v, name):
    plant, _, _ = fly(ares_v, SUDDEN[name][0], 760.0, math.inf)
    assert_arrives(ares_v, plant)


@cache
def planned(name):
    """Return a mission with free arcs, its plan, and its flight without faults."""
    mission = load_mission(name)
    first = np.array([Simulator(mission).navigation])
    plan = arc_plan(mission, find_law("peg"), first)
    law = make_law("peg", mission.arrays(foreseen=True))
    law.follow_arcs(plan)
    return mission, plan, fly_compiled(mission, law=law).plant


@pytest.mark.parametrize(
    ("mission", "share"),
    one_in(3, product(["delta_iii_coast", "geostationary_burn"], [0.1, 0.45, 0.5, 0.55, 0.9])),
)
def test_faults_in_free_coasts_and_at_their_ends(mission, share):
    mission, plan, nominal = planned(mission)
    events = nominal["events"][: nominal["event_count"]]
    first, last = float(events["time"][0]), float(nominal["time"])
    begin = first + share * (last - first)
    law = make_law("peg", mission.arrays(foreseen=True))
    law.follow_arcs(plan)
    plant, watch, wrong = fly(mission, SUDDEN["position nan"][0], begin, begin + 15.0, law)
    assert watch["refused"] == len(wrong)
    assert plant["inserted"] == 1
    assert plant["mass"] == pytest.approx(float(nominal["mass"]), rel=1e-4)


@pytest.mark.parametrize(
    ("law", "time"),
    one_in(3, product(["peg", "igm"], [170.0, 250.0, 334.0, 345.0, 430.0, 440.0, 600.0, 735.0])),
)
def test_a_guidance_that_starts_in_mid_flight_arrives(ares_v, law, time):
    """Stop guidance and restart it after 5 s with navigation only."""
    simulator = Simulator(ares_v)
    guide = ready_law(ares_v, law)
    while not simulator.complete:
        now = float(simulator.navigation["time"])
        if not time <= now < time + 5.0:
            guide.step(simulator.navigation)
            simulator.command(guide.steering)
        elif now < time + 0.05:
            guide = ready_law(ares_v, law)
        simulator.advance()
    assert guide.state["navigation"]["refused"] == 0
    assert_arrives(ares_v, simulator.plant)
