"""Writes bags under limits on the size of a file; run as a process by test_full_disk.py.

Arguments: folder, limits in bytes. Prints one JSON object per limit.
"""

import json
import resource
import sys
from pathlib import Path

from ares_bags.errors import BagError
from ares_bags.testing import CUSTOM_DATA, messages, topics
from ares_bags.writer import BagWriter

MESSAGES = list(messages(400))


def write(path: Path) -> dict[str, object]:
    """Write until the limit bites; what the writer says then."""
    try:
        writer = BagWriter(path, CUSTOM_DATA, flush_interval_s=1e9, flush_bytes=4000)
    except BagError as error:
        return {"error": str(error), "taken": 0, "counts": {}, "again": str(error)}
    for topic in topics():
        writer.add_topic(topic)
    taken = 0
    error = again = ""
    try:
        for topic_name, time, data in MESSAGES:
            taken += 1
            writer.write(topic_name, time, data)
        writer.close()
    except BagError as first:
        error = str(first)
        try:
            writer.write(*MESSAGES[0])
        except BagError as second:
            again = str(second)
        writer.close()
    return {"error": error, "taken": taken, "counts": writer.counts, "again": again}


def main() -> None:
    """One bag per limit."""
    folder = Path(sys.argv[1])
    _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for limit in sys.argv[2:]:
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), hard))
        answer = write(folder / limit)
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
