# SPDX-License-Identifier: Apache-2.0
"""The preparation of the workspace, without a real one."""

import fcntl
import os
import pty
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

import pytest

import workspace
from ares_bringup.usage import read_usage
from preparation import (
    browser,
    building,
    digests,
    installing,
    layout,
    needs,
    paths,
    progress,
    running,
    stamps,
    steps,
)

ROOT = Path(__file__).parent.parent


@pytest.fixture
def project(tmp_path):
    """Make a small project: one interface package, two Python packages."""
    root = tmp_path / "a project"
    files = {
        "requirements/locked/uv.txt": "uv==0.13.9\n",
        "requirements/locked/ros-jazzy.txt": "ros-rclpy==7.1.6\n",
        "requirements/locked/build.txt": "colcon-core==0.21.3\n",
        "requirements/locked/fly.txt": "numpy==2.4.6\n",
        "requirements/locked/solve.txt": "scipy==1.17.1\n",
        "requirements/locked/live.txt": "tornado==6.6.1\n",
        "requirements/locked/pages.txt": "plotly==7.1.0\n",
        "requirements/locked/dev.txt": "pytest==9.2.0\n",
        "src/ares_msgs/package.xml": "<package/>",
        "src/ares_msgs/CMakeLists.txt": "project(ares_msgs)\n",
        "src/ares_msgs/msg/A.msg": "float64 x\n",
        "src/ares_one/package.xml": "<package/>",
        "src/ares_one/setup.py": "setup()\n",
        "src/ares_one/ares_one/__init__.py": "",
        "src/ares_one/ares_one/constants.py": "ONE = 1.0\n",
        "src/ares_one/ares_one/kernels/__init__.py": "",
        "src/ares_one/ares_one/kernels/sums.py": (
            "from ares_one.constants import (\n    ONE,\n)\nfrom . import parts\n\n"
            "@kernel\ndef total(x):\n    return ONE + parts.half(x)\n"
        ),
        "src/ares_one/ares_one/kernels/parts.py": "def half(x):\n    return 0.5 * x\n",
        "src/ares_two/package.xml": "<package/>",
        "src/ares_two/setup.py": "setup()\n",
        "src/ares_two/ares_two/node.py": "from ares_one.kernels.sums import total\n",
        "src/ares_two/launch/a.launch.py": "",
    }
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def test_digest_sees_where_parts_end():
    assert digests.digest(["ab", "c"]) != digests.digest(["a", "bc"])
    assert digests.digest(["ab", b"c"]) == digests.digest([b"ab", "c"])


def test_environment_follows_pins_python_ros_and_place(project):
    before = digests.environment_digest(project, "3.11", "")
    assert digests.environment_digest(project, "3.11", "") == before
    assert digests.environment_digest(project, "3.12", "") != before
    assert digests.environment_digest(project, "3.11", "/opt/ros/jazzy") != before
    (project / "requirements/locked/dev.txt").write_text("pytest==9.2.1\n")
    assert digests.environment_digest(project, "3.11", "") == before
    (project / "requirements/locked/fly.txt").write_text("numpy==2.4.7\n")
    assert digests.environment_digest(project, "3.11", "") != before


def test_a_sourced_ros_does_not_depend_on_the_wheels(project):
    before = digests.environment_digest(project, "3.12", "/opt/ros/jazzy")
    (project / "requirements/locked/ros-jazzy.txt").write_text("ros-rclpy==7.1.8\n")
    assert digests.environment_digest(project, "3.12", "/opt/ros/jazzy") == before


def test_interfaces_are_rebuilt_for_messages_only(project):
    before = digests.interface_digest(project, "x")
    (project / "src/ares_one/ares_one/constants.py").write_text("ONE = 2.0\n")
    (project / "src/ares_one/setup.py").write_text("setup(name='ares_one')\n")
    assert digests.interface_digest(project, "x") == before
    (project / "src/ares_msgs/msg/B.msg").write_text("float64 y\n")
    changed = digests.interface_digest(project, "x")
    assert changed != before
    (project / "src/ares_msgs/msg/B.msg").write_text("float64 z\n")
    assert digests.interface_digest(project, "x") != changed


def test_messages_that_ros_lacks_are_built(project, tmp_path):
    package = project / "tools/interfaces/tf2_msgs"
    package.mkdir(parents=True)
    before = digests.interface_digest(project, "x")
    (package / "package.xml").write_text("<package/>")
    (package / "CMakeLists.txt").write_text("project(tf2_msgs)")
    assert digests.interface_digest(project, "x") != before
    here = layout.Workspace(project, "3.11")
    installed = project / "install/share/tf2_msgs"
    ros = tmp_path / "ros/share/tf2_msgs"
    # what this workspace has built itself is none of ROS 2
    environ = {"AMENT_PREFIX_PATH": f"{project / 'install'}:{tmp_path / 'ros'}"}
    installed.mkdir(parents=True)
    (installed / "package.xml").write_text("<package/>")
    assert building.missing_interfaces(here, environ) == [package]
    ros.mkdir(parents=True)
    (ros / "package.xml").write_text("<package/>")
    assert building.missing_interfaces(here, environ) == []


def test_packages_are_reinstalled_for_their_layout_only(project):
    before = digests.package_digest(project)
    (project / "src/ares_one/ares_one/constants.py").write_text("ONE = 2.0\n")
    (project / "src/ares_two/launch/a.launch.py").write_text("# live through its link\n")
    assert digests.package_digest(project) == before
    (project / "src/ares_two/launch/b.launch.py").write_text("")
    added = digests.package_digest(project)
    assert added != before
    (project / "src/ares_one/setup.py").write_text("setup(name='ares_one')\n")
    assert digests.package_digest(project) != added


@pytest.mark.parametrize(
    ("changed", "counts"),
    [
        ("ares_one/ares_one/kernels/sums.py", True),
        ("ares_one/ares_one/kernels/parts.py", True),  # relative import, no kernel of its own
        ("ares_one/ares_one/constants.py", True),  # frozen into the machine code
        ("ares_two/ares_two/node.py", False),
        ("ares_one/ares_one/unused.py", False),
    ],
)
def test_kernels_are_compiled_anew_for_what_they_are_made_from(project, changed, counts):
    before = digests.kernel_digest(project)
    with (project / "src" / changed).open("a") as stream:
        stream.write("\n# changed\n")
    assert (digests.kernel_digest(project) != before) == counts


def test_kernels_of_this_project_are_all_seen():
    kernels = [
        path
        for path in ROOT.glob("src/*/ares_*/**/*.py")
        if "\n@kernel" in path.read_text(encoding="utf-8")
    ]
    assert kernels
    digest = digests.kernel_digest(ROOT)
    assert layout.Workspace(ROOT, "3.11").kernels.name == digest


def test_the_environment_is_its_own_fixed_point(project):
    prepared = layout.Workspace(project, "3.12")
    once = prepared.environment({"PATH": "/bin", "HOME": "/h"})
    assert prepared.environment(once) == once
    assert once["HOME"] == "/h"
    assert once["PATH"] == f"{project}/.venv/bin:/bin"
    assert once["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert once["AMENT_PREFIX_PATH"].split(":") == [f"{project}/install", f"{project}/.venv"]
    assert f"{project}/src/ares_one" in once["PYTHONPATH"].split(":")


def test_the_user_decides_over_the_defaults(project):
    mine = {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp", "NUMBA_CACHE_DIR": "/cache"}
    result = layout.Workspace(project, "3.12").environment(mine)
    assert result["RMW_IMPLEMENTATION"] == "rmw_cyclonedds_cpp"
    assert result["NUMBA_CACHE_DIR"] == "/cache"


def test_kernels_of_an_older_state_are_not_used(project):
    prepared = layout.Workspace(project, "3.12")
    before = prepared.environment({})
    (project / "src/ares_one/ares_one/constants.py").write_text("ONE = 2.0\n")
    assert prepared.environment(before)["NUMBA_CACHE_DIR"] != before["NUMBA_CACHE_DIR"]


def test_an_unused_ros_leaves_no_trace(project):
    humble = "/opt/ros/humble"
    sourced = {
        "ROS_DISTRO": "humble",
        "AMENT_PREFIX_PATH": humble,
        "PATH": f"{humble}/bin:/usr/bin",
        "PYTHONPATH": f"{humble}/lib/python3.10/site-packages:/mine",
    }
    result = layout.Workspace(project, "3.12").environment(sourced)
    assert not [name for name, value in result.items() if humble in value]
    assert "ROS_DISTRO" not in result
    assert result["PYTHONPATH"].endswith(":/mine")
    assert result["PATH"].endswith(":/usr/bin")


def test_another_clone_leaves_no_trace(project, tmp_path):
    (tmp_path / "b").mkdir()
    other = layout.Workspace(tmp_path / "b", "3.12").environment({"PATH": "/bin"})
    alone = layout.Workspace(project, "3.12").environment({"PATH": "/bin"})
    assert layout.Workspace(project, "3.12").environment(other) == alone


@pytest.fixture
def jazzy(tmp_path):
    """Return the environment of a sourced ROS 2 Jazzy."""
    prefix = tmp_path / "jazzy"
    (prefix / "share/rclpy").mkdir(parents=True)
    (prefix / "share/rclpy/package.xml").touch()
    return {
        "ROS_DISTRO": "jazzy",
        "AMENT_PREFIX_PATH": str(prefix),
        "PATH": f"{prefix}/bin:/bin",
        "PYTHONPATH": f"{prefix}/lib/python3.12/site-packages",
    }


def test_a_sourced_jazzy_is_found(project, jazzy):
    assert paths.sourced_ros(project, jazzy) == jazzy["AMENT_PREFIX_PATH"]
    assert paths.sourced_ros(project, jazzy | {"ROS_DISTRO": "humble"}) == ""
    assert paths.sourced_ros(project, {"PATH": "/bin"}) == ""


def test_a_workspace_on_a_sourced_jazzy_runs_in_a_plain_shell(project, jazzy):
    added = paths.ros_paths(jazzy)
    prefix = jazzy["AMENT_PREFIX_PATH"]
    prepared = layout.Workspace(project, "3.12", prefix, prefix, added)
    plain = prepared.environment({"PATH": "/bin"})
    assert prefix in plain["AMENT_PREFIX_PATH"].split(":")
    assert f"{prefix}/lib/python3.12/site-packages" in plain["PYTHONPATH"].split(":")
    assert plain["ROS_DISTRO"] == "jazzy"
    assert "_ROS_WHEELS_BOOTSTRAP_COMPLETE" not in plain


def stamped(project, **changes):
    """Pretend that .venv is complete."""
    python = project / ".venv/bin/python"
    python.parent.mkdir(parents=True, exist_ok=True)
    if not python.exists():
        python.symlink_to(sys.executable)
    stamp = {"python": "3.11", "ros": "", "sourced": ""} | changes
    made_from = digests.environment_digest(project, stamp["python"], stamp["ros"])
    stamps.write_stamp(stamps.venv_stamp(project), {"digest": made_from} | stamp)


def test_a_complete_environment_is_accepted(project):
    assert stamps.prepared_environment(project, {}) is None
    stamped(project)
    found = stamps.prepared_environment(project, {})
    assert found == layout.Workspace(project, "3.11")


def test_an_environment_is_made_anew_when_it_does_not_fit(project, jazzy):
    stamped(project)
    assert stamps.prepared_environment(project, jazzy) is None
    assert stamps.prepared_environment(project, {}) is not None
    (project / "requirements/locked/fly.txt").write_text("numpy==2.5.0\n")
    assert stamps.prepared_environment(project, {}) is None
    stamped(project)
    assert stamps.prepared_environment(project, {}) is not None
    stamps.venv_stamp(project).write_text('{"digest": "cut of')
    assert stamps.prepared_environment(project, {}) is None
    stamped(project)
    (project / ".venv/bin/python").unlink()
    assert stamps.prepared_environment(project, {}) is None


def test_a_jazzy_without_a_python_for_it_is_asked_once(project, jazzy):
    stamped(project, sourced=jazzy["AMENT_PREFIX_PATH"])
    assert stamps.prepared_environment(project, jazzy) is not None


def test_a_removed_jazzy_is_noticed(project, jazzy):
    prefix = jazzy["AMENT_PREFIX_PATH"]
    stamped(project, ros=prefix, sourced=prefix)
    assert stamps.prepared_environment(project, {}) is not None
    shutil.rmtree(prefix)
    assert stamps.prepared_environment(project, {}) is None


def test_a_build_counts_only_with_its_stamp(project):
    prepared = layout.Workspace(project, "3.11")
    (project / "build").mkdir()
    (project / "install").mkdir()
    (project / "install/setup.sh").touch()
    assert not stamps.is_built(prepared)
    stamps.write_stamp(stamps.build_stamp(project), stamps.build_digests(prepared))
    assert stamps.is_built(prepared)
    (project / "src/ares_msgs/msg/A.msg").write_text("float32 x\n")
    assert not stamps.is_built(prepared)


def program(folder: Path, name: str, text: str = "") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def test_a_missing_compiler_is_one_line(tmp_path):
    environ = {"PATH": str(tmp_path)}
    with pytest.raises(running.WorkspaceError, match=r"no C compiler .* install"):
        installing.check_prerequisites(environ)
    program(tmp_path, "gcc")
    with pytest.raises(running.WorkspaceError, match=r"no C\+\+ compiler .* install"):
        installing.check_prerequisites(environ)
    program(tmp_path, "g++")
    if Path(sysconfig.get_path("include"), "Python.h").exists():
        installing.check_prerequisites(environ)


def test_a_compiler_may_be_named(tmp_path):
    compiler = program(tmp_path / "elsewhere", "mycc")
    environ = {"PATH": str(tmp_path), "CC": f"{shlex.quote(str(compiler))} -m64"}
    assert installing.find_compiler("CC", ("cc",), environ) == str(compiler)
    assert installing.find_compiler("CC", ("cc",), environ | {"CC": "nothing"}) is None


def test_missing_parts_of_python_are_one_line(tmp_path, monkeypatch):
    program(tmp_path, "cc")
    program(tmp_path, "c++")
    environ = {"PATH": str(tmp_path)}
    monkeypatch.setattr(installing.importlib.util, "find_spec", {}.get)
    with pytest.raises(running.WorkspaceError, match="virtual environments: install"):
        installing.check_prerequisites(environ)
    monkeypatch.setattr(installing.sysconfig, "get_path", lambda _: str(tmp_path))
    with pytest.raises(running.WorkspaceError, match="header files: install"):
        installing.check_prerequisites(environ)


def test_a_browser_that_is_there_is_enough(project, tmp_path, capsys):
    assert browser.find_browser({"PATH": str(tmp_path)}) is None
    chromium = program(tmp_path / "bin", "chromium")
    environ = {"PATH": str(tmp_path / "bin")}
    assert browser.find_browser(environ) == str(chromium)
    browser.install_browser(layout.Workspace(project, "3.11"), environ)
    assert capsys.readouterr().err == ""


def test_a_missing_browser_is_installed(project, tmp_path, capsys, monkeypatch):
    (project / "requirements/apt.list").write_text("# why\nchromium\n")
    bin_folder = tmp_path / "bin"
    program(bin_folder, "apt-get", f'echo "$@" >> {tmp_path}/asked')
    monkeypatch.setattr(browser.os, "geteuid", lambda: 0)
    browser.install_browser(layout.Workspace(project, "3.11"), {"PATH": str(bin_folder)})
    asked = (tmp_path / "asked").read_text().splitlines()
    assert asked == ["update", "install -y --no-install-recommends chromium"]
    assert "installing a browser" in capsys.readouterr().err


@pytest.mark.parametrize("may", [False, True])
def test_a_browser_that_cannot_be_installed_is_one_line(
    project, tmp_path, capsys, monkeypatch, may
):
    (project / "requirements/apt.list").write_text("chromium\n")
    bin_folder = tmp_path / "bin"
    program(bin_folder, "apt-get", "echo 'E: Unable to locate package chromium'; exit 100")
    program(bin_folder, "sudo", f"touch {tmp_path}/used")
    monkeypatch.setattr(browser.os, "geteuid", lambda: 0 if may else 1000)
    browser.install_browser(layout.Workspace(project, "3.11"), {"PATH": str(bin_folder)})
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.endswith(browser.NO_BROWSER)
    assert ("Unable to locate package" in last) == may
    assert not (tmp_path / "used").exists()


def test_what_a_verb_needs_is_added_once(project):
    prepared = layout.Workspace(project, "3.11")
    (project / ".venv").mkdir()
    both = ("pages.txt", "dev.txt")
    assert stamps.missing_additions(prepared, ()) == []
    assert stamps.missing_additions(prepared, both) == list(both)
    for name in both:
        stamp = stamps.addition_digest(prepared, name)
        stamps.write_stamp(stamps.addition_stamp(project, name), stamp)
    assert stamps.missing_additions(prepared, both) == []
    (project / "requirements/locked/dev.txt").write_text("pytest==9.2.1\n")
    assert stamps.missing_additions(prepared, both) == ["dev.txt"]


@pytest.mark.parametrize(
    ("arguments", "kernels"),
    [
        (["fly"], "peg"),
        (["fly", "--mission", "peg", "--json"], "peg"),
        (["fly", "--guidance", "igm"], "igm"),
        (["fly", "--guidance=optimal", "--json"], "optimal"),
        (["fly", "--guidance", "../x"], "peg"),
        (["missions"], ""),
        (["dispersions", "new", "--mission", "ares_v"], ""),
        (["replay", "bag"], ""),
        (["replay", "bag", "--check"], "peg"),
        (["replay", "bag", "--check", "--guidance", "igm"], "igm"),
        (["optimize"], "all"),
        (["montecarlo", "--guidance", "igm"], "all"),
        (["test"], "all"),
    ],
)
def test_a_flight_compiles_its_own_law(arguments, kernels):
    assert needs.kernels_for(arguments) == kernels


@pytest.mark.parametrize(
    ("arguments", "additions"),
    [
        (["fly"], ("solve.txt",)),
        (["fly", "--in-process", "--json", "--bag", "flight"], ("solve.txt",)),
        (["fly", "--foxglove"], ("solve.txt", "live.txt", "pages.txt")),
        (["fly", "--foxglove-port=8766", "--seed", "1"], ("solve.txt", "live.txt", "pages.txt")),
        (["missions"], ()),
        (["export"], ("solve.txt", "live.txt", "pages.txt")),
        (["missions", "new", "mine"], ()),
        (["dispersions", "new"], ()),
        (["optimize"], ("solve.txt",)),
        (["fly", "--live"], ("solve.txt", "live.txt")),
        (["live"], ("live.txt",)),
        (["montecarlo"], ("solve.txt", "live.txt", "pages.txt")),
        # the extra `pages` asks for SciPy
        (["plot"], ("solve.txt", "live.txt", "pages.txt")),
        (["report"], ("solve.txt", "live.txt", "pages.txt")),
        (["reproduce"], ("solve.txt", "live.txt", "pages.txt")),
        (["test"], ("solve.txt", "live.txt", "pages.txt", "dev.txt")),
    ],
)
def test_a_plain_flight_installs_nothing_that_it_does_not_need(arguments, additions):
    assert needs.additions_for(arguments) == additions


def test_kernels_that_are_there_are_not_compiled_again(project):
    warm_up = project / "src/ares_studies/ares_studies/warm_up.py"
    warm_up.parent.mkdir(parents=True)
    warm_up.touch()
    prepared = layout.Workspace(project, "3.11")
    prepared.kernels.mkdir(parents=True)

    def wanting():
        return [
            what for what in ("", "peg", "igm", "all") if stamps.kernels_wanting(prepared, {}, what)
        ]

    assert wanting() == ["peg", "igm", "all"]
    stamps.kernel_stamp(prepared.kernels, "peg").touch()
    assert wanting() == ["igm", "all"]
    stamps.kernel_stamp(prepared.kernels, "all").touch()
    assert wanting() == []


def test_uv_is_told_of_the_index_of_pip(project):
    python = program(
        project / ".venv/bin",
        "python",
        "echo \"global.extra-index-url='x'\nglobal.index-url='https://mine/simple'\"",
    )
    prepared = layout.Workspace(project, "3.11")
    assert prepared.interpreter == python
    told = {"UV_DEFAULT_INDEX": "https://mine/simple"}
    assert installing.index_of_pip(prepared, {}) == told
    named = {"PIP_INDEX_URL": "https://other/simple"}
    assert installing.index_of_pip(prepared, named) == {"UV_DEFAULT_INDEX": named["PIP_INDEX_URL"]}
    assert installing.index_of_pip(prepared, {"UV_DEFAULT_INDEX": "x"}) == {}


def test_the_browser_is_named_for_apt():
    assert browser.debian_packages(ROOT) == ["chromium"]


UNSATISFIED = "ERROR: Could not find a version that satisfies the requirement numpy==2.4.6"


@pytest.mark.parametrize(
    ("output", "cause"),
    [
        (
            f"WARNING: Retrying ... NewConnectionError(...)\n{UNSATISFIED} (from versions: none)\n",
            "no network or package index (pip could not get numpy==2.4.6)",
        ),
        (
            f"{UNSATISFIED} (from versions: 2.4.5)\nERROR: No matching distribution found\n",
            "the package index has no numpy==2.4.6",
        ),
        ("OSError: [Errno 28] No space left on device: 'x'\n", "the disk is full"),
        ("a\nCMake Error at x: y\nmore\n\n", "CMake Error at x: y"),
        ("only this\n", "only this"),
        ("", "no output"),
    ],
)
def test_the_cause_of_a_failure_is_named(output, cause):
    assert running.cause_of_failure(output).startswith(cause)


def test_a_failed_step_names_cause_and_log(project):
    prepared = layout.Workspace(project, "3.11")
    command = [sys.executable, "-c", "print('error: no luck'); raise SystemExit(3)"]
    with (
        running.preparation_lock(project) as lock,
        pytest.raises(running.WorkspaceError, match=r"the step failed: error: no luck \(log: "),
    ):
        running.run_logged(command, prepared, dict(os.environ), lock, "the step")
    assert "no luck" in prepared.log.read_text()


def test_a_second_call_waits_for_the_first(project):
    code = (
        f"import pathlib, sys; sys.path.insert(0, {str(ROOT / 'tools')!r})\n"
        "from preparation.running import preparation_lock\n"
        f"with preparation_lock(pathlib.Path({str(project)!r})):\n    print('mine')\n"
    )
    with running.preparation_lock(project):
        second = subprocess.Popen(
            [sys.executable, "-c", code],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert "waiting" in second.stderr.readline()
        time.sleep(0.1)
        assert second.poll() is None
    out, _ = second.communicate()
    assert out == "mine\n"


def test_a_call_that_waits_knows_how_long(project):
    with running.preparation_lock(project) as lock:
        assert running.time_left(lock) == 1.0
        running.announce(lock, {"packages": 40.0, "kernels": 60.0})
        assert 1.0 <= running.time_left(lock) <= 101.0
        running.announce(lock, {"kernels": 0.0})
        assert running.time_left(lock) == 1.0


def test_what_other_verbs_need_is_offered_once_in_one_line(project, capsys, monkeypatch):
    made = []

    def due(_workspace, _environ, kernels, also):
        if not made:
            return {"kernels": 30.0}
        return {"further packages": 20.0, "kernels": 75.0} if kernels == "all" or also else {}

    prepared = layout.Workspace(project, "3.11")
    monkeypatch.setattr(steps, "prepared_environment", lambda *_: prepared)
    monkeypatch.setattr(steps, "steps_to_do", due)
    monkeypatch.setattr(steps, "make", lambda *_: made.append(1) or prepared)
    assert steps.prepare(project, {}, "peg") is prepared
    said = capsys.readouterr().err
    assert said.endswith("all of it now, about 95 s: ./ares prepare\n")
    assert said.count("\n") == 1
    # nothing had to be made: nothing is said
    assert steps.prepare(project, {}, "peg") is prepared
    assert capsys.readouterr().err == ""


def test_a_child_that_outlives_its_parent_keeps_the_lock(project):
    with running.preparation_lock(project) as lock:
        child = subprocess.Popen(["cat"], stdin=subprocess.PIPE, pass_fds=(lock,))
    try:
        descriptor = os.open(project / "build/.lock", os.O_RDWR)
        with pytest.raises(BlockingIOError):
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    finally:
        child.communicate()
    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    os.close(descriptor)


def test_cmake_paths_are_moved_to_this_machine(tmp_path):
    target = tmp_path / "share/a/cmake/export.cmake"
    target.parent.mkdir(parents=True)
    old = "/opt/python/cp312-cp312"
    target.write_text(
        f'INCLUDE "{old}/include/python3.12;{old}/lib/python3.12/site-packages/numpy/_core/include"'
    )
    assert installing.relocate_cmake(tmp_path / "share", "/inc", "/site") == 1
    assert target.read_text() == 'INCLUDE "/inc;/site/numpy/_core/include"'
    assert installing.relocate_cmake(tmp_path / "share", "/inc", "/site") == 0


def test_node_executables_start_from_a_path_with_blanks(tmp_path):
    interpreter = tmp_path / "a b" / "python"
    interpreter.parent.mkdir()
    interpreter.symlink_to(sys.executable)
    script = tmp_path / "install/lib/ares_one/node"
    script.parent.mkdir(parents=True)
    script.write_text(f'#!"{interpreter}"\nimport sys\nprint(sys.argv[1:])\n')
    script.chmod(0o755)
    building.repair_scripts(tmp_path / "install", interpreter)
    answer = subprocess.run([script, "x y"], capture_output=True, text=True, check=True)
    assert answer.stdout == "['x y']\n"


@pytest.fixture
def launcher(tmp_path):
    """Copy the launcher to a project of its own, with a stand-in for tools/workspace.py."""
    root = tmp_path / "a b" / "clone"
    (root / "tools").mkdir(parents=True)
    shutil.copy(ROOT / "ares", root)
    (root / "tools/workspace.py").write_text("import os, sys\nprint(os.getcwd(), sys.argv[1:])\n")
    return root / "ares"


def run(command, **settings):
    return subprocess.run(command, capture_output=True, text=True, check=False, **settings)


def test_the_launcher_keeps_folder_and_arguments(launcher, tmp_path):
    link = tmp_path / "link"
    link.symlink_to("a b/clone/ares")
    environ = os.environ | {"PYTHON": sys.executable}
    for command in (launcher, link):
        answer = run([command, "fly", "--mission", "x y.yaml"], cwd=tmp_path, env=environ)
        assert answer.stdout == f"{tmp_path} ['fly', '--mission', 'x y.yaml']\n"


def tools_only(folder: Path) -> dict[str, str]:
    """Return an environment with the tools of the launcher and no Python."""
    for name in ("sh", "dirname", "readlink"):
        program(folder, name, f'exec {shutil.which(name)} "$@"')
    return {"PATH": str(folder)}


@pytest.fixture(scope="module")
def fresh_clone(tmp_path_factory):
    """Make what `./ares` answers from before anything is made."""
    folder = tmp_path_factory.mktemp("clone")
    for name in ("ares", "tools", "src/ares_models/ares_models", "src/ares_bringup"):
        place, origin = folder / name, ROOT / name
        place.parent.mkdir(parents=True, exist_ok=True)
        if origin.is_dir():
            shutil.copytree(origin, place, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(origin, place)
    return folder


def of_fresh_clone(clone, *words):
    """Run a call in a fresh clone, without preparation; return exit status, output, errors."""
    done = run([str(clone / "ares"), *words], env={"PATH": os.environ["PATH"]})
    assert sorted(path.name for path in clone.iterdir()) == ["ares", "src", "tools"]
    return done.returncode, done.stdout, done.stderr


def test_a_fresh_clone_has_a_version(fresh_clone):
    assert of_fresh_clone(fresh_clone, "--version") == (0, f"ares {workspace.version(ROOT)}\n", "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("module", ["workspace.py", "ares_bringup"])
def test_a_signal_while_python_starts_is_no_traceback(module, number):
    command = [ROOT / "ares", "optimize"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        about = Path(f"/proc/{process.pid}")
        while module not in (about / "cmdline").read_text():
            assert process.poll() is None
        while "SigBlk:\t0000000000004002" not in (about / "status").read_text():
            assert process.poll() is None
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    # SIGTERM ends the preparation itself without a word
    assert process.returncode in (128 + number, -signal.SIGTERM)
    assert err == "" or (err.startswith("ares: interrupted") and err.count("\n") == 1)


VERBS_OF_THE_COMMAND = [
    *((verb,) for verb in read_usage()["commands"]),
    *(("bag", verb) for verb in read_usage()["commands"]["bag"]["commands"]),
    ("missions", "new"),
    ("dispersions", "schema"),
]


@pytest.mark.parametrize("verb", [(), *VERBS_OF_THE_COMMAND, *((v,) for v in workspace.VERBS)])
def test_a_fresh_clone_has_help(fresh_clone, verb):
    status, out, err = of_fresh_clone(fresh_clone, *verb, "--help")
    assert (status, err) == (0, "")
    assert out.startswith(f"Usage: {' '.join(['ares', *verb])}")


def test_help_lists_the_verbs_of_the_workspace_too(fresh_clone):
    for word in ("--help", "-h"):
        _, out, _ = of_fresh_clone(fresh_clone, word)
        listed = out.partition("Workspace:")[2]
        assert [verb for verb in workspace.VERBS if f"\n  {verb} " not in listed] == []
        assert max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize(
    ("words", "refusal"),
    [
        ((), "Missing command (see `ares --help`)"),
        (("flly",), "No such command 'flly'; did you mean fly? (see `ares --help`)"),
        (("prepar",), "No such command 'prepar'; did you mean prepare? (see `ares --help`)"),
        (("xyzzy",), "No such command 'xyzzy' (see `ares --help`)"),
        (("bag", "inf"), "No such command 'inf'; did you mean info? (see `ares bag --help`)"),
        (
            ("fly", "--json", "--misson=ares_v"),
            "No such option: --misson; did you mean --mission? (see `ares fly --help`)",
        ),
        (("report",), "Missing argument 'BAG...' (see `ares report --help`)"),
        (("report", "--out", "x.html"), "Missing argument 'BAG...' (see `ares report --help`)"),
        (("bag", "info"), "Missing argument 'BAG' (see `ares bag info --help`)"),
        (("missions", "new"), "Missing argument 'NAME' (see `ares missions new --help`)"),
        (
            ("dispersions", "new", "my"),
            "Missing option '--mission' (see `ares dispersions new --help`)",
        ),
        (("exec",), "exec needs a command, for example: ./ares exec ruff check"),
        (("prepare", "--all"), "prepare takes no arguments; here is '--all'"),
    ],
)
def test_a_fresh_clone_refuses_what_is_no_verb(fresh_clone, words, refusal):
    assert of_fresh_clone(fresh_clone, *words) == (2, "", f"ares: {refusal}\n")


def test_what_comes_behind_the_words_of_another_program_is_not_read():
    for words in (
        *(("exec", "pytest", "--help"), ("test", "--collect-only"), ("env",)),
        *(("report", "a", "b"), ("report", "--out=x", "--", "--a"), ("missions", "new", "-")),
        ("dispersions", "new", "--mission=ares_v"),
    ):
        assert workspace.answer_at_once(words) is None
    for words in (("node", "sim", "--ros-args", "-p", "pace:=1"), ("fly", "--mission", "--help")):
        assert workspace.answer_at_once(words) is None


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no full device")
def test_help_onto_a_full_disk_is_one_line():
    with Path("/dev/full").open("w") as full:
        command = [str(ROOT / "ares"), "--help"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    said = "ares: standard output cannot be written: No space left on device\n"
    assert (done.returncode, done.stderr) == (1, said)


@pytest.mark.parametrize("old", [False, True])
def test_no_fitting_python_is_one_line(launcher, tmp_path, old):
    environ = tools_only(tmp_path / "bin")
    if old:  # prints no path, like a Python that is too old
        program(tmp_path / "bin", "python3")
    answer = run([launcher, "fly"], env=environ)
    assert answer.returncode == 2
    assert answer.stdout == ""
    assert answer.stderr.count("\n") == 1
    assert "no Python 3.11, 3.12 or 3.13 found: install" in answer.stderr


def test_a_named_python_that_does_not_fit_is_one_line(launcher, tmp_path):
    old = program(tmp_path / "old", "python3.9")
    answer = run([launcher, "fly"], env=tools_only(tmp_path / "bin") | {"PYTHON": str(old)})
    assert answer.returncode == 2
    assert answer.stderr.count("\n") == 1
    assert str(old) in answer.stderr


def test_the_makefile_lists_its_targets():
    answer = run(["make", "--no-print-directory", "help"], cwd=ROOT)
    assert answer.returncode == 0
    for target in ("help", "prepare", "fly", "test", "lint", "format", "clean"):
        assert f"\n  {target} " in answer.stdout


# ---- how far a preparation is


class HandClock:
    """Return a time set by the test."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def test_the_share_that_is_done_follows_the_steps():
    clock = HandClock()
    steps = progress.Steps({"first": 10.0, "second": 30.0}, clock)
    assert steps.share() == 0.0
    assert steps.left() == pytest.approx(40.0)
    with steps.step("first"):
        clock.now += 10.0
        assert 0.7 * 0.25 < steps.share() < 0.8 * 0.25
        clock.now += 10.0
        assert 0.9 * 0.25 < steps.share() < 0.25
    # this machine takes twice as long
    assert steps.share() == pytest.approx(0.25)
    assert steps.left() == pytest.approx(60.0)
    with steps.step("second"):
        clock.now += 60.0
        assert steps.share() == pytest.approx(0.25 + 0.75 * 0.777, abs=1e-3)
        assert "]  83%  80 s, about 16 s left  second" in progress.line(steps)
    assert steps.share() == 1.0
    with steps.step("what nobody expected"):
        assert steps.share() == 1.0


def test_a_bar_is_drawn_on_a_terminal_alone(capsys):
    steps = progress.Steps({"first": 10.0})
    bar = progress.Bar()
    with bar.over(steps), steps.step("first"):
        bar.say("a line")
        time.sleep(1.5 * progress.PERIOD)
    assert capsys.readouterr().err == "ares: a line\n"


def test_lines_do_not_run_into_the_bar():
    program = (
        "import sys, time; sys.path.insert(0, sys.argv[1]); from preparation import progress as p;"
        "steps = p.Steps({'first': 10.0});\n"
        "with p.BAR.over(steps), steps.step('first'):\n"
        "    time.sleep(2.5 * p.PERIOD); p.say('a line'); time.sleep(2.5 * p.PERIOD)\n"
    )
    reader, writer = pty.openpty()
    command = [sys.executable, "-c", program, str(ROOT / "tools")]
    with subprocess.Popen(command, stderr=writer) as process:
        process.wait(30)
        os.close(writer)
        said = os.read(reader, 100_000).decode()
    os.close(reader)
    assert said.count("s left  first") >= 2
    assert f"{progress.CLEAR_LINE}ares: a line" in said
    assert said.endswith(progress.CLEAR_LINE)


def test_a_closed_output_is_no_traceback():
    tools = str(Path(workspace.__file__).parent)
    program = "import workspace; workspace.keep_standard_streams(); import os; os.fstat(1)"
    done = subprocess.run(
        f"{sys.executable} -c '{program}' >&-",
        shell=True,
        env={**os.environ, "PYTHONPATH": tools},
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
