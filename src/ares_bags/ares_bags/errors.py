# SPDX-License-Identifier: Apache-2.0
"""The one error of this package."""

import os


class BagError(Exception):
    """Report in one line, with path and cause, that a bag cannot be read or written."""

    def __init__(self, text: str) -> None:
        super().__init__(printable(text))


def printable(text: str) -> str:
    """Escape unprintable characters, so that a name from a bag cannot control the terminal."""
    if text.isprintable():
        return text
    escaped = (c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return "".join(escaped)


def cause(error: BaseException) -> str:
    """Return an error's text on one line; for errors of the operating system, without the path."""
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno)
    return " ".join(str(error).split()) or type(error).__name__
