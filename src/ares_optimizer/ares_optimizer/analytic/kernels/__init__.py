"""Compiled: polynomial burns and their iteration."""
