# SPDX-License-Identifier: Apache-2.0
"""Topic and frame names of a flight that shares a ROS domain with others. No ROS."""

#: Default namespace of the nodes of a flight.
NAMESPACE = "ares"

CLOCK = "/clock"
DIAGNOSTICS = "/diagnostics"
TF = "/tf"
TF_STATIC = "/tf_static"


def own_names(namespace: str) -> dict[str, str]:
    """Map the names expected by common tools to names in the flight's namespace.

    Args:
        namespace: of the flight's nodes; NAMESPACE keeps the names as they are.

    Returns:
        New names, relative to the namespace, by old names.
    """
    if namespace.strip("/") == NAMESPACE:
        return {}
    return {name: name.removeprefix("/") for name in (CLOCK, DIAGNOSTICS, TF, TF_STATIC)}


def own_frames(namespace: str) -> str:
    """Return the prefix of a flight's frames; empty for NAMESPACE."""
    return f"{namespace.strip('/')}/" if own_names(namespace) else ""


def remappings(namespace: str) -> list[str]:
    """Return :func:`own_names` as command-line arguments after `--ros-args`."""
    return [word for old, new in own_names(namespace).items() for word in ("-r", f"{old}:={new}")]
