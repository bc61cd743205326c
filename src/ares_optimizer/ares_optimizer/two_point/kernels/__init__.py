"""Compiled: costates, shooting, Newton, search."""
