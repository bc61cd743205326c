# SPDX-License-Identifier: Apache-2.0
"""Targets of fuzzing: consumers of bytes, and results that must never occur."""

from abc import ABC, abstractmethod
from random import Random
from typing import Self


class Broken(Exception):
    """Report in one line a result that no input may cause."""


def check(holds: bool, words: str) -> None:
    """Raise Broken with the words unless something holds."""
    if not holds:
        raise Broken(words)


def one_line(text: str) -> str:
    """Return the text of a refusal, checked.

    Raises:
        Broken: it is not one readable line.
    """
    good = bool(text) and text.isprintable() and "Traceback" not in text and "pydantic" not in text
    check(good, f"not one clear line: {text[:300]!r}")
    return text


class Target(ABC):
    """Take inputs. A context manager, which may hold files, nodes or a server.

    Attributes:
        name: of the target.
        stateful: earlier inputs have effects, until `begin` is called again.
        share: of all inputs, percent: more for cheap ones.
    """

    name = ""
    stateful = False
    share = 0.0

    def __enter__(self) -> Self:
        """Prepare for inputs."""
        self.begin()
        return self

    def __exit__(self, *_: object) -> None:
        """Free what is held."""
        self.end()

    def begin(self) -> None:  # noqa: B027, most have nothing to do
        """Start from nothing; once more in the middle: forget what has come."""

    def end(self) -> None:  # noqa: B027
        """Free what `begin` has made."""

    @abstractmethod
    def make(self, random: Random) -> bytes:
        """Make an input."""

    @abstractmethod
    def run(self, data: bytes) -> str:
        """Give it one input.

        Returns:
            What came of it, in a word, for the counts.

        Raises:
            Broken: what must not be; any other exception must not be either.
        """
