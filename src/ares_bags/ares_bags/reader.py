"""Reading a bag: topics, decoded messages, columns of numbers. Needs no ROS."""

import errno
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Metadata, Schema
from mcap.summary import Summary
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray

from ares_bags.contents import topic_of
from ares_bags.decoded import numbers
from ares_bags.errors import BagError, cause
from ares_bags.layout import fixed_layout
from ares_bags.metadata import (
    METADATA_FILE,
    RECORD_NAME,
    custom_data_conflict,
    custom_data_of,
    information_of,
    read_metadata_file,
)
from ares_bags.schema import Topic
from ares_bags.survey import Span, begins_well, ends_well, map_file, parse, read_summary

#: Column with the log time in ns, int64.
LOG_TIME = "log_time_ns"


def find_file(path: Path | str) -> Path:
    """The MCAP file of a bag, given its folder, its `metadata.yaml` or the file itself.

    Raises:
        BagError: there is no such file, or the folder holds none or several.
    """
    path = Path(path)
    if path.name == METADATA_FILE:
        path = path.parent
    if path.is_file():
        return path
    if not path.is_dir():
        raise BagError(f"bag {path} does not exist")
    files = sorted(path.glob("*.mcap"))
    if len(files) != 1:
        count = len(files) or "no"
        raise BagError(f"{path} is not a bag: it holds {count} .mcap files; expected one")
    return files[0]


@dataclass(frozen=True)
class BagTopic(Topic):
    """A topic of a recorded bag; `count` is the number of its messages."""

    count: int = 0


class Bag:
    """A complete bag on disk.

    Attributes:
        path: as given.
        file: the MCAP file.
        topics: by full name, sorted.
        custom_data: texts by name (mission, law, seed, ...).
        message_count: messages of all topics.
        start_ns: first log time in ns; 0 without messages.
        end_ns: last log time in ns.
    """

    def __init__(self, path: Path | str) -> None:
        """Open; see `open_bag`."""
        self.path = Path(path)
        self.file = find_file(self.path)
        self._decoders = DecoderFactory()
        self._schemas: dict[str, Schema] = {}
        self.topics: dict[str, BagTopic] = {}
        self.custom_data: dict[str, str] = {}
        try:
            self._open()
        except BagError:
            raise
        except Exception as error:
            raise self._damaged(error) from error

    def _damaged(self, error: Exception) -> BagError:
        """What to raise for an error of the MCAP reader, which raises one of many."""
        # a wrong offset becomes a seek to where no file can be
        if isinstance(error, OSError) and error.errno != errno.EINVAL:
            return BagError(f"bag {self.path} cannot be read: {cause(error)}")
        return BagError(
            f"bag {self.path} is damaged ({cause(error)}); "
            "./ares bag repair saves what is left of it"
        )

    def _open(self) -> None:
        if not self.file.stat().st_size:
            raise BagError(f"bag {self.path} is empty: {self.file.name} has no bytes")
        data = map_file(self.file)
        if not begins_well(data):
            if not ends_well(data):
                raise BagError(f"{self.path} is not a bag: {self.file.name} is not an MCAP file")
            raise ValueError("its first bytes are wrong")
        if not ends_well(data):
            raise BagError(
                f"bag {self.path} has no end (its recorder was killed, or the file was cut); "
                "./ares bag repair saves its complete part"
            )
        found = read_summary(data)
        summary = found[0] if found else Summary()
        statistics = summary.statistics
        if statistics is None:
            raise BagError(f"bag {self.path} has no index; ./ares bag repair makes one")
        self.custom_data = _custom_data(data, summary, self.file.with_name(METADATA_FILE))
        self.message_count = statistics.message_count
        self.start_ns = statistics.message_start_time
        self.end_ns = statistics.message_end_time
        topics = []
        for channel in summary.channels.values():
            schema = summary.schemas.get(channel.schema_id)
            topic = topic_of(channel, schema)
            count = statistics.channel_message_counts.get(channel.id, 0)
            topics.append(BagTopic(**vars(topic), count=count))
            if schema is not None:
                self._schemas[topic.name] = schema
        self.topics = {topic.name: topic for topic in sorted(topics, key=lambda t: t.name)}

    def name_of(self, topic: str) -> str:
        """Full name of a topic, given that or the end of it (`nav_state`).

        Raises:
            BagError: no topic, or more than one, is called so.
        """
        if topic in self.topics:
            return topic
        found = [name for name in self.topics if name.endswith("/" + topic.lstrip("/"))]
        if len(found) != 1:
            known = ", ".join(self.topics) or "none"
            raise BagError(f"bag {self.path} has no single topic {topic!r}; expected of: {known}")
        return found[0]

    def raw_messages(self, topics: Iterable[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Messages as recorded: topic, log time in ns, CDR.

        Ordered by log time; messages of the same time keep the order in which they came.

        Args:
            topics: names, short or full; default all.

        Raises:
            BagError: unknown topic, or the file is damaged from here on.
        """
        names = None if topics is None else [self.name_of(topic) for topic in topics]
        return self._raw(names)

    def _raw(self, names: list[str] | None) -> Iterator[tuple[str, int, bytes]]:
        try:
            with self.file.open("rb") as stream:
                reader = SeekingReader(stream, validate_crcs=True)
                for _, channel, message in reader.iter_messages(names):
                    yield channel.topic, message.log_time, message.data
        except Exception as error:
            raise self._damaged(error) from error

    def decoder(self, topic: str) -> Callable[[bytes], Any]:
        """What turns the CDR of a topic into an object with the message's fields."""
        name = self.name_of(topic)
        try:
            decoder = self._decoders.decoder_for("cdr", self._schemas[name])
        except Exception as error:
            raise BagError(
                f"bag {self.path}: definition of {self.topics[name].type_name} cannot be parsed "
                f"({cause(error)})"
            ) from error
        assert decoder is not None  # topic_of() has checked the encodings
        return decoder

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """Decoded messages of one topic with their log time in ns, in order of time.

        Raises:
            BagError: unknown topic, or the file is damaged.
        """
        name = self.name_of(topic)
        decode = self.decoder(name)
        for _, log_time, data in self._raw([name]):
            try:
                message = decode(data)
            except Exception as error:
                raise self._damaged(error) from error
            yield log_time, message

    def columns(self, topic: str) -> dict[str, NDArray[Any]]:
        """The numbers of a topic as arrays, one row per message, in order of time.

        Args:
            topic: name, short or full.

        Returns:
            By field name (nested: `outer.inner`): shape (n,), or (n, m) for an array field of
            m numbers. A stamp is one int64 column in ns. Texts and arrays that change their
            length are left out. `log_time_ns` is always there; without messages only that.

        Raises:
            BagError: unknown topic, or the file is damaged.
        """
        name = self.name_of(topic)
        layout = fixed_layout(self.topics[name].type_name, self.topics[name].definition)
        if layout is not None:
            raw = [(log_time, data) for _, log_time, data in self._raw([name])]
            read = layout.columns([data for _, data in raw])
            if read is not None:
                return {LOG_TIME: np.array([time for time, _ in raw], dtype=np.int64)} | read
        times: list[int] = []
        rows: list[dict[str, Any]] = []
        for log_time, message in self.messages(name):
            times.append(log_time)
            rows.append(dict(numbers(message)))
        columns = {LOG_TIME: np.array(times, dtype=np.int64)}
        for key in rows[0] if rows else ():
            values = [row.get(key) for row in rows]
            lengths = {np.shape(value) for value in values if value is not None}
            if len(lengths) == 1 and all(value is not None for value in values):
                columns[key] = np.array(values)
        return columns


def _custom_data(data: memoryview, summary: Summary, metadata_file: Path) -> dict[str, str]:
    """The custom data of a bag. No checksum covers them, but there are up to three copies.

    Raises:
        ValueError: the copies contradict each other, or one cannot be read.
    """
    copies = []
    for index in summary.metadata_indexes:
        span = Span(index.offset, index.offset + index.length, Opcode.METADATA)
        record = parse(data, span)
        if index.name == RECORD_NAME and isinstance(record, Metadata):
            copies.append(("the file", custom_data_of(information_of(record.metadata))))
    if metadata_file.is_file():
        copies.append((METADATA_FILE, custom_data_of(read_metadata_file(metadata_file))))
    conflict = custom_data_conflict(copies)
    if conflict:
        raise ValueError(conflict)
    return next((custom for _, custom in reversed(copies) if custom), {})


def open_bag(path: Path | str) -> Bag:
    """Open a complete bag.

    Args:
        path: the bag's folder, its MCAP file or its `metadata.yaml` (which may be missing).

    Raises:
        BagError: it does not exist, is not a bag, is empty, cut or damaged.
    """
    return Bag(path)
