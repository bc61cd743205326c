# SPDX-License-Identifier: Apache-2.0
"""Physics and mission data: no ROS, no guidance."""
