# SPDX-License-Identifier: Apache-2.0
"""The end of an MCAP file: metadata record, end of data, summary with the index, footer."""

# mypy: allow-untyped-calls
# some methods of the MCAP library have no types

import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from struct import pack
from typing import Any

from mcap import records as mcap
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from ares_bags.contents import Contents
from ares_bags.metadata import RECORD_NAME


@dataclass
class ChunkEntry:
    """Hold the summary entry of one chunk.

    Attributes:
        index: position of the chunk and of its message indexes.
        counts: number of its messages by channel.
    """

    index: mcap.ChunkIndex
    counts: dict[int, int] = field(default_factory=dict)


def _group(
    builder: RecordBuilder, opcode: Opcode, records: list[Any], base: int
) -> mcap.SummaryOffset:
    begin = builder.count
    for record in records:
        record.write(builder)
    return mcap.SummaryOffset(
        group_opcode=opcode, group_start=base + begin, group_length=builder.count - begin
    )


def _statistics(contents: Contents, chunks: Sequence[ChunkEntry], metadata: int) -> mcap.Statistics:
    """Return the statistics of a file with so many metadata records."""
    counts: Counter[int] = Counter()
    for chunk in chunks:
        counts.update(chunk.counts)
    return mcap.Statistics(
        attachment_count=0,
        channel_count=len(contents.channels),
        channel_message_counts=dict(counts),
        chunk_count=len(chunks),
        message_count=counts.total(),
        message_start_time=min((chunk.index.message_start_time for chunk in chunks), default=0),
        message_end_time=max((chunk.index.message_end_time for chunk in chunks), default=0),
        metadata_count=metadata,
        schema_count=len(contents.schemas),
    )


def ending(
    begin: int,
    contents: Contents,
    chunks: Sequence[ChunkEntry],
    metadata: Sequence[mcap.MetadataIndex],
    data: Mapping[str, str],
    checksum: int,
) -> bytes:
    """Return all bytes after the last chunk.

    Args:
        begin: offset of the first of them in the file, bytes.
        contents: schemas and channels.
        chunks: entries of all chunks.
        metadata: index of the metadata records before the chunks.
        data: content of the metadata record to be written.
        checksum: CRC-32 of all bytes before `begin`.
    """
    builder = RecordBuilder()
    mcap.Metadata(name=RECORD_NAME, metadata=dict(data)).write(builder)
    metadata = [*metadata, mcap.MetadataIndex(begin, builder.count, RECORD_NAME)]
    before = builder.end()
    mcap.DataEnd(data_section_crc=zlib.crc32(before, checksum)).write(builder)
    before += builder.end()

    base = begin + len(before)
    groups = [
        _group(builder, opcode, records, base)
        for opcode, records in (
            (Opcode.SCHEMA, list(contents.schemas.values())),
            (Opcode.CHANNEL, list(contents.channels.values())),
            (Opcode.STATISTICS, [_statistics(contents, chunks, len(metadata))]),
            (Opcode.CHUNK_INDEX, [chunk.index for chunk in chunks]),
            (Opcode.METADATA_INDEX, metadata),
        )
        if records
    ]
    offsets_begin = base + builder.count
    for group in groups:
        group.write(builder)
    summary = builder.end()
    # the checksum covers the summary and the footer up to the checksum itself
    footer_head = pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, base, offsets_begin)
    mcap.Footer(
        summary_start=base,
        summary_offset_start=offsets_begin,
        summary_crc=zlib.crc32(footer_head, zlib.crc32(summary)),
    ).write(builder)
    return bytes(before + summary + builder.end() + MCAP0_MAGIC)
