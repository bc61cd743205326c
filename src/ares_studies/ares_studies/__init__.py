"""Whole flights without ROS, in one compiled loop."""
