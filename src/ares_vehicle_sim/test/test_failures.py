# SPDX-License-Identifier: Apache-2.0
"""Failures of the plant: the remaining vehicle, and no other change."""

import math

import numpy as np
import pytest

from ares_models.failures import Failure, FailureError, FailureKind, read_failure
from ares_models.kernels.weakened import weaken_stage
from ares_models.mission import Mission, load_mission
from ares_vehicle_sim.arrays import (
    ARC_ENDED,
    DEPLETION,
    FAILED,
    FLIGHT_COMPLETE,
    IGNITION,
    JETTISON_DONE,
    JETTISON_STUCK,
    OVER_LIMIT,
    STAGING,
)
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions

STEPS = SimulatorOptions(navigation_period_s=1.0, integration_step_s=1.0)


def fly(name, failure=None, until=math.inf):
    """Return the simulator after an unguided flight to a time or to its end."""
    simulator = Simulator(load_mission(name), STEPS, failure=failure)
    while not simulator.complete and simulator.plant["time"] < until:
        simulator.advance()
    return simulator


def times(simulator, kind):
    plant = simulator.plant
    events = plant["events"][: plant["event_count"]]
    return list(events[events["type"] == kind]["time"])


def test_a_failure_to_come_changes_nothing_before_it():
    failure = Failure(FailureKind.THRUST_LOW, 250.25, thrust_ratio=0.7, flow_ratio=0.8)
    for name in ("position", "velocity", "mass", "sensed_delta_v"):
        with_it = fly("ares_v", failure, 249.5).plant[name]
        assert np.array_equal(with_it, fly("ares_v", until=249.5).plant[name])


def test_an_engine_lost_burns_the_same_propellant_longer():
    failure = Failure(FailureKind.ENGINE_OUT, 250.25, thrust_ratio=0.8)
    staging = times(fly("ares_v", failure, 400.0), IGNITION)[1]
    assert staging == pytest.approx(250.25 + (337.15 - 250.25) / 0.8, abs=1e-9)


def test_an_engine_lost_in_its_start_burns_the_same_propellant_longer():
    failure = Failure(FailureKind.ENGINE_OUT, 165.0, thrust_ratio=0.8)
    as506 = load_mission("saturn_v_as506")
    arcs = as506.arrays().arcs
    simulator = Simulator(as506, STEPS, failure=failure)
    while simulator.plant["arc"] < 5:
        used = simulator.plant["propellant_used"]
        simulator.advance()
    burnt = sum((arcs["duration"] - arcs["start_loss"])[1:4] * arcs["mass_flow"][1:4])
    tail = arcs["tail_gain"][3] * arcs["mass_flow"][3]
    assert used == pytest.approx(burnt + 0.8 * tail, rel=1e-4)
    assert times(simulator, IGNITION)[2] > 498.0 + 40.0


def test_low_thrust_ends_by_the_clock_and_leaves_propellant():
    failure = Failure(FailureKind.THRUST_LOW, 250.25, thrust_ratio=0.7, flow_ratio=0.75)
    before = fly("ares_v", failure, 251.0).plant
    sensed, mass = before["sensed_delta_v"].copy(), float(before["mass"])
    after = fly("ares_v", failure, 252.0).plant
    arc = load_mission("ares_v").arrays().arcs[0]
    assert mass - after["mass"] == pytest.approx(0.75 * arc["mass_flow"], rel=1e-9)
    gain = np.linalg.norm(after["sensed_delta_v"] - sensed)
    wanted = 0.7 / 0.75 * arc["exhaust_velocity"] * math.log(mass / after["mass"])
    assert gain == pytest.approx(wanted, rel=1e-6)
    assert times(fly("ares_v", failure, 400.0), IGNITION)[1] == pytest.approx(337.15)


@pytest.mark.parametrize(
    ("failure", "begins"),
    [
        (Failure(FailureKind.EARLY_SHUTDOWN, 250.25), 250.25),
        (Failure(FailureKind.FAILED_IGNITION, arc=0), 155.9),
    ],
)
def test_the_next_stage_is_lit_at_once(failure, begins):
    simulator = fly("ares_v", failure, 260.0)
    assert times(simulator, IGNITION)[-1] == pytest.approx(begins)
    assert times(simulator, ARC_ENDED) == pytest.approx([begins])
    lit = load_mission("ares_v").stages[1].ignition_mass_kg
    flow = load_mission("ares_v").arrays().arcs[1]["mass_flow"]
    burnt = (simulator.plant["time"] - begins) * flow
    assert simulator.plant["mass"] == pytest.approx(lit - burnt, abs=1e-3)


def test_a_burn_of_several_arcs_ends_as_one():
    simulator = fly("saturn_v_as506", Failure(FailureKind.EARLY_SHUTDOWN, 300.0), 310.0)
    assert times(simulator, IGNITION)[-1] == pytest.approx(300.0 + 0.78 + 0.2)


#: Of `ariane5_eca_pad`.
CORE_N, BOOSTERS_END = 1_390_000.0, 141.05


@pytest.mark.parametrize("kind", [FailureKind.ENGINE_OUT, FailureKind.THRUST_LOW])
def test_boosters_burn_on_beside_a_weak_engine(kind):
    failure = Failure(kind, 50.5, thrust_ratio=0.5, flow_ratio=0.5)
    weak, sound = (fly("ariane5_eca_pad", each, 51.0).truth() for each in (failure, None))
    assert sound["thrust"] - weak["thrust"] == pytest.approx(0.5 * CORE_N, rel=1e-4)
    flow = CORE_N / (432.0 * 9.80665)
    assert sound["mass_flow"] - weak["mass_flow"] == pytest.approx(0.5 * flow, rel=1e-4)


@pytest.mark.parametrize("lasts", [True, False])
def test_what_a_weak_engine_leaves_beside_boosters_is_burnt_after_them(lasts):
    arcs = load_mission("ariane5_eca_pad").arrays().arcs
    core = np.flatnonzero(arcs["stage"] == 0)
    alone = core[-1]
    assert arcs["core_thrust"][core].tolist() == [CORE_N] * (len(core) - 1) + [0.0]
    begin, length = float(arcs["duration"][: core[-1]].sum()), float(arcs["duration"][alone])
    weaken_stage(arcs, 0, 2.0, (0.5, 0.5), lasts)
    wanted = (length + 0.5 * (begin - 2.0)) / 0.5 if lasts else length
    assert arcs["duration"][alone] == pytest.approx(wanted, rel=1e-12)
    assert float(arcs["duration"][: core[-1]].sum()) == begin
    assert arcs["core_thrust"][0] == 0.5 * CORE_N


@pytest.mark.parametrize(
    "failure",
    [
        Failure(FailureKind.EARLY_SHUTDOWN, 50.5),
        Failure(FailureKind.FAILED_IGNITION, arc=1),
    ],
    ids=str,
)
def test_boosters_burn_on_beside_an_engine_that_is_shut_down(failure):
    sound, alone = fly("ariane5_eca_pad", until=51.0).truth(), fly("ariane5_eca_pad", failure, 51.0)
    flow = CORE_N / (432.0 * 9.80665)
    assert sound["mass_flow"] - alone.truth()["mass_flow"] == pytest.approx(flow, rel=1e-6)
    while alone.plant["time"] < BOOSTERS_END + 2.0:
        alone.advance()
    assert times(alone, STAGING) == times(alone, JETTISON_DONE) == [pytest.approx(BOOSTERS_END)]
    # with the fairing, which goes later
    assert alone.plant["mass"] == pytest.approx(5490.0 + 14900.0 + 10050.0 + 2400.0, abs=1e-6)
    assert load_mission("ariane5_eca_pad").arrays().arcs["stage"][alone.plant["arc"]] == 1


@pytest.mark.parametrize(
    "failure",
    [Failure(FailureKind.EARLY_SHUTDOWN, 400.0), Failure(FailureKind.FAILED_IGNITION, arc=1)],
)
def test_after_the_last_burn_there_is_no_thrust_any_more(failure):
    simulator = fly("ares_v", failure)
    assert simulator.complete and not simulator.ended_well
    assert len(times(simulator, FLIGHT_COMPLETE)) == 1
    assert not times(simulator, DEPLETION)


def test_a_stuck_throttle_passes_the_limit():
    free = fly("space_shuttle_sts121", until=600.0)
    plant = fly("space_shuttle_sts121", Failure(FailureKind.STUCK_THROTTLE, 400.0)).plant
    arc = load_mission("space_shuttle_sts121").arrays().arcs[0]
    assert plant["time"] < free.plant["time"]
    assert arc["thrust"] / plant["mass"] > 1.5 * arc["max_acceleration"]
    (over,) = plant["events"][plant["events"]["type"] == OVER_LIMIT]
    assert arc["thrust"] / over["mass"] == pytest.approx(1.01 * arc["max_acceleration"])
    assert not times(free, OVER_LIMIT)
    # so late that the engine stops before: no event, since the failure did not happen
    end = free.plant["time"]
    late = fly("space_shuttle_sts121", Failure(FailureKind.STUCK_THROTTLE, end - 0.1))
    assert times(late, FAILED) and not times(late, OVER_LIMIT)


def test_no_throttle_is_stuck_in_a_burn_that_has_none():
    data = load_mission("ares_v").model_dump(exclude_unset=True)
    # the first stage alone is throttled
    data["stages"][0]["max_acceleration_m_s2"] = 30.0
    failure = Failure(FailureKind.STUCK_THROTTLE, 400.0)
    simulator = Simulator(Mission.model_validate(data), STEPS, failure=failure)
    while not simulator.complete:
        simulator.advance()
    assert not times(simulator, FAILED)
    assert simulator.escaped == "failure stuck_throttle: it struck no throttle, nothing failed"


def test_a_jettison_that_is_stuck_is_carried_on():
    stuck = Failure(FailureKind.STUCK_JETTISON, jettison=1)
    simulator = fly("saturn_v_as506", stuck, 560.0)
    assert len(times(simulator, JETTISON_DONE)) == 2
    whole = fly("saturn_v_as506", until=560.0)
    ring = load_mission("saturn_v_as506").jettisons[1].mass_kg
    assert simulator.plant["mass"] - whole.plant["mass"] == pytest.approx(ring)


def test_in_a_coast_nothing_is_there_to_fail():
    late = Failure(FailureKind.EARLY_SHUTDOWN, 548.5)
    flown = fly("saturn_v_as506", late, 600.0).plant["velocity"]
    # a stop of the integrator more, and nothing else
    assert flown == pytest.approx(fly("saturn_v_as506", until=600.0).plant["velocity"], rel=1e-9)


@pytest.mark.parametrize(
    ("failure", "kind", "time", "index"),
    [
        (Failure(FailureKind.ENGINE_OUT, 300.0, thrust_ratio=0.8), FAILED, 300.0, 1),
        (Failure(FailureKind.EARLY_SHUTDOWN, 300.0), FAILED, 300.0, 1),
        (Failure(FailureKind.FAILED_IGNITION, arc=1), FAILED, 163.0, 1),
        (Failure(FailureKind.STUCK_JETTISON, jettison=1), JETTISON_STUCK, 192.3, 1),
    ],
)
def test_what_fails_is_an_event(failure, kind, time, index):
    simulator = fly("saturn_v_as506", failure, 320.0)
    (event,) = [
        event
        for event in simulator.plant["events"][: simulator.plant["event_count"]]
        if event["type"] in (FAILED, JETTISON_STUCK)
    ]
    assert (event["type"], event["index"]) == (kind, index)
    assert event["time"] == pytest.approx(time)
    assert simulator.escaped == ""


@pytest.mark.parametrize(
    ("failure", "said"),
    [
        (None, ""),
        (
            Failure(FailureKind.EARLY_SHUTDOWN, 548.5),
            "failure early_shutdown: it struck a coast, nothing failed",
        ),
        (
            Failure(FailureKind.EARLY_SHUTDOWN, 1e5),
            "failure early_shutdown: its time did not come, nothing failed",
        ),
    ],
)
def test_a_failure_that_does_not_happen_is_told(failure, said):
    simulator = fly("saturn_v_as506", failure)
    assert not times(simulator, FAILED)
    assert simulator.escaped == said


def test_as_it_is_written():
    failure = read_failure("thrust_low:time=200,thrust_ratio=0.8,flow_ratio=0.9")
    assert failure == Failure(FailureKind.THRUST_LOW, 200.0, thrust_ratio=0.8, flow_ratio=0.9)
    assert read_failure("stuck_jettison:jettison=1").jettison == 1


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("engine", "failure is 'engine'; expected engine_out, thrust_low, early_shutdown"),
        ("engine_out:arc=1", "failure engine_out: 'arc'; expected time, thrust_ratio"),
        ("engine_out:time=1,time=2", "'time'; expected time, thrust_ratio once"),
        ("engine_out:time=soon", "failure engine_out: time is 'soon'; expected a number"),
        ("failed_ignition:arc=1.5", "arc is '1.5'; expected a number"),
        ("engine_out:thrust_ratio=0.5", "time is missing; expected a number"),
        ("failed_ignition", "arc is missing; expected a number"),
        ("engine_out:time=200,thrust_ratio=1.5", "thrust_ratio is 1.5; expected 0.01 to 1"),
        ("thrust_low:time=200,flow_ratio=nan", "flow_ratio is nan; expected 0.01 to 2"),
        ("engine_out:time=200", "nothing fails; expected thrust_ratio other than 1"),
        ("thrust_low:time=200", "expected thrust_ratio or flow_ratio other than 1"),
        ("failed_ignition:arc=2", "arc is 2; expected a burn: 0, 1"),
        ("stuck_jettison:jettison=1", "jettison is 1; expected 0 to 0"),
        ("stuck_throttle:time=200", "nothing fails; expected a mission with a burn that is thr"),
    ],
)
def test_what_cannot_fail(text, line):
    with pytest.raises(FailureError) as caught:
        Simulator(load_mission("ares_v"), STEPS, failure=read_failure(text))
    assert line in str(caught.value)


def test_no_jettison_can_be_stuck_where_there_is_none():
    with pytest.raises(FailureError, match="jettison is 0; the mission has none"):
        Simulator(
            load_mission("delta_iii"),
            STEPS,
            failure=Failure(FailureKind.STUCK_JETTISON, jettison=0),
        )


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("peak_heating_after_jettison", 3.4e3, ()),
        (
            "peak_heating_after_jettison",
            131e3,
            ("heating after the jettison reached 131,000 W/m2, 115 times its limit",),
        ),
        ("q_alpha_share", 1.04, ()),
        ("q_alpha_share", 1.27, ("q alpha reached 1.27 times its limit",)),
        ("dynamic_pressure_share", 1.1, ("dynamic pressure reached 1.10 times its limit",)),
    ],
)
def test_a_limit_that_is_passed_by_far_is_told(field, value, said):
    simulator = Simulator(load_mission("ares_v"))
    simulator.plant[field] = value
    assert simulator.overloads == said
