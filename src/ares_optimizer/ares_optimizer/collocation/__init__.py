"""Collocation: one sparse program for every mission that a file can state."""
