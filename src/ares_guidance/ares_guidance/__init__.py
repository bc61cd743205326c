"""Ascent guidance: the laws, and the node that flies them."""
