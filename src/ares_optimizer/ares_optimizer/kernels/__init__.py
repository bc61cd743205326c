"""Compiled pieces of the optimizer, on plain floats, tuples and structured arrays."""
