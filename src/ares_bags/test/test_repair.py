# SPDX-License-Identifier: Apache-2.0
"""Killed recorders, cut and damaged files: intact messages are saved, losses are reported."""

import hashlib
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from rosbags.rosbag2 import Reader

from ares_bags.compare import differences
from ares_bags.errors import BagError
from ares_bags.metadata import METADATA_FILE
from ares_bags.reader import open_bag
from ares_bags.repair import repair
from ares_trials.testing.bags import CUSTOM_DATA, NAV, messages, write_bag

RECORD = Path(__file__).with_name("record_forever.py")


def fingerprint(path: Path) -> dict[str, str]:
    return {
        str(file.relative_to(path)): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(path.rglob("*"))
        if file.is_file()
    }


def file_of(bag: Path) -> Path:
    return next(bag.glob("*.mcap"))


def what_is_wrong(bag: Path) -> str:
    try:
        opened = open_bag(bag)
        for topic in opened.topics:
            for _ in opened.messages(topic):
                pass
    except BagError as error:
        return str(error)
    return ""


def test_sigkill_loses_at_most_the_flush_interval(tmp_path: Path) -> None:
    bag = tmp_path / "flight"
    process = subprocess.Popen(
        [sys.executable, str(RECORD), str(bag)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    taken = 0
    while taken < 400:
        taken = int(process.stdout.readline())
    process.kill()
    rest = process.stdout.read().split()
    process.wait()
    taken = int(rest[-1]) if rest else taken
    before = fingerprint(bag)
    assert METADATA_FILE not in before

    with pytest.raises(BagError, match=r"has no end .*; \./ares bag repair saves") as caught:
        open_bag(bag)
    assert "\n" not in str(caught.value)
    done = repair(bag)
    assert fingerprint(bag) == before, "the original is left alone"
    assert done.path == tmp_path / "flight_repaired"
    assert "has no end" in done.problem
    # 0.05 s at less than 1000 messages a second; the last one may be saved and not yet said
    assert taken - 200 <= done.saved <= taken + 1
    assert done.lost is None

    saved = open_bag(done.path)
    assert saved.message_count == done.saved
    assert saved.custom_data["mission"] == CUSTOM_DATA["mission"]
    assert saved.custom_data["incomplete"].startswith("repaired: ")
    source = messages(300)
    expected = [
        (source[number % len(source)][0], source[number % len(source)][1] + number)
        for number in range(done.saved)
    ]
    assert sorted((topic, time) for topic, time, _ in saved.raw_messages()) == sorted(expected)
    with Reader(done.path) as reader:
        assert reader.message_count == done.saved == sum(1 for _ in reader.messages())


def test_cut_anywhere(tmp_path: Path) -> None:
    whole = write_bag(tmp_path / "whole", 200)
    data = file_of(whole).read_bytes()
    cut = tmp_path / "cut"
    cut.mkdir()
    counts = []
    for number, size in enumerate(range(0, len(data), len(data) // 40)):
        (cut / "cut_0.mcap").write_bytes(data[:size])
        with pytest.raises(BagError) as caught:
            open_bag(cut)
        assert "\n" not in str(caught.value)
        target = tmp_path / f"saved{number}"
        try:
            done = repair(cut, target)
        except BagError:
            with pytest.raises(BagError, match="no message can be saved"):
                repair(cut, target)
            assert not target.exists()
            counts.append(0)
            continue
        saved = open_bag(target)
        assert (
            list(saved.raw_messages(["nav_state"]))
            == [message for message in messages(200) if message[0] == NAV][
                : saved.topics[NAV].count
            ]
        )
        assert done.damaged_chunks == 0
        counts.append(done.saved)
    assert counts == sorted(counts)
    assert counts[0] == 0
    # only the index is cut
    assert counts[-1] == len(messages(200))


def test_a_damaged_chunk_in_the_middle_costs_only_itself(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "flight", 200, flush_every=20)
    file = file_of(bag)
    with file.open("rb") as stream:
        ends = [
            stream.tell()
            for record in StreamReader(stream, emit_chunks=True).records
            if isinstance(record, Chunk)
        ]
    data = bytearray(file.read_bytes())
    data[ends[4] - 30] ^= 0xFF
    file.write_bytes(data)
    damaged = open_bag(bag)
    with pytest.raises(BagError, match=r"is damaged \(.*\); \./ares bag repair") as caught:
        list(damaged.raw_messages())
    assert "\n" not in str(caught.value)
    done = repair(bag)
    sent = messages(200)
    assert (done.saved, done.damaged_chunks) == (len(sent) - 20, 1)
    saved = open_bag(done.path)
    assert sorted(saved.raw_messages()) == sorted(sent[:80] + sent[100:])
    lines = differences(saved, open_bag(write_bag(tmp_path / "again", 200)), [NAV])
    assert len(lines) == 10


def test_every_damaged_byte_is_one_line(tmp_path: Path) -> None:
    """Damage bytes one by one: the result is one BagError, or no message is affected."""
    bag = write_bag(tmp_path / "flight", 60)
    file = file_of(bag)
    data = file.read_bytes()
    lines = []
    for place in range(0, len(data), 251):
        damaged = bytearray(data)
        damaged[place] ^= 0x5A
        file.write_bytes(damaged)
        lines.append(what_is_wrong(bag))
    assert not any("\n" in line for line in lines)
    assert sum(bool(line) for line in lines) > len(lines) // 3


def test_nothing_to_repair_and_nothing_to_save(tmp_path: Path) -> None:
    whole = write_bag(tmp_path / "whole", 10)
    with pytest.raises(BagError, match="is not damaged; nothing to repair"):
        repair(whole)
    (tmp_path / "empty.mcap").touch()
    with pytest.raises(BagError, match=r"empty\.mcap: no message can be saved .*is empty"):
        repair(tmp_path / "empty.mcap")
    (tmp_path / "text.mcap").write_text("not a bag at all")
    with pytest.raises(BagError, match=r"no message can be saved .*is not an MCAP file"):
        repair(tmp_path / "text.mcap")
    with pytest.raises(BagError, match="does not exist"):
        repair(tmp_path / "none")
    file_of(whole).write_bytes(file_of(whole).read_bytes()[:-20])
    with pytest.raises(BagError, match="exists already"):
        repair(whole, tmp_path / "whole")
    assert repair(file_of(whole)).path == whole / "whole_0_repaired"
