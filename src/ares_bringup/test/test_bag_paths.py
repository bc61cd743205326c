# SPDX-License-Identifier: Apache-2.0
"""Names and places of new bags."""

from datetime import UTC, datetime
from pathlib import Path

from ares_bringup.bag_paths import bags_folder, new_bag, workspace_root

NOON = datetime(2025, 3, 1, 12, 0, 0, tzinfo=UTC)


def test_a_new_bag_overwrites_nothing_and_sorts(tmp_path):
    names = []
    for _ in range(12):
        path = new_bag("ares_v", tmp_path, NOON)
        path.mkdir()
        names.append(path.name)
    later = new_bag("ares_v", tmp_path, NOON.replace(second=1))
    assert names[0] == "ares_v_20250301T120000Z"
    assert len(set(names)) == 12
    assert sorted([*names, later.name]) == [*names, later.name]


def test_a_dangling_link_is_not_overwritten_either(tmp_path):
    (tmp_path / "ares_v_20250301T120000Z").symlink_to(tmp_path / "nowhere")
    assert new_bag("ares_v", tmp_path, NOON).name == "ares_v_20250301T120000Z_02"


def test_bags_lie_in_the_workspace(monkeypatch):
    monkeypatch.delenv("ARES_BAGS", raising=False)
    root = workspace_root()
    assert root is not None
    assert (root / "src" / "ares_bringup").is_dir()
    assert bags_folder() == root / "bags"


def test_the_folder_can_be_named(monkeypatch, tmp_path):
    monkeypatch.setenv("ARES_BAGS", str(tmp_path))
    assert bags_folder() == tmp_path


def test_outside_of_a_workspace_bags_lie_here(monkeypatch, tmp_path):
    monkeypatch.delenv("ARES_BAGS", raising=False)
    monkeypatch.setattr("ares_bringup.bag_paths.workspace_root", lambda: None)
    monkeypatch.chdir(tmp_path)
    assert bags_folder() == Path.cwd() / "bags"
