# SPDX-License-Identifier: Apache-2.0
"""Write one MCAP file: messages into chunks, chunks into a stream."""

# mypy: allow-untyped-calls
# some methods of the MCAP library have no types

import zlib
from collections import defaultdict
from collections.abc import Mapping
from struct import Struct, pack
from typing import Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Header, Metadata, MetadataIndex, Schema
from mcap.writer import LIBRARY_IDENTIFIER, MCAP0_MAGIC

from ares_bags.contents import Contents
from ares_bags.ending import ChunkEntry, ending
from ares_bags.metadata import RECORD_NAME

#: Beginning of the library field in the header of a file written here.
LIBRARY = "ares_bags"

#: A message without its data: opcode, length of the rest, channel, sequence, log and publish time.
_MESSAGE = Struct("<BQHIQQ")
_OPCODE = int(Opcode.MESSAGE)
#: Bytes of a record before its length counts.
_PREFIX = 9

#: Placeholder in the index while the size of the file's end is computed.
_NO_CHUNK = ChunkIndex(
    message_start_time=0,
    message_end_time=0,
    chunk_start_offset=0,
    chunk_length=0,
    message_index_offsets={},
    message_index_length=0,
    compression="",
    compressed_size=0,
    uncompressed_size=0,
)


class Stream(Protocol):
    """Accept the bytes of a file."""

    def write(self, data: bytes) -> int:
        """Append bytes; return their number."""

    def tell(self) -> int:
        """Return the number of bytes appended so far."""


class ChunkedFile:
    """Write one MCAP file of the profile ros2, compressed, indexed, with checksums.

    The library's own writer takes five times as long for a message.
    """

    def __init__(self, stream: Stream, data: Mapping[str, str]) -> None:
        """Begin the file.

        Args:
            stream: receives the bytes, chunk by chunk.
            data: content of the first metadata record.
        """
        self._stream = stream
        self._checksum = 0
        self._contents = Contents()
        self._chunks: list[ChunkEntry] = []
        #: bytes of the chunk index so far, which `end` will write
        self.index_size = 0
        self._builder = RecordBuilder()
        self._put(MCAP0_MAGIC)
        Header("ros2", f"{LIBRARY} {LIBRARY_IDENTIFIER}").write(self._builder)
        self._put(self._builder.end())
        self._metadata: list[MetadataIndex] = []
        self.note(data)
        self._begin_chunk()

    def note(self, data: Mapping[str, str]) -> None:
        """Write a metadata record, before the first chunk.

        Args:
            data: its content.
        """
        begin = self._stream.tell()
        Metadata(RECORD_NAME, dict(data)).write(self._builder)
        self._put(self._builder.end())
        self._metadata.append(MetadataIndex(begin, self._stream.tell() - begin, RECORD_NAME))

    def _put(self, data: bytes) -> None:
        self._checksum = zlib.crc32(data, self._checksum)
        self._stream.write(data)

    def _begin_chunk(self) -> None:
        self._records: list[bytes] = []
        self._size = 0
        # per channel: log time in ns and offset of each message, alternating
        self._entries: defaultdict[int, list[int]] = defaultdict(list)

    def describe(self, record: Schema | Channel) -> None:
        """Add a schema or a channel, before its first message."""
        self._contents.note(record)
        record.write(self._builder)
        self._records.append(self._builder.end())
        self._size += len(self._records[-1])

    def add(self, channel: int, log_time_ns: int, data: bytes, publish_time_ns: int) -> None:
        """Add a message of a channel that has been described."""
        length = _MESSAGE.size - _PREFIX + len(data)
        head = _MESSAGE.pack(_OPCODE, length, channel, 0, log_time_ns, publish_time_ns)
        self._entries[channel] += (log_time_ns, self._size)
        self._records += (head, data)
        self._size += length + _PREFIX

    def end_chunk(self) -> None:
        """Compress and write the messages since the last chunk, if any."""
        if not self._entries:
            return
        content = b"".join(self._records)
        times = [time for entries in self._entries.values() for time in entries[::2]]
        chunk = Chunk(
            compression="zstd",
            data=zstandard.compress(content),
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(content),
            uncompressed_size=len(content),
        )
        begin = self._stream.tell()
        chunk.write(self._builder)
        length = self._builder.count
        places = {}
        for channel, entries in self._entries.items():
            places[channel] = begin + self._builder.count
            size = 8 * len(entries)
            self._builder.write(pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + size, channel, size))
            self._builder.write(pack(f"<{len(entries)}Q", *entries))
        index = ChunkIndex(
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            chunk_start_offset=begin,
            chunk_length=length,
            message_index_offsets=places,
            message_index_length=self._builder.count - length,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
        )
        counts = {channel: len(entries) // 2 for channel, entries in self._entries.items()}
        self._chunks.append(ChunkEntry(index, counts))
        self._put(self._builder.end())
        index.write(self._builder)
        self.index_size += len(self._builder.end())
        self._begin_chunk()

    def size_of_end(self, data: Mapping[str, str]) -> int:
        """Return the size in bytes that the file's end would have now, without its chunk index.

        Args:
            data: content of the last metadata record.
        """
        counted = ChunkEntry(_NO_CHUNK, dict.fromkeys(self._contents.channels, 0))
        begin = self._stream.tell()
        return len(ending(begin, self._contents, [counted], self._metadata, data, self._checksum))

    def end(self, data: Mapping[str, str]) -> None:
        """Write the last chunk and the end of the file.

        Args:
            data: content of the last metadata record.
        """
        self.end_chunk()
        self._stream.write(
            ending(
                self._stream.tell(),
                self._contents,
                self._chunks,
                self._metadata,
                data,
                self._checksum,
            )
        )
