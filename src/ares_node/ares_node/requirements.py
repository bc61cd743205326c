# SPDX-License-Identifier: Apache-2.0
"""Check of required Python packages and middleware before their import.

Requirements are those of `install_requires` in each package's `setup.py`, in the forms `name` and
`name>=version`. Standard library only.
"""

import os
import re
from collections.abc import Iterator, Mapping
from importlib import metadata
from pathlib import Path

#: Prefix of the project's own packages; their requirements count too.
OWN = "ares_"
#: Pattern of the files that register ROS middleware below a prefix.
_MIDDLEWARE = "share/ament_index/resource_index/rmw_typesupport/*"

_FORM = re.compile(r"([\w.-]+?)\s*(?:>=\s*([\d.]+))?")


def _numbers(version: str) -> tuple[int, ...]:
    """Parse the leading numbers of a version: 2.14.0rc1 gives 2, 14, 0."""
    return tuple(int(part) for part in re.findall(r"(?:^|\.)(\d+)", version))


def requirements(distribution: str, extra: str = "") -> Iterator[tuple[str, str]]:
    """List the foreign packages required by a package and its own packages below.

    Args:
        distribution: name of the package; without requirements if it is not installed.
        extra: name of optional requirements to include.

    Yields:
        name and least version, empty for any.
    """
    waiting, seen = [distribution], set()
    while waiting:
        package = waiting.pop()
        if package in seen:
            continue
        seen.add(package)
        try:
            lines = metadata.requires(package) or []
        except metadata.PackageNotFoundError:
            continue
        for line in lines:
            form, _, condition = line.partition(";")
            match = _FORM.fullmatch(form.strip())
            wanted = "extra ==" not in condition or (
                extra and re.search(rf"""extra == ['"]{extra}['"]""", condition)
            )
            if match is None or not wanted:
                continue
            name, least = match[1], match[2] or ""
            if name.replace("-", "_").startswith(OWN):
                waiting.append(name.replace("-", "_"))
            elif name not in seen:
                seen.add(name)
                yield name, least


def missing_middleware(environ: Mapping[str, str] = os.environ) -> str | None:
    """Return one line on a requested ROS middleware that is not installed, or None.

    rcl would end the process during its import, with another exit status.
    """
    asked = environ.get("RMW_IMPLEMENTATION", "")
    prefixes = environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    files = (file for prefix in prefixes if prefix for file in Path(prefix).glob(_MIDDLEWARE))
    found = sorted({file.name for file in files} - {"rmw_implementation"})
    if not asked or not found or asked in found:
        return None
    return f"RMW_IMPLEMENTATION is {asked!r}; expected one that is installed: {', '.join(found)}"


def unmet(distribution: str, extra: str = "") -> str | None:
    """Return one line on the first package that is missing or too old, or None.

    Args: as in :func:`requirements`.
    """
    for name, least in requirements(distribution, extra):
        wanted = f"{name} {least} or newer" if least else name
        advice = f'install it, for example: pip install "{name}{f">={least}" if least else ""}"'
        try:
            found = metadata.version(name)
        except metadata.PackageNotFoundError:
            return f"needs the Python package {wanted}, found none; {advice}"
        if _numbers(found) < _numbers(least):
            return f"needs the Python package {wanted}, found {found}; {advice}"
    return None
