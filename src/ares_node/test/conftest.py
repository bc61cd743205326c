# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests of this package."""

from ares_trials.testing.ros import ros_context, ros_domain, ros_environment

__all__ = ["ros_context", "ros_domain", "ros_environment"]
