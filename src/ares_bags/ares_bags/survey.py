# SPDX-License-Identifier: Apache-2.0
"""Locate the records of an MCAP file that may be damaged anywhere.

The index at the end of the file, if its checksum is right, locates the chunks; without it the
file is searched for them. A chunk counts only if the checksum of its contents is right.
"""

# mypy: allow-untyped-calls
# some methods of the MCAP library have no types

import mmap
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from struct import Struct
from struct import error as struct_error
from typing import Any

from mcap import records as mcap
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdDecompressor, ZstdError

from ares_bags.errors import BagError, cause
from ares_bags.files import PACKED

MAGIC = len(MCAP0_MAGIC)
#: Opcode and length of a record.
HEAD = Struct("<BQ")
#: First and last log time in ns, uncompressed size, checksum of the uncompressed contents.
CHUNK_HEAD = Struct("<QQQI")
#: Channel, sequence, log time and publish time in ns.
_MESSAGE_HEAD = Struct("<HIQQ")
#: Opcode, length, offsets of summary and summary offsets, checksum.
_FOOTER = Struct("<BQQQI")
_LENGTH = Struct("<I")
_LONG_LENGTH = Struct("<Q")

#: Errors of the parsers for invalid bytes.
UNREADABLE = (McapError, ValueError, OverflowError, MemoryError, struct_error)

_PRIVATE_OPCODES = 0x80
_KINDS: dict[int, Any] = {
    Opcode.HEADER: mcap.Header,
    Opcode.SCHEMA: mcap.Schema,
    Opcode.CHANNEL: mcap.Channel,
    Opcode.MESSAGE_INDEX: mcap.MessageIndex,
    Opcode.CHUNK_INDEX: mcap.ChunkIndex,
    Opcode.ATTACHMENT_INDEX: mcap.AttachmentIndex,
    Opcode.METADATA: mcap.Metadata,
    Opcode.METADATA_INDEX: mcap.MetadataIndex,
    Opcode.STATISTICS: mcap.Statistics,
    Opcode.DATA_END: mcap.DataEnd,
}
_COMPRESSIONS = ("", "zstd", "lz4")
#: Patterns by which chunks are found: their compression field.
_COMPRESSED = re.compile(rb"\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4")
_UNCOMPRESSED = re.compile(rb"\x06(?=[\x00-\xff]{36}\x00\x00\x00\x00)")


@dataclass(frozen=True)
class Span:
    """Hold the extent of a record, or of a gap in which no record can be recognized.

    Attributes:
        begin: offset of the first byte.
        end: offset after the last byte.
        opcode: expected kind of the record; None for a gap.
        index: entry of a chunk in the index; None without an index.
    """

    begin: int
    end: int
    opcode: int | None
    index: mcap.ChunkIndex | None = None


def map_file(path: Path) -> memoryview:
    """Return the bytes of a non-empty file.

    Raises:
        OSError: it cannot be read.
        BagError: it was compressed whole and cannot be unpacked.
    """
    with path.open("rb") as stream:
        if path.suffix == PACKED:
            try:
                return memoryview(ZstdDecompressor().stream_reader(stream).read())
            except ZstdError as error:
                raise BagError(f"{path} cannot be unpacked: {cause(error)}") from error
        return memoryview(mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ))


def begins_well(data: memoryview) -> bool:
    """Tell whether a file begins with the magic, or, if shorter, with its first bytes."""
    return MCAP0_MAGIC[: len(data)] == data[:MAGIC]


def ends_well(data: memoryview) -> bool:
    """Tell whether a file ends with the magic."""
    return len(data) >= 2 * MAGIC and data[-MAGIC:] == MCAP0_MAGIC


def parse(data: memoryview, span: Span) -> mcap.McapRecord | None:
    """Parse the record of a span; return None for a kind that says nothing about messages.

    Raises:
        UNREADABLE: its content is no such record.
    """
    if span.opcode == Opcode.MESSAGE:
        return _message(bytes(data[span.begin + HEAD.size : span.end]))
    kind = _KINDS.get(span.opcode or 0)
    if kind is None:
        return None
    return kind.read(ReadDataStream(BytesIO(data[span.begin + HEAD.size : span.end])))


def _message(body: bytes) -> mcap.Message:
    channel, sequence, log_time, publish_time = _MESSAGE_HEAD.unpack_from(body)
    return mcap.Message(
        channel_id=channel,
        log_time=log_time,
        data=body[_MESSAGE_HEAD.size :],
        publish_time=publish_time,
        sequence=sequence,
    )


def read_summary(data: memoryview) -> tuple[Summary, int] | None:
    """Return the summary of a file and its offset; None if the file has none.

    Raises:
        UNREADABLE: it is damaged.
    """
    end = len(data) - MAGIC - _FOOTER.size
    if end < MAGIC:
        raise ValueError("no footer")
    opcode, length, begin, _, checksum = _FOOTER.unpack_from(data, end)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - HEAD.size:
        raise ValueError("no footer")
    if not begin:
        return None
    if not MAGIC <= begin <= end:
        raise ValueError("summary beyond the end")
    # the footer counts up to its checksum
    if checksum and zlib.crc32(data[begin : end + _FOOTER.size - 4]) != checksum:
        raise ValueError("checksum of the summary is wrong")
    summary = Summary()
    for span in records_between(data, begin, end, []):
        record = parse(data, span)
        if span.opcode is None:
            raise ValueError("summary is not made of records")
        if isinstance(record, mcap.Statistics):
            summary.statistics = record
        elif isinstance(record, mcap.Schema):
            summary.schemas[record.id] = record
        elif isinstance(record, mcap.Channel):
            summary.channels[record.id] = record
        elif isinstance(record, mcap.ChunkIndex):
            summary.chunk_indexes.append(record)
        elif isinstance(record, mcap.AttachmentIndex):
            summary.attachment_indexes.append(record)
        elif isinstance(record, mcap.MetadataIndex):
            summary.metadata_indexes.append(record)
    return summary, begin


def records_between(data: memoryview, begin: int, end: int, known: list[Span]) -> Iterator[Span]:
    """Yield all records between two offsets, and the gaps between them.

    Args:
        data: the file.
        begin: offset of the first record.
        end: offset after the last one.
        known: records at known offsets, in order; after damage, reading resumes at the next one.
    """
    for span in [*known, Span(end, end, None)]:
        while begin < span.begin:
            stop = _record_end(data, begin, span.begin)
            if stop is None:
                yield Span(begin, span.begin, None)
                break
            yield Span(begin, stop, data[begin])
            begin = stop
        if span.end > span.begin:
            yield span
        begin = span.end


def _record_end(data: memoryview, begin: int, limit: int) -> int | None:
    """Return the end offset of the record at an offset; None if there is no record."""
    if limit - begin < HEAD.size:
        return None
    opcode, length = HEAD.unpack_from(data, begin)
    end = begin + HEAD.size + length
    if end > limit or not (
        Opcode.HEADER <= opcode <= Opcode.DATA_END or opcode >= _PRIVATE_OPCODES
    ):
        return None
    if opcode == Opcode.CHUNK:
        chunk = _chunk_at(data, begin)
        if chunk is None or chunk.end != end:
            return None
    return int(end)


def _compression_of(data: memoryview, begin: int) -> tuple[str, int]:
    """Return the compression of the chunk at an offset, and the offset of its payload's length.

    Raises:
        UNREADABLE: there is no such chunk.
    """
    begin += HEAD.size + CHUNK_HEAD.size
    (length,) = _LENGTH.unpack_from(data, begin)
    begin += _LENGTH.size
    return str(data[begin : begin + length], "utf-8"), begin + length


def _chunk_at(data: memoryview, begin: int) -> Span | None:
    """Return the chunk at an offset, by the length of its payload; None if it exceeds the file."""
    try:
        _, at = _compression_of(data, begin)
        (size,) = _LONG_LENGTH.unpack_from(data, at)
    except UNREADABLE:
        return None
    end = at + _LONG_LENGTH.size + size
    return Span(begin, end, Opcode.CHUNK) if end <= len(data) else None


def packing(data: memoryview, chunk: Span) -> tuple[str, int]:
    """Return a chunk's compression and the offset of its payload, which ends with the chunk.

    The index, which has a checksum, takes precedence over the chunk's head, which has none.

    Raises:
        UNREADABLE: there is no index and the head is damaged.
    """
    if chunk.index is not None:
        return chunk.index.compression, chunk.end - chunk.index.compressed_size
    compression, begin = _compression_of(data, chunk.begin)
    return compression, begin + _LONG_LENGTH.size


def chunk_content(data: memoryview, chunk: Span) -> bytes:
    """Return the uncompressed contents of a chunk, verified by their checksum.

    Raises:
        UNREADABLE: they are not as written.
    """
    *_, size, checksum = CHUNK_HEAD.unpack_from(data, chunk.begin + HEAD.size)
    if chunk.index is not None:
        size = chunk.index.uncompressed_size
    compression, begin = packing(data, chunk)
    if compression not in _COMPRESSIONS:
        raise ValueError(f"its compression is {compression!r}")
    packed = mcap.Chunk(
        compression=compression,
        data=bytes(data[begin : chunk.end]),
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=0,
        uncompressed_size=size,
    )
    try:
        stream, length = get_chunk_data_stream(packed)
    except Exception as error:
        # each decompression library raises its own errors
        raise ValueError(f"it cannot be unpacked: {cause(error)}") from error
    content = stream.read(length)
    if zlib.crc32(content) != checksum and (checksum or len(content) != size):
        raise ValueError("checksum of its contents is wrong")
    return content


def chunk_records(content: bytes) -> Iterator[tuple[int, mcap.McapRecord]]:
    """Yield schemas, channels and messages of a chunk's contents with their offsets.

    Raises:
        UNREADABLE: the contents are not made of records.
    """
    begin = 0
    while begin < len(content):
        opcode, length = HEAD.unpack_from(content, begin)
        end = begin + HEAD.size + length
        body = content[begin + HEAD.size : end]
        if end > len(content):
            raise ValueError("a record goes beyond its end")
        if opcode == Opcode.MESSAGE:
            yield begin, _message(body)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            yield begin, _KINDS[opcode].read(ReadDataStream(BytesIO(body)))
        begin = end


def _search(data: memoryview) -> list[Span]:
    """Return all readable chunks, found by their compression field."""
    lead = HEAD.size + CHUNK_HEAD.size
    begins = {match.start() - lead for match in _COMPRESSED.finditer(data)}
    for match in _UNCOMPRESSED.finditer(data):
        if _record_end(data, match.start(), len(data)) is not None:
            begins.add(match.start())
    found: list[Span] = []
    after = MAGIC
    for begin in sorted(begins):
        chunk = _chunk_at(data, begin) if begin >= after else None
        if chunk is None:
            continue
        try:
            for _ in chunk_records(chunk_content(data, chunk)):
                pass
        except UNREADABLE:
            continue
        found.append(chunk)
        after = chunk.end
    return found


@dataclass(frozen=True)
class Survey:
    """Hold everything readable in a file.

    Attributes:
        data: its bytes.
        summary: the summary, if its checksum is right.
        problem: fault of the end of the file, a few words; "" if there is none.
        spans: the records between the magic at the beginning and the summary, and the gaps.
    """

    data: memoryview
    summary: Summary | None
    problem: str
    spans: list[Span]

    @property
    def chunks(self) -> list[Span]:
        """Return the chunks, readable or not."""
        return [span for span in self.spans if span.opcode == Opcode.CHUNK]


def survey(data: memoryview) -> Survey | None:
    """Locate all records of a file; return None if nothing in it resembles an MCAP file."""
    summary = None
    end = len(data)
    problem = ""
    try:
        found = read_summary(data)
    except UNREADABLE as error:
        problem = f"is damaged ({cause(error)})"
    else:
        if found:
            summary, end = found
        else:
            problem = "has no index"
    if not ends_well(data):
        problem = "has no end (its recorder was killed, or the file was cut)"
    known = _known(summary, end) if summary and summary.chunk_indexes else _search(data)
    if not (begins_well(data) or ends_well(data) or summary or known):
        return None
    spans = list(records_between(data, MAGIC, end, known))
    if summary is None:
        spans = _data_section(_written(data, spans))
    return Survey(data, summary, problem, spans)


def _written(data: memoryview, spans: list[Span]) -> list[Span]:
    """Remove the zeros that a recorder has reserved behind its last record."""
    if not spans or spans[-1].opcode is not None:
        return spans
    begin = spans[-1].begin
    size = len(bytes(data[begin : spans[-1].end]).rstrip(b"\0"))
    return [*spans[:-1], Span(begin, begin + size, None)] if size else spans[:-1]


def _data_section(spans: list[Span]) -> list[Span]:
    """Cut off a summary at the end that no checksum proves."""
    last_chunk = max((n for n, span in enumerate(spans) if span.opcode == Opcode.CHUNK), default=0)
    for number, span in enumerate(spans):
        if number > last_chunk and span.opcode == Opcode.DATA_END:
            return spans[: number + 1]
    return spans


def _known(summary: Summary, end: int) -> list[Span]:
    """Return the records located by a summary, in order."""
    spans = [
        Span(index.offset, index.offset + index.length, Opcode.METADATA)
        for index in summary.metadata_indexes
    ]
    for index in summary.chunk_indexes:
        end_of_chunk = index.chunk_start_offset + index.chunk_length
        spans.append(Span(index.chunk_start_offset, end_of_chunk, Opcode.CHUNK, index))
        begins = sorted(index.message_index_offsets.values())
        # listed here, because one wrong bit in its opcode turns one into a message
        ends = [*begins[1:], end_of_chunk + index.message_index_length]
        spans += [Span(*pair, Opcode.MESSAGE_INDEX) for pair in zip(begins, ends, strict=False)]
    ordered: list[Span] = []
    for span in sorted(spans, key=lambda span: span.begin):
        if (ordered[-1].end if ordered else MAGIC) <= span.begin < span.end <= end:
            ordered.append(span)
    return ordered
