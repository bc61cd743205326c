# SPDX-License-Identifier: Apache-2.0
"""Compiled physics on plain floats, 3-tuples and structured arrays."""
