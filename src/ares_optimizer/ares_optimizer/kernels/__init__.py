# SPDX-License-Identifier: Apache-2.0
"""Compiled pieces of the optimizer, on plain floats, tuples and structured arrays."""
