"""The true vehicle as compiled functions, and the node that owns the clock."""
