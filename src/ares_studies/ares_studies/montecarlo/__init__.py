"""Campaigns of dispersed flights: flown in compiled code, kept in Parquet, judged."""
