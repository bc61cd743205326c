"""The optimum as the root of a two-point problem."""
