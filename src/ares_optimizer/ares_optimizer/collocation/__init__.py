# SPDX-License-Identifier: Apache-2.0
"""Solve any mission file as one sparse program, by collocation."""
