# SPDX-License-Identifier: Apache-2.0
"""A flight in messages that every ROS tool knows."""
