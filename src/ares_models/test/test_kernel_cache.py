# SPDX-License-Identifier: Apache-2.0
"""Default folder of compiled kernels."""

import os
import subprocess
import sys
import tempfile
import time

import pytest

from ares_models import kernel_cache


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_kernels_go_to_the_users_cache(home):
    folder = kernel_cache.choose_folder()
    assert folder.is_dir()
    assert folder.parent == home / "cache" / "ares" / "kernels"
    assert kernel_cache.choose_folder() == folder


def test_without_a_home_they_go_to_a_temporary_folder_of_this_user(home):
    (home / "cache").write_text("not a folder")
    folder = kernel_cache.choose_folder()
    assert folder.parents[1] == home / f"ares-{os.getuid()}"
    assert folder.parents[1].stat().st_mode & 0o777 == 0o700


def test_a_folder_that_others_can_write_is_not_trusted(home):
    (home / "cache").write_text("not a folder")
    trap = home / f"ares-{os.getuid()}"
    trap.mkdir()
    trap.chmod(0o777)
    assert trap not in kernel_cache.choose_folder().parents


def test_states_that_nobody_uses_are_dropped(home):
    folders = [home / "cache" / "ares" / "kernels" / name for name in ("old", "new")]
    for folder in folders:
        folder.mkdir(parents=True)
    long_ago = time.time() - 2.0 * kernel_cache.KEPT
    os.utime(folders[0], (long_ago, long_ago))
    kernel_cache.choose_folder()
    assert [folder.exists() for folder in folders] == [False, True]


@pytest.mark.parametrize("chosen", ["", "mine"])
def test_the_user_decides(home, chosen):
    wanted = str(home / chosen) if chosen else ""
    environment = {**os.environ, "NUMBA_CACHE_DIR": wanted}
    look = "import ares_models.jit, numba; print(numba.config.CACHE_DIR)"
    answer = subprocess.run(
        [sys.executable, "-c", look], env=environment, capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == (wanted or str(kernel_cache.choose_folder()))
