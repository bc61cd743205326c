# SPDX-License-Identifier: Apache-2.0
"""Write a new end for an MCAP file whose writer failed.

A full disk leaves complete chunks without the index that readers need. The index is
rebuilt from the chunks and written into the space that the writer has reserved behind them;
where none could be reserved, the last chunks are overwritten.
"""

# mypy: allow-untyped-calls
# some methods of the MCAP library have no types

import os
import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap import records as mcap
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

from ares_bags.contents import Contents
from ares_bags.ending import ChunkEntry, ending
from ares_bags.metadata import bag_information, record_data, write_metadata_file


@dataclass
class _Span(ChunkEntry):
    """Hold one chunk with its message indexes, schemas and channels."""

    records: list[mcap.McapRecord] = field(default_factory=list)

    @property
    def end(self) -> int:
        index = self.index
        return index.chunk_start_offset + index.chunk_length + index.message_index_length

    @property
    def complete(self) -> bool:
        return self.index.message_index_offsets.keys() == self.counts.keys()


def _indexed(chunk: mcap.Chunk, begin: int, end: int) -> _Span:
    index = mcap.ChunkIndex(
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
    span = _Span(index)
    for record in breakup_chunk(chunk, validate_crc=True):
        if isinstance(record, mcap.Message):
            span.counts[record.channel_id] = span.counts.get(record.channel_id, 0) + 1
        else:
            span.records.append(record)
    return span


def _scan(path: Path) -> tuple[int, list[mcap.MetadataIndex], list[_Span]]:
    """Return the offset of the first chunk, the metadata records before it, the complete chunks."""
    metadata: list[mcap.MetadataIndex] = []
    spans: list[_Span] = []
    begin = start = len(MCAP0_MAGIC)
    # where the file breaks off the reader raises errors of many types; the chunks before are intact
    with path.open("rb") as stream, suppress(Exception):
        for record in StreamReader(stream, emit_chunks=True).records:
            end = stream.tell()
            if isinstance(record, mcap.Chunk):
                spans.append(_indexed(record, begin, end))
            elif isinstance(record, mcap.MessageIndex):
                spans[-1].index.message_index_offsets[record.channel_id] = begin
                spans[-1].index.message_index_length += end - begin
            elif isinstance(record, mcap.DataEnd) or spans:
                break
            else:
                start = end
                if isinstance(record, mcap.Metadata):
                    metadata.append(mcap.MetadataIndex(begin, end - begin, record.name))
            begin = end
    if spans and not spans[-1].complete:
        spans.pop()
    return start, metadata, spans


def _checksum(path: Path, end: int) -> int:
    with path.open("rb") as stream:
        return zlib.crc32(stream.read(end))


def _rewrite_end(path: Path, begin: int, end: bytes) -> None:
    with path.open("r+b", buffering=0) as stream:
        stream.seek(begin)
        view = memoryview(end)
        while view:
            view = view[stream.write(view) :]
        # truncate last: other processes may take the freed space at once
        os.ftruncate(stream.fileno(), begin + len(end))


def seal(path: Path, custom_data: dict[str, str]) -> dict[str, Any]:
    """Close an MCAP file after its last complete chunk and write its `metadata.yaml`.

    Args:
        path: the MCAP file, in the bag's folder; no other process writes to it.
        custom_data: texts by name for the bag's metadata.

    Returns:
        The metadata of the sealed bag (see `bag_information`).

    Raises:
        OSError: the disk has no space even for an empty bag.
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
            end = ending(begin, contents, spans, metadata, record_data(information), checksum)
            _rewrite_end(path, begin, end)
            write_metadata_file(path.parent, information)
        except OSError:
            if not spans:
                raise
            spans.pop()
        else:
            return information
