"""Reading a mission file: YAML 1.2 scalars, no surprises, errors that name the line."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

MAX_BYTES = 1 << 20

#: Keys and list indices from the top of the file to a value.
KeyPath = tuple[str | int, ...]

_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_PLAIN_TAGS = {
    "tag:yaml.org,2002:str",
    "tag:yaml.org,2002:seq",
    "tag:yaml.org,2002:map",
}


class MissionError(ValueError):
    """A mission cannot be used; the text is one line.

    Attributes:
        source: the file or name that was asked for.
        problems: every problem found, each one line with its key path.
    """

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        self.source = source
        self.problems = tuple(problems)
        more = len(self.problems) - 1
        tail = f" (and {more} more)" if more else ""
        super().__init__(f"{source}: {self.problems[0]}{tail}")

    def __reduce__(self) -> tuple[type["MissionError"], tuple[str, tuple[str, ...]]]:
        return type(self), (self.source, self.problems)


def format_path(path: KeyPath) -> str:
    """A key path as a person writes it: ``stages[0].arcs[1].thrust_n``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{part}" if text else part
    return text


def format_value(value: object) -> str:
    """A value for an error message, short and on one line."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return "an empty list" if not value else f"a list of {len(value)}"
    if value is None:
        return "empty"
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def read_mission_file(path: Path) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """Read a mission file into plain data.

    Numbers follow YAML 1.2 (``3.986e14`` is a number, ``010`` is ten, ``yes`` is text).
    Anchors, tags and duplicate keys are refused.

    Args:
        path: the file.

    Returns:
        The mapping, and the line (from 1) of every key path.

    Raises:
        MissionError: unreadable, not YAML, not a mapping; with the line where there is one.
    """
    source = str(path)
    try:
        if path.is_dir():
            raise MissionError(source, ["is a directory; expected a YAML mission file"])
        if path.stat().st_size > MAX_BYTES:
            raise MissionError(source, [f"is larger than {MAX_BYTES} bytes; not a mission file"])
        text = path.read_text("utf-8")
    except FileNotFoundError as error:
        raise MissionError(source, ["no such file; expected a YAML mission file"]) from error
    except UnicodeDecodeError as error:
        raise MissionError(
            source, [f"is not text (byte {error.start}); expected a YAML mission file"]
        ) from error
    except OSError as error:
        raise MissionError(source, [f"cannot be read: {error.strerror}"]) from error
    try:
        node = yaml.compose(text, Loader=yaml.BaseLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}: " if mark else ""
        what = " ".join(filter(None, (error.context, error.problem))).replace("\n", " ")
        raise MissionError(source, [f"{where}not valid YAML: {what}"]) from error
    except yaml.YAMLError as error:
        what = " ".join(str(error).split())
        raise MissionError(source, [f"not valid YAML: {what}"]) from error
    except RecursionError as error:
        raise MissionError(source, ["is nested too deeply; not a mission file"]) from error
    if node is None:
        raise MissionError(source, ["is empty; expected a mapping with the keys of a mission"])
    lines: dict[KeyPath, int] = {}
    data = _construct(node, (), source, lines, set())
    if not isinstance(data, dict):
        raise MissionError(
            source, [f"is {format_value(data)}; expected a mapping with the keys of a mission"]
        )
    return data, lines


def _construct(
    node: yaml.Node, path: KeyPath, source: str, lines: dict[KeyPath, int], seen: set[int]
) -> Any:
    line = node.start_mark.line + 1
    lines.setdefault(path, line)

    def refuse(what: str) -> MissionError:
        return MissionError(source, [f"line {line}: {format_path(path) or 'the file'} {what}"])

    if id(node) in seen:
        raise refuse("is an alias (*name); expected the value itself")
    seen.add(id(node))
    if node.tag not in _PLAIN_TAGS:
        raise refuse(f"has the YAML tag {node.tag}; expected a plain value")
    if isinstance(node, yaml.ScalarNode):
        return _scalar(node)
    if isinstance(node, yaml.SequenceNode):
        return [
            _construct(item, (*path, k), source, lines, seen) for k, item in enumerate(node.value)
        ]
    data: dict[str, Any] = {}
    for key_node, value_node in node.value:
        if not isinstance(key_node, yaml.ScalarNode):
            raise refuse("has a list or mapping as a key; expected a name")
        key = key_node.value
        inner = (*path, key)
        if key in data:
            problem = f"is given twice (first in line {lines[inner]}); expected it once"
            at = key_node.start_mark.line + 1
            raise MissionError(source, [f"line {at}: {format_path(inner)} {problem}"])
        lines[inner] = key_node.start_mark.line + 1
        data[key] = _construct(value_node, inner, source, lines, seen)
    return data


def _scalar(node: yaml.ScalarNode) -> object:
    text = node.value
    if node.style is not None:
        return text
    if text in ("", "~", "null", "Null", "NULL"):
        return None
    if text in ("true", "True", "TRUE"):
        return True
    if text in ("false", "False", "FALSE"):
        return False
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _SPECIAL.fullmatch(text):
        return float(text.replace(".", ""))
    return text
