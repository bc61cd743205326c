# SPDX-License-Identifier: Apache-2.0
"""Reading a file that people write: YAML 1.2 scalars, no surprises, errors that name the line."""

import difflib
import os
import re
import stat
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import yaml

#: A file of this size, with so many values so deep in each other, is read within seconds,
#: whatever is in it.
MAX_BYTES = 1 << 18
MAX_VALUES = 1 << 15
MAX_DEPTH = 32

#: Longest text of a file or an option that an error message repeats.
_SHOWN = 60

#: Keys and list indices from the top of the file to a value.
KeyPath = tuple[str | int, ...]

_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_SURROGATE = re.compile("[\ud800-\udfff]")
_PLAIN_TAGS = {
    "tag:yaml.org,2002:str",
    "tag:yaml.org,2002:seq",
    "tag:yaml.org,2002:map",
}


#: So many problems of a file are told at a time: a long list may be wrong from end to end.
_TOLD = 20

#: Keys that say the same in other words, by the word that stands there instead, and how.
_COUNTED = ", which counts from the centre"
_SAME = {"altitude": ("radius_m", _COUNTED), "height": ("radius_m", _COUNTED)}


class InputError(ValueError):
    """A file cannot be used; the text is one line, with all that is wrong.

    Attributes:
        source: the file or name that was asked for.
        problems: every problem found, each one line with its key path.
    """

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        self.source = source if source.isprintable() else repr(source)
        self.problems = tuple(problems)
        more = len(self.problems) - _TOLD
        tail = f"; and {more} more" if more > 0 else ""
        super().__init__(f"{self.source}: {'; also '.join(self.problems[:_TOLD])}{tail}")

    def __reduce__(self) -> tuple[type["InputError"], tuple[str, tuple[str, ...]]]:
        return type(self), (self.source, self.problems)


@dataclass(frozen=True)
class InputKind:
    """A kind of file.

    Attributes:
        name: what one holds, in a word: `mission`.
        error: raised for a bad one.
        package: where the shipped ones are.
        folder: folder of that package.
        may_be_empty: an empty file is a mapping without keys.
    """

    name: str
    error: type[InputError]
    package: str
    folder: str
    may_be_empty: bool = False

    def shipped(self) -> tuple[str, ...]:
        """Names of the files that come with the package, sorted."""
        folder = resources.files(self.package).joinpath(self.folder)
        return tuple(
            sorted(item.name[: -len(".yaml")] for item in folder.iterdir() if _is_yaml(item.name))
        )

    def find(self, name_or_path: str | Path) -> Path:
        """File of a shipped name or of a path.

        Args:
            name_or_path: what holds a path separator or ends in .yaml or .yml is a path.

        Raises:
            InputError: neither; the text names those that are shipped.
        """
        text = str(name_or_path)
        looks_like_path = (
            isinstance(name_or_path, Path) or _is_yaml(text) or "/" in text or "\\" in text
        )
        shipped = self.shipped()
        if text in shipped and not isinstance(name_or_path, Path):
            folder = resources.files(self.package).joinpath(self.folder)
            return Path(str(folder.joinpath(f"{text}.yaml")))
        # a long name is no error here; a folder is told of as one by whoever reads it
        if looks_like_path or os.path.exists(text):  # noqa: PTH110
            return Path(text)
        close = difflib.get_close_matches(text.lower(), shipped, n=1, cutoff=0.4)
        hint = f"; did you mean {close[0]}?" if close else ""
        raise self.error(
            f"{self.name} {format_value(text)}",
            [f"no such {self.name}; shipped are {', '.join(shipped)}, or give a file's path{hint}"],
        )


def _is_yaml(name: str) -> bool:
    return name.endswith((".yaml", ".yml"))


def format_path(path: KeyPath) -> str:
    """A key path as a person writes it: ``stages[0].arcs[1].thrust_n``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            key = part if part.isprintable() and len(part) <= _SHOWN else _short(repr(part))
            text += f".{key}" if text else key
    return text


def format_number(value: float) -> str:
    """A number of few digits as a person writes it: ``1e9``."""
    return re.sub(r"e([-+])0*", lambda found: f"e{found[1]}".rstrip("+"), f"{value:g}")


def _short(text: str) -> str:
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


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
    return _short(repr(value))


def _open_at_once(path: str, flags: int) -> int:
    """A file that has nothing to give does not keep its reader waiting."""
    return os.open(path, flags | os.O_NONBLOCK)


def _read_text(path: Path, kind: InputKind) -> str:
    """Text of a plain file: no device, no pipe, which might never end.

    Raises:
        InputError: not one, or one that is too large.
        OSError, ValueError: it cannot be opened, or is not text.
    """
    source = str(path)
    expected = f"expected a YAML {kind.name} file"
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise kind.error(source, [f"is a directory; {expected}"])
    if not stat.S_ISREG(mode):
        raise kind.error(source, [f"is a device or a pipe; {expected}"])
    with open(path, "rb", opener=_open_at_once) as file:
        content = file.read(MAX_BYTES + 1)
    if content is None:
        raise kind.error(source, [f"cannot be read at once; {expected}"])
    if len(content) > MAX_BYTES:
        raise kind.error(source, [f"is larger than {MAX_BYTES} bytes; not a {kind.name} file"])
    return content.decode("utf-8")


class _TooMuch(Exception):
    """What a file has too much of; the text goes behind its name."""


class _Loader(yaml.BaseLoader):
    """Composes within bounds: what is read ahead of a nested list grows with its square."""

    depth = 0
    values = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.depth > MAX_DEPTH:
            raise _TooMuch("is nested too deeply")
        if self.values > MAX_VALUES:
            raise _TooMuch(f"has more than {MAX_VALUES} values")
        self.depth += 1
        self.values += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def read_input(path: Path, kind: InputKind) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """Read a file into plain data.

    Numbers follow YAML 1.2 (``3.986e14`` is a number, ``010`` is ten, ``yes`` is text).
    Anchors, tags and duplicate keys are refused.

    Args:
        path: the file.
        kind: what it should be.

    Returns:
        The mapping, and the line (from 1) of every key path.

    Raises:
        InputError: unreadable, not YAML, not a mapping; with the line where there is one.
    """
    return parse_input(read_text(path, kind), str(path), kind)


def read_text(path: Path, kind: InputKind) -> str:
    """Read the text of a file.

    Args: as :func:`read_input`.

    Raises:
        InputError: it cannot be read, or is no text, or too large.
    """
    source = str(path)
    expected = f"expected a YAML {kind.name} file"
    try:
        return _read_text(path, kind)
    except InputError:
        raise
    except FileNotFoundError as error:
        raise kind.error(source, [f"no such file; {expected}"]) from error
    except UnicodeDecodeError as error:
        raise kind.error(source, [f"is not text (byte {error.start}); {expected}"]) from error
    except OSError as error:
        raise kind.error(_short(source), [f"cannot be read: {error.strerror}"]) from error
    except ValueError as error:
        raise kind.error(source, [f"cannot be read: {error}"]) from error


def parse_input(
    text: str, source: str, kind: InputKind
) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """Turn the text of a file into plain data, as :func:`read_input` does.

    Args:
        text: of the file.
        source: what errors call it.
        kind: what it should be.

    Raises:
        InputError: not YAML, not a mapping, too much; with the line where there is one.
    """
    if len(text) > MAX_BYTES:
        raise kind.error(source, [f"is larger than {MAX_BYTES} bytes; not a {kind.name} file"])
    try:
        node = yaml.compose(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}: " if mark else ""
        what = " ".join(filter(None, (error.context, error.problem))).replace("\n", " ")
        raise kind.error(source, [f"{where}not valid YAML: {what}"]) from error
    except yaml.YAMLError as error:
        what = " ".join(str(error).split())
        raise kind.error(source, [f"not valid YAML: {what}"]) from error
    except (ValueError, OverflowError) as error:
        # an escape beyond the last character
        raise kind.error(source, [f"not valid YAML: {error}"]) from error
    except _TooMuch as error:
        raise kind.error(source, [f"{error}; not a {kind.name} file"]) from error
    if node is None and kind.may_be_empty:
        return {}, {}
    if node is None:
        raise kind.error(
            source, [f"is empty; expected a mapping with the keys of a {kind.name} file"]
        )
    lines: dict[KeyPath, int] = {}
    data = _construct(node, (), source, lines, set(), kind)
    if not isinstance(data, dict):
        raise kind.error(
            source,
            [f"is {format_value(data)}; expected a mapping with the keys of a {kind.name} file"],
        )
    return data, lines


def _construct(
    node: yaml.Node,
    path: KeyPath,
    source: str,
    lines: dict[KeyPath, int],
    seen: set[int],
    kind: InputKind,
) -> Any:
    line = node.start_mark.line + 1
    lines.setdefault(path, line)

    def refuse(what: str) -> InputError:
        return kind.error(source, [f"line {line}: {format_path(path) or 'the file'} {what}"])

    if id(node) in seen:
        raise refuse("is an alias (*name); expected the value itself")
    seen.add(id(node))
    if node.tag not in _PLAIN_TAGS:
        raise refuse(f"has the YAML tag {node.tag}; expected a plain value")
    if isinstance(node, yaml.ScalarNode):
        if _SURROGATE.search(node.value):
            raise refuse("has half of a character; expected text")
        return _scalar(node)
    if isinstance(node, yaml.SequenceNode):
        return [
            _construct(item, (*path, k), source, lines, seen, kind)
            for k, item in enumerate(node.value)
        ]
    data: dict[str, Any] = {}
    for key_node, value_node in node.value:
        if not isinstance(key_node, yaml.ScalarNode):
            raise refuse("has a list or mapping as a key; expected a name")
        key = key_node.value
        if _SURROGATE.search(key):
            raise refuse("has half of a character in a key; expected text")
        inner = (*path, key)
        if key in data:
            problem = f"is given twice (first in line {lines[inner]}); expected it once"
            at = key_node.start_mark.line + 1
            raise kind.error(source, [f"line {at}: {format_path(inner)} {problem}"])
        lines[inner] = key_node.start_mark.line + 1
        data[key] = _construct(value_node, inner, source, lines, seen, kind)
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


_UNITS = {
    "_m3_s2": "m3/s2",
    "_m2_s2": "m2/s2",
    "_w_m2": "W/m2",
    "_rad_s": "rad/s",
    "_m_s2": "m/s2",
    "_m_s": "m/s",
    "_deg": "deg",
    "_kg": "kg",
    "_m": "m",
    "_n": "N",
    "_s": "s",
    "_h": "h",
}

_EXPECTED: dict[str, str] = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "string_type": "text",
    "string_too_short": "text that is not empty",
    "string_pattern_mismatch": "a name of small letters, digits and underscores",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "dict_type": "a mapping",
    "tuple_type": "a list",
}


def unit_of(key: str | int) -> str:
    """Unit of a number by the ending of its key, such as " in kg"; empty if it has none."""
    if isinstance(key, str):
        for ending, unit in _UNITS.items():
            if key.endswith(ending):
                return f" in {unit}"
    return ""


def _expected(kind: str, context: dict[str, Any], message: str, path: KeyPath) -> str:
    names = [part for part in path if isinstance(part, str)]
    unit = unit_of(names[-1]) if names else ""
    if kind == "out_of_range":
        return f"{context['noun']} from {context['low']} to {context['high']}{unit}"
    if kind == "too_short":
        return f"a list of at least {context['min_length']}"
    if kind == "too_long":
        return f"a list of at most {context['max_length']}"
    if kind == "string_too_long":
        return f"text of at most {context['max_length']} characters"
    if kind == "literal_error":
        return f"one of {context['expected']}"
    if kind in _EXPECTED:
        return _EXPECTED[kind] + (unit if kind in ("float_type", "finite_number") else "")
    return message.replace("Input should be ", "")


def by_cause(errors: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Elements of ``ValidationError.errors()``, keys first that are not known where one is missing.

    A key that is misspelt is both, and the word that stands there says more.
    """
    lacking = {item["loc"][:-1] for item in errors if item["type"] == "missing"}
    return sorted(
        errors,
        key=lambda item: item["type"] != "extra_forbidden" or item["loc"][:-1] not in lacking,
    )


def explain(
    item: Mapping[str, Any],
    lines: Mapping[KeyPath, int],
    siblings: Callable[[KeyPath], Sequence[str]],
) -> str:
    """One pydantic error as one line of ours.

    Args:
        item: element of ``ValidationError.errors()``.
        lines: line of every key path, of :func:`read_input`.
        siblings: keys that the mapping around a location may have.
    """
    kind = item["type"]
    context: dict[str, Any] = item.get("ctx", {})
    # marks of the form that was tried are no keys; a key that is not known may look like one
    own = len(item["loc"]) - 1 if kind == "extra_forbidden" else -1
    place = tuple(
        part
        for k, part in enumerate(item["loc"])
        if k == own or not (isinstance(part, str) and part.startswith("<"))
    )
    value = item["input"]
    if kind == "expected" and "path" in context:
        place = (*place, *context["path"])
        value = context["value"]
        expected = context["expected"]
        missing = value is None
    else:
        missing = kind == "missing"
        expected = _expected(kind, context, item["msg"], place)
        if kind == "expected":
            expected = item["msg"]
    name = format_path(place) or "the file"
    line = _line(place, lines)
    where = f"line {line}: " if line else ""
    if kind == "extra_forbidden":
        known = siblings(item["loc"])
        close = _meant(str(place[-1]), known)
        hint = f"did you mean {close}?" if close else "known are " + ", ".join(known)
        return f"{where}{name} is not a known key (its value is {format_value(value)}); {hint}"
    if missing:
        if kind == "missing":
            unit = unit_of(place[-1])
            number = isinstance(place[-1], int)
            expected = f"a number{unit}" if unit or number else "a value"
        return f"{where}{name} is missing; expected {expected}"
    return f"{where}{name} is {format_value(value)}; expected {expected}"


def _meant(word: str, known: Sequence[str]) -> str:
    """Find the key that a word may stand for: the same quantity, then what is spelled like it."""
    quantity = _quantity(word)
    same = [key for key in known if _quantity(key) == quantity]
    kinds = [key for key in known if f"_{quantity}_" in f"_{_quantity(key)}_"]
    key, how = _SAME.get(quantity, ("", ""))
    others = [key + how] if key in known else []
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return " or ".join((same or kinds or others or close)[:3])


def _quantity(key: str) -> str:
    """Drop the unit at the end of a key, whether it is one of ours or not: `km`, `deg`, `m_s`."""
    return re.sub(r"(?<=[a-z])(_m)?_(deg|k?[a-zA-Z]\d?)(_s2?)?$", "", key)


def at_line(place: KeyPath, text: str, lines: Mapping[KeyPath, int]) -> str:
    """Return a text behind the line, if it is known, and the key that it is about."""
    line = _line(place, lines)
    return f"line {line}: {format_path(place)} {text}" if line else f"{format_path(place)} {text}"


def _line(place: KeyPath, lines: Mapping[KeyPath, int]) -> int | None:
    """Line of a key, or of the nearest thing around it."""
    for end in range(len(place), 0, -1):
        if place[:end] in lines:
            return lines[place[:end]]
    return None
