# SPDX-License-Identifier: Apache-2.0
"""The one error of this package."""

import os


class BagError(Exception):
    """A bag cannot be written or read; the text is one line with path and cause."""

    def __init__(self, text: str) -> None:
        super().__init__(printable(text))


def printable(text: str) -> str:
    """A text on one line that a terminal shows as it is: a bag may hold any names."""
    if text.isprintable():
        return text
    escaped = (c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return "".join(escaped)


def cause(error: BaseException) -> str:
    """An error's text on one line; for the operating system's errors without the path."""
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno)
    return " ".join(str(error).split()) or type(error).__name__
