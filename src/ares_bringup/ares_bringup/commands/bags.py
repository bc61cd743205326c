# SPDX-License-Identifier: Apache-2.0
"""Print for `ares bag` and `ares replay`. Only the replay needs ROS."""

import json
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from ares_bags.errors import BagError
from ares_bags.reader import Bag, open_bag
from ares_bags.repair import repair
from ares_bags.verify import BagVerification, verify
from ares_bags.writer import INCOMPLETE_KEY
from ares_bringup.commands.interrupts import note_written
from ares_bringup.flown_mission import flown_mission
from ares_bringup.options import CannotStart, LiveOptions, refusals
from ares_bringup.plain_json import print_json
from ares_bringup.report import console, number
from ares_models.units import NANOSECONDS

EXIT_DAMAGED = 1
#: Topics of the live page; the replay waits for its subscriptions to them.
SHOWN = ("vehicle_state", "guidance_status", "flight_event")


def show_bag(path: Path, as_json: bool) -> int:
    """Print the contents of a bag and the state of its checksums, indexes and counts.

    Returns:
        Exit status: 0, or 1 if the bag is damaged.

    Raises:
        CannotStart: it cannot be opened; one line.
    """
    with refusals(BagError):
        bag = open_bag(path)
        found = verify(path, decode=False)
    if as_json:
        print_json(_contents(bag) | {"findings": found.findings})
        return _status(found)
    out = console()
    out.print(Text(f"{bag.file}, {number(_size(bag) / 1e6, 2)} MB{_more(bag)}"), soft_wrap=True)
    for name, value in sorted(bag.custom_data.items()):
        out.print(Text(f"{name:<11} {_readable(value)}"), soft_wrap=True)
    start, end = bag.start_ns / NANOSECONDS, bag.end_ns / NANOSECONDS
    out.print(f"{'time':<12}{number(start, 3)} to {number(end, 3)} s")
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("messages", justify="right")
    table.add_column("topic")
    table.add_column("type")
    for name, topic in bag.topics.items():
        table.add_row(f"{topic.count:,}", Text(name), Text(topic.type_name))
    out.print(table)
    for reason in bag.left_out.values():
        out.print(Text(f"left out: {reason}"), soft_wrap=True)
    if bag.timed_by_stamps:
        out.print("log times are of a wall clock: each message counts for the time of its stamp")
    if found.findings:
        _print_damage(found)
    else:
        out.print("checksums, indexes and counts are right; `ares bag verify` decodes too")
    return _status(found)


def _size(bag: Bag) -> int:
    return sum(file.stat().st_size for file in bag.files)


def _more(bag: Bag) -> str:
    return f" in {len(bag.files)} files" if len(bag.files) > 1 else ""


def _readable(value: str) -> str:
    """Format a text of the custom data; list a JSON object's entries, long ones by length."""
    try:
        entries = json.loads(value)
    except ValueError:
        entries = None
    if not isinstance(entries, dict):
        return value
    return ", ".join(f"{name} {_short(entry)}" for name, entry in entries.items())


def _short(entry: object) -> object:
    lines = entry.count("\n") if isinstance(entry, str) else 0
    return f"({lines:,} lines)" if lines else entry


def _status(found: BagVerification) -> int:
    return EXIT_DAMAGED if found.findings else 0


def _print_damage(found: BagVerification) -> None:
    for finding in found.findings:
        print(f"damaged: {finding}")
    if found.lost:
        print(f"{found.lost:,} of {found.expected:,} messages cannot be read")
    print("`ares bag repair` saves what is intact")


def verify_bag(path: Path, as_json: bool) -> int:
    """Verify everything in a bag and print the faults.

    Returns:
        Exit status: 0, or 1 if the bag is damaged.

    Raises:
        CannotStart: it is not a bag; one line.
    """
    with refusals(BagError):
        found = verify(path)
    incomplete = _incomplete(path)
    if as_json:
        print_json(_verification(found) | {"incomplete": incomplete})
        return _status(found)
    print(f"{found.file}: {found.messages:,} messages in {found.chunks:,} chunks")
    if found.findings:
        _print_damage(found)
    else:
        print("whole: every checksum, index and count is right, every message can be decoded")
        if found.unproven_chunks:
            print(f"{found.unproven_chunks:,} chunks carry no checksum: a wrong bit may be there")
        if not found.data_checksum:
            print("no checksum covers what stands between the chunks; their copies agree")
    if incomplete:
        print(f"who wrote it says that it is incomplete: {incomplete}")
    return _status(found)


def _incomplete(path: Path) -> str | None:
    """Return the cause for which an intact bag is marked as incomplete; None if it is not."""
    try:
        return open_bag(path).custom_data.get(INCOMPLETE_KEY)
    except BagError:
        return None


def _verification(found: BagVerification) -> dict[str, object]:
    return {
        "file": str(found.file.absolute()),
        "whole": not found.findings,
        "messages": found.messages,
        "messages_recorded": found.expected,
        "chunks": found.chunks,
        "damaged_chunks": found.damaged_chunks,
        "unproven_chunks": found.unproven_chunks,
        "data_checksum": found.data_checksum,
        "findings": found.findings,
    }


def _contents(bag: Bag) -> dict[str, object]:
    return {
        "file": str(bag.file.absolute()),
        "files": [str(file.absolute()) for file in bag.files],
        "size_bytes": _size(bag),
        "start_s": bag.start_ns / NANOSECONDS,
        "end_s": bag.end_ns / NANOSECONDS,
        "messages": bag.message_count,
        "custom_data": bag.custom_data,
        "topics": {
            name: {"type": topic.type_name, "messages": topic.count, "type_hash": topic.type_hash}
            for name, topic in bag.topics.items()
        },
    }


def repair_bag(path: Path, into: Path | None) -> int:
    """Repair a damaged bag and print the result.

    Returns:
        Exit status: 0 if no recorded message is lost, 1 if one is, or may be.

    Raises:
        CannotStart: nothing to repair, nothing to save, or the copy cannot be written.
    """
    with refusals(BagError):
        result = repair(path, into)
    note_written(str(result.path))
    print(result.problem)
    print(f"saved {result.saved:,} messages in {result.path}; {result.loss}")
    return EXIT_DAMAGED if result.lost != 0 else 0


def replay_bag(
    path: Path,
    pace: float,
    extract: Mapping[str, Any],
    namespace: str | None,
    live: LiveOptions | None = None,
) -> int:
    """Publish a bag again until its end, a key or a signal; return the exit status.

    Args:
        path: the bag.
        pace: real-time factor; 0: as fast as the readers acknowledge.
        extract: attributes of `ares_bags.replay.Extract`.
        namespace: prefix of every topic name.
        live: options of the live page; None: no page.

    Raises:
        CannotStart: the namespace is invalid, or the page cannot be served.
    """
    if namespace is not None and not namespace.strip("/"):
        raise CannotStart(f"--namespace is {namespace!r}; expected a name such as /again")
    from ares_bags.replay import Extract, run_replay
    from ares_bringup.discovery import apply_discovery_settings

    apply_discovery_settings()
    with ExitStack() as held:
        stay: Callable[[], None] = lambda: None  # noqa: E731
        facts: dict[str, object] = {}
        if live is not None:
            from ares_bringup.audience import served
            from ares_bringup.fly import say_on_standard_error

            with refusals(BagError):
                bag = open_bag(path)
                home = bag.name_of(SHOWN[0]).removesuffix(f"/{SHOWN[0]}")
            mission = ""
            # without a mission the page has no names and no verdict
            with suppress(CannotStart):
                mission = held.enter_context(flown_mission(path, bag.custom_data).file())
                facts = _facts_at_the_end(path)
            prefix = (namespace or "").strip("/")
            home = f"/{prefix}{home}" if prefix else home
            stay = held.enter_context(served(live, mission, home, path, say_on_standard_error))
        return run_replay(
            path,
            rate=pace,
            extract=Extract(**extract),
            namespace=namespace or "",
            expected=() if live is None else SHOWN,
            facts=facts,
            then=stay,
        )


def _facts_at_the_end(path: Path) -> dict[str, object]:
    """Return the verdict on a recorded flight and its exit status, for the live page."""
    from ares_bringup.monitor import verdict_facts
    from ares_bringup.recorded import read_flight
    from ares_node.diagnostics import EXIT_STATUS

    facts = verdict_facts(read_flight(path).summary)
    return facts | {EXIT_STATUS: f"{facts[EXIT_STATUS]}, as far as the bag tells"}
