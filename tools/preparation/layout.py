# SPDX-License-Identifier: Apache-2.0
"""Name the places of a workspace, and make the environment in which the project runs."""

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path

from preparation.digests import kernel_digest, packages
from preparation.paths import (
    ROS_DISTRO,
    SEARCH_PATHS,
    below,
    split_path,
    without_foreign_ros,
    without_other_clone,
)


@dataclasses.dataclass(frozen=True)
class Workspace:
    """Hold a prepared, or partly prepared, workspace.

    Attributes:
        root: top of the project.
        python: version of Python in .venv, such as "3.12".
        ros: prefix of the sourced ROS 2 on which it is built; "": the wheels.
        sourced: prefix of the ROS 2 that was sourced when .venv was made; "": none.
        ros_paths: search-path entries of that ROS 2, for shells without it.
    """

    root: Path
    python: str
    ros: str = ""
    sourced: str = ""
    ros_paths: Mapping[str, str] = dataclasses.field(default_factory=dict)

    @property
    def venv(self) -> Path:
        """Return the path of the virtual environment."""
        return self.root / ".venv"

    @property
    def site_packages(self) -> Path:
        """Return the folder of its packages."""
        return self.venv / "lib" / f"python{self.python}" / "site-packages"

    @property
    def interpreter(self) -> Path:
        """Return the path of its Python."""
        return self.venv / "bin" / "python"

    @property
    def log(self) -> Path:
        """Return the log of the last preparation."""
        return self.root / "build" / "prepare.log"

    @property
    def kernels(self) -> Path:
        """Return the folder of the compiled kernels for the present sources."""
        return self.root / "build" / "kernels" / kernel_digest(self.root)

    def environment(self, environ: Mapping[str, str], build: bool = False) -> dict[str, str]:
        """Make the environment in which the project runs from the user's.

        Args:
            environ: the user's environment, or one made by this function.
            build: leave out the workspace itself, for the tools that build it.
        """
        result = without_foreign_ros(without_other_clone(environ, self.root), self.ros)
        for name, value in self.ros_paths.items():
            present = split_path(result.get(name, ""))
            absent = [entry for entry in split_path(value) if entry not in present]
            result[name] = os.pathsep.join([*present, *absent])
        venv, install = str(self.venv), str(self.root / "install")
        front: dict[str, list[str]] = {name: [] for name in SEARCH_PATHS}
        front["PATH"] = [f"{venv}/bin"]
        if not build:
            front["AMENT_PREFIX_PATH"] += [install]
            front["LD_LIBRARY_PATH"] += [f"{install}/lib"]
            # the sources themselves, then colcon's metadata (entry points)
            mine = [path for path in packages(self.root) if (path / "setup.py").exists()]
            front["PYTHONPATH"] += [str(path) for path in mine]
            front["PYTHONPATH"] += [str(self.root / "build" / path.name) for path in mine]
            front["PYTHONPATH"] += [f"{install}/lib/python{self.python}/site-packages"]
        if self.ros:
            result["ROS_DISTRO"] = ROS_DISTRO
        else:
            front["AMENT_PREFIX_PATH"] += [venv]
            front["LD_LIBRARY_PATH"] += [f"{venv}/lib"]
            front["LD_LIBRARY_PATH"] += sorted(map(str, self.site_packages.glob("ros_*.libs")))
            # the wheels restart each Python to set LD_LIBRARY_PATH unless this is set
            result["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] = "1"
        front["CMAKE_PREFIX_PATH"] = [
            *front["AMENT_PREFIX_PATH"],
            *split_path(result.get("AMENT_PREFIX_PATH", "")),
        ]
        for name, entries in front.items():
            old = [entry for entry in split_path(result.get(name, "")) if entry not in entries]
            if entries or old:
                result[name] = os.pathsep.join([*dict.fromkeys(entries), *old])
        result["VIRTUAL_ENV"] = venv
        result.pop("PYTHONHOME", None)
        previous = result.get("NUMBA_CACHE_DIR", "")
        if not previous or below(previous, [f"{self.root}/build/kernels"]):
            result["NUMBA_CACHE_DIR"] = str(self.kernels)
        result["ARES_WORKSPACE"] = str(self.root)
        result.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        # the matrices are small, and OpenBLAS threads cost each Python 0.1 s
        result.setdefault("OPENBLAS_NUM_THREADS", "1")
        # else pydantic searches all installed packages for plugins at each start
        result.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
        result.setdefault("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
        result.setdefault("ROS_LOG_DIR", str(self.root / "log" / "ros"))
        result.setdefault("PYTHONUNBUFFERED", "1")
        return result
