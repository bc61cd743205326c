# SPDX-License-Identifier: Apache-2.0
"""Write bags where the disk is too small; run as a process by test_full_disk.py.

Arguments: folder, limits on the size of a file in bytes; without limits, the folder is a small
disk, which is filled. Prints one JSON object per bag.
"""

import json
import resource
import sys
from collections.abc import Callable
from pathlib import Path

from ares_bags.errors import BagError
from ares_bags.reader import open_bag
from ares_bags.verify import verify
from ares_bags.writer import BagWriter
from ares_trials.testing.bags import CUSTOM_DATA, messages, topics

MESSAGES = list(messages(400))


#: Messages between flushes.
FLUSH_EVERY = 20


def write(
    path: Path, meanwhile: Callable[[int], None] = lambda _flushed: None
) -> dict[str, object]:
    """Write until the disk is full; return the writer's error and the number of messages flushed.

    Args:
        path: of the bag.
        meanwhile: called after each flush with the number of messages flushed.
    """
    try:
        writer = BagWriter(path, CUSTOM_DATA, flush_interval_s=1e9, flush_bytes=10**9)
    except BagError as error:
        return {"error": str(error), "taken": 0, "counts": {}, "again": str(error)}
    for topic in topics():
        writer.add_topic(topic)
    taken = flushed = 0
    error = again = ""
    try:
        for topic_name, time, data in MESSAGES:
            taken += 1
            writer.write(topic_name, time, data)
            if taken % FLUSH_EVERY == 0:
                writer.flush()
                flushed = taken
                meanwhile(flushed)
        writer.close()
        flushed = taken
    except BagError as first:
        error = str(first)
        try:
            writer.write(*MESSAGES[0])
        except BagError as second:
            again = str(second)
        writer.close()
    return {
        "error": error,
        "taken": taken,
        "flushed": flushed,
        "counts": writer.counts,
        "again": again,
    }


def fill(folder: Path) -> dict[str, object]:
    """Write a bag to a disk that others fill to the last byte; return its remains."""

    def fill_up(flushed: int) -> None:
        if flushed < len(MESSAGES) / 2:
            return
        with (folder / "filling").open("ab", buffering=0) as stream:
            for size in (4096, 1):
                try:
                    while stream.write(bytes(size)):
                        pass
                except OSError:
                    continue

    answer = write(folder / "bag", fill_up)
    bag = open_bag(folder / "bag")
    return answer | {
        "saved": bag.message_count,
        "findings": verify(folder / "bag").findings,
        "files": sorted(path.name for path in (folder / "bag").iterdir()),
    }


def main() -> None:
    """Write one bag per limit, or one on a full disk."""
    folder = Path(sys.argv[1])
    if len(sys.argv) == 2:
        print(json.dumps(fill(folder)))
        return
    _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for limit in sys.argv[2:]:
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), hard))
        answer = write(folder / limit)
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
