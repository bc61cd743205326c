# SPDX-License-Identifier: Apache-2.0
"""Plans that commands share."""

import os
from pathlib import Path

import pytest

from ares_bringup import shared_plans
from ares_bringup.commands.cli import main
from ares_bringup.rehearsal import rehearse
from ares_optimizer import kept
from ares_optimizer.registry import SHARED_SOLUTIONS


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path):
    monkeypatch.setattr(kept, "_kept", type(kept._kept)())
    monkeypatch.delenv(SHARED_SOLUTIONS, raising=False)
    monkeypatch.setattr(shared_plans, "plans_folder", lambda: tmp_path / "plans")
    return tmp_path / "plans"


def test_a_flight_finds_the_plan_of_the_optimum(folder, monkeypatch, capfd):
    assert main(["optimize", "--mission", "delta_iii_pad"]) == 0
    assert "7,529.712" in capfd.readouterr().out
    assert len(list(folder.iterdir())) == 1
    kept._kept.clear()
    monkeypatch.setattr(kept, "solve", None)
    with shared_plans.shared_plans():
        assert rehearse({"mission": "delta_iii_pad"}) == ""
    assert SHARED_SOLUTIONS not in os.environ


def test_the_processes_of_a_command_share_where_the_folder_cannot_be_made(folder):
    folder.write_text("a file")
    with shared_plans.shared_plans():
        temporary = os.environ[SHARED_SOLUTIONS]
        assert temporary != str(folder)
        assert Path(temporary).is_dir()
    assert not Path(temporary).exists()


def test_outside_of_a_workspace_plans_are_kept_in_the_cache_of_the_user(monkeypatch, tmp_path):
    monkeypatch.undo()
    monkeypatch.setattr(shared_plans, "workspace_root", lambda: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert shared_plans.plans_folder() == tmp_path / "ares" / "plans"
