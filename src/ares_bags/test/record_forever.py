# SPDX-License-Identifier: Apache-2.0
"""Write a bag until killed; run as a process by test_repair.py. Argument: folder."""

import itertools
import sys
import time
from pathlib import Path

from ares_bags.writer import BagWriter
from ares_trials.testing.bags import CUSTOM_DATA, messages, topics


def main() -> None:
    """Print the number of messages written after each of them."""
    writer = BagWriter(Path(sys.argv[1]), CUSTOM_DATA, flush_interval_s=0.05)
    for topic in topics():
        writer.add_topic(topic)
    source = list(messages(300))
    for number in itertools.count():
        topic_name, stamp, data = source[number % len(source)]
        writer.write(topic_name, stamp + number, data)
        print(number + 1, flush=True)
        time.sleep(0.001)


if __name__ == "__main__":
    main()
