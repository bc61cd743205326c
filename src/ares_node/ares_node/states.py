# SPDX-License-Identifier: Apache-2.0
"""Serialization of states and clock without message objects, for the full navigation rate.

NavState and VehicleState have a fixed size: in CDR they are a head and a NumPy record. Making,
filling and converting a message object takes longer than all the rest of its transport.
"""

from struct import Struct
from struct import error as struct_error
from typing import Any

import numpy as np
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import deserialize_message

from ares_node.time import NANOSECONDS

_TYPES: dict[str, np.dtype[Any]] = {"double": np.dtype("<f8"), "uint8": np.dtype("<u1")}
#: First fields of the message classes.
_HEAD_FIELDS = {
    "stamp": "builtin_interfaces/Time",
    "flight_id": "uint64",
    "sequence": "uint32",
}
_HEADS = Struct(">iIQI"), Struct("<iIQI")
_TIME = Struct("<iI")
#: Encapsulation header, which comes first: CDR, little endian.
_LITTLE = b"\x00\x01\x00\x00"
_BEGIN = len(_LITTLE)


class Unreadable(ValueError):
    """Report bytes that are not a message of the expected definition."""


def message_of(data: bytes, kind: Any) -> Any:
    """Deserialize a message of a class from CDR.

    Raises:
        Unreadable: the bytes are not such a message.
    """
    try:
        return deserialize_message(data, kind)
    except rclpy_implementation.RMWError as error:
        raise Unreadable(f"{len(data)} bytes that are no {kind.__name__}") from error


def clock_data(stamp_ns: int) -> bytes:
    """Serialize a Clock message.

    Args:
        stamp_ns: time, ns.
    """
    return _LITTLE + _TIME.pack(*divmod(stamp_ns, NANOSECONDS))


class StateMessage:
    """Serialize and parse a message class that begins with stamp, flight_id and sequence.

    Attributes:
        fields: names of the other fields, in order; fields of the record.
    """

    def __init__(self, kind: Any) -> None:
        """Compute the layout of the fields: CDR aligns each number to its size.

        Raises:
            TypeError: the class begins differently, or a field has no fixed size.
        """
        named: dict[str, str] = kind.get_fields_and_field_types()
        if dict(list(named.items())[:3]) != _HEAD_FIELDS:
            raise TypeError(f"{kind.__name__} does not begin with {', '.join(_HEAD_FIELDS)}")
        self.fields = tuple(named)[3:]
        formats: list[np.dtype[Any]] = []
        offsets: list[int] = []
        end = _HEADS[0].size
        for name in self.fields:
            base, _, length = named[name].removesuffix("]").partition("[")
            if base not in _TYPES or not (length or "1").isdigit():
                raise TypeError(f"{kind.__name__}.{name} is {named[name]}; expected a fixed size")
            number = _TYPES[base]
            offsets.append(-(-end // number.itemsize) * number.itemsize)
            formats.append(np.dtype((number, int(length))) if length else number)
            end = offsets[-1] + formats[-1].itemsize
        layout: Any = {"names": self.fields, "formats": formats, "offsets": offsets}
        layout["itemsize"] = end
        little: np.dtype[np.void] = np.dtype(layout)
        self._layouts = little.newbyteorder(">"), little
        self._buffer = bytearray(_LITTLE) + bytes(little.itemsize)
        self._record = np.frombuffer(self._buffer, little, offset=_BEGIN)
        ends = [_HEADS[0].size]
        ends += [at + form.itemsize for at, form in zip(offsets, formats, strict=True)]
        #: padding between fields, where NumPy may copy bytes of the record
        self._gaps = [
            slice(_BEGIN + before, _BEGIN + after)
            for before, after in zip(ends, offsets, strict=False)
            if before < after
        ]

    def data(self, stamp_ns: int, flight_id: int, sequence: int, record: Any) -> bytes:
        """Serialize a message.

        Args:
            stamp_ns: time, ns.
            flight_id: of the message.
            sequence: number of the state.
            record: fields in the order of `fields`.
        """
        sec, nanosec = divmod(stamp_ns, NANOSECONDS)
        _HEADS[1].pack_into(self._buffer, _BEGIN, sec, nanosec, flight_id, sequence)
        self._record[0] = record
        for gap in self._gaps:
            self._buffer[gap] = bytes(gap.stop - gap.start)
        return bytes(self._buffer)

    def content(self, data: bytes) -> bytes:
        """Return the content of a serialized message, without padding by the middleware."""
        return data[_BEGIN : len(self._buffer)]

    def read(self, data: bytes) -> tuple[int, int, int, Any]:
        """Parse a raw message to stamp in ns, flight_id, sequence and record.

        Raises:
            Unreadable: the data are too short.
        """
        try:
            # the second byte is odd for little endian
            order = data[1] & 1
            sec, nanosec, flight_id, sequence = _HEADS[order].unpack_from(data, _BEGIN)
            record = np.frombuffer(data, self._layouts[order], 1, _BEGIN)[0]
        except (IndexError, ValueError, struct_error) as error:
            raise Unreadable(f"{len(data)} bytes; expected {len(self._buffer)}") from error
        return sec * NANOSECONDS + nanosec, flight_id, sequence, record
