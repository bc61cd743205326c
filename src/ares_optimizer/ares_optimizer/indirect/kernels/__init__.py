"""Compiled: sampling."""
