# SPDX-License-Identifier: Apache-2.0
"""Read a bag: topics, decoded messages, columns of numbers. Needs no ROS."""

import errno
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from heapq import merge
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Metadata, Schema, Statistics
from mcap.summary import Summary
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray

from ares_bags.contents import topic_of
from ares_bags.decoded import numbers, quiet
from ares_bags.errors import BagError, cause
from ares_bags.files import PACKED, find_files
from ares_bags.layout import WALL_CLOCK_NS, begins_with_stamp, fixed_layout, stamp_of_cdr
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

#: Package prefix of this project's types.
OURS = "ares_msgs/"
#: Column with the log time in ns, int64.
LOG_TIME = "log_time_ns"


@dataclass(frozen=True)
class BagTopic(Topic):
    """Hold a topic of a recorded bag; `count` is the number of its messages."""

    count: int = 0


@dataclass(frozen=True)
class _Part:
    """Hold one file of a bag.

    Attributes:
        path: of the file.
        data: its bytes.
        summary: summary section at its end.
        statistics: its statistics record.
    """

    path: Path
    data: memoryview
    summary: Summary
    statistics: Statistics

    def messages(
        self, names: list[str], start_ns: int, end_ns: int | None
    ) -> Iterator[tuple[str, int, bytes]]:
        """Yield messages of this file; see `Bag.raw_messages`."""
        packed = self.path.suffix == PACKED
        with BytesIO(self.data) if packed else self.path.open("rb") as stream:
            reader = SeekingReader(stream, validate_crcs=True)
            for _, channel, message in reader.iter_messages(
                names, starting_at=start_ns, ending_before=None if end_ns is None else end_ns + 1
            ):
                yield channel.topic, message.log_time, message.data


class Bag:
    """Read a complete bag on disk.

    Attributes:
        path: as given.
        files: its MCAP files in order; a bag of ours has one.
        topics: by full name, sorted.
        left_out: reason by name for each topic that is not of ROS 2 or has no ros2msg definition.
        custom_data: texts by name (mission, law, seed, ...).
        message_count: messages of all topics.
        start_ns: first log time in ns; 0 without messages.
        end_ns: last log time in ns.
        timed_by_stamps: the log times are wall-clock times, as `ros2 bag record` writes them;
            each message is then given the time of its stamp, or of the last stamp before it.
    """

    def __init__(self, path: Path | str) -> None:
        """Open the bag; see `open_bag`."""
        self.path = Path(path)
        self.files = find_files(self.path)
        self._decoders = DecoderFactory()
        self._schemas: dict[str, Schema] = {}
        self.topics: dict[str, BagTopic] = {}
        self.left_out: dict[str, str] = {}
        self.custom_data: dict[str, str] = {}
        self._retimed: list[tuple[str, int, bytes]] = []
        try:
            self._open()
        except BagError:
            raise
        except Exception as error:
            raise self._damaged(error) from error

    @property
    def file(self) -> Path:
        """Return the first MCAP file."""
        return self.files[0]

    def _damaged(self, error: Exception) -> BagError:
        """Convert an error of the MCAP reader, of whatever type, into a BagError."""
        # a wrong offset leads to a seek to an impossible position, which is EINVAL
        if isinstance(error, OSError) and error.errno != errno.EINVAL:
            return BagError(f"bag {self.path} cannot be read: {cause(error)}")
        return BagError(
            f"bag {self.path} is damaged ({cause(error)}); "
            "./ares bag repair saves what is left of it"
        )

    def _open(self) -> None:
        self._parts = [self._open_part(file) for file in self.files]
        self.custom_data = _custom_data(self._parts, self.file.with_name(METADATA_FILE))
        counts = [part.statistics for part in self._parts]
        self.message_count = sum(count.message_count for count in counts)
        filled = [count for count in counts if count.message_count] or counts[:1]
        self.start_ns = min(count.message_start_time for count in filled)
        self.end_ns = max(count.message_end_time for count in filled)
        topics: dict[str, BagTopic] = {}
        for part in self._parts:
            for channel in part.summary.channels.values():
                self._add_topic(topics, part, channel)
        if self.left_out and not topics:
            raise BagError(f"{self.path}: {next(iter(self.left_out.values()))}")
        self.topics = dict(sorted(topics.items()))
        self.timed_by_stamps = self.start_ns >= WALL_CLOCK_NS
        if self.timed_by_stamps:
            self._retime()

    def _open_part(self, file: Path) -> _Part:
        if not file.stat().st_size:
            raise BagError(f"bag {self.path} is empty: {file.name} has no bytes")
        data = map_file(file)
        if not begins_well(data):
            if not ends_well(data):
                raise BagError(f"{self.path} is not a bag: {file.name} is not an MCAP file")
            raise ValueError("its first bytes are wrong")
        if not ends_well(data):
            raise BagError(
                f"bag {self.path} has no end (its recorder was killed, or the file was cut); "
                "./ares bag repair saves its complete part"
            )
        found = read_summary(data)
        summary = found[0] if found else Summary()
        if summary.statistics is None:
            raise BagError(f"bag {self.path} has no index; ./ares bag repair makes one")
        return _Part(file, data, summary, summary.statistics)

    def _add_topic(self, topics: dict[str, BagTopic], part: _Part, channel: Channel) -> None:
        schema = part.summary.schemas.get(channel.schema_id)
        try:
            topic = topic_of(channel, schema)
        except BagError as error:
            self.left_out[channel.topic] = str(error)
            return
        count = part.statistics.channel_message_counts.get(channel.id, 0)
        before = topics.get(topic.name)
        if before is not None and before.type_name != topic.type_name:
            raise BagError(
                f"bag {self.path}: topic {topic.name} is of two types, {before.type_name} and "
                f"{topic.type_name}"
            )
        topics[topic.name] = BagTopic(**vars(topic), count=count + (before.count if before else 0))
        if schema is not None:
            self._schemas[topic.name] = schema

    def _retime(self) -> None:
        """Replace wall-clock log times with flight times."""
        stamped = {
            name for name, topic in self.topics.items() if begins_with_stamp(topic.definition)
        }
        now: int | None = None
        early: list[tuple[str, bytes]] = []
        for topic, _, data in self._recorded(list(self.topics), 0, None):
            stamp = stamp_of_cdr(data) if topic in stamped else -1
            if 0 <= stamp < WALL_CLOCK_NS:
                now = stamp if now is None else max(now, stamp)
            elif now is None:
                early.append((topic, data))
                continue
            else:
                stamp = now
            self._retimed.append((topic, stamp, data))
        if now is None:
            # no message carries a flight time
            self.timed_by_stamps = False
            return
        begin = min(time for _, time, _ in self._retimed)
        self._retimed = [(topic, begin, data) for topic, data in early] + self._retimed
        self._retimed.sort(key=lambda entry: entry[1])
        self.start_ns, self.end_ns = self._retimed[0][1], self._retimed[-1][1]

    def holds(self, topic: str) -> bool:
        """Tell whether a topic has this full name, or a name that ends in it (`nav_state`)."""
        return any(name.endswith("/" + topic.lstrip("/")) for name in self.topics)

    def name_of(self, topic: str) -> str:
        """Return the full name of a topic, given that or its end (`nav_state`).

        Of several matches, the only one with a type of `ares_msgs` is taken.

        Raises:
            BagError: no topic, or more than one, matches.
        """
        if topic in self.topics:
            return topic
        found = [name for name in self.topics if name.endswith("/" + topic.lstrip("/"))]
        ours = [name for name in found if self.topics[name].type_name.startswith(OURS)]
        if len(ours) == 1:
            return ours[0]
        if len(found) != 1:
            known = ", ".join(self.topics) or "none"
            raise BagError(f"bag {self.path} has no single topic {topic!r}; expected of: {known}")
        return found[0]

    def raw_messages(
        self, topics: Iterable[str] | None = None, start_ns: int = 0, end_ns: int | None = None
    ) -> Iterator[tuple[str, int, bytes]]:
        """Yield messages as recorded: topic, log time in ns, CDR.

        Ordered by log time; messages of equal time keep their recorded order.

        Args:
            topics: names, full or their ends; default: all.
            start_ns: first log time, ns.
            end_ns: last log time, ns, inclusive; default: the end.

        Raises:
            BagError: unknown topic, or the file is damaged from here on.
        """
        names = list(self.topics) if topics is None else [self.name_of(topic) for topic in topics]
        return self._raw(names, start_ns, end_ns)

    def _raw(
        self, names: list[str], start_ns: int = 0, end_ns: int | None = None
    ) -> Iterator[tuple[str, int, bytes]]:
        if not self.timed_by_stamps:
            yield from self._recorded(names, start_ns, end_ns)
            return
        wanted = set(names)
        for topic, time, data in self._retimed:
            if topic in wanted and time >= start_ns and (end_ns is None or time <= end_ns):
                yield topic, time, data

    def _recorded(
        self, names: list[str], start_ns: int, end_ns: int | None
    ) -> Iterator[tuple[str, int, bytes]]:
        try:
            parts = [part.messages(names, start_ns, end_ns) for part in self._parts]
            yield from parts[0] if len(parts) == 1 else merge(*parts, key=lambda entry: entry[1])
        except Exception as error:
            raise self._damaged(error) from error

    def decoder(self, topic: str) -> Callable[[bytes], Any]:
        """Return the decoder of a topic: from CDR to an object with the message's fields."""
        name = self.name_of(topic)
        try:
            with quiet():
                decoder = self._decoders.decoder_for("cdr", self._schemas[name])
        except Exception as error:
            raise BagError(
                f"bag {self.path}: definition of {self.topics[name].type_name} cannot be parsed "
                f"({cause(error)})"
            ) from error
        assert decoder is not None  # topic_of() has checked the encodings
        return decoder

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """Yield log time in ns and decoded message of one topic, in order of time.

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
        """Return the numbers of a topic as arrays, one row per message, in order of time.

        Args:
            topic: name, full or its end.

        Returns:
            By field name (nested: `outer.inner`): shape (n,), or (n, m) for an array field of
            m numbers. A stamp is one int64 column in ns. Texts and arrays of varying length are
            left out. `log_time_ns` is always present; without messages it is the only column.

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


def _custom_data(parts: Sequence[_Part], metadata_file: Path) -> dict[str, str]:
    """Return the custom data of a bag from its copies, which no checksum covers.

    Raises:
        ValueError: copies contradict each other, or one cannot be read.
    """
    copies = []
    for part in parts:
        for index in part.summary.metadata_indexes:
            span = Span(index.offset, index.offset + index.length, Opcode.METADATA)
            record = parse(part.data, span)
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
