# SPDX-License-Identifier: Apache-2.0
"""Generate input files from a schema: at each bound, beyond it, and absurd.

The models define the values to try, so a new key needs no change here.
"""

import copy
import hashlib
import json
import math
import re
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel

from ares_models.ranges import Range
from ares_vehicle_sim.dispersions import SpreadRange

#: Keys and indices from the top of a file.
Path = tuple[str | int, ...]

_MISSING = object()
_DELETED = object()
#: Stands for a value in the text of a file; in no file.
_PLACE = "\0"
_PLACE_TEXT = json.dumps(_PLACE)

#: Tokens that JSON and YAML write differently, and texts, which stay unchanged.
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|-?Infinity|NaN')
_NOT_FINITE = {"Infinity": ".inf", "-Infinity": "-.inf", "NaN": ".nan"}

#: Numbers that no key accepts.
ABSURD_NUMBERS = (1e308, -1e308, math.inf, -math.inf, math.nan)
#: Values that are no numbers, choices, lists or mappings.
NO_NUMBERS: tuple[object, ...] = (True, "1.0", "", [1.0], {"value": 1.0})
NO_CHOICES: tuple[object, ...] = ("no such choice", True, [])
NO_LISTS: tuple[object, ...] = ([], None, 1.0, "x", {}, [None])
NO_MAPPINGS: tuple[object, ...] = ({}, [], None, 1.0, "x")
#: A subnormal number, which has lost most of its digits.
TINY = 1e-320
#: More items than any list has room for.
TOO_MANY = 300
#: Factors of a slip of the pen on a valid number.
SLIPS = (0.1, 1.1, 10.0)
TEXTS = ("", "x" * 81, "two\nlines", "bell\a", "\ud800", "1", "~", 1.0, True, None, ["x"])
DATES = (
    "1900-01-01",
    "2200-12-31T23:59:59Z",
    "1899-12-31T23:59:59Z",
    "0001-01-01T00:00:00+14:00",
    "9999-12-31T23:59:59-14:00",
    "2010-02-30",
    "now",
    0,
    None,
)


@dataclass(frozen=True)
class Input:
    """Hold one file.

    Attributes:
        base: name of the file from which it is derived.
        path: keys of the changed value.
        value: the new value.
        whole: that file.
        fit: False: no file with this value is valid; True: the schema names the value, so that it
            can only be invalid in combination; None: unknown.
    """

    base: str
    path: Path
    value: Any = field(repr=False)
    whole: Mapping[str, Any] = field(repr=False)
    fit: bool | None

    @property
    def data(self) -> dict[str, Any]:
        """Return the file; made anew each time, since there are very many."""
        return _put(self.whole, self.path, self.value)

    def __str__(self) -> str:
        place = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in self.path)
        return f"{self.base}: {place.lstrip('.')} = {_short(to_yaml(self.value))}"


def _short(text: str) -> str:
    return text if len(text) < 80 else text[:77] + "..."


def to_yaml(value: Any) -> str:
    """Write plain data in the flow style of YAML 1.2: JSON except for non-finite numbers."""
    if value is _DELETED:
        return "(absent)"
    text = json.dumps(value)
    if not any(name in text for name in _NOT_FINITE):
        return text
    return _TOKEN.sub(lambda token: _NOT_FINITE.get(token[0], token[0]), text)


def inputs(model: type[BaseModel], bases: Mapping[str, Mapping[str, Any]]) -> Iterator[Input]:
    """Yield every base with every value of every key, one change at a time, each file once.

    Args:
        model: the schema.
        bases: valid files by name; values missing in all of them are made from the schema.
    """
    seen = set()
    for name, base in bases.items():
        around: dict[Path, tuple[str, ...]] = {}
        for path, value, fit in _mapping(model, dict(base), ()):
            if value is _DELETED:
                text = json.dumps(_put(base, path, value))
            else:
                # what stands beside the value is the same for each
                if path not in around:
                    around[path] = tuple(json.dumps(_put(base, path, _PLACE)).split(_PLACE_TEXT))
                text = json.dumps(value).join(around[path])
            # the texts of all files are a GB
            mark = hashlib.blake2b(text.encode(), digest_size=16).digest()
            if mark not in seen:
                seen.add(mark)
                yield Input(name, path, value, base, fit)


def used_keys(model: type[BaseModel], data: Mapping[str, Any]) -> set[tuple[str, str]]:
    """Return model and key of every entry of a file."""
    found = set()
    for key, info in model.model_fields.items():
        if key in data:
            found.add((model.__name__, key))
            found |= _used(info.rebuild_annotation(), data[key])
    return found


def all_keys(model: type[BaseModel]) -> set[tuple[str, str]]:
    """Return model and key of every entry of a schema."""
    found = {(model.__name__, key) for key in model.model_fields}
    for info in model.model_fields.values():
        for part in _models(info.rebuild_annotation()):
            found |= all_keys(part)
    return found


def _models(annotation: Any) -> set[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return {annotation}
    return set().union(*(_models(inner) for inner in get_args(annotation)))


def _used(annotation: Any, value: Any) -> set[tuple[str, str]]:
    values = value if isinstance(value, list) else [value]
    found = set()
    for item in values:
        if isinstance(item, dict):
            part = _form(_models(annotation), item)
            found |= used_keys(part, item) if part else set()
    return found


def _form(forms: set[type[BaseModel]], data: Mapping[str, Any]) -> type[BaseModel] | None:
    """Return the smallest model that has all keys of a mapping; None if there is none."""
    fits = [form for form in forms if set(data) <= set(form.model_fields)]
    return min(fits, key=lambda form: len(form.model_fields), default=None)


def _put(base: Mapping[str, Any], path: Path, value: Any) -> dict[str, Any]:
    """Copy data with one value changed or deleted; share all that is beside the path."""
    data = dict(base)
    at: Any = data
    for key in path[:-1]:
        at[key] = copy.copy(at[key])
        at = at[key]
    if value is _DELETED:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return data


_Change = tuple[Path, Any, bool | None]


def _mapping(model: type[BaseModel], data: dict[str, Any], path: Path) -> Iterator[_Change]:
    """Yield changes inside a mapping of a model."""
    for key, info in model.model_fields.items():
        annotation = info.rebuild_annotation()
        here = (*path, key)
        if key in data:
            yield here, _DELETED, False if info.is_required() else None
        yield from _changes(annotation, data.get(key, _MISSING), here)
    yield (*path, "no_such_key"), 1.0, False


def _changes(annotation: Any, value: Any, path: Path) -> Iterator[_Change]:
    """Yield changes of one value, by its type in the schema."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        yield from _annotated(arguments[0], arguments[1:], value, path)
    elif origin is Literal:
        yield from ((path, choice, True) for choice in arguments)
        yield from ((path, wrong, False) for wrong in NO_CHOICES)
        yield from ((path, other, None) for other in (1.0, None))
    elif origin in (Union, types.UnionType):
        yield from _union(arguments, value, path)
    elif origin is tuple:
        yield from _list(arguments, value, path)
    elif annotation is datetime:
        yield from ((path, date, None) for date in DATES)
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield from _whole(annotation, value, path)
    elif annotation is str:
        yield from ((path, text, None) for text in TEXTS)


def _annotated(inner: Any, notes: tuple[Any, ...], value: Any, path: Path) -> Iterator[_Change]:
    for note in notes:
        if isinstance(note, Range):
            yield from _number(note, inner is int, path)
            if isinstance(value, (int, float)):
                yield from ((path, slip * value, None) for slip in SLIPS if inner is float)
            return
        if isinstance(note, SpreadRange):
            yield from _spread(note, path)
            return
    yield from _changes(inner, value, path)


def _number(limits: Range, whole: bool, path: Path) -> Iterator[_Change]:
    bounds: tuple[float, float] = (limits.low, limits.high)
    if whole:
        beyond = [int(limits.low) - 1, int(limits.high) + 1, 1.5, 10**17]
        bounds = (int(limits.low), int(limits.high))
    else:
        beyond = [math.nextafter(limits.low, -math.inf), math.nextafter(limits.high, math.inf)]
    yield from ((path, bound, True) for bound in bounds)
    yield from ((path, number, False) for number in (*beyond, *ABSURD_NUMBERS))
    for number in (TINY, -TINY, 0.0):
        yield path, number, not whole and limits.low <= number <= limits.high
    yield from ((path, wrong, False) for wrong in NO_NUMBERS)
    yield path, None, None


def _spread(limits: SpreadRange, path: Path) -> Iterator[_Change]:
    reach = limits.reach
    good: list[Any] = [0.0, TINY, limits.limit]
    good += [{"mean": reach, "sigma": limits.limit}, {"mean": limits.low}]
    good += [{"low": limits.low, "high": reach}, {"low": TINY, "high": 2 * TINY}]
    over = math.nextafter(reach, math.inf)
    bad: list[Any] = [-TINY, math.nextafter(limits.limit, math.inf), {"mean": over}, []]
    bad += [{"low": -over, "high": 0.0}, {"low": 0.0, "high": over}, {"mean": "1"}, {"high": 1.0}]
    yield from ((path, value, True) for value in good)
    yield path, [limits.limit], None
    yield from ((path, value, False) for value in (*bad, *ABSURD_NUMBERS, True, "1", None))


def _union(arguments: tuple[Any, ...], value: Any, path: Path) -> Iterator[_Change]:
    forms = {form for argument in arguments for form in _models(argument)}
    chosen = _form(forms, value) if isinstance(value, dict) else None
    for argument in arguments:
        if argument is type(None):
            yield path, None, None
        elif chosen is None or chosen in _models(argument) or not _models(argument):
            yield from _changes(argument, value, path)
        else:
            # another form in its place; its own changes are made in files that have it
            yield path, sample(argument), None


def _list(arguments: tuple[Any, ...], value: Any, path: Path) -> Iterator[_Change]:
    many = arguments[-1] is Ellipsis
    items = value if isinstance(value, list) else []
    if not items:
        made = [sample(arguments[0])] * 2 if many else [sample(item) for item in arguments]
        yield path, made, None
    yield from ((path, wrong, None) for wrong in NO_LISTS)
    yield path, [sample(arguments[0])] * TOO_MANY, False
    for k, item in enumerate(items):
        yield from _changes(arguments[0] if many else arguments[k], item, (*path, k))
        yield path, [*items[:k], *items[k + 1 :]], None
        yield path, [*items, item], None


def _whole(model: type[BaseModel], value: Any, path: Path) -> Iterator[_Change]:
    """Yield the changes of a mapping or, if it is missing, of a made-up one."""
    yield from ((path, wrong, None) for wrong in NO_MAPPINGS)
    if isinstance(value, dict):
        yield from _mapping(model, value, path)
        return
    made = sample(model)
    yield path, made, None
    for inner, changed, _ in _mapping(model, made, ()):
        yield path, _put(made, inner, changed), None


def sample(annotation: Any) -> Any:
    """Make a valid value of a type."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        limits = next((note for note in arguments[1:] if isinstance(note, Range)), None)
        if limits is None:
            return sample(arguments[0])
        middle = 0.5 * (limits.low + limits.high)
        if limits.low > 0.0:
            middle = math.sqrt(limits.low * limits.high)
        return int(middle) if arguments[0] is int else middle
    if origin is Literal:
        return arguments[0]
    if origin in (Union, types.UnionType):
        return sample(arguments[0])
    if origin is tuple:
        many = arguments[-1] is Ellipsis
        return [sample(item) for item in (arguments[:1] if many else arguments)]
    if annotation is datetime:
        return "2010-06-21T12:00:00Z"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        fields = annotation.model_fields.items()
        return {key: sample(i.rebuild_annotation()) for key, i in fields if i.is_required()}
    return 0.0 if annotation not in (str, Any) else "sample"
