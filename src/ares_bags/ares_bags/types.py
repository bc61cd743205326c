# SPDX-License-Identifier: Apache-2.0
"""Find message classes by name; read stamps and identities from CDR."""

import importlib
from struct import Struct
from typing import TYPE_CHECKING, Any

from ares_bags.errors import BagError
from ares_bags.schema import split_type_name, type_hash

if TYPE_CHECKING:
    from ares_bags.reader import Bag, BagTopic

_LITTLE_FLIGHT = Struct("<QI")
_BIG_FLIGHT = Struct(">QI")
_LITTLE_GUIDANCE = Struct("<Q")
_BIG_GUIDANCE = Struct(">Q")


def message_class(type_name: str) -> Any:
    """Return the Python class of `package/msg/Name`.

    Raises:
        BagError: it is not installed.
    """
    package, name = split_type_name(type_name)
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise BagError(f"message type {type_name} is not installed") from error


def check_installed(bag: "Bag", topic: "BagTopic") -> None:
    """Check that the type of a topic is installed here in the recorded version.

    Raises:
        BagError: the type is not installed, or in another version; one line.
    """
    installed = type_hash(topic.type_name)
    if topic.type_hash and topic.type_hash != installed:
        raise BagError(
            f"bag {bag.path}: topic {topic.name} was recorded with another version of "
            f"{topic.type_name} than the one installed here"
        )


def starts_with_stamp(kind: Any) -> bool:
    """Tell whether a message class begins with a stamp, or with a header, which begins with one."""
    first = next(iter(kind.get_fields_and_field_types().values()), "")
    return first in ("builtin_interfaces/Time", "std_msgs/Header")


def names_its_flight(kind: Any) -> bool:
    """Tell whether a message class begins with a stamp and the identity of a flight."""
    return list(kind.get_fields_and_field_types())[:2] == ["stamp", "flight_id"]


def flight_of_cdr(data: bytes) -> tuple[int, int]:
    """Return flight and, if it is the third field, sequence of a serialized flight message.

    Raises:
        struct.error: fewer than 24 bytes.
    """
    layout = _BIG_FLIGHT if data[1:2] and not data[1] & 1 else _LITTLE_FLIGHT
    flight, sequence = layout.unpack_from(data, 12)
    return int(flight), int(sequence)


def guidance_of_cdr(data: bytes) -> int:
    """Return the guidance of a serialized command or status: its third field.

    Raises:
        struct.error: fewer than 28 bytes.
    """
    (guidance,) = (_LITTLE_GUIDANCE if data[1] & 1 else _BIG_GUIDANCE).unpack_from(data, 20)
    return int(guidance)
