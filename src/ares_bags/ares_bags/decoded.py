# SPDX-License-Identifier: Apache-2.0
"""Traverse the objects into which mcap-ros2-support decodes messages."""

import io
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from types import SimpleNamespace
from typing import Any


@contextmanager
def quiet() -> Iterator[None]:
    """Silence standard error, on which the definition parser prints errors that it also raises."""
    with redirect_stderr(io.StringIO()):
        yield


def is_message(value: Any) -> bool:
    """Tell whether a value is a (nested) message."""
    return isinstance(value, SimpleNamespace)


def fields(message: Any) -> Iterator[tuple[str, Any]]:
    """Yield name and value of a message's fields, in the order of its definition."""
    for name in type(message).__slots__:
        yield name, getattr(message, name)


def stamp_ns(message: Any) -> int | None:
    """Return the time in ns of a nested builtin_interfaces/Time or Duration; None for others."""
    if type(message).__slots__ != ["sec", "nanosec"]:
        return None
    # the decoder takes sec as unsigned
    sec = message.sec - 2**32 if message.sec >= 2**31 else message.sec
    return int(sec) * 10**9 + int(message.nanosec)


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every number and text of a decoded message by name (`header.stamp.sec`, `a[2]`)."""
    if is_message(value):
        for key, item in fields(value):
            yield from leaves(item, f"{name}.{key}" if name else key)
    elif isinstance(value, (str, bytes, bool, int, float)):
        yield name, value
    else:
        items = list(value)
        yield f"{name}.length", len(items)
        for number, item in enumerate(items):
            yield from leaves(item, f"{name}[{number}]")


def numbers(message: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield name and value of each numeric field: a number, or a non-empty list of numbers.

    A stamp is one number, in ns; nested names are joined with a dot.
    """
    for key, item in fields(message):
        if is_message(item):
            time = stamp_ns(item)
            if time is None:
                yield from numbers(item, f"{prefix}{key}.")
            else:
                yield prefix + key, time
        elif isinstance(item, (bool, int, float)):
            yield prefix + key, item
        elif not isinstance(item, (str, bytes)):
            row = list(item)
            if row and all(isinstance(number, (bool, int, float)) for number in row):
                yield prefix + key, row
