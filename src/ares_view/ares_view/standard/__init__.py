# SPDX-License-Identifier: Apache-2.0
"""A flight in standard ROS messages."""
