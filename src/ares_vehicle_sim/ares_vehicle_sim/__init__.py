"""The truth: plant, engines, navigation errors, dispersions, and their node."""
