# SPDX-License-Identifier: Apache-2.0
"""Read the parameters of all nodes, which `make usage` writes from the nodes' tables. No ROS."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from ares_bringup.options import MAX_RESTARTS, RESTARTS
from ares_node.parameters import Parameter

#: Parameters by node name, as JSON.
TABLES = Path(__file__).with_name("parameters.json")

#: Launch arguments that are no parameter of a node.
LAUNCH = (
    Parameter("namespace", "ares", "Namespace of all nodes and topics."),
    Parameter(
        "domain_id",
        "",
        "ROS domain; empty takes $ROS_DOMAIN_ID, else 0 if no other flight has this namespace "
        "there, else one that is free.",
    ),
    Parameter("params_file", "", "Parameter file of the nodes; empty takes params/flight.yaml."),
    Parameter(
        "use_sim_time",
        False,
        "Guidance and recorder stamp their log lines with flight time. Nothing else depends on "
        "it: the flight runs on the stamps of its messages.",
    ),
    Parameter("record", True, "Record a bag."),
    Parameter(
        "bag",
        "",
        "Folder of the new bag; empty takes a new name in the folder of bags ($ARES_BAGS, or "
        "`bags` of the workspace).",
    ),
    Parameter("view", True, "Show the flight in standard messages too, for RViz and maps."),
    Parameter("live", False, "Serve a page that follows the flight; its address is printed."),
    Parameter(
        "restarts",
        RESTARTS,
        "How often guidance, optimizer and view are each restarted if they end in flight.",
        minimum=0,
        maximum=MAX_RESTARTS,
    ),
    Parameter("exit_when_complete", True, "End the processes of the flight when it is over."),
    Parameter(
        "log_level",
        "info",
        "Log level of all nodes.",
        choices=("debug", "info", "warn", "error", "fatal"),
    ),
)


@cache
def tables() -> dict[str, tuple[Parameter, ...]]:
    """Return the parameters of each node, by node name."""
    found = json.loads(TABLES.read_text(encoding="utf-8"))
    return {node: tuple(map(_row, rows)) for node, rows in found.items()}


def _row(item: Mapping[str, Any]) -> Parameter:
    values: dict[str, Any] = {k: tuple(x) if isinstance(x, list) else x for k, x in item.items()}
    return Parameter(**values)


def offered() -> dict[str, Parameter]:
    """Return the parameters with an option, by its name; the first node's where several have it."""
    found: dict[str, Parameter] = {}
    for table in tables().values():
        for row in table:
            if row.option:
                found.setdefault(row.option, row)
    return found


def known(node: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Select the values, by parameter name, that a node has parameters for."""
    return {row.name: values[row.name] for row in tables()[node] if row.name in values}
