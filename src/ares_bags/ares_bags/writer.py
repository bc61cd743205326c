# SPDX-License-Identifier: Apache-2.0
"""Write a bag: a folder with one MCAP file and `metadata.yaml`, in rosbag2's format.

The file reaches the disk in complete chunks, at a bounded interval of time and of bytes, so
that a killed process loses at most that interval. Space for the end of the file is reserved before
each chunk is written, so that a full disk costs no message that has reached the file.
"""

import errno
import os
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Self

from mcap.records import Channel, Schema

from ares_bags.chunks import ChunkedFile
from ares_bags.errors import BagError, cause
from ares_bags.metadata import bag_information, record_data, write_metadata_file
from ares_bags.schema import Topic, qos_text
from ares_bags.seal import seal

#: Custom-data key of a bag that lost messages to a write error; its text is the error.
INCOMPLETE_KEY = "incomplete"
#: Prefix, before a guidance's identity, of the key of its settings, a JSON object.
GUIDANCE_KEY = "guidance "
#: Key of the simulator's settings, a JSON object: parameters, software, texts of files.
SIMULATOR_KEY = "simulator"
#: Keys of the date of recording (UTC) and of the machine.
DATE_KEY = "date"
MACHINE_KEY = "machine"

#: Bytes reserved for what is unknown before the end: the text of a write error, the last settings
#: of guidance, larger counts, and two partly filled blocks.
TO_SPARE = 16 * 1024
#: Error numbers of file systems that cannot reserve space for a file.
_CANNOT_HOLD = (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS)


class _WholeChunks:
    """Write bytes to the file at `flush` only, with space reserved behind them."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        self._pending = bytearray()
        self._written = 0
        self._held = 0

    def write(self, data: bytes) -> int:
        self._pending += data
        return len(data)

    def tell(self) -> int:
        return self._written + len(self._pending)

    def reserve(self, space: int) -> None:
        """Reserve space for the pending bytes and `space` bytes more.

        Raises:
            OSError: the disk is full.
        """
        end = self.tell() + space
        if end <= self._held or not hasattr(os, "posix_fallocate"):
            return
        try:
            os.posix_fallocate(self._descriptor, self._held, end - self._held)
        except OSError as error:
            if error.errno not in _CANNOT_HOLD:
                raise
        self._held = end

    def flush(self) -> None:
        # a chunk that is cut short is not counted: `seal` overwrites it
        data = bytes(self._pending)
        done = 0
        while done < len(data):
            done += os.write(self._descriptor, data[done:])
        self._written += done
        self._pending.clear()

    def release(self) -> None:
        """Release the reserved space."""
        os.ftruncate(self._descriptor, self._written)

    def close(self) -> None:
        if self._descriptor >= 0:
            descriptor, self._descriptor = self._descriptor, -1
            os.close(descriptor)


def _make_folder(path: Path) -> None:
    """Create a bag's folder and its parents.

    Raises:
        BagError: it exists, or cannot be created.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir()
    except FileExistsError as error:
        if os.path.lexists(path):
            raise BagError(f"bag {path} exists already; expected a new name") from error
        raise BagError(f"bag {path} cannot be created: {cause(error)}") from error
    except OSError as error:
        raise BagError(f"bag {path} cannot be created: {cause(error)}") from error


class BagWriter:
    """Write one bag.

    After a write error the bag is closed with everything flushed before; `error` holds the cause,
    and every further `write` raises it again.

    Attributes:
        path: the bag's folder.
        counts: messages written so far by topic; after an error, messages on disk.
        error: the write error; None if there was none.
        custom_data: texts by name for the bag's metadata; may be extended until `close`.
    """

    def __init__(
        self,
        path: Path | str,
        custom_data: Mapping[str, str] | None = None,
        *,
        flush_interval_s: float = 0.5,
        flush_bytes: int = 256 * 1024,
    ) -> None:
        """Create the folder and begin the file.

        Args:
            path: folder of the new bag; its parents are created too.
            custom_data: texts by name for the bag's metadata.
            flush_interval_s: wall time in s after which a write flushes.
            flush_bytes: message bytes after which a write flushes.

        Raises:
            BagError: the folder exists, or it cannot be created or written.
        """
        self.path = Path(path)
        self.counts: dict[str, int] = {}
        self.error: BagError | None = None
        self.custom_data = dict(custom_data or {})
        self._noted = dict(self.custom_data)
        self._flush_interval = flush_interval_s
        self._flush_bytes = flush_bytes
        self._topics: dict[str, Topic] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._first: int | None = None
        self._last = 0
        self._unflushed = 0
        self._flushed_at = time.monotonic()
        self._open = False
        self._measured: tuple[int, int] | None = None
        self._fixed = 0
        self.file = self.path / f"{self.path.name}_0.mcap"
        _make_folder(self.path)
        try:
            self._output = _WholeChunks(self.file)
            # the custom data go first, so that a killed recorder leaves at least them
            self._chunks = ChunkedFile(self._output, record_data(self._information()))
            self._output.flush()
            with suppress(OSError):
                # on a nearly full disk the next flush will fail and seal the bag
                self._output.reserve(self._needed())
        except BaseException as error:
            # BaseException: after a signal nobody could close the file
            with suppress(OSError):
                self.file.unlink(missing_ok=True)
                self.path.rmdir()
            if not isinstance(error, OSError):
                raise
            raise BagError(f"bag {self.path} cannot be written: {cause(error)}") from error
        self._open = True

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the bag, also after an error."""
        self.close()

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic; ignore it if its name is known."""
        if topic.name in self._channels:
            return
        schema = self._schemas.get(topic.type_name)
        if schema is None:
            schema = self._schemas[topic.type_name] = len(self._schemas) + 1
            definition = topic.definition.encode()
            self._chunks.describe(Schema(schema, definition, "ros2msg", topic.type_name))
        self._topics[topic.name] = topic
        self.counts[topic.name] = 0
        channel = self._channels[topic.name] = len(self._channels) + 1
        offered = {"offered_qos_profiles": qos_text(topic.qos), "topic_type_hash": topic.type_hash}
        self._chunks.describe(Channel(channel, topic.name, "cdr", offered, schema))

    def write(
        self, topic: str, log_time_ns: int, data: bytes, publish_time_ns: int | None = None
    ) -> None:
        """Write one message.

        Args:
            topic: name of a topic that was added.
            log_time_ns: flight time in ns, not negative.
            data: the message as CDR, with its encapsulation header.
            publish_time_ns: ns; default the log time.

        Raises:
            BagError: the bag could not be written; it is closed then.
            ValueError: negative time.
        """
        if not self._open:
            raise self.error or BagError(f"bag {self.path} is closed")
        if log_time_ns < 0:
            raise ValueError(f"log time is {log_time_ns} ns; expected zero or more")
        publish_time = log_time_ns if publish_time_ns is None else publish_time_ns
        self._chunks.add(self._channels[topic], log_time_ns, data, publish_time)
        self.counts[topic] += 1
        if self._first is None or log_time_ns < self._first:
            self._first = log_time_ns
        if log_time_ns > self._last:
            self._last = log_time_ns
        self._unflushed += len(data)
        if (
            self._unflushed >= self._flush_bytes
            or time.monotonic() - self._flushed_at >= self._flush_interval
        ):
            self.flush()

    def note(self) -> None:
        """Write extended custom data to the file, if it has no message yet.

        Raises:
            BagError: the bag could not be written; it is closed then.
        """
        if not self._open or self._chunks.index_size or self.custom_data == self._noted:
            return
        self._noted = dict(self.custom_data)
        try:
            self._chunks.note(record_data(self._information()))
            self._output.reserve(self._needed())
            self._output.flush()
        except OSError as error:
            raise self._fail(error) from error

    def flush(self) -> None:
        """Write all messages so far to the file, as a complete chunk.

        Raises:
            BagError: the bag could not be written; it is closed then.
        """
        self._flushed_at = time.monotonic()
        if not self._open or not self._unflushed:
            return
        self._unflushed = 0
        try:
            self._chunks.end_chunk()
            self._output.reserve(self._needed())
            self._output.flush()
        except OSError as error:
            raise self._fail(error) from error

    def close(self) -> None:
        """Write the end of the file and `metadata.yaml`; do nothing if closed.

        Raises:
            BagError: the bag could not be completed; what fits on the disk is readable.
        """
        if not self._open:
            return
        self.flush()
        information = self._information()
        try:
            self._chunks.end(record_data(information))
            self._output.flush()
            self._output.release()
            self._open = False
            self._output.close()
            write_metadata_file(self.path, information)
        except OSError as error:
            raise self._fail(error) from error

    def discard(self) -> None:
        """Remove an open bag from the disk."""
        self._open = False
        self._output.close()
        with suppress(OSError):
            self.file.unlink()
            self.path.rmdir()

    def _information(self) -> dict[str, object]:
        span = None if self._first is None else (self._first, self._last)
        counts = [(topic, self.counts[topic.name]) for topic in self._topics.values()]
        return bag_information(self.file.name, counts, span, self.custom_data)

    def _needed(self) -> int:
        """Return the bytes needed for the end of the file as it is now, and for `metadata.yaml`."""
        known = (len(self._topics), sum(map(len, self.custom_data.values())))
        if known != self._measured:
            self._measured = known
            data = record_data(self._information())
            metadata = sum(len(text.encode()) for text in data.values())
            self._fixed = self._chunks.size_of_end(data) + metadata + TO_SPARE
        return self._fixed + self._chunks.index_size

    def _fail(self, error: OSError) -> BagError:
        self._open = False
        why = cause(error)
        taken = sum(self.counts.values())
        with suppress(OSError):
            self._output.close()
        try:
            information = seal(self.file, {**self.custom_data, INCOMPLETE_KEY: why})
        except OSError:
            self.counts = dict.fromkeys(self.counts, 0)
            saved = "nothing of it can be read"
        else:
            self.counts = dict.fromkeys(self.counts, 0) | {
                entry["topic_metadata"]["name"]: entry["message_count"]
                for entry in information["topics_with_message_count"]
            }
            saved = f"{information['message_count']} of {taken} messages are in it"
        self.error = BagError(f"bag {self.path} is incomplete: {why}; {saved}")
        return self.error
