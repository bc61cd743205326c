# SPDX-License-Identifier: Apache-2.0
"""Many flights and pictures of flights: closed loops in compiled code, without ROS."""
