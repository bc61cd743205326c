"""Recorded flights on a page: their columns as series, the globe, the charts."""
