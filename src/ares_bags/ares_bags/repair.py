# SPDX-License-Identifier: Apache-2.0
"""Save the intact messages of a bag whose recorder was killed or whose file was damaged."""

import shutil
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import McapRecord, Message

from ares_bags.errors import BagError
from ares_bags.files import find_files
from ares_bags.metadata import custom_data_of
from ares_bags.survey import UNREADABLE, chunk_content, chunk_records, parse
from ares_bags.verify import Examination
from ares_bags.writer import INCOMPLETE_KEY, BagWriter

#: Custom-data key of a bag repaired without loss; its text is the fault of the original.
REPAIRED_KEY = "repaired"


@dataclass
class Repair:
    """Hold the result of a repair.

    Attributes:
        path: folder of the new bag.
        counts: messages saved, by topic.
        damaged_chunks: chunks dropped whole, because their checksum is wrong.
        problem: fault of the original, one line.
        lost: messages that were recorded and are not saved; None if unknown.
    """

    path: Path
    counts: dict[str, int] = field(default_factory=dict)
    damaged_chunks: int = 0
    problem: str = ""
    lost: int | None = None

    @property
    def saved(self) -> int:
        """Return the total number of messages saved."""
        return sum(self.counts.values())

    @property
    def loss(self) -> str:
        """Return a description of the loss."""
        if self.lost is None:
            return "how many messages are lost cannot be known"
        if not self.lost:
            return "no message is lost"
        dropped = f", {self.damaged_chunks} damaged chunks dropped whole" * bool(
            self.damaged_chunks
        )
        return f"{self.lost:,} of {self.saved + self.lost:,} messages are lost{dropped}"


def repair(path: Path | str, output: Path | str | None = None) -> Repair:
    """Copy every intact message of a damaged bag into a new bag; leave the original unchanged.

    A chunk is copied if the checksum of its contents is right, and dropped whole if not: a
    wrong bit could be in any of its messages.

    Args:
        path: the damaged bag: folder or MCAP file.
        output: folder of the new bag; default: `<name>_repaired` beside the original.

    Returns:
        Numbers of messages saved and lost.

    Raises:
        BagError: not a bag, no fault in it, no message to save, or the new bag cannot be
            written.
    """
    path = Path(path)
    files = find_files(path)
    if len(files) > 1:
        raise BagError(
            f"bag {path} is of {len(files)} files; expected the name of one, such as {files[0]}"
        )
    file = files[0]
    try:
        found = Examination(path, file, decode=False)
    except BagError as error:
        raise BagError(f"bag {path}: no message can be saved ({error})") from error
    findings = found.result.findings
    if not findings:
        raise BagError(f"bag {path} is not damaged; nothing to repair")
    problem = findings[0] if len(findings) == 1 else f"{findings[0]}, and {len(findings) - 1} more"
    source = path if path.is_dir() else file.with_suffix("")
    target = Path(output) if output is not None else source.with_name(f"{source.name}_repaired")
    counts = found.savable_counts
    if not counts:
        raise BagError(f"bag {path}: no message can be saved ({problem})")
    result = Repair(
        target,
        counts=counts,
        damaged_chunks=found.result.damaged_chunks,
        problem=f"bag {path}: {problem}",
        lost=_lost(found, sum(counts.values())),
    )
    custom_data = _custom_data([custom_data_of(copy) for _, copy in found.copies])
    if result.lost == 0:
        custom_data[REPAIRED_KEY] = problem
    else:
        custom_data[INCOMPLETE_KEY] = f"repaired: {problem}; {result.loss}"
    _copy(found, target, custom_data)
    return result


def _lost(found: Examination, saved: int) -> int | None:
    """Return the number of messages that were recorded and are not saved; None if unknown."""
    if found.result.expected is not None:
        return max(found.result.expected - saved, 0)
    # no recorded count: nothing is lost if the data section is whole from header to end
    spans = found.survey.spans
    ended = bool(spans) and spans[-1].opcode == Opcode.DATA_END
    return found.result.messages - saved if ended and found.whole else None


def _custom_data(copies: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Merge copies of the custom data: for each key the value of most copies, the later of two."""
    votes = {
        key: Counter(copy[key] for copy in reversed(copies) if key in copy)
        for key in dict.fromkeys(key for copy in copies for key in copy)
    }
    # of three copies or more, a key in a single one is a misread key
    return {
        key: count.most_common(1)[0][0]
        for key, count in votes.items()
        if count.total() > 1 or len(copies) < 3
    }


def _messages(found: Examination) -> Iterator[Message]:
    """Yield the intact messages in the order of recording."""
    data = found.survey.data
    for span in found.survey.spans:
        records: list[McapRecord | None] = []
        with suppress(*UNREADABLE):
            if span.opcode == Opcode.CHUNK:
                records += [record for _, record in chunk_records(chunk_content(data, span))]
            elif span.opcode == Opcode.MESSAGE:
                records.append(parse(data, span))
        yield from (record for record in records if isinstance(record, Message))


def _copy(found: Examination, target: Path, custom_data: Mapping[str, str]) -> None:
    """Write the new bag; remove it if that fails."""
    writer = BagWriter(target, custom_data, flush_interval_s=float("inf"))
    try:
        with writer:
            for message in _messages(found):
                try:
                    topic = found.contents.topic(message.channel_id)
                except BagError:
                    continue  # its description was in a damaged chunk
                writer.add_topic(topic)
                writer.write(topic.name, message.log_time, message.data, message.publish_time)
    except BaseException:
        shutil.rmtree(target, ignore_errors=True)
        raise
