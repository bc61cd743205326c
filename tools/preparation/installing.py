# SPDX-License-Identifier: Apache-2.0
"""Make .venv: check what it takes, install lists of requirements into it."""

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from pathlib import Path

from preparation.digests import (
    INSTALLER,
    REQUIREMENTS,
    ROS_REQUIREMENTS,
    environment_digest,
    lock_file,
)
from preparation.layout import Workspace
from preparation.paths import ROS_DISTRO, base_python, find_ros_python, ros_paths, sourced_ros
from preparation.progress import say
from preparation.running import WorkspaceError, remove, run_logged
from preparation.stamps import addition_digest, addition_stamp, venv_stamp, write_stamp


def find_compiler(variable: str, names: Sequence[str], environ: Mapping[str, str]) -> str | None:
    """Return the path of the compiler named by ``variable`` or, if unset, by one of ``names``."""
    words = shlex.split(environ.get(variable, ""))
    for name in words[:1] or names:
        found = shutil.which(name, path=environ.get("PATH", os.defpath))
        if found:
            return found
    return None


def check_prerequisites(environ: Mapping[str, str]) -> None:
    """Raise WorkspaceError, with what to install, if a prerequisite is missing."""
    python = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    if not find_compiler("CC", ("cc", "gcc", "clang"), environ):
        raise WorkspaceError(
            "no C compiler found (cc, gcc, clang or $CC): install one,"
            " for example `apt install build-essential`"
        )
    if not find_compiler("CXX", ("c++", "g++", "clang++"), environ):
        raise WorkspaceError(
            "no C++ compiler found (c++, g++, clang++ or $CXX), which ROS 2 messages need:"
            " install one, for example `apt install build-essential`"
        )
    if not (Path(sysconfig.get_path("include")) / "Python.h").exists():
        raise WorkspaceError(
            f"{python} has no header files: install them, for example `apt install {python}-dev`"
        )
    if not importlib.util.find_spec("ensurepip") or not importlib.util.find_spec("venv"):
        raise WorkspaceError(
            f"{python} cannot make virtual environments: install that part of it,"
            f" for example `apt install {python}-venv`"
        )


def relocate_cmake(share: Path, include: str, site_packages: str) -> int:
    """Point the wheels' exported CMake targets at this machine's Python; return the file count."""
    build_machine = re.compile(
        r"/opt/python/cp\d+-cp\d+/(include/python3\.\d+|lib/python3\.\d+/site-packages)"
    )
    changed = 0
    for path in sorted(share.rglob("*.cmake")):
        text = path.read_text(encoding="utf-8")
        moved = build_machine.sub(
            lambda match: include if match[1].startswith("include") else site_packages, text
        )
        if moved != text:
            # replace the file, since uv hard-links it to its cache
            path.unlink()
            path.write_text(moved, encoding="utf-8")
            changed += 1
    return changed


def tool_environment(workspace: Workspace, environ: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of the build tools."""
    result = workspace.environment(environ, build=True)
    if not workspace.ros:
        result.pop("PYTHONPATH", None)
    return result


def index_of_pip(workspace: Workspace, environ: Mapping[str, str]) -> dict[str, str]:
    """Return pip's package index for uv, which does not read pip's settings."""
    if "UV_DEFAULT_INDEX" in environ:
        return {}
    asked = subprocess.run(
        [str(workspace.interpreter), "-m", "pip", "config", "list"],
        env=dict(environ),
        capture_output=True,
        text=True,
        check=False,
    )
    found = re.findall(r"^\S*\.index-url='(.*)'$", asked.stdout, re.MULTILINE)
    index = environ.get("PIP_INDEX_URL") or (found[-1] if found else "")
    return {"UV_DEFAULT_INDEX": index} if index else {}


def install(
    names: Sequence[str], workspace: Workspace, environ: Mapping[str, str], lock: int
) -> None:
    """Install lists of requirements into .venv: by uv, or by pip if uv fails."""
    settings = tool_environment(workspace, environ)
    lists = [f"--requirements={lock_file(workspace.root, name)}" for name in names]
    options = ["--no-deps", "--require-hashes"]
    python = str(workspace.interpreter)
    uv = workspace.venv / "bin" / "uv"
    if uv.exists():
        command = [str(uv), "pip", "install", f"--python={python}"]
        if environ.get("PYTHONDONTWRITEBYTECODE"):
            # else each start would compile its imports
            command.append("--compile-bytecode")
        try:
            by_uv = settings | index_of_pip(workspace, settings)
            run_logged([*command, *options, *lists], workspace, by_uv, lock, "installing by uv")
        except WorkspaceError as problem:
            say(f"{problem}; trying pip, which takes longer")
        else:
            return
    # drop settings by which pip would install elsewhere
    for name in ("PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_REQUIRE_VIRTUALENV"):
        settings.pop(name, None)
    settings |= {"PIP_USER": "0", "PIP_NO_INPUT": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    lists = [f"--requirement={lock_file(workspace.root, name)}" for name in names]
    command = [python, "-m", "pip", "install", "--progress-bar=off", *options, *lists]
    run_logged(command, workspace, settings, lock, "installing into .venv")


def add(names: Sequence[str], workspace: Workspace, environ: Mapping[str, str], lock: int) -> None:
    """Install additional lists of requirements."""
    kinds = {
        "solve.txt": "what the optimizer needs",
        "live.txt": "what the live page needs",
        "pages.txt": "what pages and tables need",
        "dev.txt": "what the tests need",
    }
    say(f"installing {' and '.join(kinds[name] for name in names)} (once, half a minute)")
    for name in names:
        remove(addition_stamp(workspace.root, name))
    install(names, workspace, environ, lock)
    for name in names:
        write_stamp(addition_stamp(workspace.root, name), addition_digest(workspace, name))


def make_environment(root: Path, environ: Mapping[str, str], lock: int) -> Workspace:
    """Make .venv from scratch."""
    python, ros = base_python(), ""
    sourced = sourced_ros(root, environ)
    distro = environ.get("ROS_DISTRO", "")
    if sourced:
        ros_python = find_ros_python(environ)
        if ros_python:
            python, ros = ros_python, sourced
            say(f"using the sourced ROS 2 {ROS_DISTRO} in {ros}")
        else:
            say(f"no Python can import the rclpy in {sourced}; using ROS 2 wheels instead")
    elif distro and distro != ROS_DISTRO:
        say(f"the sourced ROS 2 is {distro}, this needs {ROS_DISTRO}; using ROS 2 wheels instead")
    version = subprocess.run(
        [python, "-I", "-S", "-c", "import sys; print('{}.{}'.format(*sys.version_info))"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    workspace = Workspace(root, version, ros, sourced, ros_paths(environ) if ros else {})
    build_environ = tool_environment(workspace, environ)
    say(f"making a Python {version} environment in .venv")
    remove(workspace.venv)
    options = ["--system-site-packages"] if ros else []
    run_logged(
        [python, "-m", "venv", *options, str(workspace.venv)],
        workspace,
        build_environ,
        lock,
        "making .venv",
    )
    what = "what flying needs" if ros else "ROS 2 Jazzy and what flying needs"
    say(f"installing {what} into .venv (once, half a minute)")
    install([INSTALLER], workspace, environ, lock)
    names = REQUIREMENTS if ros else ROS_REQUIREMENTS + REQUIREMENTS
    install(names, workspace, environ, lock)
    if not ros:
        include = subprocess.run(
            [python, "-I", "-S", "-c", "import sysconfig; print(sysconfig.get_path('include'))"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        relocate_cmake(workspace.venv / "share", include, str(workspace.site_packages))
    stamp = {
        "digest": environment_digest(root, version, ros),
        "python": version,
        "ros": ros,
        "sourced": sourced,
        **{f"ros {name}": value for name, value in workspace.ros_paths.items()},
    }
    write_stamp(venv_stamp(root), stamp)
    return workspace
