# SPDX-License-Identifier: Apache-2.0
"""Units for modules without ROS; those of messages are in `ares_node.time`."""

#: Nanoseconds in a second.
NANOSECONDS = 1_000_000_000
