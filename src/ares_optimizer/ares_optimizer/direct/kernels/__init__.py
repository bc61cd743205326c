"""Compiled: the flight with its tangents, SQP."""
