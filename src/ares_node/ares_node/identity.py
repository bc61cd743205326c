# SPDX-License-Identifier: Apache-2.0
"""Identities of flights and of who takes part in them. No ROS."""

import secrets


def new_id() -> int:
    """A random identity, never 0; it fits into a ROS integer parameter."""
    return secrets.randbits(62) + 1


def id_text(identity: int) -> str:
    """An identity as people see it."""
    return f"{identity:016x}"
