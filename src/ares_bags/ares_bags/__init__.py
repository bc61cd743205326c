"""Record, read and check flights as rosbag2-conformant MCAP bags."""
