# SPDX-License-Identifier: Apache-2.0
"""Bags of `ros2 bag record`: chunked in every way, split, packed, with wall-clock times."""

from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Reader as RosbagsReader
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from ares_bags.compare import differences
from ares_bags.errors import BagError
from ares_bags.metadata import METADATA_FILE, write_metadata_file
from ares_bags.reader import LOG_TIME, Bag, open_bag
from ares_bags.repair import repair
from ares_bags.schema import qos_text
from ares_bags.verify import verify
from ares_trials.testing.bags import (
    DIAGNOSTICS,
    EVENT,
    NAV,
    PERIOD_NS,
    START_NS,
    messages,
    topics,
    write_bag,
)

COUNT = 40
#: When somebody recorded it, ns since 1970.
WALL_NS = 1_790_000_000_000_000_000


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Bag:
    return open_bag(write_bag(tmp_path_factory.mktemp("ours") / "flight", COUNT))


def write_file(path: Path, part: slice = slice(None), wall: bool = True, **how: object) -> int:
    """Write one file of a split bag: our messages, one of another package, one not of ROS.

    Returns:
        Number of its messages.
    """
    written = list(messages(COUNT))[part]
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2000, **how)  # type: ignore[arg-type]
        writer.start(profile="ros2", library="rosbag2_storage_mcap 0.26")
        channels = {}
        for topic in topics():
            schema = writer.register_schema(topic.type_name, "ros2msg", topic.definition.encode())
            about = {
                "offered_qos_profiles": qos_text(topic.qos),
                "topic_type_hash": topic.type_hash,
            }
            channels[topic.name] = writer.register_channel(topic.name, "cdr", schema, about)
        text = writer.register_schema("other_msgs/msg/State", "ros2msg", b"float64 x\n")
        other = writer.register_channel("/other/nav_state", "cdr", text)
        foreign = writer.register_channel("/video", "h264", 0)
        for number, (topic, time, data) in enumerate(written):
            now = WALL_NS + (time - START_NS) * 3 + number if wall else time
            writer.add_message(channels[topic], now, data, now)
            if number == 0:
                writer.add_message(other, now, b"\0\1\0\0" + bytes(8), now)
                writer.add_message(foreign, now, b"picture", now)
        writer.finish()
    return len(written) + 2


def write_split(folder: Path, version: int = 9, **how: object) -> Path:
    """Write a bag of three files, whose third sorts before the second by name."""
    folder.mkdir()
    parts = (slice(0, 15), slice(15, 30), slice(30, None))
    names = [f"{folder.name}_{number}.mcap" for number in (9, 10, 11)]
    counts = [
        write_file(folder / name, part, **how) for name, part in zip(names, parts, strict=True)
    ]
    write_metadata_file(
        folder,
        {
            "version": version,
            "storage_identifier": "mcap",
            "relative_file_paths": names,
            "message_count": sum(counts),
            "compression_format": "",
            "compression_mode": "",
        },
    )
    return folder


def assert_ours(bag: Bag, ours: Bag) -> None:
    """Assert that the messages of the flight have their flight times."""
    assert differences(ours, bag, list(ours.topics), limit=1) == []
    assert "/video" not in bag.topics
    assert "is h264/no schema; expected cdr/ros2msg" in bag.left_out["/video"]
    assert bag.topics["/other/nav_state"].count
    assert bag.name_of("nav_state") == NAV
    columns = bag.columns("nav_state")
    assert list(columns[LOG_TIME]) == [START_NS + k * PERIOD_NS for k in range(COUNT)]
    assert (bag.start_ns, bag.end_ns) == (ours.start_ns, ours.end_ns)


HOW = {
    "lz4": {"compression": CompressionType.LZ4},
    "zstd": {"compression": CompressionType.ZSTD},
    "plain": {"compression": CompressionType.NONE},
    "fastwrite": {"use_chunking": False},
}


@pytest.mark.parametrize("wall", [True, False], ids=["wall clock", "flight time"])
@pytest.mark.parametrize("how", HOW)
def test_one_file_without_metadata(ours: Bag, tmp_path: Path, how: str, wall: bool) -> None:
    path = tmp_path / "bare.mcap"
    count = write_file(path, wall=wall, **HOW[how])
    bag = open_bag(path)
    assert bag.timed_by_stamps is wall
    assert_ours(bag, ours)
    found = verify(path)
    assert (found.findings, found.messages) == ([], count)


@pytest.mark.parametrize("version", [4, 5, 8, 9])
@pytest.mark.parametrize("how", ["lz4", "fastwrite"])
def test_a_split_bag(ours: Bag, tmp_path: Path, how: str, version: int) -> None:
    path = write_split(tmp_path / "split", version, **HOW[how])
    bag = open_bag(path)
    assert len(bag.files) == 3
    assert bag.topics["/other/nav_state"].count == 3
    assert_ours(bag, ours)
    found = verify(path)
    assert (found.findings, found.lost) == ([], 0)
    # without its metadata the names tell the order
    (path / METADATA_FILE).unlink()
    assert_ours(open_bag(path), ours)
    assert verify(path).findings == ["metadata.yaml is missing"]


def test_a_damaged_file_of_a_split_bag_is_named(tmp_path: Path) -> None:
    path = write_split(tmp_path / "split", **HOW["plain"])
    file = path / "split_10.mcap"
    data = bytearray(file.read_bytes())
    data[data.index(b"line ")] ^= 1
    file.write_bytes(data)
    (finding,) = [f for f in verify(path).findings if "chunk" in f]
    assert finding.startswith("split_10.mcap: ")
    with pytest.raises(BagError, match="is of 3 files; expected the name of one, such as"):
        repair(path)
    assert repair(file, tmp_path / "saved").damaged_chunks == 1


def test_a_piece_of_time(ours: Bag, tmp_path: Path) -> None:
    split = open_bag(write_split(tmp_path / "split"))
    begin, end = START_NS + 7 * PERIOD_NS, START_NS + 21 * PERIOD_NS
    for bag in (ours, split):
        times = [time for _, time, _ in bag.raw_messages([NAV], begin, end)]
        assert times == [START_NS + k * PERIOD_NS for k in range(7, 22)]
    assert list(split.raw_messages(ours.topics, begin, end)) == list(
        ours.raw_messages(ours.topics, begin, end)
    )


def by_rosbags(path: Path, version: int, mode: CompressionMode, plugin: StoragePlugin) -> Path:
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = RosbagsWriter(path, version=version, storage_plugin=plugin)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(
            DIAGNOSTICS, "diagnostic_msgs/msg/DiagnosticArray", typestore=store
        )
        for topic, time, data in messages(COUNT):
            if topic == DIAGNOSTICS:
                writer.write(connection, WALL_NS + time, data)
    return path


@pytest.mark.parametrize("version", [8, 9])
@pytest.mark.parametrize(
    "mode", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.STORAGE]
)
def test_what_rosbags_writes(
    ours: Bag, tmp_path: Path, version: int, mode: CompressionMode
) -> None:
    path = by_rosbags(tmp_path / "theirs", version, mode, StoragePlugin.MCAP)
    bag = open_bag(path)
    with RosbagsReader(path) as reader:
        assert bag.message_count == reader.message_count
    assert differences(ours, bag, [DIAGNOSTICS], limit=1) == []
    assert verify(path).findings == []


def test_what_is_not_read_is_said(tmp_path: Path) -> None:
    each = by_rosbags(tmp_path / "each", 9, CompressionMode.MESSAGE, StoragePlugin.MCAP)
    old = by_rosbags(tmp_path / "old", 9, CompressionMode.NONE, StoragePlugin.SQLITE3)
    (bare := tmp_path / "bare").mkdir()
    (next(old.glob("*.db3"))).rename(bare / "old.db3")
    for path, text in (
        (each, "has each message compressed by itself"),
        (old, "is kept by sqlite3, expected mcap: rosbags-convert --src"),
        (bare, "is kept by sqlite3"),
        (bare / "old.db3", "is kept by sqlite3"),
    ):
        for read in (open_bag, verify):
            with pytest.raises(BagError) as caught:
                read(path)
            assert text in str(caught.value)
            assert "\n" not in str(caught.value)


def test_a_packed_file_that_is_damaged(tmp_path: Path) -> None:
    path = by_rosbags(tmp_path / "cut", 9, CompressionMode.FILE, StoragePlugin.MCAP)
    file = next(path.glob("*.zstd"))
    whole = file.read_bytes()
    file.write_bytes(whole[:-40])
    with pytest.raises(BagError, match="has no end"):
        open_bag(path)
    assert any("has no end" in finding for finding in verify(path).findings)
    file.write_bytes(whole[:2] + bytes(100) + whole[102:])
    for read in (open_bag, verify):
        with pytest.raises(BagError, match="cannot be unpacked"):
            read(path)


def test_events_keep_their_place(ours: Bag, tmp_path: Path) -> None:
    bag = open_bag(write_split(tmp_path / "split"))
    mixed = [(topic, time) for topic, time, _ in bag.raw_messages([NAV, EVENT])]
    assert mixed == [(topic, time) for topic, time, _ in ours.raw_messages([NAV, EVENT])]
