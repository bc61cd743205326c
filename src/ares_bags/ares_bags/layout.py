# SPDX-License-Identifier: Apache-2.0
"""Messages of one size: their numbers lie at the same place in each, and are read all at once."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Size in bytes and numpy's letter of the numbers that a fixed layout may hold.
_NUMBERS = {
    "bool": "?",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
#: Arrays of these are no lists of numbers when decoded one by one.
_NO_ARRAYS = {"bool", "int8", "uint8"}
_TIMES = {"builtin_interfaces/Time", "builtin_interfaces/Duration"}
_PART = re.compile(r"^=+\nMSG: (\S+)\n", re.MULTILINE)
_FIELD = re.compile(r"^[ \t]*([A-Za-z][\w/]*)(\S*)[ \t]+([A-Za-z]\w*)[ \t]*(=?)", re.MULTILINE)
_COUNT = re.compile(r"\[(\d+)\]")
_LITTLE = Struct("<iI")
_BIG = Struct(">iI")
#: Stamps beyond this flight time (115 days) are those of a wall clock, ns.
WALL_CLOCK_NS = 10**7 * 10**9
#: Bytes in front of a message that say how it is written: plain CDR, little-endian.
_HEADER = b"\x00\x01"
_HEADER_SIZE = 4
#: A message may be filled up to a multiple of it.
_FILLED = 4


@dataclass(frozen=True)
class _Number:
    """A field: its name, numpy's letter, the count of an array or 0, its place in bytes."""

    name: str
    kind: str
    count: int
    offset: int


@dataclass(frozen=True)
class FixedLayout:
    """Where the numbers of a message lie.

    Attributes:
        dtype: of a message without its header; a stamp is `sec` and `nanosec` below its name.
        stamps: names of the stamps.
    """

    dtype: np.dtype[Any]
    stamps: tuple[str, ...]

    def columns(self, messages: Sequence[bytes]) -> dict[str, NDArray[Any]] | None:
        """The numbers of some messages, as `Bag.columns` gives them, but for the log time.

        Returns:
            None if the messages are not written so: to be decoded one by one.
        """
        sizes = {len(message) for message in messages}
        extra = next(iter(sizes), 0) - _HEADER_SIZE - self.dtype.itemsize
        if len(sizes) != 1 or not 0 <= extra < _FILLED:
            return None
        if any(message[:2] != _HEADER for message in messages):
            return None
        padded = np.dtype([("header", "V4"), ("body", self.dtype), ("rest", f"V{extra}")])
        rows = np.frombuffer(b"".join(messages), padded)["body"]
        columns: dict[str, NDArray[Any]] = {}
        for name in self.dtype.names or ():
            stamp, _, part = name.rpartition(".")
            if stamp in self.stamps:
                if part == "sec":
                    columns[stamp] = rows[name] * np.int64(10**9) + rows[f"{stamp}.nanosec"]
                continue
            columns[name] = _widest(rows[name])
        return columns


def _widest(values: NDArray[Any]) -> NDArray[Any]:
    """As an array of the numbers themselves would be: int64 where they fit, float64, bool."""
    if values.dtype.kind == "f":
        return values.astype(np.float64)
    if values.dtype.kind == "b":
        return values.copy()
    if values.dtype.itemsize == 8 and values.dtype.kind == "u" and np.max(values) >= 2**63:
        return values.copy()
    return values.astype(np.int64)


def stamp_of_cdr(data: bytes) -> int:
    """Time in ns of a serialised message that begins with a stamp.

    The stamp follows the four bytes of the encapsulation header, whose second byte is odd for
    little endian.

    Raises:
        struct.error: fewer than 12 bytes.
    """
    sec, nanosec = (_BIG if data[1:2] and not data[1] & 1 else _LITTLE).unpack_from(data, 4)
    return int(sec) * 1_000_000_000 + int(nanosec)


def begins_with_stamp(definition: str) -> bool:
    """Whether messages of a type begin with a stamp, or with a header, which begins with one."""
    own = _PART.split(definition)[0]
    kind = next((kind for kind, _, _, constant in _FIELD.findall(own) if not constant), "")
    return kind in ("builtin_interfaces/Time", "std_msgs/Header", "Header")


def fixed_layout(type_name: str, definition: str) -> FixedLayout | None:
    """Where the numbers of a type lie; None if its messages differ in size or hold texts.

    Args:
        type_name: `package/msg/Name`.
        definition: ros2msg text with all dependencies.
    """
    head, *rest = _PART.split(definition)
    texts = dict(zip(rest[::2], rest[1::2], strict=True))
    package = type_name.partition("/")[0]
    stamps: list[str] = []
    try:
        numbers = list(_numbers(head, package, texts, "", 0, stamps))
        if not numbers:
            return None
        formats = [(f"<{n.kind}", (n.count,)) if n.count else f"<{n.kind}" for n in numbers]
        dtype = np.dtype(
            {
                "names": [number.name for number in numbers],
                "formats": formats,
                "offsets": [number.offset for number in numbers],
                "itemsize": numbers[-1].offset + _size(numbers[-1]),
            }
        )
    except (LookupError, ValueError, OverflowError, RecursionError):
        # texts and lists; or fields that no message can have: doubled, endless, in themselves
        return None
    return FixedLayout(dtype, tuple(stamps))


def _size(number: _Number) -> int:
    return np.dtype(number.kind).itemsize * max(1, number.count)


def _numbers(
    text: str, package: str, texts: dict[str, str], prefix: str, offset: int, stamps: list[str]
) -> Iterator[_Number]:
    """Fields of a message and of those in it, with their places; LookupError: no fixed layout."""
    for kind, array, name, constant in _FIELD.findall(text):
        if constant:
            continue
        counted = _COUNT.fullmatch(array)
        if array and counted is None:
            raise LookupError(array)
        count = int(counted[1]) if counted else 0
        if kind in _NUMBERS:
            if count and kind in _NO_ARRAYS:
                raise LookupError(kind)
            size = np.dtype(_NUMBERS[kind]).itemsize
            number = _Number(prefix + name, _NUMBERS[kind], count, -(-offset // size) * size)
            offset = number.offset + _size(number)
            yield number
            continue
        full = kind if "/" in kind else f"{package}/{kind}"
        if count:
            raise LookupError(full)
        if full in _TIMES:
            stamps.append(prefix + name)
        inside = "int32 sec\nuint32 nanosec" if full in _TIMES else texts[full]
        for number in _numbers(
            inside, full.partition("/")[0], texts, f"{prefix}{name}.", offset, stamps
        ):
            offset = number.offset + _size(number)
            yield number
