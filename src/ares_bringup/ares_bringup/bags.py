"""What `ares bag` and `ares replay` print. ROS is needed for the replay only."""

import json
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table
from rich.text import Text

from ares_bags.errors import BagError
from ares_bags.reader import Bag, open_bag
from ares_bags.repair import repair
from ares_bringup.options import CannotStart
from ares_bringup.report import console, number

NANOSECONDS = 1e9


def show_bag(path: Path, as_json: bool) -> None:
    """Print what a bag holds.

    Raises:
        CannotStart: it is not a complete bag; one line.
    """
    try:
        bag = open_bag(path)
    except BagError as error:
        raise CannotStart(str(error)) from error
    if as_json:
        print(json.dumps(_contents(bag), indent=2, allow_nan=False))
        return
    out = console()
    out.print(Text(f"{bag.file}, {number(bag.file.stat().st_size / 1e6, 2)} MB"), soft_wrap=True)
    for name, value in sorted(bag.custom_data.items()):
        out.print(Text(f"{name:<12}{value}"), soft_wrap=True)
    start, end = bag.start_ns / NANOSECONDS, bag.end_ns / NANOSECONDS
    out.print(f"{'time':<12}{number(start, 3)} to {number(end, 3)} s")
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("messages", justify="right")
    table.add_column("topic")
    table.add_column("type")
    for name, topic in bag.topics.items():
        table.add_row(f"{topic.count:,}", Text(name), Text(topic.type_name))
    out.print(table)


def _contents(bag: Bag) -> dict[str, object]:
    return {
        "file": str(bag.file.absolute()),
        "size_bytes": bag.file.stat().st_size,
        "start_s": bag.start_ns / NANOSECONDS,
        "end_s": bag.end_ns / NANOSECONDS,
        "messages": bag.message_count,
        "custom_data": bag.custom_data,
        "topics": {
            name: {"type": topic.type_name, "messages": topic.count, "type_hash": topic.type_hash}
            for name, topic in bag.topics.items()
        },
    }


def repair_bag(path: Path, into: Path | None) -> None:
    """Save what can be read of a damaged bag and say what that is.

    Raises:
        CannotStart: nothing to repair, nothing to save, or the copy cannot be written.
    """
    try:
        result = repair(path, into)
    except BagError as error:
        raise CannotStart(str(error)) from error
    print(f"{result.problem}")
    damaged = f", {result.damaged_chunks} damaged chunks passed over" * bool(result.damaged_chunks)
    print(f"saved {result.saved:,} messages in {result.path}{damaged}")


def replay_bag(path: Path, rate: float, topics: Sequence[str], namespace: str) -> int:
    """Publish a bag again until its end or a signal; returns the exit status."""
    from ares_bags.replay import run_replay
    from ares_bringup.discovery import apply_discovery_settings

    apply_discovery_settings()
    return run_replay(path, rate=rate, topics=list(topics) or None, namespace=namespace)
