# SPDX-License-Identifier: Apache-2.0
"""Write and compare the stamps of the parts of a workspace."""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from preparation.digests import (
    digest,
    environment_digest,
    interface_digest,
    lock_file,
    package_digest,
)
from preparation.layout import Workspace
from preparation.needs import ALL_KERNELS, NO_KERNELS
from preparation.paths import SEARCH_PATHS, sourced_ros


def read_stamp(path: Path) -> dict[str, str]:
    """Read a stamp; empty if it is missing or damaged."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(content, dict):
        return {}
    return {str(key): str(value) for key, value in content.items()}


def write_stamp(path: Path, content: Mapping[str, str]) -> None:
    """Write a stamp atomically."""
    partial = path.with_name(path.name + ".partial")
    partial.write_text(json.dumps(dict(content), indent=1) + "\n", encoding="utf-8")
    os.replace(partial, path)


def venv_stamp(root: Path) -> Path:
    """Return the path of the stamp of .venv."""
    return root / ".venv" / ".ready"


def build_stamp(root: Path) -> Path:
    """Return the path of the stamp of build/ and install/."""
    return root / "build" / ".ready"


def prepared_environment(root: Path, environ: Mapping[str, str]) -> Workspace | None:
    """Return the workspace if its .venv is complete and matches ``environ``; else None."""
    stamp = read_stamp(venv_stamp(root))
    python, ros = stamp.get("python", ""), stamp.get("ros", "")
    if not python or not os.access(root / ".venv" / "bin" / "python", os.X_OK):
        return None
    if environ.get("PYTHON") and python != "{}.{}".format(*sys.version_info):
        return None
    sourced = sourced_ros(root, environ)
    if sourced and sourced != stamp.get("sourced"):
        return None
    if ros and not Path(ros, "share/rclpy/package.xml").exists():
        return None
    if stamp.get("digest") != environment_digest(root, python, ros):
        return None
    ros_paths = {name: stamp[f"ros {name}"] for name in SEARCH_PATHS if f"ros {name}" in stamp}
    return Workspace(root, python, ros, stamp.get("sourced", ""), ros_paths)


def addition_stamp(root: Path, name: str) -> Path:
    """Return the path of the stamp of an additional list of requirements."""
    return root / ".venv" / f".ready-{name}"


def missing_additions(workspace: Workspace, names: Sequence[str]) -> list[str]:
    """Return the lists of requirements that are not installed in their present version."""
    return [
        name
        for name in names
        if read_stamp(addition_stamp(workspace.root, name)) != addition_digest(workspace, name)
    ]


def addition_digest(workspace: Workspace, name: str) -> dict[str, str]:
    """Return the expected stamp of an installed list."""
    return {"digest": digest([lock_file(workspace.root, name).read_bytes()])}


def build_digests(workspace: Workspace) -> dict[str, str]:
    """Return the expected stamp of the built workspace."""
    root = workspace.root
    made_from = environment_digest(root, workspace.python, workspace.ros)
    return {"interfaces": interface_digest(root, made_from), "packages": package_digest(root)}


def is_built(workspace: Workspace) -> bool:
    """Tell whether build/ and install/ are complete and up to date."""
    root = workspace.root
    return (root / "install/setup.sh").exists() and (
        read_stamp(build_stamp(root)) == build_digests(workspace)
    )


def kernel_stamp(folder: Path, what: str) -> Path:
    """Return the path of the stamp of all kernels, or of a law's."""
    return folder / (".ready" if what == ALL_KERNELS else f".ready-{what}")


def kernels_wanting(workspace: Workspace, environ: Mapping[str, str], what: str) -> bool:
    """Tell whether kernels are missing in the folder that this workspace uses."""
    folder = workspace.kernels
    if what == NO_KERNELS or workspace.environment(environ)["NUMBA_CACHE_DIR"] != str(folder):
        return False
    warm_up = workspace.root / "src/ares_studies/ares_studies/warm_up.py"
    ready = (kernel_stamp(folder, each).exists() for each in (ALL_KERNELS, what))
    return warm_up.exists() and not any(ready)
