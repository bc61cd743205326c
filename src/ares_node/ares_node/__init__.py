"""What every node of the graph shares."""
