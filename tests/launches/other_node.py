# SPDX-License-Identifier: Apache-2.0
"""A foreign node: reports its environment once a second."""

import json
import os
from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String

OURS = ("ARES_LAUNCHER_PID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE")


def main():
    rclpy.init()
    node = Node("other")
    out = node.create_publisher(String, "other", 10)
    found = json.dumps({name: os.environ.get(name) for name in OURS})
    node.create_timer(1.0, lambda: out.publish(String(data=found)))
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    print("other node ends well", flush=True)


if __name__ == "__main__":
    main()
