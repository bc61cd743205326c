# SPDX-License-Identifier: Apache-2.0
"""Hostile messages of any class: valid ones with some fields changed, as bytes and back."""

import re
from collections.abc import Sequence
from random import Random
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message

from hostile.mutate import changed, number, text

_SIZES = {"int8": 8, "uint8": 8, "octet": 8, "int16": 16, "uint16": 16, "int32": 32, "uint32": 32}
_SIZES |= {"int64": 64, "uint64": 64}
_SEQUENCE = re.compile(r"sequence<([^,>]+)(?:,\s*(\d+))?>")
_ARRAY = re.compile(r"([^\[]+)\[(\d+)\]")
#: Longest list that is made of one without a bound.
_LONG = 40


def _whole(kind: str, random: Random, good: Any) -> Any:
    bits = _SIZES[kind]
    low, high = (0, 2**bits - 1) if kind[0] in "uo" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    near = good if isinstance(good, int) else 0
    value = random.choice((0, 1, low, high, near + 1, near - 1, random.randint(low, high)))
    value = min(max(value, low), high)
    return bytes([value]) if kind == "octet" else value


def _value(kind: str, random: Random, good: Any) -> Any:
    if kind in _SIZES:
        return _whole(kind, random, good)
    if kind in ("double", "float"):
        value = number(random, float(good) if isinstance(good, float) else 1.0)
        return value if kind == "double" or abs(value) < 3e38 else 0.0
    if kind == "boolean":
        return random.random() < 0.5
    if kind.startswith(("string", "wstring")):
        return text(random).replace("\x00", "").encode("utf-8", "replace").decode()
    return good


def _field(kind: str, random: Random, good: Any) -> Any:
    if array := _ARRAY.fullmatch(kind):
        # plain numbers: a message takes no list of NumPy's
        values = good.tolist()
        for at in random.sample(range(len(values)), random.randint(1, len(values))):
            values[at] = _value(array[1], random, values[at])
        return values
    if sequence := _SEQUENCE.fullmatch(kind):
        inner, bound = sequence[1], int(sequence[2] or _LONG)
        if "/" in inner:
            items = list(good)
            for item in items:
                change(item, random)
            return (items * random.choice((0, 1, 1, 2, 9)))[:bound]
        if len(good) and random.random() < 0.5:
            values = list(good)
            for at in random.sample(
                range(len(values)), random.choice((1, 1, 2, len(values))) if len(values) > 1 else 1
            ):
                values[at] = _value(inner, random, values[at])
            return values[:bound]
        return [_value(inner, random, 1.0) for _ in range(random.randint(0, bound))]
    if "/" in kind:
        change(good, random)
        return good
    return _value(kind, random, good)


def change(message: Any, random: Random, kept: Sequence[str] = ()) -> None:
    """Change some fields of a message.

    Args:
        message: what to change.
        random: decides.
        kept: fields that mostly stay, so that it is looked at at all.
    """
    kinds = message.get_fields_and_field_types()
    free = [name for name in kinds if name not in kept or random.random() < 0.1]
    for name in random.sample(free, min(len(free), random.choice((0, 1, 1, 2, 3, len(free))))):
        good = getattr(message, name)
        good = good.item() if hasattr(good, "item") and not hasattr(good, "__len__") else good
        setattr(message, name, _field(kinds[name], random, good))


def hostile(message: Any, random: Random, kept: Sequence[str] = ()) -> bytes:
    """Change some fields of a message; return it as CDR."""
    change(message, random, kept)
    return bytes(serialize_message(message))


def hostile_raw(message: Any, random: Random, kept: Sequence[str] = ()) -> bytes:
    """Do the same, in one case of five with damaged bytes."""
    data = hostile(message, random, kept)
    return changed(data, random) if random.random() < 0.2 else data


def heard(kind: Any, data: bytes) -> Any:
    """Deserialize CDR; None if invalid, which the middleware drops."""
    try:
        return deserialize_message(data, kind)
    except Exception:
        # rclpy raises errors of several types
        return None
