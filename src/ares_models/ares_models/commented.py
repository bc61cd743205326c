# SPDX-License-Identifier: Apache-2.0
"""A file as its schema explains it: every key with what it is, its unit and its range.

Nothing is said here that the models do not say: they hold descriptions, ranges and defaults.
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

_PLAIN_TEXT = re.compile(r"[A-Za-z][\w ,.;()/'-]*")
_WORDS = {"null", "true", "false"}

#: A key of the schema by the top-level key that it stands under, and its description.
_Told = tuple[str, str, str | None]


def commented(
    model: type[BaseModel], data: Mapping[str, Any], reasons: Mapping[KeyPath, str] | None = None
) -> str:
    """Plain data as YAML with a comment on each key, where it stands for the first time.

    Keys that the data leaves out follow commented out, with their default.

    Args:
        model: the schema.
        data: what the file holds; fits the schema.
        reasons: of values, by their key paths; they stand in place of what the schema says.
    """
    writer = _Writer(reasons or {}, set(_used(model, data)))
    return "\n".join(writer.mapping(model, data, ())) + "\n"


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """The models that a type may be, in order."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in models_in(inner)]


def allowed(annotation: Any, key: str) -> str:
    """What a value may be, in words: ranges with their unit, choices; empty if it may be all."""
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
    """Whether a type is a list of something, or may be one."""
    return get_origin(annotation) is tuple or any(map(_lists, get_args(annotation)))


def _form(models: Iterable[type[BaseModel]], data: Mapping[str, Any]) -> type[BaseModel]:
    """The model whose keys a mapping has."""
    return next(model for model in models if set(data) <= set(model.model_fields))


def _used(model: type[BaseModel], data: Mapping[str, Any], top: str = "") -> Iterator[_Told]:
    """Everything that stands in a file."""
    for key, value in data.items():
        info = model.model_fields[key]
        yield top or key, key, info.description
        models = models_in(info.rebuild_annotation())
        for item in value if isinstance(value, list) else [value]:
            if models:
                yield from _used(_form(models, item), item, top or key)


class _Writer:
    """Lines of a file, and what has been told in them."""

    def __init__(self, reasons: Mapping[KeyPath, str], used: set[_Told]) -> None:
        self._reasons = reasons
        self._used = used
        self._told: set[_Told] = set()
        self._top = ""

    def mapping(
        self, model: type[BaseModel], data: Mapping[str, Any], path: KeyPath
    ) -> Iterator[str]:
        """Lines of a mapping: what is in it, and commented out what is nowhere in the file."""
        for key, info in model.model_fields.items():
            self._top = str(path[0]) if path else key
            if key in data:
                yield from self._value(key, info, data[key], (*path, key))
            elif (self._top, key, info.description) not in self._used | self._told:
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
        """A key with its default."""
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
        told = (self._top, key, info.description)
        if reason is None and told not in self._told:
            limits = allowed(info.rebuild_annotation(), key)
            reason = "; ".join(filter(None, (info.description, limits)))
        self._told.add(told)
        return f"  # {reason}" if reason else ""


def _item(lines: Iterable[str]) -> Iterator[str]:
    """Lines of a mapping as an item of a list."""
    first, *rest = lines
    yield f"  - {first}"
    yield from (f"    {line}" for line in rest)


def scalar(value: Any) -> str:
    """A value on one line, as YAML 1.2 reads it."""
    if isinstance(value, tuple) and len(value) == 1:
        # one for all
        return scalar(value[0])
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(scalar, value)) + "]"
    if isinstance(value, float) and value and not 1e-3 <= abs(value) < 1e9:
        return np.format_float_scientific(value, trim="0", exp_digits=1).replace("e+", "e")
    if isinstance(value, str) and (not _PLAIN_TEXT.fullmatch(value) or value.lower() in _WORDS):
        return json.dumps(value, ensure_ascii=False)
    return str(value)
