# SPDX-License-Identifier: Apache-2.0
"""Hold compiled functions shared by all methods, on floats, tuples and structured arrays."""
