# SPDX-License-Identifier: Apache-2.0
"""Read all topics, as `ros2 bag record -a` does, and report the number of messages at the end."""

import json
from collections import Counter
from contextlib import suppress
from functools import partial

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from ares_bags.types import message_class

LOOK_PERIOD = 0.2
DEPTH = 1000


class Reader(Node):
    def __init__(self):
        super().__init__("reader")
        self.counts = Counter()
        self.create_timer(LOOK_PERIOD, self.look)

    def look(self):
        for topic, kinds in self.get_topic_names_and_types():
            if topic not in self.counts:
                self.counts[topic] = 0
                qos = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
                take = partial(self.take, topic)
                self.create_subscription(message_class(kinds[0]), topic, take, qos, raw=True)

    def take(self, topic, _data):
        self.counts[topic] += 1


def main():
    rclpy.init()
    node = Reader()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    print(f"read {json.dumps(node.counts)}", flush=True)


if __name__ == "__main__":
    main()
