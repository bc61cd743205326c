# SPDX-License-Identifier: Apache-2.0
"""Name what all flights of a ROS domain would share. No ROS."""

#: Namespace of the nodes of a flight that is told none.
NAMESPACE = "ares"

CLOCK = "/clock"
DIAGNOSTICS = "/diagnostics"
TF = "/tf"
TF_STATIC = "/tf_static"


def own_names(namespace: str) -> dict[str, str]:
    """Remap the names by which every tool looks for a robot to names of one flight's own.

    Args:
        namespace: of the flight's nodes; NAMESPACE keeps the names as they are.

    Returns:
        New names, relative to the namespace, by old ones.
    """
    if namespace.strip("/") == NAMESPACE:
        return {}
    return {name: name.removeprefix("/") for name in (CLOCK, DIAGNOSTICS, TF, TF_STATIC)}


def own_frames(namespace: str) -> str:
    """Give the prefix of a flight's frames; as for :func:`own_names`, empty for NAMESPACE."""
    return f"{namespace.strip('/')}/" if own_names(namespace) else ""


def remappings(namespace: str) -> list[str]:
    """Write :func:`own_names` as words of a command line after `--ros-args`."""
    return [word for old, new in own_names(namespace).items() for word in ("-r", f"{old}:={new}")]
