# SPDX-License-Identifier: Apache-2.0
"""Solutions that are kept for those who ask again."""

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
    kept._kept.clear()
    monkeypatch.setattr(kept, "solve", None)
    again = solved()
    assert again is not first
    assert again.m_f_kg == first.m_f_kg
    assert np.array_equal(again.trajectory.position, first.trajectory.position)


def test_without_the_folder_it_is_solved(monkeypatch, tmp_path):
    monkeypatch.setenv(SHARED_SOLUTIONS, str(tmp_path / "gone"))
    assert solved().converged
