"""Saving the complete part of a bag whose recorder was killed or whose file was damaged."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk

from ares_bags.contents import Contents
from ares_bags.errors import BagError
from ares_bags.metadata import RECORD_NAME, custom_data_of
from ares_bags.reader import find_file, open_bag
from ares_bags.writer import INCOMPLETE_KEY, BagWriter


@dataclass
class Repair:
    """What a repair did.

    Attributes:
        path: folder of the new bag.
        counts: messages saved, by topic.
        damaged_chunks: chunks in the middle of the file that could not be read.
        problem: what was wrong with the original, one line.
    """

    path: Path
    counts: dict[str, int] = field(default_factory=dict)
    damaged_chunks: int = 0
    problem: str = ""

    @property
    def saved(self) -> int:
        """Messages saved in all."""
        return sum(self.counts.values())


def _problem(path: Path) -> str | None:
    """What is wrong with a bag; None if every message of it can be read."""
    try:
        for _ in open_bag(path).raw_messages():
            pass
    except BagError as error:
        return str(error).split("; ./ares", maxsplit=1)[0]
    return None


def repair(path: Path | str, output: Path | str | None = None) -> Repair:
    """Copy every complete chunk of a damaged bag into a new bag; the original stays as it is.

    Args:
        path: the damaged bag: folder or MCAP file.
        output: folder of the new bag; default `<name>_repaired` beside the original.

    Returns:
        What was saved.

    Raises:
        BagError: not a bag, nothing wrong with it, nothing to save, or the new bag cannot be
            written.
    """
    path = Path(path)
    file = find_file(path)
    problem = _problem(path)
    if problem is None:
        raise BagError(f"bag {path} is complete; nothing to repair")
    source = path if path.is_dir() else file.with_suffix("")
    target = Path(output) if output is not None else source.with_name(f"{source.name}_repaired")
    result = Repair(path=target, problem=problem)
    custom_data, salvaged = _beginning(file)
    if not salvaged:
        raise BagError(f"bag {path}: no message can be saved ({problem})")
    custom_data[INCOMPLETE_KEY] = f"repaired: {problem}"
    with BagWriter(target, custom_data, flush_interval_s=float("inf")) as writer:
        _copy(file, writer, result)
    result.counts = writer.counts
    return result


def _records(file: Path, result: Repair) -> Iterator[McapRecord]:
    """Records in order, chunks opened, up to where the file breaks off."""
    with file.open("rb") as stream:
        records = StreamReader(stream, emit_chunks=True).records
        while True:
            try:
                record = next(records)
            except StopIteration:
                return
            except Exception:
                # the reader raises one of many where the file breaks off
                return
            if not isinstance(record, Chunk):
                yield record
                continue
            try:
                inner = breakup_chunk(record, validate_crc=True)
            except Exception:
                result.damaged_chunks += 1
                continue
            yield from inner


def _beginning(file: Path) -> tuple[dict[str, str], bool]:
    """The custom data of a broken file, and whether it has any message that can be read."""
    custom_data: dict[str, str] = {}
    for record in _records(file, Repair(file)):
        if isinstance(record, Metadata) and record.name == RECORD_NAME:
            custom_data = custom_data_of(record.metadata)
        elif isinstance(record, Message):
            return custom_data, True
    return custom_data, False


def _copy(file: Path, writer: BagWriter, result: Repair) -> None:
    contents = Contents()
    for record in _records(file, result):
        contents.note(record)
        if isinstance(record, Message):
            try:
                topic = contents.topic(record.channel_id)
            except BagError:
                continue  # its description was in a damaged chunk
            writer.add_topic(topic)
            writer.write(topic.name, record.log_time, record.data, record.publish_time)
