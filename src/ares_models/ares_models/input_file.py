# SPDX-License-Identifier: Apache-2.0
"""Reader of input files: YAML 1.2 scalars, no anchors or tags, errors that name the line."""

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

from ares_models.yaml_advice import advise

#: Bounds on size, number of values and nesting, so that any file is read within seconds.
MAX_BYTES = 1 << 18
MAX_VALUES = 1 << 15
MAX_DEPTH = 32

#: Longest text of a file or an option that an error message repeats.
_SHOWN = 60


class Nothing:
    """Stand for an empty value, which no key takes, not even one that may be left out."""


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


#: Largest number of problems in one message: every element of a long list may be wrong.
_MOST_PROBLEMS = 20

#: Known keys for quantities under another name, with a note on the difference.
_COUNTED = ", which counts from the centre"
_SAME = {
    "altitude": ("radius_m", _COUNTED),
    "height": ("radius_m", _COUNTED),
    "max_q_pa": ("max_dynamic_pressure_pa", ""),
    "longitude": ("right_ascension_deg", ", which counts from the inertial x axis"),
}


class InputError(ValueError):
    """Report an unusable file with all its problems in one line.

    Attributes:
        source: the requested file or name.
        problems: all problems, each one line with its key path.
    """

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        self.source = source if source.isprintable() else repr(source)
        self.problems = tuple(problems)
        more = len(self.problems) - _MOST_PROBLEMS
        tail = f"; and {more} more" if more > 0 else ""
        super().__init__(f"{self.source}: {'; also '.join(self.problems[:_MOST_PROBLEMS])}{tail}")

    def __reduce__(self) -> tuple[type["InputError"], tuple[str, tuple[str, ...]]]:
        return type(self), (self.source, self.problems)


@dataclass(frozen=True)
class InputKind:
    """Describe a kind of input file.

    Attributes:
        name: of the kind, one word such as `mission`.
        error: raised for a bad file.
        package: with the shipped files.
        folder: folder of that package.
        may_be_empty: an empty file is a mapping without keys.
    """

    name: str
    error: type[InputError]
    package: str
    folder: str
    may_be_empty: bool = False

    def shipped(self) -> tuple[str, ...]:
        """Return the names of the shipped files, sorted."""
        folder = resources.files(self.package).joinpath(self.folder)
        return tuple(
            sorted(item.name[: -len(".yaml")] for item in folder.iterdir() if _is_yaml(item.name))
        )

    def find(self, name_or_path: str | Path) -> Path:
        """Find the file of a shipped name or of a path.

        Args:
            name_or_path: a text with a path separator or with the ending .yaml or .yml is a path.

        Raises:
            InputError: neither; the text names the shipped files.
        """
        text = str(name_or_path)
        looks_like_path = (
            isinstance(name_or_path, Path) or _is_yaml(text) or "/" in text or "\\" in text
        )
        shipped = self.shipped()
        if text in shipped and not isinstance(name_or_path, Path):
            folder = resources.files(self.package).joinpath(self.folder)
            return Path(str(folder.joinpath(f"{text}.yaml")))
        # os.path.exists accepts over-long names; the reader reports a folder
        if looks_like_path or os.path.exists(text):  # noqa: PTH110
            return Path(text)
        close = difflib.get_close_matches(text.lower(), shipped, n=1, cutoff=0.4)
        beside = f"{text}.yaml"
        if text.isprintable() and os.path.exists(beside):  # noqa: PTH110
            close = [beside]
        hint = f"; did you mean {close[0]}?" if close else ""
        raise self.error(
            f"{self.name} {format_value(text)}",
            [f"no such {self.name}; shipped are {', '.join(shipped)}, or give a file's path{hint}"],
        )


def _is_yaml(name: str) -> bool:
    return name.endswith((".yaml", ".yml"))


def format_path(path: KeyPath) -> str:
    """Format a key path, such as ``stages[0].arcs[1].thrust_n``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            key = part if part.isprintable() and len(part) <= _SHOWN else _short(repr(part))
            text += f".{key}" if text else key
    return text


def format_number(value: float) -> str:
    """Format a number of few digits without padding of the exponent, such as ``1e9``."""
    return re.sub(r"e([-+])0*", lambda found: f"e{found[1]}".rstrip("+"), f"{value:g}")


def format_kilograms(mass: float) -> str:
    """Format a mass, kg, with all digits before the point and six in all at least."""
    return f"{mass:,.0f}" if mass >= 1e5 else f"{mass:,.6g}"


def _short(text: str) -> str:
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def format_value(value: object) -> str:
    """Format a value for an error message, short and on one line."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return "an empty list" if not value else f"a list of {len(value)}"
    if value is None or isinstance(value, Nothing):
        return "empty"
    if isinstance(value, bool):
        return str(value).lower()
    return _short(repr(value))


def _open_at_once(path: str, flags: int) -> int:
    """Open a file without blocking, for the argument ``opener`` of :func:`open`."""
    return os.open(path, flags | os.O_NONBLOCK)


def _read_text(path: Path, kind: InputKind) -> str:
    """Read the text of a regular file; a device or a pipe might never end.

    Raises:
        InputError: not a regular file, or too large.
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
    """Report a size limit that is exceeded; the text is appended to the file's name."""


class _Loader(yaml.BaseLoader):
    """Compose YAML within bounds: the look-ahead of nested lists grows with their square."""

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
        kind: expected kind of file.

    Returns:
        The mapping, and the line (from 1) of every key path.

    Raises:
        InputError: unreadable, not YAML, not a mapping; with the line if known.
    """
    return parse_input(read_text(path, kind), str(path), kind)


def read_text(path: Path, kind: InputKind) -> str:
    """Read the text of a file.

    Args: as in :func:`read_input`.

    Raises:
        InputError: it cannot be read, is not text, or is too large.
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
    """Parse the text of a file into plain data, as :func:`read_input` does.

    Args:
        text: of the file.
        source: name of the file in errors.
        kind: expected kind of file.

    Raises:
        InputError: not YAML, not a mapping, or too large; with the line if known.
    """
    if len(text) > MAX_BYTES:
        raise kind.error(source, [f"is larger than {MAX_BYTES} bytes; not a {kind.name} file"])
    try:
        node = yaml.compose(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        line, what = advise(text, error)
        where = f"line {line}: " if line else ""
        raise kind.error(source, [f"{where}not valid YAML: {what}"]) from error
    except yaml.YAMLError as error:
        what = " ".join(str(error).split())
        raise kind.error(source, [f"not valid YAML: {what}"]) from error
    except (ValueError, OverflowError) as error:
        # an escape beyond the last Unicode character
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
        return Nothing()
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

#: Errors of a whole block, or of a key of another form.
_NOT_THE_BLOCK = (
    "missing",
    "model_type",
    "model_attributes_type",
    "tuple_type",
    "extra_forbidden",
)

_EXPECTED: dict[str, str] = {
    "float_type": "a number{unit}",
    "finite_number": "a finite number{unit}",
    "string_type": "text",
    "string_too_short": "text that is not empty",
    "string_pattern_mismatch": "a name of small letters, digits and underscores",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "dict_type": "a mapping",
    "tuple_type": "a list",
    "out_of_range": "{noun} from {low} to {high}{unit}",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
    "string_too_long": "text of at most {max_length} characters",
    "literal_error": "one of {expected}",
}


def unit_of(key: str | int) -> str:
    """Return the unit of a number by the ending of its key, such as " in kg", or ""."""
    if isinstance(key, str):
        for ending, unit in _UNITS.items():
            if key.endswith(ending):
                return f" in {unit}"
    return ""


def _expected(kind: str, context: dict[str, Any], message: str, path: KeyPath) -> str:
    names = [part for part in path if isinstance(part, str)]
    unit = unit_of(names[-1]) if names else ""
    if kind in _EXPECTED:
        return _EXPECTED[kind].format(**context, unit=unit)
    return message.replace("Input should be ", "")


def by_cause(errors: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Sort ``ValidationError.errors()``: unknown keys first if a key is missing beside them.

    A misspelt key causes both errors, and the unknown key is the more helpful one. A list that is
    too short only because elements of it are wrong is left out.
    """
    lacking = {item["loc"][:-1] for item in errors if item["type"] == "missing"}
    return sorted(
        (item for item in errors if not _short_by_errors(item)),
        key=lambda item: item["type"] != "extra_forbidden" or item["loc"][:-1] not in lacking,
    )


def _short_by_errors(item: Mapping[str, Any]) -> bool:
    """Tell whether a list that is called too short has elements enough, good and bad together."""
    return item["type"] == "too_short" and len(item["input"]) >= item["ctx"]["min_length"]


def explain(
    item: Mapping[str, Any],
    lines: Mapping[KeyPath, int],
    siblings: Callable[[KeyPath], Sequence[str]],
    blocks: Mapping[str, str] | None = None,
) -> str:
    """Explain a pydantic error in one line.

    Args:
        item: element of ``ValidationError.errors()``.
        lines: line of every key path, from :func:`read_input`.
        siblings: function that returns the known keys of the mapping around a location.
        blocks: what is expected in place of a whole block that is missing or of another kind, or of
            a key of another form, by key path.
    """
    kind = item["type"]
    context: dict[str, Any] = item.get("ctx", {})
    # tags of union members are no keys; only the last part may be an unknown key like a tag
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
        elif kind in ("model_type", "model_attributes_type"):
            expected = f"a mapping with keys such as {siblings((*item['loc'], ''))[0]}"
    name = format_path(place) or "the file"
    block = (blocks or {}).get(name) if kind in _NOT_THE_BLOCK else None
    line = _line(place, lines)
    where = f"line {line}: " if line else ""
    if kind == "extra_forbidden" and not block:
        known = siblings(item["loc"])
        close = _meant(str(place[-1]), known)
        hint = f"did you mean {close}?" if close else "known are " + ", ".join(known)
        return f"{where}{name} is not a known key (its value is {format_value(value)}); {hint}"
    if missing:
        if kind == "missing":
            unit = unit_of(place[-1])
            number = isinstance(place[-1], int)
            expected = f"a number{unit}" if unit or number else "a value"
        return f"{where}{name} is missing; expected {block or expected}"
    return f"{where}{name} is {format_value(value)}; expected {block or expected}"


def _meant(word: str, known: Sequence[str]) -> str:
    """Suggest known keys for an unknown one: the same quantity, else a similar spelling."""
    quantity = _quantity(word)
    same = [key for key in known if _quantity(key) == quantity]
    kinds = [key for key in known if f"_{quantity}_" in f"_{_quantity(key)}_"]
    key, how = _SAME.get(quantity, ("", ""))
    others = [key + how] if key in known else []
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return " or ".join((same or kinds or others or close)[:3])


def _quantity(key: str) -> str:
    """Remove the unit at the end of a key, known or not, such as `km`, `deg`, `m_s`."""
    return re.sub(r"(?<=[a-z])(_m)?_(deg|k?[a-zA-Z]\d?)(_s2?)?$", "", key)


def at_line(place: KeyPath, text: str, lines: Mapping[KeyPath, int]) -> str:
    """Prefix a text with the line, if known, and the key that it concerns."""
    line = _line(place, lines)
    return f"line {line}: {format_path(place)} {text}" if line else f"{format_path(place)} {text}"


def _line(place: KeyPath, lines: Mapping[KeyPath, int]) -> int | None:
    """Return the line of a key, or of the innermost enclosing key with a known line."""
    for end in range(len(place), 0, -1):
        if place[:end] in lines:
            return lines[place[:end]]
    return None
