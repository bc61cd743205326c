# SPDX-License-Identifier: Apache-2.0
"""Find what is missing before it is imported: packages of the Python Package Index, middleware.

Each package's `setup.py` says it in `install_requires`, in the forms `name` and
`name>=version`. Standard library only.
"""

import os
import re
from collections.abc import Iterator, Mapping
from importlib import metadata
from pathlib import Path

#: The project's own packages; their requirements count too.
OWN = "ares_"
#: Where ROS middleware is registered below a prefix, by its name.
_MIDDLEWARE = "share/ament_index/resource_index/rmw_typesupport/*"

_FORM = re.compile(r"([\w.-]+?)\s*(?:>=\s*([\d.]+))?")


def _numbers(version: str) -> tuple[int, ...]:
    """The leading numbers of a version: 2.14.0rc1 gives 2, 14, 0."""
    return tuple(int(part) for part in re.findall(r"(?:^|\.)(\d+)", version))


def requirements(distribution: str, extra: str = "") -> Iterator[tuple[str, str]]:
    """Foreign packages that an installed package and those of the project below it need.

    Args:
        distribution: name of the package; none of it is known if it is not installed.
        extra: one of its `extras_require`, or of those below it, that counts too.

    Yields:
        name and smallest version; empty: any.
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
    """One line on a ROS middleware that is asked for and not installed; None if there is none.

    rcl ends the process, as soon as it is loaded, with a status of its own.
    """
    asked = environ.get("RMW_IMPLEMENTATION", "")
    prefixes = environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    files = (file for prefix in prefixes if prefix for file in Path(prefix).glob(_MIDDLEWARE))
    found = sorted({file.name for file in files} - {"rmw_implementation"})
    if not asked or not found or asked in found:
        return None
    return f"RMW_IMPLEMENTATION is {asked!r}; expected one that is installed: {', '.join(found)}"


def unmet(distribution: str, extra: str = "") -> str | None:
    """One line on the first package that is missing or too old; None if there is none.

    Args: as for :func:`requirements`.
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
