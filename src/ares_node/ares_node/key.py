# SPDX-License-Identifier: Apache-2.0
"""Key of a flight, inherited through the environment, and its keyed digests. No ROS."""

import os
import secrets
from collections.abc import Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from hashlib import blake2b

#: Environment variable with the key in hexadecimal digits, for all processes of a flight. On a
#: command line or as a parameter it would be public.
VARIABLE = "ARES_FLIGHT_KEY"
#: Prefix of reports on messages under a forged identity.
FORGED = "forged: "
#: Size of a key and of a digest, bytes.
KEY_SIZE = 32
DIGEST_SIZE = 16


class FlightKeyError(ValueError):
    """Report an unusable key; the text is one line without the key."""


@contextmanager
def new_key(environ: MutableMapping[str, str] = os.environ) -> Iterator[None]:
    """Put a new key into the environment for a block, unless there is one."""
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
    """Read the key of the flight; empty if it has none.

    Raises:
        FlightKeyError: the text is not a key.
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
        data: all its fields in the form of `canonical`.
    """
    return blake2b(kind.encode() + b"\0" + data, key=key, digest_size=DIGEST_SIZE).digest()
