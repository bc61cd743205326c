# SPDX-License-Identifier: Apache-2.0
"""Abort maps: failures at every second, flown, and compared with the optimum."""
