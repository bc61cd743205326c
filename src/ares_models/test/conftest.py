"""Settings of the property tests: the same examples each run, no clock."""

from hypothesis import settings

settings.register_profile("models", deadline=None, derandomize=True, database=None)
settings.load_profile("models")
