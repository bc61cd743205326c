# SPDX-License-Identifier: Apache-2.0
"""Bags: cut, flipped, overwritten; and bags with correct checksums over hostile contents."""

import contextlib
import io
import shutil
import tempfile
import zlib
from pathlib import Path
from random import Random
from typing import Any

from mcap.writer import CompressionType, Writer
from rclpy.serialization import deserialize_message

from ares_bags.errors import BagError
from ares_bags.files import find_file
from ares_bags.metadata import METADATA_FILE, RECORD_NAME, record_data
from ares_bags.reader import Bag, open_bag
from ares_bags.repair import repair
from ares_bags.replay import Extract
from ares_bags.schema import qos_text
from ares_bags.types import message_class
from ares_bags.verify import verify
from ares_bags.writer import BagWriter
from ares_bringup.commands.cli import main
from hostile.messages import hostile
from hostile.mutate import WHOLE, changed, text, yaml_text
from hostile.target import Target, check, one_line

#: What ends the first part of an input: the MCAP file; the rest is metadata.yaml.
_END = b"\n=== metadata.yaml\n"
#: Ends an input that is a whole bag of odd messages.
_ODD = b"# odd messages\n"


class _Bag(Target):
    """Write a new bag for each input."""

    def __init__(self) -> None:
        self._folder = Path()

    def begin(self) -> None:
        self.end()
        self._folder = Path(tempfile.mkdtemp(prefix="ares-fuzz-"))
        self.bag = self._folder / "flight"

    def end(self) -> None:
        if self._folder.name:
            shutil.rmtree(self._folder, ignore_errors=True)

    def write(self, data: bytes) -> None:
        """Lay the bag of an input down."""
        content, mark, metadata = data.partition(_END)
        self.bag.mkdir(exist_ok=True)
        (self.bag / "flight_0.mcap").write_bytes(content)
        if mark:
            (self.bag / METADATA_FILE).write_bytes(metadata)
        else:
            (self.bag / METADATA_FILE).unlink(missing_ok=True)


def _content(bag: Bag) -> list[tuple[str, int, bytes]]:
    return list(bag.raw_messages())


def _read_all(bag: Bag) -> None:
    """Read a bag as plots, reports and exports do."""
    for topic in bag.topics:
        with contextlib.suppress(BagError):
            bag.columns(topic)
        with contextlib.suppress(BagError):
            for _ in bag.messages(topic):
                pass


def _examined(path: Path, folder: Path) -> tuple[str, list[Any] | None, list[str] | None]:
    """Open, verify and repair a bag; every refusal is one line.

    Returns:
        What came of it, what can be read, and the findings; None where refused.
    """
    content = findings = None
    try:
        bag = open_bag(path)
        _read_all(bag)
        content = _content(bag)
    except BagError as error:
        one_line(str(error))
    try:
        Extract().check(open_bag(path))
    except BagError as error:
        one_line(str(error))
    try:
        found = verify(path)
        findings = found.findings
        for finding in findings:
            one_line(finding)
    except BagError as error:
        one_line(str(error))
    saved = folder / "saved"
    shutil.rmtree(saved, ignore_errors=True)
    try:
        done = repair(path, saved)
    except BagError as error:
        one_line(str(error))
        check(not saved.exists(), "a repair that was refused has left a bag")
    else:
        one_line(done.problem)
        # what was recorded wrong is saved as it is
        found = verify(saved, decode=False)
        check(found.findings == [], f"the repaired bag is damaged: {found.findings}")
        check(found.messages == done.saved, "the repair has counted other messages")
    return ("whole" if findings == [] else "damaged"), content, findings


class DamagedBags(_Bag):
    """Damage a recorder's bag: it must not pass as whole, and nothing may be invented."""

    name = "damaged bags"
    share = 1.0

    def begin(self) -> None:
        from ares_trials.testing.bags import write_bag

        super().begin()
        original = write_bag(self._folder / "original" / "flight", 24, 8)
        self._good = find_file(original).read_bytes()
        self._metadata = (original / METADATA_FILE).read_bytes()
        self._content = _content(open_bag(original))

    def make(self, random: Random) -> bytes:
        content, metadata = self._good, self._metadata
        kind = random.random()
        if kind < 0.7:
            content = changed(content, random)
        elif kind < 0.8:
            content = content[: random.randint(0, len(content))]
        elif kind < 0.9:
            metadata = yaml_text(metadata.decode(), random)
        else:
            content, metadata = changed(content, random), changed(metadata, random)
        return content + (_END + metadata if random.random() < 0.8 else b"")

    def run(self, data: bytes) -> str:
        self.write(data)
        word, content, findings = _examined(self.bag, self._folder)
        same = data == self._good + _END + self._metadata
        if content is not None and findings == []:
            check(content == self._content, "a bag that was changed passes for whole")
        if findings == [] and not data.startswith(self._good):
            check(content == self._content, "a file that was cut or changed passes for whole")
        check(not same or findings == [], "a whole bag is called damaged")
        return word


class ForgedBags(_Bag):
    """Write bags that are valid MCAP with hostile contents."""

    name = "forged bags"
    share = 0.5

    def begin(self) -> None:
        from ares_trials.testing.bags import messages, topics

        super().begin()
        self._topics = topics()
        self._messages = messages(12)

    def make(self, random: Random) -> bytes:
        stream = io.BytesIO()
        writer = Writer(
            stream,
            compression=random.choice(list(CompressionType)[:3]),
            chunk_size=random.choice((200, 2000, 100_000)),
            use_chunking=random.random() < 0.9,
            use_statistics=random.random() < 0.9,
            use_summary_offsets=random.random() < 0.9,
        )
        writer.start(profile=_odd("ros2", random), library=_odd("libmcap", random))
        channels = {}
        for topic in self._topics:
            schema = writer.register_schema(
                name=_odd(topic.type_name, random),
                encoding=_odd("ros2msg", random),
                data=_definition(topic.definition, random),
            )
            told = {"offered_qos_profiles": _qos(qos_text(topic.qos), random)}
            told["topic_type_hash"] = _odd(topic.type_hash, random)
            channels[topic.name] = writer.register_channel(
                topic=_odd(topic.name, random),
                message_encoding=_odd("cdr", random),
                schema_id=random.choice((schema, schema, schema, schema, 0, 9)),
                metadata=told if random.random() < 0.9 else {},
            )
        for name, time_ns, data in self._messages:
            late = random.choice(WHOLE) if random.random() < 0.05 else time_ns
            writer.add_message(
                channels[name],
                log_time=max(late, 0),
                data=changed(data, random) if random.random() < 0.2 else data,
                publish_time=time_ns,
            )
        if random.random() < 0.8:
            information = {"custom_data": {_odd("mission", random): _odd("ares_v", random)}}
            record = record_data(information)
            if random.random() < 0.5:
                key, words = next(iter(record.items()))
                record = {_odd(key, random): yaml_text(words, random).decode("utf-8", "replace")}
            writer.add_metadata(_odd(RECORD_NAME, random), record)
        writer.finish()
        return stream.getvalue()

    def run(self, data: bytes) -> str:
        self.write(data)
        return _examined(self.bag, self._folder)[0]


def _odd(good: str, random: Random) -> str:
    if random.random() < 0.93:
        return good
    return text(random).encode("utf-8", "replace").decode()


def _definition(good: str, random: Random) -> bytes:
    return changed(good.encode(), random) if random.random() < 0.15 else good.encode()


def _qos(good: str, random: Random) -> str:
    if random.random() < 0.9:
        return good
    return yaml_text(good, random).decode("utf-8", "replace")


class BagCommands(_Bag):
    """Run `ares` verbs on a bag of a flight that is damaged or holds odd messages."""

    name = "commands on bags"
    share = 0.05

    def __init__(self, reference: Path) -> None:
        """Set the bag of a flight.

        Args:
            reference: a small bag.
        """
        super().__init__()
        self._reference = reference

    def begin(self) -> None:
        super().begin()
        self._good = find_file(self._reference).read_bytes()
        self._metadata = (find_file(self._reference).with_name(METADATA_FILE)).read_bytes()
        flight = open_bag(self._reference)
        self._topics = list(flight.topics.values())
        self._messages = list(flight.raw_messages())

    def make(self, random: Random) -> bytes:
        content = self._good
        if random.random() < 0.3:
            return self._recorded(random)
        if random.random() < 0.5:
            content = changed(content, random)
        else:
            content = content[: random.randint(0, len(content))]
        return content + _END + self._metadata

    def _recorded(self, random: Random) -> bytes:
        """Write a whole bag with some messages that no flight has."""
        # named as it will be, which its metadata tell
        made = self._folder / "made" / "flight"
        shutil.rmtree(made, ignore_errors=True)
        made.parent.mkdir(exist_ok=True)
        of = {topic.name: topic for topic in self._topics}
        odd = random.choice((0.002, 0.05, 0.5))
        chosen = random.choice((None, *of))
        with BagWriter(made, {"mission": "ares_v", "law": "peg"}) as writer:
            for topic in self._topics:
                writer.add_topic(topic)
            for name, time_ns, data in self._messages:
                content = data
                if chosen in (None, name) and random.random() < odd:
                    kind = message_class(of[name].type_name)
                    content = hostile(deserialize_message(data, kind), random, ("flight_id",))
                writer.write(name, time_ns, content)
        return find_file(made).read_bytes() + _END + (made / METADATA_FILE).read_bytes() + _ODD

    def run(self, data: bytes) -> str:
        self.write(data)
        out = str(self._folder / "out")
        words = (
            ("bag", "info", str(self.bag)),
            ("bag", "verify", str(self.bag), "--json"),
            ("export", str(self.bag), "--format", "csv", "--out", out),
            ("export", str(self.bag), "--format", "czml", "--out", out),
            ("report", str(self.bag), "--out", out),
        )
        number = zlib.crc32(data) % len(words)
        status, said = commanded(*words[number])
        check(status in (0, 1, 2), f"exit status {status}")
        if words[number][:2] == ("bag", "verify"):
            whole = data.endswith(_ODD) or data == self._good + _END + self._metadata
            check((status == 0) == whole, f"verify ends with {status}: {said}")
        return f"{words[number][0]} {status}"


def commanded(*argv: str) -> tuple[int, str]:
    """Run a command; return its exit status and standard error."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(list(argv))
    said = err.getvalue()
    check("Traceback" not in said + out.getvalue(), f"a traceback: {said[-300:]!r}")
    if status == 2:
        lists = argv[0] in ("missions", "dispersions")
        check(lists or not out.getvalue(), f"a refusal with output: {out.getvalue()[:200]!r}")
        # a line for each file that it was given
        for line in said.removesuffix("\n").split("\n") if lists else [said.removesuffix("\n")]:
            one_line(line)
    return status, said
