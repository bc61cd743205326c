# SPDX-License-Identifier: Apache-2.0
"""Test missions with known failures: their arrays and their optima."""

import math
from importlib import resources

import numpy as np
import pytest

from ares_models.arrays import BURN
from ares_models.failures import Failure, FailureKind
from ares_models.mission import load_mission
from ares_optimizer.foreknown import begin_times, burning_at, foreknown
from ares_optimizer.indirect.solve import solve_indirect
from ares_optimizer.solution import OptimizerError, UnfitMethod
from ares_optimizer.solve import solve


def left_of(name, failure):
    mission = load_mission(name)
    return foreknown(mission.arrays(), mission.start().navigation(), failure)


def burnt(arcs):
    """Return the propellant of every burn of fixed length by its curve, kg."""
    fixed = arcs[(arcs["kind"] == BURN) & np.isfinite(arcs["duration"])]
    return float(np.sum((fixed["duration"] - fixed["start_loss"]) * fixed["mass_flow"]))


@pytest.fixture
def failing_file(tmp_path):
    """Write a shipped mission with `engine_out` in the burn of a length, as a file."""

    def write(name, burn_time, text):
        shipped = resources.files("ares_models").joinpath("missions", f"{name}.yaml").read_text()
        line = next(row for row in shipped.splitlines() if f"burn_time_s: {burn_time}" in row)
        indent = line[: len(line) - len(line.lstrip())]
        path = tmp_path / f"{name}.yaml"
        path.write_text(shipped.replace(line, f"{line}\n{indent}engine_out: {text}"))
        return load_mission(path)

    return write


@pytest.mark.parametrize(
    ("name", "burn_time", "begins", "engines"),
    # the last burn of its stage: in a file those that follow lose no engine
    [("ares_v", "181.25", 155.9, 5), ("saturn_v_as506", "50.22", 498.0, 4)],
)
@pytest.mark.parametrize("after", [10.5, 40.0])
def test_as_the_same_failure_in_the_file(failing_file, name, burn_time, begins, engines, after):
    text = f"{{time_after_ignition_s: {after}, engines: {engines}, lost: 1}}"
    mission = failing_file(name, burn_time, text)
    start = mission.start().navigation()
    in_file = solve_indirect(mission.arrays(), start, verify=False)
    lost = Failure(FailureKind.ENGINE_OUT, begins + after, thrust_ratio=(engines - 1) / engines)
    known = left_of(name, lost)
    assert known.end_s == math.inf
    solution = solve_indirect(known.arrays, start, verify=False)
    assert solution.converged and in_file.converged
    assert solution.m_f_kg == pytest.approx(in_file.m_f_kg, abs=1e-3)
    assert solution.t_meco_s == pytest.approx(in_file.t_meco_s, abs=1e-6)


@pytest.mark.parametrize(
    "failure",
    [
        Failure(FailureKind.ENGINE_OUT, 200.0, thrust_ratio=0.8),
        Failure(FailureKind.THRUST_LOW, 400.0, thrust_ratio=0.7, flow_ratio=0.8),
        Failure(FailureKind.EARLY_SHUTDOWN, 300.0),
    ],
)
def test_another_method_and_its_proof_find_the_same(failure):
    known = left_of("ares_v", failure)
    start = load_mission("ares_v").start().navigation()
    fast = solve_indirect(known.arrays, start, verify=False)
    proven = solve(known.arrays, "direct14", state=start)
    assert fast.converged and proven.converged
    assert fast.m_f_kg == pytest.approx(proven.m_f_kg, abs=1.0)


@pytest.mark.parametrize("time_s", [163.0, 164.0, 166.5, 300.0, 460.0, 480.0, 520.0])
def test_an_engine_lost_takes_no_propellant_with_it(time_s):
    whole = load_mission("saturn_v_as506").arrays().arcs
    lost = Failure(FailureKind.ENGINE_OUT, time_s, thrust_ratio=0.8)
    assert burnt(left_of("saturn_v_as506", lost).arrays.arcs) == pytest.approx(burnt(whole))


def test_low_thrust_ends_by_the_clock():
    low = Failure(FailureKind.THRUST_LOW, 300.0, thrust_ratio=0.7, flow_ratio=0.8)
    arcs = left_of("saturn_v_as506", low).arrays.arcs
    assert begin_times(load_mission("saturn_v_as506").arrays(), 162.3)[-2] == pytest.approx(549.2)
    assert 162.3 + arcs["duration"][:-1].sum() == pytest.approx(549.2)
    first, weak = arcs[1], arcs[2]
    assert weak["thrust"] == pytest.approx(0.7 * first["thrust"])
    assert weak["exhaust_velocity"] == pytest.approx(0.7 / 0.8 * first["exhaust_velocity"])


def test_a_shutdown_ends_all_arcs_of_the_burn_without_a_tail_off():
    known = left_of("saturn_v_as506", Failure(FailureKind.EARLY_SHUTDOWN, 400.0))
    arcs = known.arrays.arcs
    assert list(arcs["stage"]) == [0, 0, 0, 1, 1]
    assert arcs["duration"][1] == pytest.approx(237.0)
    assert not arcs["tail_knots"][1]
    assert known.end_s == math.inf


@pytest.mark.parametrize(
    ("failure", "arcs", "end_s"),
    [
        (Failure(FailureKind.EARLY_SHUTDOWN, 700.0), 2, 700.0),
        (Failure(FailureKind.EARLY_SHUTDOWN, 337.15), 1, 337.15),
        (Failure(FailureKind.FAILED_IGNITION, arc=1), 1, 337.15),
    ],
)
def test_after_the_last_burn_the_flight_is_over(failure, arcs, end_s):
    known = left_of("ares_v", failure)
    assert len(known.arrays.arcs) == arcs
    assert known.arrays.arcs["duration"][-1] == math.inf
    assert known.end_s == pytest.approx(end_s)


def test_a_stage_that_does_not_ignite_drops_at_once():
    known = left_of("saturn_v_as506", Failure(FailureKind.FAILED_IGNITION, arc=1))
    assert list(known.arrays.arcs["stage"]) == [0, 0, 0, 1, 1]
    assert known.arrays.arcs["duration"][1] == 0.0


def test_a_stuck_fairing_is_carried_to_the_end():
    start = load_mission("ares_v").start().navigation()
    known = left_of("ares_v", Failure(FailureKind.STUCK_JETTISON, jettison=0))
    solution = solve_indirect(known.arrays, start, verify=False)
    assert solution.converged
    assert math.isnan(solution.jettison_times_s[0])
    free = solve_indirect(load_mission("ares_v").arrays(), start, verify=False)
    # its mass, and the propellant to carry it
    assert free.m_f_kg < solution.m_f_kg < free.m_f_kg + 5837.0
    assert solution.t_meco_s > free.t_meco_s


def test_a_stuck_throttle_keeps_its_thrust():
    arrays = load_mission("space_shuttle_sts121").arrays()
    stuck = Failure(FailureKind.STUCK_THROTTLE, 480.0)
    known = left_of("space_shuttle_sts121", stuck)
    before, after = known.arrays.arcs
    begins = load_mission("space_shuttle_sts121").start().time_s
    assert before["duration"] == pytest.approx(480.0 - begins)
    assert after["max_acceleration"] == math.inf
    part = after["thrust"] / before["thrust"]
    assert arrays.arcs[0]["min_throttle"] < part < 1.0
    assert after["mass_flow"] == pytest.approx(part * before["mass_flow"])


def test_what_cannot_be_cut():
    with pytest.raises(OptimizerError, match="nothing burns then"):
        left_of("saturn_v_as506", Failure(FailureKind.ENGINE_OUT, 548.5, thrust_ratio=0.8))
    with pytest.raises(OptimizerError, match="arc 0 is the first burn"):
        left_of("delta_iii", Failure(FailureKind.FAILED_IGNITION, arc=0))
    with pytest.raises(UnfitMethod, match="expected only the last arc to be"):
        left_of("delta_iii_coast", Failure(FailureKind.EARLY_SHUTDOWN, 900.0))


def test_what_burns_when():
    arrays = load_mission("saturn_v_as506").arrays()
    found = [burning_at(arrays, 162.3, t) for t in (162.5, 163.0, 460.62, 548.5, 549.2, 900.0)]
    assert found == [-1, 1, 2, -1, 6, 6]
