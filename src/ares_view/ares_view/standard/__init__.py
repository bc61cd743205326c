"""A flight in messages that every ROS tool knows."""
