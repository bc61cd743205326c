"""The truth as compiled functions: plant, measurement, variation of a flight."""
