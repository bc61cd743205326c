"""Steering laws with finitely many parameters, optimised on exact gradients."""
