"""Compiled physics on plain floats, 3-tuples and structured arrays."""
