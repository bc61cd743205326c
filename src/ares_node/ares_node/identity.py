# SPDX-License-Identifier: Apache-2.0
"""Identities of flights and of their members. No ROS."""

import secrets

#: Key in a member's settings: digest of the numbers of its mission.
MISSION_DIGEST = "mission_digest"


def new_id() -> int:
    """Draw a random identity, never 0, that fits into a ROS integer parameter."""
    return secrets.randbits(62) + 1


def id_text(identity: int) -> str:
    """Format an identity as 16 hexadecimal digits."""
    return f"{identity:016x}"
