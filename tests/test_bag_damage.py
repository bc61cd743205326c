# SPDX-License-Identifier: Apache-2.0
"""A wrong bit or a cut anywhere in a bag: intact messages are saved, losses are reported."""

import json
import random
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.records import Message
from mcap.writer import CompressionType, IndexType, Writer

from ares_bags.errors import BagError
from ares_bags.files import find_file
from ares_bags.metadata import METADATA_FILE
from ares_bags.reader import open_bag
from ares_bags.repair import repair
from ares_bags.schema import qos_text
from ares_bags.survey import CHUNK_HEAD, HEAD, chunk_content, chunk_records
from ares_bags.verify import surveyed, verify
from ares_bringup.commands.cli import main
from ares_trials.testing.bags import CUSTOM_DATA, write_bag
from ares_trials.testing.ros import own_words
from ares_trials.testing.samples import one_in

REFERENCE = Path(__file__).parent.parent / "bags" / "reference"


@dataclass(frozen=True)
class Whole:
    """Hold a bag before the damage; each chunk with begin, end and its messages."""

    path: Path
    file: str
    data: bytes
    content: tuple
    chunks: list

    @property
    def messages(self):
        return self.content[-1]

    def copy(self, folder, data=None, metadata=True):
        """Copy the bag to a folder, with other bytes."""
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        (folder / self.file).write_bytes(self.data if data is None else data)
        if metadata:
            shutil.copy(self.path / METADATA_FILE, folder)
        return folder

    def flipped(self, folder, *bits):
        data = bytearray(self.data)
        for bit in bits:
            data[bit // 8] ^= 1 << bit % 8
        return self.copy(folder, bytes(data))

    def outside(self, hurt):
        """Return the messages of the undamaged chunks."""
        return [m for begin, end, inner in self.chunks if not hurt(begin, end) for m in inner]


def content(path):
    bag = open_bag(path)
    return bag.topics, bag.custom_data, list(bag.raw_messages())


def whole_bag(path):
    file = find_file(path)
    found = surveyed(path, file)
    chunks = []
    for span in found.chunks:
        records = [record for _, record in chunk_records(chunk_content(found.data, span))]
        names = {id: channel.topic for id, channel in found.summary.channels.items()}
        inner = [
            (names[record.channel_id], record.log_time, record.data)
            for record in records
            if isinstance(record, Message)
        ]
        chunks.append((span.begin, span.end, inner))
    return Whole(path, file.name, file.read_bytes(), content(path), chunks)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Write 251 messages in 13 chunks, every byte covered by a checksum."""
    return whole_bag(write_bag(tmp_path_factory.mktemp("made") / "flight", 200))


@pytest.fixture(scope="module")
def old(made, tmp_path_factory):
    """Make the same bag of an older version: no checksum covers the bytes between its chunks."""
    data = bytearray(made.data)
    end = surveyed(made.path, find_file(made.path)).spans[-1].end
    data[end - 4 : end] = bytes(4)
    return whole_bag(made.copy(tmp_path_factory.mktemp("old") / "flight", bytes(data)))


@pytest.fixture(scope="module")
def reference():
    return whole_bag(REFERENCE)


def check_reader(whole, bag):
    """Read a bag: all of its contents, or one line of error, which is returned."""
    line = ""
    try:
        assert content(bag) == whole.content
    except BagError as error:
        line = str(error)
    assert "\n" not in line
    return line


def check_repair(whole, bag, target, safe):
    """Repair a bag: intact messages are saved, none invented, the loss reported."""
    shutil.rmtree(target, ignore_errors=True)
    if not verify(bag).messages:
        with pytest.raises(BagError, match="no message can be saved"):
            repair(bag, target)
        assert not safe
        assert not target.exists()
        return None
    done = repair(bag, target)
    topics, custom_data, saved = content(target)
    rest = iter(whole.messages)
    assert all(message in rest for message in saved), "in order, and nothing else"
    assert set(safe) <= set(saved)
    assert done.saved == len(saved)
    assert done.lost in (None, len(whole.messages) - len(saved))
    for name, topic in topics.items():
        assert vars(topic) | {"count": 0} == vars(whole.content[0][name]) | {"count": 0}
    said = custom_data.pop("repaired" if done.lost == 0 else "incomplete")
    assert said.endswith(done.loss) or done.lost == 0
    # a bag that is cut early has not said its flight yet
    said = {name: text for name, text in whole.content[1].items() if name != "flight_id"}
    assert {name: text for name, text in custom_data.items() if name != "flight_id"} == said
    assert verify(target).findings == []
    return done


def check_flip(whole, folder, bit):
    """Flip one bit; return whether it was noticed."""
    bag = whole.flipped(folder / "bag", bit)
    line = check_reader(whole, bag)
    findings = verify(bag).findings
    assert not any("\n" in finding for finding in findings)
    if not findings:
        assert not line
        with pytest.raises(BagError, match="nothing to repair"):
            repair(bag, folder / "saved")
        return False
    safe = whole.outside(lambda begin, end: begin <= bit // 8 < end)
    done = check_repair(whole, bag, folder / "saved", safe)
    assert done is not None
    assert done.lost is not None
    assert (done.lost == 0) == (done.damaged_chunks == 0)
    return True


@pytest.mark.parametrize("seed", one_in(3, [1, 11, 12]))
def test_one_wrong_bit_anywhere(made, tmp_path, seed):
    places = random.Random(seed).sample(range(len(made.data) * 8), 10)
    assert all(check_flip(made, tmp_path, bit) for bit in places)


def test_a_message_index_that_looks_like_a_message_is_none(made, tmp_path):
    spans = surveyed(made.path, find_file(made.path)).spans
    indexes = [span for span in spans if span.opcode == Opcode.MESSAGE_INDEX]
    differs = Opcode.MESSAGE ^ Opcode.MESSAGE_INDEX
    for span in indexes[::8]:
        assert check_flip(made, tmp_path, 8 * span.begin + differs.bit_length() - 1)


def test_one_wrong_bit_in_a_bag_of_an_older_version(old, tmp_path):
    """Flip bits: each is noticed, or affects nothing that is read."""
    for bit in random.Random(2).sample(range(len(old.data) * 8), 10):
        check_flip(old, tmp_path, bit)


@pytest.mark.trial
def test_one_wrong_bit_in_the_reference_flight(reference, tmp_path):
    for bit in random.Random(8).sample(range(len(reference.data) * 8), 6):
        check_flip(reference, tmp_path, bit)


@pytest.mark.parametrize(
    ("metadata", "seed"), one_in(2, [(True, 4), (True, 41), (False, 3), (False, 31)])
)
def test_cut_anywhere(made, tmp_path, metadata, seed):
    found = surveyed(made.path, find_file(made.path))
    end_of_data = found.spans[-1].begin
    for size in random.Random(seed).sample(range(1, len(made.data)), 8):
        bag = made.copy(tmp_path / "bag", made.data[:size], metadata)
        assert "has no end" in check_reader(made, bag)
        assert verify(bag).findings
        safe = made.outside(lambda _, end, size=size: end > size)
        done = check_repair(made, bag, tmp_path / "saved", safe)
        if done is not None:
            assert done.saved == len(safe)
            # metadata.yaml tells how much there was, and so does its copy after the last chunk
            assert (done.lost is None) == (not metadata and size < end_of_data)
            assert (done.lost == 0) == (len(safe) == len(made.messages)) or done.lost is None


def test_a_cut_in_the_reference_flight(reference, tmp_path):
    for size in random.Random(5).sample(range(1, len(reference.data)), 5):
        bag = reference.copy(tmp_path / "bag", reference.data[:size])
        safe = reference.outside(lambda _, end, size=size: end > size)
        done = check_repair(reference, bag, tmp_path / "saved", safe)
        assert done is None or done.lost == len(reference.messages) - len(safe)


@pytest.mark.parametrize("seed", one_in(3, [6, 61, 62]))
def test_one_wrong_bit_in_metadata_yaml(made, tmp_path, seed):
    size = (made.path / METADATA_FILE).stat().st_size
    noticed = 0
    for bit in random.Random(seed).sample(range(size * 8), 10):
        bag = made.copy(tmp_path / "bag")
        text = bytearray((bag / METADATA_FILE).read_bytes())
        text[bit // 8] ^= 1 << bit % 8
        (bag / METADATA_FILE).write_bytes(text)
        line = check_reader(made, bag)
        if verify(bag).findings:
            noticed += 1
            done = check_repair(made, bag, tmp_path / "saved", made.messages)
            assert done is not None and done.lost == 0
        else:
            assert not line
    assert noticed > 8


@pytest.mark.parametrize("first", one_in(3, [0, 1, 2]))
def test_a_damaged_head_costs_no_message_but_its_checksum_does(made, tmp_path, first):
    begin, _, inner = made.chunks[3]
    checksum = begin + HEAD.size + CHUNK_HEAD.size - 4
    for place in range(begin + first, begin + HEAD.size + CHUNK_HEAD.size + 16, 3):
        bag = made.flipped(tmp_path / "bag", place * 8 + place % 8)
        lost = len(inner) if checksum <= place < checksum + 4 else 0
        done = check_repair(made, bag, tmp_path / "saved", [])
        assert done is not None and done.lost == lost, place


def test_damage_in_two_places(made, tmp_path):
    """Damage the index and a chunk's length: the chunks are searched for."""
    begin, _, inner = made.chunks[5]
    index_bit = (len(made.data) - 60) * 8
    for place in (begin, begin + 3, begin + HEAD.size + CHUNK_HEAD.size + 10):
        bag = made.flipped(tmp_path / "bag", place * 8 + 2, index_bit)
        safe = made.outside(lambda at, end, place=place: at <= place < end)
        done = check_repair(made, bag, tmp_path / "saved", safe)
        assert done is not None and done.lost in (0, len(inner))


@pytest.mark.parametrize("seed", one_in(3, [7, 71, 72]))
def test_kilobytes_of_noise(made, tmp_path, seed):
    chance = random.Random(seed)
    for _ in range(5):
        begin = chance.randrange(len(made.data))
        end = min(len(made.data), begin + chance.randrange(1, 3000))
        data = made.data[:begin] + chance.randbytes(end - begin) + made.data[end:]
        bag = made.copy(tmp_path / "bag", data)
        assert verify(bag).findings
        check_reader(made, bag)
        if begin > made.chunks[0][1]:
            safe = made.outside(lambda a, b, begin=begin, end=end: a < end and begin < b)
            assert check_repair(made, bag, tmp_path / "saved", safe) is not None


def test_a_repair_that_cannot_be_finished_leaves_nothing(made, tmp_path, monkeypatch):
    bag = made.flipped(tmp_path / "bag", made.chunks[0][1] * 8 - 80)

    def full(*_):
        raise BagError("no room")

    monkeypatch.setattr("ares_bags.writer.BagWriter.write", full)
    with pytest.raises(BagError, match="no room"):
        repair(bag, tmp_path / "saved")
    assert not (tmp_path / "saved").exists()


def run(capfd, *argv):
    status = main([str(word) for word in argv])
    out, err = capfd.readouterr()
    return status, out, own_words(err)


def test_on_the_command_line(made, tmp_path, capfd):
    """Damage the first chunk, which holds every description: the index has them too."""
    status, out, err = run(capfd, "bag", "verify", made.path)
    assert (status, err) == (0, "")
    assert "whole: every checksum, index and count is right" in out
    assert "no checksum covers" not in out
    assert "incomplete" not in out
    assert run(capfd, "bag", "info", made.path)[0] == 0

    begin, end, inner = made.chunks[0]
    bag = made.flipped(tmp_path / "bag", (begin + end) // 2 * 8)
    total, left = len(made.messages), len(made.messages) - len(inner)
    for verb in ("info", "verify"):
        status, out, err = run(capfd, "bag", verb, bag)
        assert (status, err) == (1, "")
        assert f"damaged: bytes {begin} to {end}: chunk 1 is damaged" in out
        assert f"{len(inner)} of {total} messages cannot be read" in out
        said = json.loads(run(capfd, "bag", verb, "--json", bag)[1])
        assert len(said["findings"]) == 1
    status, out, err = run(capfd, "bag", "repair", bag, "--into", tmp_path / "saved")
    assert (status, err) == (1, "")
    assert out.endswith(
        f"saved {left} messages in {tmp_path / 'saved'}; {len(inner)} of {total} messages are "
        "lost, 1 damaged chunks dropped whole\n"
    )
    status, out, _ = run(capfd, "bag", "info", tmp_path / "saved")
    assert status == 0
    assert f"{len(inner)} of {total} messages are lost" in out
    status, out, _ = run(capfd, "bag", "verify", tmp_path / "saved")
    assert status == 0
    assert "who wrote it says that it is incomplete: repaired: " in out
    said = json.loads(run(capfd, "bag", "verify", "--json", tmp_path / "saved")[1])
    assert said["whole"] and said["incomplete"].startswith("repaired: ")
    for argv in (("replay", bag), ("bag", "repair", bag, "--into", tmp_path / "saved")):
        status, out, err = run(capfd, *argv)
        assert (status, out) == (2, "")
        assert err.count("\n") == 1

    # a wrong index costs nothing
    bag = made.flipped(tmp_path / "bag", (len(made.data) - 60) * 8)
    assert run(capfd, "bag", "info", bag)[0] == 2
    assert run(capfd, "bag", "verify", bag)[0] == 1
    status, out, _ = run(capfd, "bag", "repair", bag)
    assert status == 0
    assert out.endswith(f"saved {total} messages in {bag}_repaired; no message is lost\n")
    assert open_bag(f"{bag}_repaired").custom_data.keys() == CUSTOM_DATA.keys() | {"repaired"}


def test_what_is_no_bag(tmp_path, capfd):
    (tmp_path / "text.mcap").write_text("no bag at all")
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "folder").mkdir()
    for name in ("text.mcap", "empty.mcap", "folder", "none"):
        for verb in ("info", "verify", "repair"):
            status, out, err = run(capfd, "bag", verb, tmp_path / name)
            assert (status, out, err.count("\n")) == (2, "", 1)
            assert name in err


@pytest.mark.parametrize(
    ("more", "messages_outside", "unproven"),
    [
        ({}, 0, 0),
        ({"compression": CompressionType.NONE}, 0, 0),
        ({"compression": CompressionType.NONE, "enable_crcs": False}, 0, 11),
        ({"index_types": IndexType.NONE}, 0, 0),
        ({"use_chunking": False}, 249, 0),
    ],
    ids=["zstd", "plain", "no_checksums", "no_index", "no_chunks"],
)
def test_bags_of_others(made, tmp_path, more, messages_outside, unproven):
    file = tmp_path / "other.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=4000, **more)
        writer.start("ros2", "another")
        channels = {}
        for name, topic in made.content[0].items():
            schema = writer.register_schema(topic.type_name, "ros2msg", topic.definition.encode())
            metadata = {"offered_qos_profiles": qos_text(topic.qos)}
            channels[name] = writer.register_channel(name, "cdr", schema, metadata)
        for name, time, data in made.messages:
            writer.add_message(channels[name], time, data, time)
        writer.finish()
    found = verify(file)
    assert (found.findings, found.messages) == ([], len(made.messages))
    assert found.unproven_chunks == unproven
    assert (found.chunks == 0) == bool(messages_outside)
    whole = file.read_bytes()
    for number, bit in enumerate(random.Random(9).sample(range(len(whole) * 8), 20)):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        file.write_bytes(data)
        if verify(file, decode=False).findings:
            done = repair(file, tmp_path / str(number))
            assert done.saved + done.lost == len(made.messages)
    # nothing tells how much the rest was
    file.write_bytes(whole[: len(whole) // 2])
    done = repair(file)
    assert 0 < done.saved < len(made.messages)
    assert done.lost is None


@pytest.mark.parametrize(
    "namespace", ["1bad", "a b", "a//b", "//a", "~x", "", "/", "a\nb", "{x}", "x" * 300]
)
def test_namespaces_that_are_none(capfd, namespace):
    status, out, err = run(capfd, "replay", "--namespace", namespace, REFERENCE)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "namespace" in err or "characters; expected at most" in err


@pytest.mark.parametrize("topic", ["1bad", "a b", "a//b", "~x", "", "/", "a\nb", "x" * 300])
def test_topics_that_are_none(capfd, topic):
    status, out, err = run(capfd, "replay", "--topic", topic, REFERENCE)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "has no single topic" in err
