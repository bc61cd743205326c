# SPDX-License-Identifier: Apache-2.0
"""Edit search paths; find a sourced ROS 2 in them, and what is left of another clone or ROS 2."""

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

ROS_DISTRO = "jazzy"
PYTHONS = ((3, 11), (3, 12), (3, 13))
SEARCH_PATHS = ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")


def split_path(value: str) -> list[str]:
    """Return the non-empty entries of a search path."""
    return [entry for entry in value.split(os.pathsep) if entry]


def below(entry: str, prefixes: Iterable[str]) -> bool:
    """Tell whether a path is one of some folders, or lies below one."""
    return any(entry == prefix or entry.startswith(prefix + os.sep) for prefix in prefixes)


def _without(value: str, prefixes: Sequence[str]) -> str:
    return os.pathsep.join(x for x in split_path(value) if not below(x, prefixes))


def without_other_clone(environ: Mapping[str, str], root: Path) -> dict[str, str]:
    """Copy ``environ`` without the entries of another clone of this project."""
    result = dict(environ)
    other = environ.get("ARES_WORKSPACE", "")
    if not other or other == str(root):
        return result
    for name in SEARCH_PATHS:
        if name in result:
            result[name] = _without(result[name], [other])
    for name in ("NUMBA_CACHE_DIR", "ROS_LOG_DIR", "VIRTUAL_ENV"):
        if below(result.get(name, ""), [other]):
            del result[name]
    del result["ARES_WORKSPACE"]
    return result


def without_foreign_ros(environ: Mapping[str, str], ros: str) -> dict[str, str]:
    """Copy ``environ`` without the entries of a sourced ROS 2 that is not the one in use."""
    result = dict(environ)
    distro = environ.get("ROS_DISTRO", "")
    if not distro or (ros and distro == ROS_DISTRO):
        return result
    prefixes = split_path(environ.get("AMENT_PREFIX_PATH", ""))
    foreign = [prefix for prefix in prefixes if prefix not in ("/", "/usr", "/usr/local")]
    for name in SEARCH_PATHS:
        if name in result:
            result[name] = _without(result[name], foreign)
    for name in ("ROS_DISTRO", "COLCON_PREFIX_PATH"):
        result.pop(name, None)
    return result


def sourced_ros(root: Path, environ: Mapping[str, str]) -> str:
    """Return the prefix of the ROS 2 Jazzy sourced in ``environ``; "" without one."""
    if environ.get("ROS_DISTRO") != ROS_DISTRO:
        return ""
    for prefix in split_path(environ.get("AMENT_PREFIX_PATH", "")):
        if Path(prefix, "share/rclpy/package.xml").exists() and Path(prefix) != root / ".venv":
            return prefix
    return ""


def ros_paths(environ: Mapping[str, str]) -> dict[str, str]:
    """Return the entries that a sourced ROS 2 has added to the search paths."""
    prefixes = split_path(environ.get("AMENT_PREFIX_PATH", ""))
    added = {
        name: [entry for entry in split_path(environ.get(name, "")) if below(entry, prefixes)]
        for name in SEARCH_PATHS
    }
    return {name: os.pathsep.join(entries) for name, entries in added.items() if entries}


def find_ros_python(environ: Mapping[str, str]) -> str | None:
    """Return a Python that can import the sourced ROS 2's rclpy, this one if possible."""
    candidates = [base_python()]
    if not environ.get("PYTHON"):
        candidates += ["python3", "/usr/bin/python3"]
    test = f"import sys, rclpy; assert sys.version_info[:2] in {PYTHONS!r}; print(sys.executable)"
    for candidate in candidates:
        with contextlib.suppress(OSError):
            answer = subprocess.run(
                [candidate, "-c", test],
                env=dict(environ),
                capture_output=True,
                text=True,
                check=False,
            )
            if answer.returncode == 0:
                return answer.stdout.strip()
    return None


def base_python() -> str:
    """Return the interpreter of this process, outside of any virtual environment."""
    base = getattr(sys, "_base_executable", None)
    return str(base or sys.executable)
