# SPDX-License-Identifier: Apache-2.0
"""Solve for the optimum as the root of a two-point problem."""
