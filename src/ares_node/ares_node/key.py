# SPDX-License-Identifier: Apache-2.0
"""The key of a flight: handed over in the environment, and keyed digests by it. No ROS."""

import os
import secrets
from collections.abc import Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from hashlib import blake2b

#: Holds the key in hexadecimal digits, for every process of a flight. On a command line, or as a
#: parameter, everybody would see it.
VARIABLE = "ARES_FLIGHT_KEY"
#: What a report begins with on a message that somebody has said in a name that is not his.
FORGED = "forged: "
#: Bytes of a key, and of a digest.
KEY_SIZE = 32
DIGEST_SIZE = 16


class FlightKeyError(ValueError):
    """The key cannot be used; the text is one line and does not hold it."""


@contextmanager
def new_key(environ: MutableMapping[str, str] = os.environ) -> Iterator[None]:
    """Hold a key for a flight, which its processes inherit; one that was given stays."""
    given = environ.get(VARIABLE)
    if given:
        yield
        return
    environ[VARIABLE] = secrets.token_hex(KEY_SIZE)
    try:
        yield
    finally:
        del environ[VARIABLE]


def flight_key(environ: Mapping[str, str] = os.environ) -> bytes:
    """Read the key of the flight; empty where it has none.

    Raises:
        FlightKeyError: it is no key.
    """
    text = environ.get(VARIABLE, "")
    try:
        key = bytes.fromhex(text)
    except ValueError:
        key = b"?"
    if text and len(key) != KEY_SIZE:
        raise FlightKeyError(f"{VARIABLE} is no key; expected {2 * KEY_SIZE} hexadecimal digits")
    return key


def digest(key: bytes, kind: str, data: bytes) -> bytes:
    """Return the keyed digest of a message.

    Args:
        key: of the flight.
        kind: name of the message's type.
        data: all its fields, as `canonical` writes them.
    """
    return blake2b(kind.encode() + b"\0" + data, key=key, digest_size=DIGEST_SIZE).digest()
