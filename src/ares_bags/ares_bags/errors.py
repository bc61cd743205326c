"""The one error of this package."""

import os


class BagError(Exception):
    """A bag cannot be written or read; the text is one line with path and cause."""


def cause(error: BaseException) -> str:
    """An error's text on one line; for the operating system's errors without the path."""
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno)
    return " ".join(str(error).split()) or type(error).__name__
