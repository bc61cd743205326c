"""Reading a ROS parameter file without ROS, for what a launch must know before it starts."""

from pathlib import Path
from typing import Any

import yaml


def node_values(path: str | Path, node: str) -> dict[str, Any]:
    """Parameters that a file holds for a node, whatever the namespace.

    Sections named `**` hold for every node, those that end in the node's name win over them.

    Args:
        path: the parameter file.
        node: name of the node without its namespace.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not a parameter file; one line.
    """
    try:
        sections = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from error
    if not isinstance(sections, dict):
        raise ValueError(f"{path}: not a parameter file; expected node names as keys")
    values: dict[str, Any] = {}
    for wanted in ("**", node):
        for key, section in sections.items():
            if str(key).rsplit("/", maxsplit=1)[-1] != wanted:
                continue
            parameters = section.get("ros__parameters") if isinstance(section, dict) else None
            if not isinstance(parameters, dict):
                raise ValueError(f"{path}: {key}: expected ros__parameters with names and values")
            values.update(parameters)
    return values
