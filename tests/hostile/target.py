# SPDX-License-Identifier: Apache-2.0
"""What is fuzzed: something that takes bytes, and what must never come of it."""

from abc import ABC, abstractmethod
from random import Random
from types import TracebackType
from typing import Self


class Broken(Exception):
    """What no input may bring about; the text is one line."""


def check(holds: bool, words: str) -> None:
    """Raise Broken with the words unless something holds."""
    if not holds:
        raise Broken(words)


def one_line(text: str) -> str:
    """The text of a refusal.

    Raises:
        Broken: it is not one line for a person.
    """
    good = bool(text) and text.isprintable() and "Traceback" not in text and "pydantic" not in text
    check(good, f"not one clear line: {text[:300]!r}")
    return text


class Target(ABC):
    """Something that takes inputs. A context: it may hold files, nodes or a server.

    Attributes:
        name: of the target.
        stateful: what came before an input counts, until `begin` is called again.
        share: of all inputs, per cent: more where one is cheap.
    """

    name = ""
    stateful = False
    share = 0.0

    def __enter__(self) -> Self:
        """Get ready for inputs."""
        self.begin()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Free what is held."""
        self.end()

    def begin(self) -> None:  # noqa: B027, most have nothing to do
        """Start from nothing; once more in the middle: forget what has come."""

    def end(self) -> None:  # noqa: B027
        """Free what `begin` has made."""

    @abstractmethod
    def make(self, random: Random) -> bytes:
        """An input."""

    @abstractmethod
    def run(self, data: bytes) -> str:
        """Give it one input.

        Returns:
            What came of it, in a word, for the counts.

        Raises:
            Broken: what must not be; any other exception must not be either.
        """
