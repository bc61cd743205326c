# SPDX-License-Identifier: Apache-2.0
"""Record, read and check flights as rosbag2-conformant MCAP bags."""
