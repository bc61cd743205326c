# SPDX-License-Identifier: Apache-2.0
"""Verify a bag: check every checksum, index, count and message against the others."""

import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap import records as mcap
from mcap.opcode import Opcode
from mcap.summary import Summary
from mcap_ros2.decoder import DecoderFactory

from ares_bags.chunks import LIBRARY
from ares_bags.contents import Contents
from ares_bags.decoded import quiet
from ares_bags.errors import BagError, cause, printable
from ares_bags.files import find_files
from ares_bags.metadata import (
    METADATA_FILE,
    NO_TIME_NS,
    RECORD_NAME,
    bag_information,
    custom_data_conflict,
    custom_data_of,
    information_of,
    read_metadata_file,
    recorded_counts,
)
from ares_bags.survey import (
    CHUNK_HEAD,
    HEAD,
    UNREADABLE,
    Span,
    Survey,
    begins_well,
    chunk_content,
    chunk_records,
    map_file,
    packing,
    parse,
    survey,
)


@dataclass
class BagVerification:
    """Hold the result of a verification.

    Attributes:
        file: the MCAP file.
        findings: faults, one line each; empty if there are none.
        messages: messages of described topics in readable chunks.
        expected: messages that were recorded; None if unknown.
        chunks: chunks, readable or not.
        damaged_chunks: chunks whose contents are not as written.
        unproven_chunks: chunks without a checksum; a wrong bit in a message goes unnoticed.
        decoded: whether each message was decoded too.
        data_checksum: whether a checksum covers every byte before the index.
    """

    file: Path
    findings: list[str] = field(default_factory=list)
    messages: int = 0
    expected: int | None = None
    chunks: int = 0
    damaged_chunks: int = 0
    unproven_chunks: int = 0
    decoded: bool = True
    data_checksum: bool = False

    @property
    def lost(self) -> int | None:
        """Return the messages that were recorded and cannot be read; None if unknown."""
        return None if self.expected is None else max(self.expected - self.messages, 0)


def surveyed(path: Path, file: Path) -> Survey:
    """Locate the records of an MCAP file of a bag.

    Raises:
        BagError: it cannot be read, is empty or is not a bag.
    """
    try:
        if not file.stat().st_size:
            raise BagError(f"bag {path} is empty: {file.name} has no bytes")
        found = survey(map_file(file))
    except OSError as error:
        raise BagError(f"bag {path} cannot be read: {cause(error)}") from error
    if found is None:
        raise BagError(f"{path} is not a bag: {file.name} is not an MCAP file")
    return found


def verify(path: Path | str, *, decode: bool = True) -> BagVerification:
    """Read everything in a bag and check it for consistency.

    Args:
        path: the bag's folder, its MCAP file or its `metadata.yaml`.
        decode: decode each message too; otherwise only checksums, indexes and counts.

    Raises:
        BagError: it is not a bag, or not one of ROS 2.
    """
    path = Path(path)
    files = find_files(path)
    if len(files) == 1:
        return Examination(path, files[0], decode).result
    return _together(path, [Examination(path, file, decode, alone=False) for file in files])


def _together(path: Path, parts: Sequence["Examination"]) -> BagVerification:
    """Merge the results of a bag's files."""
    results = [part.result for part in parts]
    whole = BagVerification(path if path.is_dir() else path.parent, decoded=results[0].decoded)
    for result in results:
        whole.findings += [f"{result.file.name}: {finding}" for finding in result.findings]
        whole.messages += result.messages
        whole.chunks += result.chunks
        whole.damaged_chunks += result.damaged_chunks
        whole.unproven_chunks += result.unproven_chunks
    whole.data_checksum = all(result.data_checksum for result in results)
    counts = [result.expected for result in results if result.expected is not None]
    whole.expected = sum(counts) if len(counts) == len(results) else None
    metadata_file = results[0].file.with_name(METADATA_FILE)
    try:
        information = read_metadata_file(metadata_file)
    except FileNotFoundError:
        whole.findings.append(f"{METADATA_FILE} is missing")
    except (OSError, ValueError) as error:
        whole.findings.append(f"{METADATA_FILE} cannot be read: {cause(error)}")
    else:
        copies = [copy for part in parts for copy in part.copies]
        copies.append((METADATA_FILE, information))
        conflict = custom_data_conflict([(where, custom_data_of(copy)) for where, copy in copies])
        found = sum((Counter(part.message_counts) for part in parts), Counter[str]())
        told = recorded_counts([information])
        if conflict:
            whole.findings.append(printable(conflict))
        if told is not None and all(part.whole for part in parts) and Counter(told) != found:
            whole.findings.append(f"{METADATA_FILE} counts other messages than there are")
    return whole


class Examination:
    """Examine one file of a bag.

    Attributes:
        survey: records located in the file.
        result: the findings.
        contents: schemas and channels of the index and of all readable chunks.
        copies: location and content of each copy of the bag's metadata, in order of recording.
        whole: whether every record and every chunk could be read.
    """

    def __init__(self, path: Path, file: Path, decode: bool, alone: bool = True) -> None:
        """Read a file of a bag; see `verify`.

        Args:
            path: the bag.
            file: one of its files.
            decode: see `verify`.
            alone: it is the only file, so the metadata count its messages.
        """
        self.survey = surveyed(path, file)
        self.data = self.survey.data
        self.result = BagVerification(file, decoded=decode)
        self.contents = Contents()
        self.copies: list[tuple[str, dict[str, Any]]] = []
        self.whole = True
        self._decoders = DecoderFactory()
        self._undecoded: Counter[str] = Counter()
        self._counts: Counter[int] = Counter()
        self._first, self._last = NO_TIME_NS, 0
        self._indexes: list[mcap.ChunkIndex] = []
        self._metadata: list[mcap.MetadataIndex] = []
        self._attachments = 0
        self._ours = False
        self._records()
        metadata_file = file.with_name(METADATA_FILE)
        if alone:
            self._all_metadata(metadata_file if metadata_file.is_file() or path.is_dir() else None)

    @property
    def message_counts(self) -> dict[str, int]:
        """Return the readable messages by topic."""
        return self._by_topic(self._counts)

    @property
    def savable_counts(self) -> dict[str, int]:
        """Return the readable messages of ROS 2 topics by topic."""
        return self._by_topic([channel for channel in self._counts if self._of_ros(channel)])

    def _by_topic(self, channels: Iterable[int]) -> dict[str, int]:
        counts: Counter[str] = Counter()
        for channel in channels:
            counts[self.contents.channels[channel].topic] += self._counts[channel]
        return dict(counts)

    def _of_ros(self, channel: int) -> bool:
        try:
            self.contents.topic(channel)
        except BagError:
            return False
        return True

    def _say(self, finding: str) -> None:
        self.result.findings.append(printable(finding))

    def _records(self) -> None:
        """Examine every record in the MCAP file."""
        found = self.survey
        if not begins_well(self.data):
            self._say("the first bytes are not those of an MCAP file")
        if found.problem:
            self._say(f"the file {found.problem}")
        if found.summary:
            self.contents.schemas |= found.summary.schemas
            self.contents.channels |= found.summary.channels
            self._check_topics(list(found.summary.channels))
        else:
            self._describe()
        header = self._record(found.spans[0]) if found.spans else None
        if isinstance(header, mcap.Header):
            self._ours = header.library.startswith(LIBRARY)
        else:
            self._say("the file has no header")
        for number, span in enumerate(found.spans):
            self._span(number, span)
        for topic, count in self._undecoded.items():
            self._say(f"{topic}: {count} messages cannot be decoded")
        self.result.chunks = len(found.chunks)
        self.result.messages = self._counts.total()
        if found.summary and found.spans:
            self._summary(found.summary)
            self._data_end(found.spans[-1])

    def _describe(self) -> None:
        """Collect the schemas and channels of all readable chunks, since any may be damaged."""
        for span in self.survey.spans:
            described: list[mcap.McapRecord | None] = []
            with suppress(*UNREADABLE):
                if span.opcode == Opcode.CHUNK:
                    content = chunk_content(self.data, span)
                    described += [record for _, record in chunk_records(content)]
                elif span.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    described.append(parse(self.data, span))
            for record in described:
                if record is not None and not self.contents.contradicts(record):
                    self.contents.note(record)

    def _check_topics(self, channels: Sequence[int]) -> None:
        """Raise if there is no ROS 2 topic; beside one, other topics are only counted."""
        refused: list[BagError] = []
        for channel in channels:
            try:
                self.contents.topic(channel)
            except BagError as error:
                refused.append(error)
        if refused and len(refused) == len(channels):
            raise refused[0]

    def _record(self, span: Span) -> mcap.McapRecord | None:
        """Return the record of a span, None if it cannot be read."""
        if span.opcode is None or self.data[span.begin] != span.opcode:
            return None
        try:
            return parse(self.data, span)
        except UNREADABLE:
            return None

    def _span(self, number: int, span: Span) -> None:
        """Examine one record before the summary, or a gap."""
        where = f"bytes {span.begin} to {span.end}"
        if span.opcode is None:
            self.whole = False
            self._say(f"{where}: no record can be made out")
        elif span.opcode == Opcode.CHUNK:
            try:
                content = chunk_content(self.data, span)
                records = list(chunk_records(content))
            except UNREADABLE as error:
                self.whole = False
                self.result.damaged_chunks += 1
                self._say(f"{where}: chunk {len(self._indexes) + 1} is damaged ({cause(error)})")
                self._indexes.append(mcap.ChunkIndex(0, span.begin, "", 0, 0, 0, {}, 0, 0))
            else:
                self._chunk(span, len(content), records, self._message_indexes(number + 1))
        elif span.opcode == Opcode.ATTACHMENT:
            self._attachments += 1
            body = self.data[span.begin + HEAD.size : span.end]
            if int.from_bytes(body[-4:], "little") not in (0, zlib.crc32(body[:-4])):
                self._say(f"{where}: checksum of an attachment is wrong")
        elif span.opcode in (Opcode.METADATA, Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL):
            self._loose(self._record(span), span, where)

    def _loose(self, record: mcap.McapRecord | None, span: Span, where: str) -> None:
        """Examine a record outside of the chunks."""
        if isinstance(record, mcap.Metadata):
            self._metadata.append(
                mcap.MetadataIndex(span.begin, span.end - span.begin, record.name)
            )
            if record.name == RECORD_NAME:
                try:
                    self.copies.append(("the file", information_of(record.metadata)))
                except ValueError as error:
                    self._say(f"{where}: metadata: {error}")
        elif record is None:
            self._say(f"{where}: a record cannot be read")
        else:
            self._note(record)

    def _note(self, record: mcap.McapRecord) -> None:
        """Count a message; check that a schema or channel does not contradict an earlier one."""
        if isinstance(record, mcap.Message):
            channel = self.contents.channels.get(record.channel_id)
            if channel is None:
                self._undecoded[f"channel {record.channel_id}, which is not described"] += 1
                return
            self._counts[record.channel_id] += 1
            self._first = min(self._first, record.log_time)
            self._last = max(self._last, record.log_time)
            if self.result.decoded and not self._decodes(record):
                self._undecoded[channel.topic] += 1
        elif self.contents.contradicts(record):
            kind = type(record).__name__.lower()
            self._say(f"{kind} {getattr(record, 'id', '')} is described in two ways")
        else:
            self.contents.note(record)

    def _decodes(self, message: mcap.Message) -> bool:
        """Tell whether a described message can be decoded; True if it is not of ROS 2."""
        if not self._of_ros(message.channel_id):
            return True
        schema = self.contents.schemas[self.contents.channels[message.channel_id].schema_id]
        try:
            with quiet():
                decode = self._decoders.decoder_for("cdr", schema)
            assert decode is not None  # Contents.topic() has checked the encodings
            decode(message.data)
        except Exception:
            # the decoder raises errors of many types
            return False
        return True

    def _message_indexes(self, number: int) -> Iterator[Span]:
        """Yield the message indexes from a span on, which belong to the chunk before."""
        spans = self.survey.spans
        while number < len(spans) and spans[number].opcode == Opcode.MESSAGE_INDEX:
            yield spans[number]
            number += 1

    def _chunk(
        self,
        span: Span,
        size: int,
        records: Sequence[tuple[int, mcap.McapRecord]],
        message_indexes: Iterator[Span],
    ) -> None:
        """Check a readable chunk: its head, its message indexes, its entry in the index."""
        place = f"chunk {len(self._indexes) + 1}"
        entries: dict[int, list[tuple[int, int]]] = {}
        for offset, record in records:
            self._note(record)
            if isinstance(record, mcap.Message):
                entries.setdefault(record.channel_id, []).append((record.log_time, offset))
        times = [time for pairs in entries.values() for time, _ in pairs]
        compression, begin = packing(self.data, span)
        index = mcap.ChunkIndex(
            message_start_time=min(times, default=0),
            message_end_time=max(times, default=0),
            chunk_start_offset=span.begin,
            chunk_length=span.end - span.begin,
            message_index_offsets={},
            message_index_length=0,
            compression=compression,
            compressed_size=span.end - begin,
            uncompressed_size=size,
        )
        self._indexes.append(index)
        *_, checksum = CHUNK_HEAD.unpack_from(self.data, span.begin + HEAD.size)
        self.result.unproven_chunks += not checksum
        if self.data[span.begin : begin] != _head(index, checksum):
            self._say(f"{place}: its head is damaged, its contents are not")
        for after in message_indexes:
            found = self._record(after)
            if isinstance(found, mcap.MessageIndex):
                index.message_index_offsets[found.channel_id] = after.begin
                if sorted(found.records) != sorted(entries.get(found.channel_id, ())):
                    self._say(f"{place}: an index of its messages is wrong")
            index.message_index_length += after.end - after.begin
        if span.index is not None and span.index != index:
            self._say(f"{place}: the index does not fit it, or the message indexes after it")

    def _summary(self, summary: Summary) -> None:
        """Check the statistics and the index of metadata records."""
        if summary.metadata_indexes and summary.metadata_indexes != self._metadata:
            self._say("the index of the metadata records is not that of those in the file")
        statistics = summary.statistics
        if statistics is None:
            self._say("the index has no statistics")
            return
        self.result.expected = statistics.message_count
        if not self.whole:
            return
        found = mcap.Statistics(
            attachment_count=self._attachments,
            channel_count=len(self.contents.channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._indexes),
            message_count=self._counts.total(),
            message_start_time=self._first if self._counts else 0,
            message_end_time=self._last,
            metadata_count=len(self._metadata),
            schema_count=len(self.contents.schemas),
        )
        for name, value in vars(found).items():
            said = getattr(statistics, name)
            if isinstance(said, dict):
                said = {channel: count for channel, count in said.items() if count}
            if said != value:
                self._say(f"the index says {name} is {said}, the file holds {value}")

    def _data_end(self, span: Span) -> None:
        """Check the end of the data section, with its checksum of all bytes before."""
        record = self._record(span)
        if not isinstance(record, mcap.DataEnd) or span.end - span.begin != HEAD.size + 4:
            self._say(f"bytes {span.begin} to {span.end}: the end of the data is damaged")
        elif record.data_section_crc:
            self.result.data_checksum = True
            if not self.result.findings and (
                zlib.crc32(self.data[: span.begin]) != record.data_section_crc
            ):
                self._say("a bit before the index has changed; no finer checksum covers it")

    def _all_metadata(self, path: Path | None) -> None:
        """Check all copies of the metadata against each other and against the messages."""
        in_file = len(self.copies)
        if path is not None:
            try:
                self.copies.append((METADATA_FILE, read_metadata_file(path)))
            except FileNotFoundError:
                self._say(f"{METADATA_FILE} is missing")
            except (OSError, ValueError) as error:
                self._say(f"{METADATA_FILE} cannot be read: {cause(error)}")
        conflict = custom_data_conflict(
            [(where, custom_data_of(copy)) for where, copy in self.copies]
        )
        if conflict:
            self._say(conflict)
        if self.result.expected is None:
            counts = recorded_counts([copy for _, copy in self.copies])
            self.result.expected = sum(counts.values()) if counts else None
        if self.whole and self.survey.summary:
            for where, copy in self.copies[max(in_file - 1, 0) :]:
                self._information(where, copy)

    def _information(self, where: str, information: Mapping[str, Any]) -> None:
        """Check a final copy of the metadata against the messages."""
        if not self._ours:
            counts = recorded_counts([information])
            if counts and {name: n for name, n in counts.items() if n} != self.message_counts:
                self._say(f"{where} counts other messages than there are")
            return
        channels = self.contents.channels
        ought = bag_information(
            self.result.file.name,
            [(self.contents.topic(channel), self._counts[channel]) for channel in channels],
            (self._first, self._last) if self._counts else None,
            custom_data_of(information),
        )
        for key in sorted(information.keys() | ought.keys(), key=str):
            if key != "ros_distro" and information.get(key) != ought.get(key):
                said, right = information.get(key), ought.get(key)
                words = f": {said!r}, the messages say {right!r}" if isinstance(right, int) else ""
                self._say(f"{key} in {where} is wrong{words}")


def _head(index: mcap.ChunkIndex, checksum: int) -> bytes:
    """Return the head that a chunk must have."""
    return (
        HEAD.pack(Opcode.CHUNK, index.chunk_length - HEAD.size)
        + CHUNK_HEAD.pack(
            index.message_start_time, index.message_end_time, index.uncompressed_size, checksum
        )
        + len(index.compression).to_bytes(4, "little")
        + index.compression.encode()
        + index.compressed_size.to_bytes(8, "little")
    )
