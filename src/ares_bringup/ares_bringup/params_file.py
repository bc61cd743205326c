# SPDX-License-Identifier: Apache-2.0
"""Read a ROS parameter file without ROS, before launch starts anything."""

import stat
from pathlib import Path
from typing import Any

from ares_bags.errors import printable
from ares_bags.schema import load_yaml

#: Largest file accepted, bytes.
_MAX_BYTES = 1 << 18


def _text(path: Path) -> str:
    """Read a regular file; refuse devices and pipes, which might never end."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise ValueError("not a plain file; expected a parameter file")
    with path.open("rb") as file:
        content = file.read(_MAX_BYTES + 1)
    if len(content) > _MAX_BYTES:
        raise ValueError(f"larger than {_MAX_BYTES} bytes; expected a parameter file")
    return content.decode("utf-8")


def node_values(path: str | Path, node: str) -> dict[str, Any]:
    """Read the parameters of a node from a file, whatever its namespace.

    Sections named `**` apply to every node; those that end in the node's name take precedence.

    Args:
        path: the parameter file.
        node: name of the node without its namespace.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not a parameter file; one line.
    """
    path = Path(path)
    try:
        sections = load_yaml(_text(path))
    except ValueError as error:
        raise ValueError(printable(f"{path}: {error}")) from error
    if not isinstance(sections, dict):
        raise ValueError(printable(f"{path}: not a parameter file; expected node names as keys"))
    values: dict[str, Any] = {}
    for wanted in ("**", node):
        for key, section in sections.items():
            if str(key).rsplit("/", maxsplit=1)[-1] != wanted:
                continue
            parameters = section.get("ros__parameters") if isinstance(section, dict) else None
            if not isinstance(parameters, dict):
                expected = "expected ros__parameters with names and values"
                raise ValueError(printable(f"{path}: {key}: {expected}"))
            values.update(parameters)
    return values
