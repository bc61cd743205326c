"""Compiled guidance laws on plain records."""
