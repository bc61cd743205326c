"""Faults from outside into real flights: `ares faults`."""
