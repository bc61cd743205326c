# SPDX-License-Identifier: Apache-2.0
"""Hash what each part of the workspace is made from."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from ares_models import kernel_cache

# Increment to remake everything after a change of how it is made.
GENERATION = "2"
INSTALLER = "uv.txt"
ROS_REQUIREMENTS = ("ros-jazzy.txt",)
REQUIREMENTS = ("build.txt", "fly.txt")


def digest(parts: Iterable[str | bytes]) -> str:
    """Hash a sequence of texts, including their boundaries."""
    state = hashlib.sha256()
    for part in parts:
        raw = part.encode() if isinstance(part, str) else part
        state.update(b"%d:" % len(raw))
        state.update(raw)
    return state.hexdigest()[:16]


def _files(folder: Path) -> list[Path]:
    """List all files below a folder, sorted, without caches and hidden files."""
    return sorted(
        path
        for path in folder.rglob("*")
        if path.is_file()
        and not any(
            part.startswith(".") or part == "__pycache__" or part.endswith(".egg-info")
            for part in path.relative_to(folder).parts
        )
    )


def packages(root: Path) -> list[Path]:
    """List the folders of the packages in src/."""
    return sorted(path.parent for path in root.glob("src/*/package.xml"))


def interfaces(root: Path) -> list[Path]:
    """List the folders of the messages that every full ROS 2 has but no wheel contains."""
    return sorted(path.parent for path in root.glob("tools/interfaces/*/package.xml"))


def lock_file(root: Path, name: str) -> Path:
    """Return the path of a list of requirements with hashes."""
    return root / "requirements" / "locked" / name


def environment_digest(root: Path, python: str, ros: str) -> str:
    """Hash the inputs of .venv.

    Args:
        root: top of the project.
        python: version, such as "3.12".
        ros: prefix of the sourced ROS 2; "": the wheels.
    """
    names = REQUIREMENTS if ros else ROS_REQUIREMENTS + REQUIREMENTS
    pins = [lock_file(root, name).read_bytes() for name in (INSTALLER, *names)]
    return digest([GENERATION, str(root), python, ros, *pins])


def interface_digest(root: Path, environment: str) -> str:
    """Hash the inputs that require a complete rebuild.

    They are the sources of the compiled (CMake) packages, and the list of packages.
    """
    parts: list[str | bytes] = [GENERATION, environment]
    found = [*packages(root), *interfaces(root)]
    parts += [package.name for package in found]
    for package in found:
        if (package / "CMakeLists.txt").exists():
            for path in _files(package):
                parts += [path.relative_to(root).as_posix(), path.read_bytes()]
    return digest(parts)


def package_digest(root: Path) -> str:
    """Hash the inputs of the installed layout of the Python packages.

    Their modules are linked, not copied: an edit needs no rebuild.
    """
    parts: list[str | bytes] = []
    for package in packages(root):
        for name in ("package.xml", "setup.py", "setup.cfg"):
            if (package / name).exists():
                parts += [f"{package.name}/{name}", (package / name).read_bytes()]
        # each module with a law is an entry point
        laws = f"{package.name}/laws"
        for folder in ("launch", "layouts", "params", "resource", "rviz", laws):
            parts += [path.relative_to(root).as_posix() for path in _files(package / folder)]
    return digest(parts)


def kernel_digest(root: Path) -> str:
    """Hash the modules with kernels and all project modules they import."""
    texts: dict[str, str] = {}
    for package in packages(root):
        texts |= kernel_cache.read_package(package / package.name)
    return kernel_cache.state_of(texts)
