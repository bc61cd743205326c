# SPDX-License-Identifier: Apache-2.0
"""Solve ascents by chapter 5 of the thesis."""
