# SPDX-License-Identifier: Apache-2.0
"""Solutions that are kept for those who ask again."""

import os

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_optimizer import kept
from ares_optimizer.deadline import Deadline
from ares_optimizer.registry import SHARED_SOLUTIONS
from ares_optimizer.solution import Status


@pytest.fixture(autouse=True)
def nothing_kept(monkeypatch):
    monkeypatch.setattr(kept, "_kept", type(kept._kept)())
    monkeypatch.delenv(SHARED_SOLUTIONS, raising=False)


def solved(method="indirect", higher_m=0.0, limit_s=None, heating=0.0):
    mission = load_mission("ares_v")
    state = mission.start().navigation()
    state["heating_rate"] = heating
    state["position"] *= 1.0 + higher_m / np.linalg.norm(state["position"])
    return kept.solve_once(mission.arrays(), method, state, "at_jettison", Deadline(limit_s))


def in_another_process(monkeypatch):
    """Forget what this process keeps."""
    kept._kept.clear()
    monkeypatch.setattr(kept, "solve", None)


def test_the_same_inputs_are_solved_once():
    first = solved()
    assert first.converged
    assert solved() is first
    assert solved(heating=5.0) is first


@pytest.mark.parametrize("other", [{"method": "auto"}, {"higher_m": 100.0}])
def test_other_inputs_are_solved(other):
    assert solved() is not solved(**other)


def test_what_ran_out_of_time_is_not_kept():
    assert solved(limit_s=0.0).status is Status.TIME_LIMIT
    assert solved().converged
    assert solved(limit_s=0.0).status is Status.TIME_LIMIT


def test_only_the_last_are_kept(monkeypatch):
    monkeypatch.setattr(kept, "_MOST", 1)
    first = solved()
    solved(higher_m=100.0)
    assert solved() is not first


def test_another_process_finds_it_in_the_shared_folder(monkeypatch, tmp_path):
    monkeypatch.setenv(SHARED_SOLUTIONS, str(tmp_path))
    first = solved()
    in_another_process(monkeypatch)
    again = solved()
    assert again is not first
    assert again.m_f_kg == first.m_f_kg
    assert np.array_equal(again.trajectory.position, first.trajectory.position)


def test_without_the_folder_it_is_solved(monkeypatch, tmp_path):
    monkeypatch.setenv(SHARED_SOLUTIONS, str(tmp_path / "gone"))
    assert solved().converged


def test_a_search_for_others_is_a_new_one(monkeypatch, tmp_path):
    monkeypatch.setenv(SHARED_SOLUTIONS, str(tmp_path))
    mission = load_mission("ares_v")
    inputs = (mission.arrays(), "indirect", mission.start().navigation(), "at_jettison")
    first = kept.solve_once(*inputs, Deadline(None))
    again = kept.solve_once(*inputs, Deadline(None), anew=True)
    assert again is not first
    in_another_process(monkeypatch)
    assert kept.solve_once(*inputs, Deadline(None)).solve_ms == again.solve_ms


def test_a_solution_by_other_code_is_not_found(monkeypatch, tmp_path):
    monkeypatch.setenv(SHARED_SOLUTIONS, str(tmp_path))
    solved()
    kept._kept.clear()
    monkeypatch.setattr(kept, "_code", lambda: b"other")
    solved()
    assert len(list(tmp_path.iterdir())) == 2


def test_a_damaged_file_is_replaced(monkeypatch, tmp_path):
    monkeypatch.setenv(SHARED_SOLUTIONS, str(tmp_path))
    solved()
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    kept._kept.clear()
    assert solved().converged
    assert len(file.read_bytes()) >= 0.9 * len(whole)


def test_the_one_used_least_recently_is_removed(monkeypatch, tmp_path):
    monkeypatch.setenv(SHARED_SOLUTIONS, str(tmp_path))
    monkeypatch.setattr(kept, "_MOST_SHARED", 2)
    files = []
    for k in range(3):
        solved(higher_m=100.0 * k)
        files += [file for file in tmp_path.iterdir() if file not in files]
        os.utime(files[-1], (k, k))
    assert sorted(tmp_path.iterdir()) == sorted(files[1:])


def test_a_plan_in_the_air_is_verified_whether_asked_or_not():
    mission = load_mission("delta_iii_pad")
    inputs = (mission.arrays(), "auto", mission.start().navigation(), "at_jettison")
    first = kept.solve_once(*inputs, Deadline(None), verify=False)
    assert first.verification is not None
    assert kept.solve_once(*inputs, Deadline(None), verify=True) is first
