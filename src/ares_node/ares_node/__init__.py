"""What every node of the graph shares; it knows ROS and nothing of the flight."""
