# SPDX-License-Identifier: Apache-2.0
"""Monitors of navigation, engines, answers and what falls; the failures they find."""
