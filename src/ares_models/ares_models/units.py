# SPDX-License-Identifier: Apache-2.0
"""Units that what speaks no ROS needs; those of messages: `ares_node.time`."""

#: In a second.
NANOSECONDS = 1_000_000_000
