# SPDX-License-Identifier: Apache-2.0
"""Answer `--help`, unknown and missing words before anything is imported or prepared.

Standard library only: `./ares` uses it in a clone without any installed package. The words of all
verbs are in `usage.json`, which `make usage` writes from the command line itself; a test compares
the two.
"""

import difflib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

HELP_WORDS = ("-h", "--help")
EXIT_BAD_INPUT = 2


class Answer(NamedTuple):
    """Hold the answer to a call that needs no verb: exit status, help text, refusal."""

    status: int
    out: str = ""
    refusal: str = ""


def read_usage() -> dict[str, Any]:
    """Read the tree of commands that `tools/usage.py` describes."""
    text = Path(__file__).with_name("usage.json").read_text(encoding="utf-8")
    tree: dict[str, Any] = json.loads(text)
    return tree


def answer(words: Sequence[str], also: Sequence[str] = ()) -> Answer | None:
    """Answer a call that asks for help, has an unknown verb or option, or lacks an argument.

    Args:
        words: the call without the program's name.
        also: further verbs of the caller.

    Returns:
        None if the verb must parse the call itself.
    """
    command, path, left = read_usage(), "ares", list(words)
    while "commands" in command:
        commands = command["commands"]
        word = left[0] if left else ""
        if not left and "default" not in command:
            return _refuse("Missing command", path)
        if word in HELP_WORDS:
            return Answer(0, command["help"])
        if word in commands:
            left.pop(0)
        elif word in also and path == "ares":
            return None
        elif "default" in command:
            word = command["default"]
        elif word.startswith("-") and len(word) > 1:
            return _read_options(command, path, left)
        else:
            known = [*commands, *also]
            return _refuse(f"No such command {word!r}{did_you_mean(word, known)}", path)
        command = commands[word]
        path = f"{path} {word}"
    return _read_options(command, path, left)


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """Suggest the known word closest in spelling; "" if none is close."""
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"; did you mean {close[0]}?" if close else ""


def _refuse(reason: str, path: str) -> Answer:
    return Answer(EXIT_BAD_INPUT, "", f"{reason} (see `{path} --help`)")


def _read_options(command: dict[str, Any], path: str, words: list[str]) -> Answer | None:
    """Look for a request of help, for unknown options and for what is missing."""
    values: dict[str, int] = command["options"]
    known = [*values, *HELP_WORDS]
    passes_on = command.get("passes_on", False)
    left = words[:1] if passes_on else list(words)
    needed: dict[str, list[str]] = command.get("needed", {"argument": [], "option": []})
    lacking = {kind: list(names) for kind, names in needed.items()}
    while left:
        word = left.pop(0)
        if word == "--":
            del lacking["argument"][: len(left)]
            break
        if word in HELP_WORDS:
            return Answer(0, command["help"])
        name = word.partition("=")[0]
        if word in values:
            del left[: values[word]]
        elif word.startswith("--") and name not in values and not passes_on:
            return _refuse(f"No such option: {name}{did_you_mean(name, known)}", path)
        if name in lacking["option"]:
            lacking["option"].remove(name)
        elif word == "-" or not word.startswith("-"):
            del lacking["argument"][:1]
    for kind, names in lacking.items():
        if names:
            return _refuse(f"Missing {kind} {names[0]!r}", path)
    return None
