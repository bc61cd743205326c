"""The off-line optimizer: direct, indirect and analytic solutions of the ascent."""
