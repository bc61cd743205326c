# SPDX-License-Identifier: Apache-2.0
"""YAML files with comments from their schema: description, unit and range of every key.

Descriptions, ranges and defaults come from the models only.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ares_models.input_file import KeyPath, unit_of
from ares_models.input_model import models_in

_PLAIN_TEXT = re.compile(r"[A-Za-z][\w ,.;()/'-]*")
_WORDS = {"null", "true", "false"}

#: A key of the schema: its top-level key, its own name, its description.
_SchemaKey = tuple[str, str, str | None]


def commented(
    model: type[BaseModel], data: Mapping[str, Any], reasons: Mapping[KeyPath, str] | None = None
) -> str:
    """Write plain data as YAML with a comment on the first occurrence of each key.

    Keys that are missing in the data are written commented out, with their default.

    Args:
        model: the schema.
        data: content of the file; fits the schema.
        reasons: comments that replace the schema's, by key path.
    """
    writer = _Writer(reasons or {}, set(_used(model, data)))
    return "\n".join(writer.mapping(model, data, ())) + "\n"


def allowed(annotation: Any, key: str) -> str:
    """Describe the allowed values: ranges with unit, choices; empty if anything is allowed."""
    unit = unit_of(key).replace(" in ", " ")
    found = dict.fromkeys(_limits(annotation))
    return " or ".join(f"{text}{unit}" if text[-1].isdigit() else text for text in found)


def _limits(annotation: Any) -> Iterator[str]:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        yield ", ".join(map(str, arguments))
    elif origin is Annotated:
        bounds = [str(note) for note in arguments[1:] if hasattr(note, "low")]
        yield from bounds or _limits(arguments[0])
    elif origin in (Union, UnionType):
        for inner in arguments:
            yield from _limits(inner)
    elif origin is tuple and not models_in(annotation):
        each = [", ".join(_limits(inner)) for inner in arguments if inner is not Ellipsis]
        yield each[0] if len(set(each)) == 1 else f"[{', '.join(each)}]"


def _lists(annotation: Any) -> bool:
    """Return whether a type annotation is, or contains, a list."""
    return get_origin(annotation) is tuple or any(map(_lists, get_args(annotation)))


def _form(models: Iterable[type[BaseModel]], data: Mapping[str, Any]) -> type[BaseModel]:
    """Find the first model that knows all keys of a mapping."""
    return next(model for model in models if set(data) <= set(model.model_fields))


def _used(model: type[BaseModel], data: Mapping[str, Any], top: str = "") -> Iterator[_SchemaKey]:
    """List all keys of a file."""
    for key, value in data.items():
        info = model.model_fields[key]
        yield top or key, key, info.description
        models = models_in(info.rebuild_annotation())
        for item in value if isinstance(value, list) else [value]:
            if models:
                yield from _used(_form(models, item), item, top or key)


class _Writer:
    """Write the lines of a file, each comment once."""

    def __init__(self, reasons: Mapping[KeyPath, str], used: set[_SchemaKey]) -> None:
        self._reasons = reasons
        self._used = used
        self._written: set[_SchemaKey] = set()
        self._top = ""

    def mapping(
        self, model: type[BaseModel], data: Mapping[str, Any], path: KeyPath
    ) -> Iterator[str]:
        """Write a mapping; keys that occur nowhere in the file are commented out."""
        for key, info in model.model_fields.items():
            self._top = str(path[0]) if path else key
            if key in data:
                yield from self._value(key, info, data[key], (*path, key))
            elif (self._top, key, info.description) not in self._used | self._written:
                yield from (f"# {line}" for line in self._left_out(key, info))

    def _value(self, key: str, info: FieldInfo, value: Any, path: KeyPath) -> Iterator[str]:
        models = models_in(info.rebuild_annotation())
        comment = self._comment(key, info, self._reasons.get(path))
        if not models:
            yield f"{key}: {scalar(value)}{comment}"
            return
        if len(path) == 1:
            yield ""
        yield f"{key}:{comment}"
        if isinstance(value, list):
            for k, item in enumerate(value):
                yield from _item(self.mapping(_form(models, item), item, (*path, k)))
            return
        form = _form(models, value)
        yield from (f"  {line}" for line in self.mapping(form, value, path))
        for other in models:
            if other is not form:
                yield "# or in its place"
                yield f"# {key}:"
                yield from (f"#   {line}" for line in self._all_left_out(other))

    def _all_left_out(self, model: type[BaseModel]) -> Iterator[str]:
        for key, info in model.model_fields.items():
            yield from self._left_out(key, info)

    def _left_out(self, key: str, info: FieldInfo) -> Iterator[str]:
        """Write a missing key with its default."""
        annotation = info.rebuild_annotation()
        default = None if info.is_required() else info.default
        comment = self._comment(key, info, None)
        models = models_in(annotation)
        if not models:
            yield f"{key}:{'' if default is None else ' ' + scalar(default)}{comment}"
            return
        yield f"{key}:{comment}"
        for model in models:
            lines = self._all_left_out(model)
            if _lists(annotation):
                yield from _item(lines)
            else:
                yield from (f"  {line}" for line in lines)

    def _comment(self, key: str, info: FieldInfo, reason: str | None) -> str:
        entry = (self._top, key, info.description)
        if reason is None and entry not in self._written:
            limits = allowed(info.rebuild_annotation(), key)
            reason = "; ".join(filter(None, (info.description, limits)))
        self._written.add(entry)
        return f"  # {reason}" if reason else ""


def _item(lines: Iterable[str]) -> Iterator[str]:
    """Indent the lines of a mapping as an item of a list."""
    first, *rest = lines
    yield f"  - {first}"
    yield from (f"    {line}" for line in rest)


def scalar(value: Any) -> str:
    """Format a value on one line of YAML 1.2."""
    if isinstance(value, tuple) and len(value) == 1:
        # one value for all components
        return scalar(value[0])
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(scalar, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {scalar(item)}" for key, item in value.items()) + "}"
    if isinstance(value, float) and value and not 1e-3 <= abs(value) < 1e9:
        return np.format_float_scientific(value, trim="0", exp_digits=1).replace("e+", "e")
    if isinstance(value, str) and (not _PLAIN_TEXT.fullmatch(value) or value.lower() in _WORDS):
        return json.dumps(value, ensure_ascii=False)
    return str(value)
