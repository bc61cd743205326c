# SPDX-License-Identifier: Apache-2.0
"""Read the numbers of messages of constant size all at once: each has the same offset in all."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: NumPy type codes of the numbers that a fixed layout may hold.
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
#: Element types whose arrays the one-by-one decoder does not return as lists of numbers.
_NO_ARRAYS = {"bool", "int8", "uint8"}
_TIMES = {"builtin_interfaces/Time", "builtin_interfaces/Duration"}
_PART = re.compile(r"^=+\nMSG: (\S+)\n", re.MULTILINE)
_FIELD = re.compile(r"^[ \t]*([A-Za-z][\w/]*)(\S*)[ \t]+([A-Za-z]\w*)[ \t]*(=?)", re.MULTILINE)
_COUNT = re.compile(r"\[(\d+)\]")
_LITTLE = Struct("<iI")
_BIG = Struct(">iI")
#: Flight time in ns (115 days) above which a stamp is wall-clock time.
WALL_CLOCK_NS = 10**7 * 10**9
#: First bytes of the encapsulation header: plain CDR, little-endian.
_HEADER = b"\x00\x01"
_HEADER_SIZE = 4
#: Alignment in bytes to which a message may be padded.
_FILLED = 4


@dataclass(frozen=True)
class _Number:
    """Hold a field: name, NumPy type code, array length (0 for a scalar) and offset in bytes."""

    name: str
    kind: str
    count: int
    offset: int


@dataclass(frozen=True)
class FixedLayout:
    """Hold the offsets of a message's numbers.

    Attributes:
        dtype: of a message without its header; a stamp `s` is the fields `s.sec` and `s.nanosec`.
        stamps: names of the stamps.
    """

    dtype: np.dtype[Any]
    stamps: tuple[str, ...]

    def columns(self, messages: Sequence[bytes]) -> dict[str, NDArray[Any]] | None:
        """Return the numbers of messages as `Bag.columns` does, without the log time.

        Returns:
            By field name; None if the messages differ in size or encoding, to be decoded singly.
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
    """Widen values to int64 where they fit, else to float64 or bool."""
    if values.dtype.kind == "f":
        return values.astype(np.float64)
    if values.dtype.kind == "b":
        return values.copy()
    if values.dtype.itemsize == 8 and values.dtype.kind == "u" and np.max(values) >= 2**63:
        return values.copy()
    return values.astype(np.int64)


def stamp_of_cdr(data: bytes) -> int:
    """Return the time in ns of a serialized message that begins with a stamp.

    The stamp follows the four bytes of the encapsulation header, whose second byte is odd for
    little endian.

    Raises:
        struct.error: fewer than 12 bytes.
    """
    sec, nanosec = (_BIG if data[1:2] and not data[1] & 1 else _LITTLE).unpack_from(data, 4)
    return int(sec) * 1_000_000_000 + int(nanosec)


def begins_with_stamp(definition: str) -> bool:
    """Tell whether a type begins with a stamp, or with a header, whose first field is one."""
    own = _PART.split(definition)[0]
    kind = next((kind for kind, _, _, constant in _FIELD.findall(own) if not constant), "")
    return kind in ("builtin_interfaces/Time", "std_msgs/Header", "Header")


def fixed_layout(type_name: str, definition: str) -> FixedLayout | None:
    """Return the layout of a type's numbers; None if messages differ in size or hold texts.

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
        # texts, lists; or an invalid definition: a duplicate field, endless or recursive nesting
        return None
    return FixedLayout(dtype, tuple(stamps))


def _size(number: _Number) -> int:
    return np.dtype(number.kind).itemsize * max(1, number.count)


def _numbers(
    text: str, package: str, texts: dict[str, str], prefix: str, offset: int, stamps: list[str]
) -> Iterator[_Number]:
    """Yield the fields of a message and of nested ones; raise LookupError if the size varies."""
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
