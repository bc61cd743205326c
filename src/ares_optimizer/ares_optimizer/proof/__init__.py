"""The flight again, by physics written a second time."""
