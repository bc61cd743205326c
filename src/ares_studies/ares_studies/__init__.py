"""Many flights and pictures of flights: closed loops in compiled code, without ROS."""
