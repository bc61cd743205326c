# SPDX-License-Identifier: Apache-2.0
"""A file that cannot grow: the bag ends there, stays readable, and states the cause."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rosbags.rosbag2 import Reader

from ares_bags.errors import BagError
from ares_bags.reader import open_bag
from ares_bags.verify import verify
from ares_bags.writer import BagWriter
from ares_trials.testing.bags import CUSTOM_DATA, NAV, messages, topics, write_bag

FILL = Path(__file__).with_name("fill_disk.py")


def test_every_limit_leaves_a_readable_bag(tmp_path: Path) -> None:
    whole = write_bag(tmp_path / "whole", 400)
    size = next(whole.glob("*.mcap")).stat().st_size
    limits = [*range(7000, size + 8000, 2503), 10**9]
    done = subprocess.run(
        [sys.executable, str(FILL), str(tmp_path), *map(str, limits)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert done.stderr == ""
    sent = [(topic, time) for topic, time, _ in messages(400)]
    saved_by_limit = []
    for limit, line in zip(limits, done.stdout.splitlines(), strict=True):
        answer = json.loads(line)
        path = tmp_path / str(limit)
        bag = open_bag(path)
        saved = [(topic, time) for topic, time, _ in bag.raw_messages()]
        saved_by_limit.append(len(saved))
        # everything that was flushed, nothing else
        assert saved == sent[: answer["flushed"]]
        if NAV in bag.topics:
            numbers = [message.sequence for _, message in bag.messages(NAV)]
            assert numbers == list(range(bag.topics[NAV].count))
        assert {name: topic.count for name, topic in bag.topics.items() if topic.count} == {
            name: count for name, count in answer["counts"].items() if count
        }
        assert verify(path).findings == []
        with Reader(path) as reader:
            assert reader.message_count == len(saved) == sum(1 for _ in reader.messages())
        if len(saved) == len(sent):
            continue
        assert answer["error"] == (
            f"bag {path} is incomplete: File too large; {len(saved)} of {answer['taken']} "
            "messages are in it"
        )
        assert answer["again"] == answer["error"]
        assert bag.custom_data == CUSTOM_DATA | {"incomplete": "File too large"}
    assert saved_by_limit == sorted(saved_by_limit)
    assert saved_by_limit[-1] == len(sent)
    assert len(set(saved_by_limit)) > 5


def test_a_full_disk_costs_no_message_that_was_flushed(tmp_path: Path) -> None:
    """Fill the disk to the last byte: the space for the bag's end is reserved."""
    disk = (
        f"mount -t tmpfs -o size=256k tmpfs {tmp_path} && exec {sys.executable} {FILL} {tmp_path}"
    )
    done = subprocess.run(
        ["unshare", "--map-root-user", "--mount", "sh", "-c", disk],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    if not done.stdout and ("unshare:" in done.stderr or "mount:" in done.stderr):
        pytest.skip(f"no disk can be made here: {done.stderr.strip()}")
    answer = json.loads(done.stdout)
    assert "No space left on device" in answer["error"]
    assert answer["saved"] == answer["flushed"] >= 200
    assert answer["findings"] == []
    assert answer["files"] == ["bag_0.mcap", "metadata.yaml"]


def test_no_room_for_a_bag_at_all(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(FILL), str(tmp_path), "10"],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    answer = json.loads(done.stdout)
    assert answer["error"] == f"bag {tmp_path / '10'} cannot be written: File too large"
    assert not (tmp_path / "10").exists()


def test_no_room_for_metadata_yaml(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Refuse `metadata.yaml` after the file has its end: chunks are dropped until it fits."""
    refusals = 3

    real = Path.replace

    def refuse(self: Path, target: Path) -> Path:
        nonlocal refusals
        if refusals:
            refusals -= 1
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(self, target)

    monkeypatch.setattr(Path, "replace", refuse)
    writer = BagWriter(tmp_path / "flight", flush_interval_s=1e9)
    for topic in topics():
        writer.add_topic(topic)
    for number, message in enumerate(messages(100)):
        writer.write(*message)
        if number % 20 == 19:
            writer.flush()
    with pytest.raises(BagError, match="incomplete: No space left on device; 100 of 125 messages"):
        writer.close()
    assert open_bag(tmp_path / "flight").message_count == 100
    assert not list((tmp_path / "flight").glob("*.part"))
    with Reader(tmp_path / "flight") as reader:
        assert reader.message_count == 100
