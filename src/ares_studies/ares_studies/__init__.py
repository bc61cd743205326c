# SPDX-License-Identifier: Apache-2.0
"""Closed-loop flights in compiled code, campaigns of them, pages and plots. No ROS."""
