"""A new end for an MCAP file whose writer could not go on.

A full disk leaves complete chunks without the index that readers ask for. The index is
made here from the chunks; if there is no room for it either, the last chunks make room.
"""

# mypy: allow-untyped-calls
# some methods of the MCAP library have no types

import os
import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from struct import pack
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from ares_bags.contents import Contents
from ares_bags.metadata import RECORD_NAME, bag_information, record_data, write_metadata_file


@dataclass
class _Span:
    """One chunk with its message indexes."""

    index: ChunkIndex
    records: list[McapRecord]  # its schemas and channels
    counts: dict[int, int] = field(default_factory=dict)

    @property
    def end(self) -> int:
        index = self.index
        return index.chunk_start_offset + index.chunk_length + index.message_index_length

    @property
    def complete(self) -> bool:
        return self.index.message_index_offsets.keys() == self.counts.keys()


def _span(chunk: Chunk, begin: int, end: int) -> _Span:
    index = ChunkIndex(
        message_start_time=chunk.message_start_time,
        message_end_time=chunk.message_end_time,
        chunk_start_offset=begin,
        chunk_length=end - begin,
        message_index_offsets={},
        message_index_length=0,
        compression=chunk.compression,
        compressed_size=len(chunk.data),
        uncompressed_size=chunk.uncompressed_size,
    )
    span = _Span(index, [])
    for record in breakup_chunk(chunk, validate_crc=True):
        if isinstance(record, Message):
            span.counts[record.channel_id] = span.counts.get(record.channel_id, 0) + 1
        else:
            span.records.append(record)
    return span


def _scan(path: Path) -> tuple[int, list[MetadataIndex], list[_Span]]:
    """Where the first chunk begins, the metadata records before it, the complete chunks."""
    metadata: list[MetadataIndex] = []
    spans: list[_Span] = []
    begin = start = len(MCAP0_MAGIC)
    # the reader raises one of many errors where the file breaks off; what came before is good
    with path.open("rb") as stream, suppress(Exception):
        for record in StreamReader(stream, emit_chunks=True).records:
            end = stream.tell()
            if isinstance(record, Chunk):
                spans.append(_span(record, begin, end))
            elif isinstance(record, MessageIndex):
                spans[-1].index.message_index_offsets[record.channel_id] = begin
                spans[-1].index.message_index_length += end - begin
            elif isinstance(record, DataEnd) or spans:
                break
            else:
                start = end
                if isinstance(record, Metadata):
                    metadata.append(MetadataIndex(begin, end - begin, record.name))
            begin = end
    if spans and not spans[-1].complete:
        spans.pop()
    return start, metadata, spans


def _group(builder: RecordBuilder, opcode: Opcode, records: list[Any], base: int) -> SummaryOffset:
    begin = builder.count
    for record in records:
        record.write(builder)
    return SummaryOffset(
        group_opcode=opcode, group_start=base + begin, group_length=builder.count - begin
    )


def _ending(
    begin: int,
    contents: Contents,
    spans: list[_Span],
    metadata: list[MetadataIndex],
    data: dict[str, str],
    checksum: int,
) -> bytes:
    """Everything after the last chunk: metadata record, end of data, summary, footer.

    The checksum is that of all before it.
    """
    builder = RecordBuilder()
    Metadata(name=RECORD_NAME, metadata=data).write(builder)
    metadata = [*metadata, MetadataIndex(begin, builder.count, RECORD_NAME)]
    before = builder.end()
    DataEnd(data_section_crc=zlib.crc32(before, checksum)).write(builder)
    before += builder.end()

    counts: dict[int, int] = {}
    for span in spans:
        for channel, count in span.counts.items():
            counts[channel] = counts.get(channel, 0) + count
    statistics = Statistics(
        attachment_count=0,
        channel_count=len(contents.channels),
        channel_message_counts=counts,
        chunk_count=len(spans),
        message_count=sum(counts.values()),
        message_start_time=min((span.index.message_start_time for span in spans), default=0),
        message_end_time=max((span.index.message_end_time for span in spans), default=0),
        metadata_count=len(metadata),
        schema_count=len(contents.schemas),
    )
    base = begin + len(before)
    groups = [
        _group(builder, opcode, records, base)
        for opcode, records in (
            (Opcode.SCHEMA, list(contents.schemas.values())),
            (Opcode.CHANNEL, list(contents.channels.values())),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, [span.index for span in spans]),
            (Opcode.METADATA_INDEX, metadata),
        )
        if records
    ]
    offsets_begin = base + builder.count
    for group in groups:
        group.write(builder)
    summary = builder.end()
    # the checksum runs over the summary and the footer up to the checksum itself
    footer_head = pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, base, offsets_begin)
    Footer(
        summary_start=base,
        summary_offset_start=offsets_begin,
        summary_crc=zlib.crc32(footer_head, zlib.crc32(summary)),
    ).write(builder)
    return bytes(before + summary + builder.end() + MCAP0_MAGIC)


def _checksum(path: Path, end: int) -> int:
    with path.open("rb") as stream:
        return zlib.crc32(stream.read(end))


def _rewrite_end(path: Path, begin: int, ending: bytes) -> None:
    with path.open("r+b", buffering=0) as stream:
        os.ftruncate(stream.fileno(), begin)
        stream.seek(begin)
        view = memoryview(ending)
        while view:
            view = view[stream.write(view) :]


def seal(path: Path, custom_data: dict[str, str]) -> dict[str, Any]:
    """Close an MCAP file after its last complete chunk and write its `metadata.yaml`.

    Args:
        path: the MCAP file, in the bag's folder; nobody else has it open for writing.
        custom_data: texts by name for the bag's metadata.

    Returns:
        The metadata of what is left (see `bag_information`).

    Raises:
        OSError: there was no room even for an empty bag.
    """
    start, metadata, spans = _scan(path)
    while True:
        contents = Contents()
        counts: dict[int, int] = {}
        for span in spans:
            for record in span.records:
                contents.note(record)
            for channel, count in span.counts.items():
                counts[channel] = counts.get(channel, 0) + count
        indexes = [span.index for span in spans]
        information = bag_information(
            path.name,
            [(contents.topic(channel), counts.get(channel, 0)) for channel in contents.channels],
            (
                min(index.message_start_time for index in indexes),
                max(index.message_end_time for index in indexes),
            )
            if indexes
            else None,
            custom_data,
        )
        begin = spans[-1].end if spans else start
        try:
            checksum = _checksum(path, begin)
            ending = _ending(begin, contents, spans, metadata, record_data(information), checksum)
            _rewrite_end(path, begin, ending)
            write_metadata_file(path.parent, information)
        except OSError:
            if not spans:
                raise
            spans.pop()
        else:
            return information
