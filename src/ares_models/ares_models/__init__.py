"""Physics and mission data: no ROS, no guidance."""
